"""SIFT of COLMAP. This program describes images, and matchbench compares the descriptors."""

import sys
from pathlib import Path

import numpy as np
import pycolmap

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"max_keypoints": 8192, "max_size": 3200}


def describe(image, params):
    options = pycolmap.FeatureExtractionOptions()
    options.sift.max_num_features = params["max_keypoints"]
    pixels = np.ascontiguousarray(image.gray(params["max_size"]))
    keypoints, descriptors = pycolmap.Sift(options, pycolmap.Device.cpu).extract(pixels)
    # In COLMAP the centre of the first pixel is 0.5, and a frame has a radius.
    more = {"scales": 2 * keypoints[:, 2], "angles": keypoints[:, 3] % (2 * np.pi)}
    return keypoints[:, :2] - 0.5, descriptors, more


serve(describe=describe, name="COLMAP", version=pycolmap.__version__, defaults=DEFAULTS)

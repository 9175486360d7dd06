"""Any matcher of vismatch, chosen by its name. vismatch downloads its weights at the first start."""

import sys
from pathlib import Path

from importlib.metadata import version

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"model": "superpoint-lightglue", "max_keypoints": 2048, "max_size": 1024, "device": "cpu"}


def load(params):
    """The matcher, loaded once."""
    if load.matcher is None:
        from vismatch import get_matcher
        load.matcher = get_matcher(params["model"], params["device"], params["max_keypoints"])
        # The homography that it fits to its matches is not used here.
        load.matcher.skip_ransac = True
    return load.matcher


load.matcher = None


def match(a, b, params):
    pixels = [torch.from_numpy(image.rgb(params["max_size"])).permute(2, 0, 1).float() / 255
              for image in (a, b)]
    found = load(params)(*(image.to(params["device"]) for image in pixels))
    points_a, points_b = found["matched_kpts0"], found["matched_kpts1"]
    certainty = found.get("matched_confidences")
    # Each model has confidences of its own, and not all need be from 0 to 1.
    return points_a, points_b, None if certainty is None else np.clip(np.asarray(certainty), 0.0, 1.0)


serve(match=match, prepare=load, name="vismatch", version=version("vismatch"),
      defaults=DEFAULTS)

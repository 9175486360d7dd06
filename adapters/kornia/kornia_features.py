"""Local features of Kornia, chosen by the name of their class, with Kornia's mutual ratio test."""

import sys
from pathlib import Path

import kornia.feature as features
import torch
from kornia import __version__

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"features": "SIFTFeature", "max_keypoints": 4096, "ratio": 0.9, "max_size": 1024,
            "device": "cpu"}


def load(params):
    """The network, loaded once; Kornia fetches the weights of some."""
    if load.network is None:
        network = getattr(features, params["features"])(num_features=params["max_keypoints"])
        load.network = network.eval().to(params["device"])
    return load.network


load.network = None


@torch.inference_mode()
def extract(image, params):
    pixels = torch.from_numpy(image.gray(params["max_size"]))[None, None].float() / 255
    frames, _, descriptors = load(params)(pixels.to(params["device"]))
    points = features.get_laf_center(frames)[0].cpu()
    size = torch.tensor([pixels.shape[3], pixels.shape[2]])
    inside = ((points >= -0.5) & (points < size - 0.5)).all(1)
    return {"keypoints": points[inside], "descriptors": descriptors[0][inside.to(descriptors.device)]}


@torch.inference_mode()
def match(a, b, params):
    ratios, chosen = features.match_smnn(a["descriptors"], b["descriptors"], params["ratio"])
    chosen = chosen.cpu()
    return a["keypoints"][chosen[:, 0]], b["keypoints"][chosen[:, 1]], 1 - ratios[:, 0].cpu()


serve(match=match, extract=extract, prepare=load, name="Kornia", version=__version__,
      defaults=DEFAULTS)

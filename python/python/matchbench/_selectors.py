"""The selectors of GMS, KVLD, CODE, RepMatch, GAIM and AdaLAM: which of the putative matches are kept.

Each takes the features of two images and putative matches, as `match` returns them, and returns the matches that it
keeps. Without putative matches, the matcher's own search is used. Parameters are those of the matcher of the same name.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._correspondences import Correspondences
from ._native import Camera, Features
from ._native import Matcher as NativeMatcher
from ._params import to_json

_Images = tuple[NDArray[np.uint8], NDArray[np.uint8]]
_Cameras = tuple[Camera, Camera]


def gms(a: Features, b: Features, matches: Correspondences | None = None, **params: Any) -> Correspondences:
    """Keeps matches in grid cells that move together (Bian et al., CVPR 2017). Parameters: factor, scales, rotations."""
    return _select("gms", {"selection": params}, a, b, matches)


def kvld(
    a: Features,
    b: Features,
    matches: Correspondences | None = None,
    *,
    images: _Images,
    ratio: float = 0.98,
    **params: Any,
) -> Correspondences:
    """Keeps matches joined by virtual lines that look the same in both images (Liu, Marlet, BMVC 2012), after a ratio
    test at `ratio`. It uses the pixels of both images, which must be those that the features were found in."""
    return _select("kvld", {"ratio": ratio, "lines": params}, a, b, matches, images=images)


def code(
    a: Features, b: Features, matches: Correspondences | None = None, *, seed: int = 0, **params: Any
) -> Correspondences:
    """Keeps matches that move as their neighbours do (Lin et al., PAMI 2018)."""
    return _select("code", {"coherence": params}, a, b, matches, seed=seed)


def repmatch(
    a: Features,
    b: Features,
    matches: Correspondences | None = None,
    *,
    cameras: _Cameras,
    seed: int = 0,
    **params: Any,
) -> Correspondences:
    """As CODE, but learned again on the matches that one epipolar geometry explains (Lin et al., ECCV 2016)."""
    return _select("repmatch", {"selection": params}, a, b, matches, cameras=cameras, seed=seed)


def gaim(a: Features, b: Features, matches: Correspondences | None = None, **params: Any) -> Correspondences:
    """Chooses among the candidates of all features together, by affine neighbourhoods (Collins, Mesejo, Bartoli, ECCV
    2014). Its own search gives several candidates per feature; leave `matches` out to use it."""
    return _select("gaim", {"selection": params}, a, b, matches)


def adalam(a: Features, b: Features, matches: Correspondences | None = None, **params: Any) -> Correspondences:
    """Keeps matches that follow significant local affine maps around clear matches (Cavalli et al., ECCV 2020).
    `matches` must be all nearest neighbours, before any ratio test."""
    return _select("adalam", {"selection": params}, a, b, matches)


def _select(
    name: str,
    params: dict[str, Any],
    a: Features,
    b: Features,
    matches: Correspondences | None,
    *,
    images: _Images | None = None,
    cameras: _Cameras | None = None,
    seed: int = 0,
) -> Correspondences:
    native = NativeMatcher(name, to_json(params))
    if matches is None:
        putative = native.search(a, b)[:3]
    elif isinstance(matches, Correspondences):  # pyright: ignore[reportUnnecessaryIsInstance]
        putative = (matches.indices, matches.distances, matches.second)
    else:
        raise TypeError(
            f"{name} takes the matches that match() returns, not {type(matches).__name__}; "
            "Correspondences(indices, distances, second) makes them"
        )
    return Correspondences(*native.select(a, b, putative, images, cameras, seed))

"""Features with OpenCV's functions and `detectAndCompute`: `cv2.SIFT_create` becomes `matchbench.SIFT_create`.

Keypoints are `cv2.KeyPoint` if cv2 can be imported, otherwise a tuple with the same names. Arguments have OpenCV's names,
meanings and positions; those that have no counterpart here are refused. Colour images are BGR, as cv2 reads them. A mask
keeps the keypoints where it is not 0; a limit on the number of features applies before the mask.
"""

import importlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._features import AKAZE, BRISK, KAZE, ORB, SIFT, SURF, Extractor
from ._native import Features


class KeyPoint(NamedTuple):
    """A keypoint with the names of cv2.KeyPoint: angle in degrees, -1 if there is none."""

    pt: tuple[float, float]
    size: float
    angle: float
    response: float
    octave: int
    class_id: int = -1


class Feature2D:
    """An extractor with OpenCV's `detectAndCompute`."""

    def __init__(self, extractor: Extractor) -> None:
        self.extractor = extractor

    def detectAndCompute(
        self, image: NDArray[np.uint8], mask: NDArray[np.uint8] | None = None
    ) -> tuple[Sequence[Any], NDArray[Any] | None]:
        """Keypoints and their descriptors, n x d; None instead of descriptors if there are no keypoints."""
        rgb = image[:, :, ::-1] if getattr(image, "ndim", 0) == 3 else image
        features = self.extractor.extract(rgb)
        if mask is not None:
            features = _within(features, mask)
        return _keypoints(features), features.descriptors if len(features) else None


def SIFT_create(
    nfeatures: int = 0,
    nOctaveLayers: int = 3,
    contrastThreshold: float = 0.04,
    edgeThreshold: float = 10,
    sigma: float = 1.6,
) -> Feature2D:
    """As cv2.SIFT_create."""
    return Feature2D(
        SIFT(
            limit=nfeatures or None,
            octave_layers=nOctaveLayers,
            contrast_threshold=contrastThreshold,
            edge_threshold=edgeThreshold,
            sigma=sigma,
        )
    )


def ORB_create(
    nfeatures: int = 500, scaleFactor: float = 1.2, nlevels: int = 8, *, fastThreshold: int = 20
) -> Feature2D:
    """As cv2.ORB_create; all other arguments of that function have their defaults. The fourth by position is another
    one there, so `fastThreshold` is given by name."""
    return Feature2D(
        ORB(features=nfeatures, scale_factor=scaleFactor, levels=nlevels, fast_threshold=fastThreshold)
    )


def BRISK_create(thresh: int = 30, octaves: int = 3) -> Feature2D:
    """As cv2.BRISK_create, with its pattern at scale 1."""
    return Feature2D(BRISK(threshold=thresh, octaves=octaves))


def AKAZE_create(*, threshold: float = 0.001, nOctaves: int = 4, nOctaveLayers: int = 4) -> Feature2D:
    """As cv2.AKAZE_create: all 486 bits of M-LDB. By position, the first arguments are others there, so these are given
    by name."""
    return Feature2D(AKAZE(threshold=threshold, octaves=nOctaves, levels=nOctaveLayers))


def KAZE_create(*, threshold: float = 0.001, nOctaves: int = 4, nOctaveLayers: int = 4) -> Feature2D:
    """As cv2.KAZE_create: 64 values. By position, the first arguments are others there, so these are given by name."""
    return Feature2D(KAZE(threshold=threshold, octaves=nOctaves, levels=nOctaveLayers))


def SURF_create(
    hessianThreshold: float = 100,
    nOctaves: int = 4,
    nOctaveLayers: int = 3,
    extended: bool = False,
    upright: bool = False,
) -> Feature2D:
    """As cv2.xfeatures2d.SURF_create."""
    return Feature2D(
        SURF(
            threshold=hessianThreshold, octaves=nOctaves, layers=nOctaveLayers, extended=extended, upright=upright
        )
    )


def _within(features: Features, mask: NDArray[np.uint8]) -> Features:
    if mask.dtype != np.uint8 or mask.shape != features.image_size[::-1]:
        raise ValueError(
            f"the mask must be uint8 of shape {features.image_size[::-1]}, as the image; "
            f"this one is {mask.dtype} of shape {mask.shape}"
        )
    at = np.floor(features.keypoints + 0.5).astype(np.int64)
    inside = mask[at[:, 1].clip(0, mask.shape[0] - 1), at[:, 0].clip(0, mask.shape[1] - 1)] != 0
    return features.select(np.flatnonzero(inside))


def _keypoints(features: Features) -> tuple[Any, ...]:
    make = _maker()
    angles = np.where(np.isnan(features.angles), -1, np.rad2deg(features.angles))
    columns = (features.sizes, angles, features.responses, features.octaves)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return tuple(make(x, y, *row) for (x, y), row in zip(features.keypoints.tolist(), rows, strict=True))


def _maker() -> Callable[..., Any]:
    """The function that makes a keypoint from x, y, size, angle, response, octave."""

    def make(x: float, y: float, *rest: Any) -> KeyPoint:
        return KeyPoint((x, y), *rest)

    try:
        return importlib.import_module("cv2").KeyPoint
    except ImportError:
        return make

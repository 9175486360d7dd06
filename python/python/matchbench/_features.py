"""Local features: one class for each kind, all with the method `extract`. Parameters and their defaults are those of the
command line (`matchbench list matchers` shows them as `extractor`); `params` returns all of them, but of `max_size` and
`size` only one that was given."""

import json
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ._native import Features
from ._native import Matcher as NativeMatcher
from ._params import to_json


class Extractor:
    """Finds and describes keypoints. With `max_size` (pixels), an image that is wider or higher is made smaller first;
    with `size` ("640x480"), every image is made that size. Positions are those in the image that is given."""

    _matcher: ClassVar[str]

    def __init__(self, **params: Any) -> None:
        self._native = NativeMatcher(self._matcher, to_json({"extractor": params}))

    @property
    def params(self) -> dict[str, Any]:
        """Every parameter, including those at their defaults; `max_size` or `size` only if it was given."""
        return json.loads(self._native.params)["extractor"]

    def extract(self, image: NDArray[np.uint8]) -> Features:
        """The features of an image, uint8: height x width (grey), or height x width x 3 (RGB)."""
        return self._native.extract(image)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.params})"


class SIFT(Extractor):
    """D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 2004."""

    _matcher = "sift"


class RootSIFT(Extractor):
    """R. Arandjelovic, A. Zisserman, "Three things everyone should know to improve object retrieval", CVPR
    2012: SIFT whose descriptors are compared by the Hellinger kernel."""

    _matcher = "rootsift"


class DSPSIFT(Extractor):
    """J. Dong, S. Soatto, "Domain-Size Pooling in Local Descriptors: DSP-SIFT", CVPR 2015. With
    `affine_shape`, ellipses are described."""

    _matcher = "dsp-sift"


class SURF(Extractor):
    """H. Bay, A. Ess, T. Tuytelaars, L. Van Gool, "Speeded-Up Robust Features", CVIU 2008."""

    _matcher = "surf"


class ORB(Extractor):
    """E. Rublee, V. Rabaud, K. Konolige, G. Bradski, "ORB", ICCV 2011."""

    _matcher = "orb"


class BRISK(Extractor):
    """S. Leutenegger, M. Chli, R. Siegwart, "BRISK", ICCV 2011."""

    _matcher = "brisk"


class KAZE(Extractor):
    """P. F. Alcantarilla, A. Bartoli, A. J. Davison, "KAZE Features", ECCV 2012."""

    _matcher = "kaze"


class AKAZE(Extractor):
    """P. F. Alcantarilla, J. Nuevo, A. Bartoli, "Fast Explicit Diffusion for Accelerated Features in
    Nonlinear Scale Spaces", BMVC 2013."""

    _matcher = "akaze"


class DLCO(Extractor):
    """K. Simonyan, A. Vedaldi, A. Zisserman, "Learning Local Feature Descriptors Using Convex
    Optimisation", PAMI 2014; on SIFT's keypoints."""

    _matcher = "dlco"


class FREAK(Extractor):
    """A. Alahi, R. Ortiz, P. Vandergheynst, "FREAK", CVPR 2012; on SURF's keypoints."""

    _matcher = "freak"


class FREAKOnSIFT(Extractor):
    """FREAK on SIFT's keypoints."""

    _matcher = "freak-sift"


class BinBoost(Extractor):
    """T. Trzcinski, M. Christoudias, P. Fua, V. Lepetit, "Boosting Binary Keypoint Descriptors", CVPR
    2013; on SIFT's keypoints."""

    _matcher = "binboost"


class LATCH(Extractor):
    """G. Levi, T. Hassner, "LATCH", WACV 2016."""

    _matcher = "latch"


class DAISY(Extractor):
    """E. Tola, V. Lepetit, P. Fua, "DAISY", PAMI 2010; on SIFT's keypoints."""

    _matcher = "daisy"


class ASIFT(Extractor):
    """J.-M. Morel, G. Yu, "ASIFT", SIAM Journal on Imaging Sciences 2009: SIFT on simulated views."""

    _matcher = "asift"


class ShearedSURF(Extractor):
    """SURF on sheared and stretched views, the features of GAIM (T. Collins, P. Mesejo, A. Bartoli, ECCV
    2014)."""

    _matcher = "gaim"

"""Estimates the relative pose of two cameras from their images, and benchmarks feature matchers.

Images are numpy arrays of uint8, height x width (grey) or height x width x 3 (RGB). Positions are x, y in pixels; the
centre of the first pixel is (0, 0). Every call is deterministic and refuses unknown parameters. The interpreter is
released while features, matches, poses and scores are computed, but not while arrays are copied.
"""

from ._correspondences import Correspondences, match
from ._cv2 import (
    AKAZE_create,
    BRISK_create,
    KAZE_create,
    KeyPoint,
    ORB_create,
    SIFT_create,
    SURF_create,
)
from ._datasets import import_dataset, rendered_scene, write_dataset
from ._estimators import Estimator, estimator
from ._features import (
    AKAZE,
    ASIFT,
    BRISK,
    DAISY,
    DLCO,
    DSPSIFT,
    FREAK,
    FREAKOnSIFT,
    KAZE,
    LATCH,
    ORB,
    SIFT,
    SURF,
    BinBoost,
    Extractor,
    RootSIFT,
    ShearedSURF,
)
from ._matchers import Matcher, matcher
from ._matches_from import MatchesFrom
from ._native import (
    Camera,
    Dataset,
    Error,
    Features,
    HomographyEstimate,
    Matches,
    NoModel,
    PoseEstimate,
    __version__,
    read_gray,
)
from ._pose import CameraPose, estimate_relative_pose
from ._runs import Run, join, pair_seed, report, run
from ._scores import Pairs, ProtocolScores, Scores, evaluate, pairs
from ._selectors import adalam, code, gaim, gms, kvld, repmatch
from ._show import Picture, show

__all__ = [
    "AKAZE",
    "AKAZE_create",
    "ASIFT",
    "BRISK",
    "BRISK_create",
    "BinBoost",
    "Camera",
    "CameraPose",
    "Correspondences",
    "DAISY",
    "DLCO",
    "DSPSIFT",
    "Dataset",
    "Error",
    "Estimator",
    "Extractor",
    "FREAK",
    "FREAKOnSIFT",
    "Features",
    "HomographyEstimate",
    "KAZE",
    "KAZE_create",
    "KeyPoint",
    "LATCH",
    "Matcher",
    "Matches",
    "MatchesFrom",
    "NoModel",
    "ORB",
    "ORB_create",
    "Pairs",
    "Picture",
    "PoseEstimate",
    "ProtocolScores",
    "RootSIFT",
    "Run",
    "SIFT",
    "SIFT_create",
    "SURF",
    "SURF_create",
    "Scores",
    "ShearedSURF",
    "adalam",
    "code",
    "estimate_relative_pose",
    "estimator",
    "evaluate",
    "gaim",
    "gms",
    "import_dataset",
    "join",
    "kvld",
    "match",
    "matcher",
    "pair_seed",
    "pairs",
    "read_gray",
    "rendered_scene",
    "repmatch",
    "report",
    "run",
    "show",
    "write_dataset",
]

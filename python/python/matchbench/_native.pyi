"""The compiled module. The package `matchbench` adds names and defaults."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path = str | os.PathLike[str]
_Arrays = tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]
_Found = tuple[
    NDArray[np.int64],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32] | None,
    NDArray[np.float32] | None,
]

class Error(Exception):
    """A problem outside the arguments: with a file, a dataset or a run, or a matcher that failed."""

class NoModel(Error):
    """The matches determine no pose; the message says why."""

@final
class Camera:
    """A pinhole camera: `u = fx x + cx`, `v = fy y + cy` for the point (x, y) at depth 1, after lens
    distortion (k1, k2, p1, p2[, k3], as in OpenCV) or that of a `fisheye` (k1, k2, k3, k4, as in OpenCV's
    module of this name). `origin` says where the origin of (cx, cy) is: at the centre of the first pixel
    ("center": OpenCV, and everywhere here) or at its corner ("corner": COLMAP)."""

    def __new__(
        cls,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        distortion: ArrayLike | None = None,
        fisheye: ArrayLike | None = None,
        *,
        origin: str = "center",
    ) -> Camera: ...
    @staticmethod
    def from_matrix(
        matrix: ArrayLike,
        distortion: ArrayLike | None = None,
        fisheye: ArrayLike | None = None,
        *,
        origin: str = "center",
    ) -> Camera:
        """A camera, given by its calibration matrix K, 3 x 3: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]."""
    @staticmethod
    def from_model(model: str, params: Sequence[float] | NDArray[np.floating[Any]], *, origin: str) -> Camera:
        """A camera, given by the name of its model in COLMAP and PoseLib: SIMPLE_PINHOLE, PINHOLE,
        SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV where k4, k5 and k6 are 0, SIMPLE_FISHEYE, FISHEYE,
        SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE or OPENCV_FISHEYE."""
    @property
    def fx(self) -> float:
        """Focal length along x, in pixels."""
    @property
    def fy(self) -> float:
        """Focal length along y, in pixels."""
    @property
    def cx(self) -> float:
        """x of the principal point; the centre of the first pixel is at 0."""
    @property
    def cy(self) -> float:
        """y of the principal point; the centre of the first pixel is at 0."""
    @property
    def K(self) -> NDArray[np.float64]:
        """The calibration matrix, 3 x 3: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; `from_matrix` takes it back."""
    @property
    def distortion(self) -> tuple[float, float, float, float, float] | None:
        """Lens distortion (k1, k2, p1, p2, k3), as in OpenCV; None if there is none, and of a fisheye."""
    @property
    def fisheye(self) -> tuple[float, float, float, float] | None:
        """Distortion of a fisheye (k1, k2, k3, k4), as in OpenCV; None if it is none."""

@final
class Features:
    """Keypoints of an image and their descriptors: row i of every array is feature i. The arrays are
    read-only; copy one to change it."""

    @staticmethod
    def from_arrays(
        keypoints: ArrayLike,
        descriptors: NDArray[np.float32] | NDArray[np.uint8],
        image_size: Sequence[int] | NDArray[np.integer[Any]],
        *,
        sizes: ArrayLike | None = None,
        angles: ArrayLike | None = None,
        responses: ArrayLike | None = None,
        octaves: ArrayLike | None = None,
        lafs: NDArray[np.float32] | None = None,
        bits: int | None = None,
        origin: str = "center",
    ) -> Features:
        """Features from your own arrays: keypoints n x 2 (x, y in pixels), descriptors n x d (float32, or uint8 for
        bits), and width and height of the image, in which the keypoints lie. `bits` is the number of bits of a row of bytes that are used; default: all. Every
        number must be finite, except that an angle is NaN if there is none. Angles are radians, from -2 pi to 2 pi.
        Sizes must not be below 0. Octaves are whole numbers from -32768 to 32767. The centres of `lafs` are the keypoints."""
    @property
    def keypoints(self) -> NDArray[np.float32]:
        """n x 2: x, y in pixels of the image; the centre of the first pixel is (0, 0)."""
    @property
    def sizes(self) -> NDArray[np.float32]:
        """n: diameters of the described neighbourhoods, in pixels."""
    @property
    def angles(self) -> NDArray[np.float32]:
        """n: orientations in radians, from the x axis towards the y axis; NaN if there is none."""
    @property
    def responses(self) -> NDArray[np.float32]:
        """n: strength of the detector's response."""
    @property
    def octaves(self) -> NDArray[np.int32]:
        """n: pyramid levels, as the detector numbers them."""
    @property
    def lafs(self) -> NDArray[np.float32]:
        """n x 2 x 3: local affine frames in the form of kornia. Each maps the unit circle to the
        region that was described."""
    @property
    def descriptors(self) -> NDArray[Any]:
        """n x d: float32, or uint8 for bits (eight per byte, the least significant first)."""
    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the image."""
    @property
    def bits(self) -> int | None:
        """Bits of a descriptor; None if it has real values."""
    def select(self, indices: Sequence[int] | Sequence[bool] | NDArray[np.integer[Any] | np.bool_]) -> Features:
        """The features at these indices, in that order, or those for which a mask is true."""
    def to_dict(self, *, origin: str = "center") -> dict[str, NDArray[Any]]:
        """A dict with LightGlue's keys: keypoints, descriptors, keypoint_scores, scales, oris, image_size; without
        its batch axis."""
    def __len__(self) -> int: ...

@final
class Matches:
    """Matched points of two images, and the features that they are made of."""

    @property
    def points_a(self) -> NDArray[np.float64]:
        """m x 2, in pixels of image a."""
    @property
    def points_b(self) -> NDArray[np.float64]:
        """m x 2, in pixels of image b."""
    @property
    def ambiguity(self) -> NDArray[np.float32]:
        """m: from 0 (certain) to 1 (a second candidate is as good); above 1 where another candidate than the nearest was
        chosen (`gaim`)."""
    @property
    def turns(self) -> NDArray[np.float32] | None:
        """m: the angle by which the keypoint of b is turned relative to that of a, in radians from 0 to 2 pi; None if
        keypoints have no orientation."""
    @property
    def growths(self) -> NDArray[np.float32] | None:
        """m: the natural logarithm of how many times as large the keypoint of b is as that of a, in pixels of each image;
        None if sizes are not known."""
    @property
    def indices(self) -> NDArray[np.int64]:
        """m x 2: features of a and of b."""
    @property
    def features_a(self) -> Features:
        """The features of image a."""
    @property
    def features_b(self) -> Features:
        """The features of image b."""
    def __len__(self) -> int: ...

@final
class Matcher:
    """A matcher of the library with its parameters, which are JSON; `matchbench.Matcher` is made of it."""

    def __new__(cls, id: str, params: str) -> Matcher: ...
    @property
    def id(self) -> str:
        """Its name in commands, records and tables."""
    @property
    def params(self) -> str:
        """All parameters, as JSON."""
    def extract(self, pixels: NDArray[np.uint8]) -> Features:
        """The features of an image."""
    def search(self, a: Features, b: Features) -> _Found:
        """The putative matches of two images: indices, distances, distances to the second nearest, turns and growths.
        Where the matcher has a ratio test, features that fail it may have other neighbours than the two nearest."""
    def select(
        self,
        a: Features,
        b: Features,
        putative: _Arrays,
        images: tuple[NDArray[np.uint8], NDArray[np.uint8]] | None,
        cameras: tuple[Camera, Camera] | None,
        seed: int,
    ) -> _Found:
        """The putative matches that the matcher keeps."""
    def match_images(
        self,
        a: NDArray[np.uint8],
        b: NDArray[np.uint8],
        camera_a: Camera | None,
        camera_b: Camera | None,
        seed: int,
    ) -> Matches:
        """Matched points of two images: all stages, one after the other."""

@final
class PoseEstimate:
    """A relative pose, `x_b = R x_a + t`, and the matches that agree with it."""

    @property
    def R(self) -> NDArray[np.float64]:
        """3 x 3: R of `x_b = R x_a + t`."""
    @property
    def t(self) -> NDArray[np.float64]:
        """3: t of `x_b = R x_a + t`, of length 1, since the scale cannot be known from two images."""
    @property
    def q(self) -> NDArray[np.float64]:
        """R as a quaternion w, x, y, z."""
    @property
    def inliers(self) -> NDArray[np.bool_]:
        """For each match, whether it agrees."""
    @property
    def num_inliers(self) -> int:
        """Number of matches that agree."""
    @property
    def support(self) -> int:
        """Number of matches whose point is in front of both cameras and nearer than the largest depth."""
    @property
    def pose_probability(self) -> float:
        """The probability that the pose is within 10 degrees of the truth, estimated from the matches."""
    @property
    def overlap_probability(self) -> float:
        """The probability that the images overlap and the matches show that; below 0.5 the answer is "no overlap"."""
    @property
    def iterations(self) -> int:
        """Number of samples drawn."""

@final
class HomographyEstimate:
    """A homography, `x_b ~ H x_a` for pixels `(x, y, 1)`, and the matches that agree with it."""

    @property
    def H(self) -> NDArray[np.float64]:
        """3 x 3, of norm 1: maps pixels of a, as (x, y, 1), to those of b."""
    @property
    def inliers(self) -> NDArray[np.bool_]:
        """For each match, whether it agrees."""
    @property
    def num_inliers(self) -> int:
        """Number of matches that agree."""
    @property
    def iterations(self) -> int:
        """Number of samples drawn."""

@final
class Estimator:
    """An estimator of the library with its parameters, which are JSON; `matchbench.Estimator` is made of it."""

    def __new__(cls, id: str, params: str) -> Estimator: ...
    @property
    def id(self) -> str:
        """Its name in commands, records and tables."""
    @property
    def params(self) -> str:
        """All parameters, as JSON."""
    @property
    def of_homographies(self) -> bool:
        """Whether it estimates homographies, and not poses."""
    def estimate_homography(
        self,
        points_a: ArrayLike,
        points_b: ArrayLike,
        ambiguity: ArrayLike | None,
        turns: ArrayLike | None,
        seed: int,
    ) -> HomographyEstimate:
        """The homography from image a to image b from matched points, m x 2 in pixels."""
    def estimate(
        self,
        points_a: ArrayLike,
        points_b: ArrayLike,
        camera_a: Camera,
        camera_b: Camera,
        ambiguity: ArrayLike | None,
        turns: ArrayLike | None,
        growths: ArrayLike | None,
        seed: int,
    ) -> PoseEstimate:
        """The relative pose of camera b from matched points, m x 2 in pixels."""

@final
class Dataset:
    """Images with known cameras, and pairs of them with their true relative pose. A pickle holds only the path of the
    folder, which is opened again."""

    @staticmethod
    def open(folder: _Path) -> Dataset:
        """The dataset in a folder of this project's layout; see `import_dataset` for others."""
    @property
    def name(self) -> str:
        """The name of the dataset."""
    @property
    def path(self) -> Path:
        """The folder of the dataset."""
    @property
    def images(self) -> list[Path]:
        """The image files, one for each frame."""
    @property
    def pairs(self) -> NDArray[np.int64]:
        """k x 2: frames a and b."""
    @property
    def b_from_a(self) -> NDArray[np.float64]:
        """k x 4 x 4: the true poses; each takes a point from camera a to camera b. NaN if there is none."""
    @property
    def homographies(self) -> NDArray[np.float64]:
        """k x 3 x 3: true homographies; each maps pixels of a to those of b. NaN if there is none."""
    def read(self, frame: int) -> NDArray[np.uint8]:
        """The image of a frame, grey, as a matcher gets it in a run."""
    def camera(self, frame: int) -> Camera:
        """The camera of a frame."""
    def __len__(self) -> int: ...

def search(a: Features, b: Features, method: str, ratio: float | None = None) -> _Found: ...
def import_dataset(
    kind: str,
    source: _Path,
    out: _Path,
    pairs: str | None,
    sequence: str | None,
    sensor: str | None,
    camera: _Path | None,
    poses: _Path | None,
    body_from_camera: _Path | None,
    tolerance: float | None,
    interpolate: bool,
    image_root: _Path | None,
    intrinsics: _Path | None,
    property: str | None,
    images: str,
) -> list[str]: ...
def write_dataset(
    out: _Path,
    frames: Sequence[tuple[_Path, Camera, list[float]]],
    pairs: str | list[tuple[int, int]],
    origin: str,
    property: str,
    store: str,
) -> None: ...
def rendered_scene(
    name: str, cache: _Path, frames: int | None, size: Sequence[int] | NDArray[np.integer[Any]] | None
) -> Path: ...
def read_gray(path: _Path) -> NDArray[np.uint8]:
    """The image in a file as height x width, grey, decoded as in every command."""

_AnyMatcher = (
    str
    | Matcher
    | tuple[str, str, str, Callable[..., Any], Callable[..., Any] | None, bool, int]
    | tuple[str, list[str], str | None, float | None, list[int] | None, bool, dict[str, str]]
)

def run(
    datasets: Sequence[Dataset],
    matchers: Sequence[_AnyMatcher],
    estimators: Sequence[str | Estimator],
    protocols: Sequence[str],
    out: _Path,
    settings: Sequence[str],
    seed: int,
    repeat: int | None,
    limit: int | None,
    sample: int | None,
    time_budget_ms: int | None,
    keep_matches: str,
    retry_failed: bool,
    cache: _Path | None,
    threads: int | None,
    progress: Callable[[int, int, str, str], None] | None,
) -> tuple[tuple[int, int, int, int], list[str]]: ...
def show(
    dataset: Dataset,
    a: int,
    b: int,
    matcher: _AnyMatcher,
    estimators: Sequence[str | Estimator],
    settings: Sequence[str],
    seed: int,
    keypoints: bool,
) -> tuple[bytes, list[str]]: ...
def pair_seed(dataset: str, matcher: str, a: int, b: int, seed: int, repetition: int) -> int: ...
def evaluate(folder: _Path) -> tuple[str, list[str], list[str]]: ...
def evaluate_under(folder: _Path, protocols: Sequence[str]) -> tuple[str, str, list[str]]: ...
def pairs(folder: _Path) -> tuple[str, list[str]]: ...
def report(
    folder: _Path, out: _Path | None, bundle: _Path | None, pictures: int
) -> tuple[Path, list[str]]: ...
__version__: str
def join(runs: Sequence[_Path], out: _Path) -> tuple[int, int, int]: ...
def command_line(arguments: Sequence[str]) -> int: ...

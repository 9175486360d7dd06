"""Relative pose by PoseLib's function, computed by the estimator that we recommend."""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._estimators import estimator
from ._native import Camera, NoModel
from ._params import refusal, seed_of, several, text

_RANSAC = {
    "max_iterations": "max_iterations",
    "min_iterations": "min_iterations",
    "success_prob": "confidence",
    "max_epipolar_error": "threshold_px",
    "max_error": "threshold_px",
    "max_prosac_iterations": "prosac_horizon",
}
_WITHOUT_EFFECT = {
    "dyn_num_trials_mult": "the estimator stops by success_prob alone",
    "max_reproj_error": "relative pose has no reprojection error; give max_epipolar_error",
    "real_focal_check": "the focal lengths are known here",
    "score_initial_model": "there is no initial model here",
}
# That of "best".
_LEAST_ITERATIONS = 1000
_LOSSES = {"TRUNCATED": "truncated", "CAUCHY": "cauchy"}


@dataclass(frozen=True, eq=False)
class CameraPose:
    """The pose `x_2 = R x_1 + t`, with PoseLib's names."""

    R: NDArray[np.float64]
    t: NDArray[np.float64]
    q: NDArray[np.float64]

    @property
    def Rt(self) -> NDArray[np.float64]:
        """3 x 4."""
        return np.hstack([self.R, self.t[:, None]])


def estimate_relative_pose(
    points2D_1: ArrayLike,
    points2D_2: ArrayLike,
    camera1: Mapping[str, Any] | Camera,
    camera2: Mapping[str, Any] | Camera,
    ransac_opt: Mapping[str, Any] = {},
    bundle_opt: Mapping[str, Any] = {},
    *,
    ambiguity: ArrayLike | None = None,
    origin: str = "center",
) -> tuple[CameraPose | None, dict[str, Any]]:
    """PoseLib's function, computed by the estimator "best".

    Cameras are `Camera` objects, or PoseLib's dicts ("model", "width", "height", "params"). `origin` says where their
    principal points are counted from; points are always counted from the centre of the first pixel. Use "corner" for
    COLMAP's cameras together with keypoints of cv2 or of this package. If points and cameras have the same
    convention, whichever it is, do not give `origin`.

    Keys of `ransac_opt`: max_iterations, min_iterations, success_prob, max_epipolar_error (or max_error; one of the
    two), progressive_sampling, max_prosac_iterations, seed. Keys of `bundle_opt`: max_iterations, loss_type
    (TRUNCATED, CAUCHY). All other keys raise an error: unknown keys, and keys of PoseLib that would do nothing here,
    with the reason. A key that is left out has the default of "best", not that of PoseLib. Samples are drawn in the
    order of `ambiguity` if that is given, in the order of the points with progressive_sampling, and otherwise
    uniformly.

    Returns the pose and a dict with "num_inliers", "inlier_ratio", "inliers" (a list of bool), "iterations". If the
    matches determine no pose, the pose is None, and "no_pose" says why. PoseLib's "refinements" and "model_score" have
    no counterpart.
    """
    params: dict[str, Any] = {"sampler": "prosac" if ambiguity is not None else "uniform"}
    seed = 0
    for name, given in (("ransac_opt", ransac_opt), ("bundle_opt", bundle_opt)):
        if not isinstance(given, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise refusal(name, given, "a dict")
    for key, value in ransac_opt.items():
        if key == "seed":
            seed = seed_of(value, "ransac_opt: seed")
        elif key == "progressive_sampling":
            if ambiguity is not None and not value:
                raise ValueError("ambiguity orders the samples; leave it out, or progressive_sampling")
            params["sampler"] = "prosac" if value else "uniform"
        else:
            _put(params, "ransac_opt", _RANSAC, key, value, "progressive_sampling", "seed")
    for key, value in bundle_opt.items():
        if key == "loss_type":
            if not isinstance(value, str) or value not in _LOSSES:
                raise ValueError(f"bundle_opt: loss_type is {' or '.join(_LOSSES)}, not {value!r}")
            params["final_loss"] = _LOSSES[value]
        else:
            _put(params, "bundle_opt", {"max_iterations": "final_steps"}, key, value, "loss_type")
    most = params.get("max_iterations")
    if isinstance(most, numbers.Integral) and most < _LEAST_ITERATIONS and params.get("confidence") != 1:
        # As in PoseLib, the least number needs no word where the most is smaller.
        params.setdefault("min_iterations", most)
    best = estimator("best", **params)
    cameras = _camera(camera1, "camera1", origin), _camera(camera2, "camera2", origin)
    try:
        found = best.estimate(points2D_1, points2D_2, *cameras, ambiguity=ambiguity, seed=seed)
    except NoModel as reason:
        count = len(np.asarray(points2D_1))
        info = {"num_inliers": 0, "inlier_ratio": 0.0, "inliers": [False] * count, "iterations": 0}
        return None, {**info, "no_pose": str(reason)}
    info = {
        "num_inliers": found.num_inliers,
        "inlier_ratio": found.num_inliers / len(found.inliers),
        "inliers": found.inliers.tolist(),
        "iterations": found.iterations,
    }
    return CameraPose(found.R, found.t, found.q), info


def _put(params: dict[str, Any], where: str, names: Mapping[str, str], key: str, value: Any, *others: str) -> None:
    """Sets a parameter by the name of an option; `others` are options that were handled before."""
    if key in _WITHOUT_EFFECT:
        raise ValueError(f"{where}: {key} would do nothing: {_WITHOUT_EFFECT[key]}")
    if key not in names:
        raise ValueError(f"{where}: unknown key {key!r}; there are {', '.join([*names, *others])}")
    if names[key] in params:
        raise ValueError(f"{where}: {key} was given before by another name")
    params[names[key]] = value


def _camera(camera: Mapping[str, Any] | Camera, name: str, origin: str) -> Camera:
    if isinstance(camera, Camera):
        if origin == "center":
            return camera
        c = camera
        return Camera(c.fx, c.fy, c.cx, c.cy, c.distortion, c.fisheye, origin=origin)
    if not isinstance(camera, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(
            f"{name} is a Camera or a dict with model, width, height, params; this is {type(camera).__name__}. "
            "Camera.from_matrix(K) makes one of a calibration matrix"
        )
    unknown = set(camera) - {"model", "width", "height", "params"}
    if unknown or not {"model", "params"} <= set(camera):
        raise ValueError(f"{name} has the keys {sorted(camera)}; expected model, width, height and params")
    model = text(f"{name}: model", camera["model"], 'a name, as in "PINHOLE"')
    try:
        params = [float(x) for x in several(f"{name}: params", camera["params"])]
        return Camera.from_model(model, params, origin=origin)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None

"""Estimators by name: matched points in, a relative pose or a homography out."""

from __future__ import annotations

import json
from typing import Any

from numpy.typing import ArrayLike

from ._native import Camera, HomographyEstimate, PoseEstimate
from ._native import Estimator as NativeEstimator
from ._params import seed_of, text, to_json


class Estimator:
    """An estimator, as the command line has it; see `estimator`."""

    def __init__(self, id: str, **params: Any) -> None:
        self._native = NativeEstimator(text("id", id, 'a name, as in "best"'), to_json(params))

    @property
    def id(self) -> str:
        """Its name in commands, records and tables."""
        return self._native.id

    @property
    def native(self) -> NativeEstimator:
        """The compiled object."""
        return self._native

    @property
    def params(self) -> dict[str, Any]:
        """Every parameter, including those at their defaults."""
        return json.loads(self._native.params)

    @property
    def of_homographies(self) -> bool:
        """Whether it estimates homographies, and not poses."""
        return self._native.of_homographies

    def estimate(
        self,
        points_a: ArrayLike,
        points_b: ArrayLike,
        camera_a: Camera,
        camera_b: Camera,
        *,
        ambiguity: ArrayLike | None = None,
        turns: ArrayLike | None = None,
        growths: ArrayLike | None = None,
        seed: int = 0,
    ) -> PoseEstimate:
        """The relative pose of camera b from matched points: row i of `points_a` and of `points_b`, m x 2 in pixels, is
        one match. Points are pixels of the original images, whose cameras these are; the centre of the first pixel is
        (0, 0).

        `ambiguity` has m numbers from 0 (certain) to 1 (a second candidate is as good), and above 1 where another
        candidate than the nearest was chosen, as `Matches.ambiguity` may be; without it every match has 0.5.
        Progressive samplers (`sampler="prosac"`) draw the least ambiguous matches first.
        `turns` has m angles in radians by which the keypoint of b is turned relative to that of a (`Matches.turns`).
        An estimator uses them with `turns=True`, as "adaptive" has it by default; every other one refuses them.
        `growths` has m logarithms of how many times as large the keypoint of b is as that of a (`Matches.growths`). An
        estimator of poses uses them, beside turns, with `hypotheses=8` (or any number above 1), as "adaptive" has it
        by default; every other one refuses them.
        With the `seed` of `pair_seed`, the result is that of a run; the same input and seed give the same bits.

        Raises `NoModel` if the matches determine no pose."""
        drawn = seed_of(seed)
        return self._native.estimate(points_a, points_b, camera_a, camera_b, ambiguity, turns, growths, drawn)

    def estimate_homography(
        self,
        points_a: ArrayLike,
        points_b: ArrayLike,
        *,
        ambiguity: ArrayLike | None = None,
        turns: ArrayLike | None = None,
        seed: int = 0,
    ) -> HomographyEstimate:
        """The homography from image a to image b: row i of `points_a` and of `points_b`, m x 2 in pixels, is one match.
        `ambiguity`, `turns` and `seed` are those of `estimate`.

        Raises `NoModel` if the matches determine no homography."""
        return self._native.estimate_homography(points_a, points_b, ambiguity, turns, seed_of(seed))

    def __repr__(self) -> str:
        return f"estimator({self.id!r}, **{self.params})"


def estimator(id: str, **params: Any) -> Estimator:
    """The estimator with this `id` ("best" is our recommendation for poses, "best-h" for homographies;
    `matchbench list estimators` lists all). Parameters that are not in `params` keep their defaults.
    `estimate(points_a, points_b, camera_a, camera_b)` returns a `PoseEstimate`. An estimator of homographies has
    `estimate_homography(points_a, points_b)` instead, which returns a `HomographyEstimate`. Both may raise `NoModel`."""
    return Estimator(id, **params)

"""Putative matches: pairs of features whose descriptors are close to each other."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._native import Features, search


class _IndicesAndDistances(NamedTuple):
    indices: NDArray[np.int64]
    distances: NDArray[np.float32]


class Correspondences(_IndicesAndDistances):
    """Putative matches. Unpacks as `indices, distances`: m x 2 (feature of a, feature of b), and m distances of
    descriptors (Euclidean, or the number of differing bits). `second` has the distances to the second nearest
    neighbour, which selectors and `ambiguity` need."""

    second: NDArray[np.float32]

    @classmethod
    def of(
        cls, indices: NDArray[np.int64], distances: NDArray[np.float32], second: NDArray[np.float32]
    ) -> "Correspondences":
        """Makes them from your own arrays. `second` is infinite if there is no second candidate."""
        made = cls(indices, distances)
        made.second = second
        return made

    def _replace(self, **changes: Any) -> "Correspondences":  # pyright: ignore[reportIncompatibleMethodOverride]
        """The same matches with other values of some fields; `second` is one of the fields."""
        kept = {**vars(self), **{name: changes.pop(name) for name in ("second",) if name in changes}}
        made = super()._replace(**changes)
        vars(made).update(kept)
        return made

    __replace__ = _replace

    @property
    def ambiguity(self) -> NDArray[np.float32]:
        """m: nearest divided by second nearest distance, as estimators take it: from 0 (certain) to 1, and above 1 where
        another candidate than the nearest was chosen."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.distances / self.second
        return np.where(np.isnan(ratio), np.float32(1), ratio)


def match(
    a: Features,
    b: Features,
    method: str = "ratio",
    ratio: float | None = None,
) -> Correspondences:
    """Exact nearest neighbours of the features of `a` among those of `b`, as `indices, distances`.

    `method` says which neighbours are kept. "nn": all. "ratio": those that are clearly nearer than the second nearest
    (Lowe's test at `ratio`, 0.8 unless given). "mutual": those where each is the nearest of the other. "smnn": mutual
    nearest neighbours that also pass the ratio test in both directions.
    """
    for value in (a, b):
        if not isinstance(value, Features):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise TypeError(
                f"match takes Features, not {type(value).__name__}; "
                "Features.from_arrays(keypoints, descriptors, image_size) makes them"
            )
    return Correspondences.of(*search(a, b, method, ratio))

"""Putative matches: pairs of features whose descriptors are close to each other."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Features, search
from ._params import text


@dataclass(frozen=True, eq=False)
class Correspondences:
    """Putative matches. Unpacks as `indices, distances`. All arrays have a row for each match."""

    indices: NDArray[np.int64]
    """m x 2: feature of a, feature of b."""
    distances: NDArray[np.float32]
    """m: distances of descriptors (Euclidean, or the number of differing bits)."""
    second: NDArray[np.float32]
    """m: distances to the second nearest neighbour, which selectors and `ambiguity` need; infinite without one."""
    turns: NDArray[np.float32] | None = None
    """m: the angle by which the keypoint of b is turned relative to that of a, in radians from 0 to 2 pi; None if
    keypoints have no orientation. `estimator("adaptive")` uses them."""
    growths: NDArray[np.float32] | None = None
    """m: the natural logarithm of how many times as large the keypoint of b is as that of a; None if sizes are not known,
    which is also where all are equal. `estimator("adaptive")` uses them beside turns."""

    def __post_init__(self) -> None:
        for name in ("distances", "second", "turns", "growths"):
            column = getattr(self, name)
            if column is not None and len(column) != len(self.indices):
                raise ValueError(f"{name}: {len(column)} for {len(self.indices)} matches; give one for each")

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.indices, self.distances))

    def __len__(self) -> int:
        return len(self.indices)

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
    return Correspondences(*search(a, b, text("method", method, '"nn", "ratio", "mutual" or "smnn"'), ratio))

"""One pair as a picture, as `matchbench show` draws it, in a notebook or a file."""

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._contenders import any_dataset, any_estimator, any_matcher, changes
from ._estimators import Estimator
from ._native import Dataset
from ._native import show as native_show
from ._params import seed_of, whole

_Path = str | os.PathLike[str]
# Frames are numbered in 32 bits.
_LAST = 2**32 - 1


@dataclass(frozen=True, repr=False)
class Picture:
    """A PNG; a notebook shows it."""

    png: bytes

    def save(self, path: _Path) -> Path:
        """Writes the PNG and returns its path."""
        path = Path(path)
        path.write_bytes(self.png)
        return path

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"Picture({len(self.png)} bytes of PNG)"


def show(
    dataset: Dataset | _Path,
    a: int,
    b: int,
    matcher: Any = "sift",
    estimator: str | Estimator | None = None,
    *,
    settings: str | Sequence[str] | Mapping[str, Any] = (),
    seed: int = 0,
    keypoints: bool = False,
) -> Picture:
    """Matches the pair of frames `a` and `b` as a run would, and draws the result: matches that agree with the estimate
    and those that do not, coloured by their distance from the true epipolar line.

    `matcher` is whatever `run` takes: a name, the path of a manifest, `matcher(...)`, `MatchesFrom(...)` or Python code.
    Without an `estimator`, the one that belongs to the matcher is used. `settings` are as on the command line,
    ["sift.ratio=0.7"], or a dict, {"sift.ratio": 0.7}. With `keypoints`, keypoints without a match are drawn too.
    """
    png, notes = native_show(
        any_dataset("dataset", dataset),
        whole("a", a, 0, most=_LAST),
        whole("b", b, 0, most=_LAST),
        any_matcher("matcher", matcher),
        [] if estimator is None else [any_estimator("estimator", estimator)],
        changes(settings),
        seed_of(seed),
        keypoints,
    )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Picture(png)

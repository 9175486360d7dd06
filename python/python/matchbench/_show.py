"""One pair as a picture, as `matchbench show` draws it, in a notebook or a file."""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ._native import Dataset, Error
from ._params import several

_Path = str | os.PathLike[str]


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
    matcher: str | os.PathLike[str] = "sift",
    estimator: str | None = None,
    *,
    settings: str | Sequence[str] = (),
    seed: int = 0,
    keypoints: bool = False,
) -> Picture:
    """Matches the pair of frames `a` and `b` as a run would, and draws the result: matches that agree with the estimate
    and those that do not, coloured by their distance from the true epipolar line.

    `matcher` is a name or the path of a manifest. Without an `estimator`, the one that belongs to the matcher is used.
    `settings` are as on the command line: ["sift.ratio=0.7"], or one string. With `keypoints`, keypoints without a match
    are drawn too.
    """
    folder = dataset.path if isinstance(dataset, Dataset) else dataset
    words = ["show", "--matcher", os.fspath(matcher), "--seed", str(seed), "--out", "-"]
    if estimator is not None:
        words += ["--estimator", estimator]
    for setting in several(settings):
        words += ["--set", setting]
    if keypoints:
        words.append("--keypoints")
    # In a process of its own, since the picture is written to standard output, which belongs to the interpreter here.
    words += ["--", os.fspath(folder), str(a), str(b)]
    done = subprocess.run([sys.executable, "-m", "matchbench", *words], capture_output=True)
    if done.returncode != 0:
        raise Error(done.stderr.decode(errors="replace").removeprefix("error: ").strip())
    return Picture(done.stdout)

"""Matches of other tools in a run, read from their files."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from ._params import several

_Path = str | os.PathLike[str]


@dataclass(frozen=True)
class MatchesFrom:
    """Matches of another tool (LightGlue in hloc, COLMAP, SuperGlue, LoFTR ...), as `--matches` of the command line has
    them: `mb.run(scene, ["sift", mb.MatchesFrom("lightglue", "hloc/matches.h5")], out="run")`."""

    name: str
    """Their name in tables, which is not that of a matcher of the library."""
    files: _Path | Sequence[_Path]
    """The files: one or several, a folder of files, or a folder with one folder for each dataset."""
    _: KW_ONLY
    format: str | None = None
    """Id of the format (`matchbench list formats`). Without it, the content of the files tells."""
    pixel_center: float | None = None
    """Where the centre of the first pixel is, 0 or 0.5. Without it, the format says so."""
    resized: tuple[int, int] | None = None
    """Width and height of the images in whose pixels the points are, if these were resized."""
    verified: bool = False
    """Whether to read the matches that the tool verified (COLMAP's two-view geometries)."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Facts that are recorded with them and shown in the report."""

    @property
    def parts(self) -> tuple[Any, ...]:
        """What the compiled module takes."""
        given: list[_Path] = several(self.files)
        files = [os.fspath(file) for file in given]
        resized = None if self.resized is None else list(self.resized)
        return (self.name, files, self.format, self.pixel_center, resized, self.verified, dict(self.notes))

"""Matches of other tools in a run, read from their files."""

import numbers
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, cast

from ._params import path, refusal, several, text, whole

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
    resized: tuple[int, int] | str | None = None
    """Width and height of the images in whose pixels the points are, if these were resized; or as text, "640x480"."""
    verified: bool = False
    """Whether to read the matches that the tool verified (COLMAP's two-view geometries)."""
    notes: Mapping[str, str | float] = field(default_factory=dict[str, "str | float"])
    """Facts that are recorded with them, as text, and shown in the report."""

    def __post_init__(self) -> None:
        _ = self.parts

    @property
    def parts(self) -> tuple[Any, ...]:
        """What the compiled module takes."""
        name = text("name", self.name, "a name")
        files = [path("files", file, "a path, or a list of paths") for file in several("files", self.files)]
        format = None if self.format is None else text("format", self.format, "the id of a format")
        verified: Any = self.verified
        if not isinstance(verified, bool):
            raise refusal("verified", verified, "True or False")
        return (name, files, format, _center(self.pixel_center), _size(self.resized), verified, _notes(self.notes))


def _center(given: Any) -> float | None:
    """Where the centre of the first pixel is."""
    if given is None:
        return None
    if not isinstance(given, numbers.Real) or given not in (0, 0.5):
        raise ValueError(f"pixel_center: {given!r}; give 0 (as OpenCV, numpy indices) or 0.5 (as COLMAP)")
    return float(given)


def _size(given: Any) -> list[int] | None:
    """Width and height, given as two numbers or as text."""
    if given is None:
        return None
    text_of_size = re.fullmatch(r"(\d+)x(\d+)", given, re.ASCII) if isinstance(given, str) else None
    sides = [int(side) for side in text_of_size.groups()] if text_of_size else several("resized", given)
    if len(sides) != 2:
        raise ValueError(f'resized: {given!r}; give width and height, as (640, 480) or "640x480"')
    return [whole("resized", side, 1) for side in sides]


def _notes(given: Any) -> dict[str, str]:
    """Names and texts."""
    if not isinstance(given, Mapping):
        raise refusal("notes", given, 'a dict, such as {"device": "RTX 4090"}')
    notes = cast("Mapping[Any, Any]", given)
    return {text("notes", name, "names that are text"): text("notes", str(value), "text") for name, value in notes.items()}

"""Datasets imported from other layouts, and rendered datasets to try things out."""

import os
import warnings

from ._native import Dataset
from ._native import import_dataset as native_import
from ._native import rendered_scene as native_scene
from ._params import text

_Path = str | os.PathLike[str]


def import_dataset(
    kind: str,
    source: _Path,
    out: _Path,
    *,
    pairs: str | None = None,
    sequence: str | None = None,
    sensor: str | None = None,
    camera: _Path | None = None,
    poses: _Path | None = None,
    tolerance: float | None = None,
    interpolate: bool = False,
    image_root: _Path | None = None,
    intrinsics: _Path | None = None,
    property: str | None = None,
    images: str = "reference",
) -> Dataset:
    """Imports the folder `source`, in the layout `kind` ("tum", "kitti", "folder" ...; `matchbench import --help`
    describes all), as the new folder `out`, and opens it. The options are those of this command; an option that the
    kind does not have is refused. `pairs` is a rule, such as "all", "window:10", or "list:pairs.txt" for a file with a pair
    in each line. `property` says in a few words what the images show, for the report. Whatever you should know about the
    dataset is given as a warning."""
    rule = None if pairs is None else text("pairs", pairs, 'a rule as text, such as "all" or "list:pairs.txt"')
    notes = native_import(
        kind,
        source,
        out,
        rule,
        sequence,
        sensor,
        camera,
        poses,
        tolerance,
        interpolate,
        image_root,
        intrinsics,
        property,
        images,
    )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Dataset.open(out)


def rendered_scene(
    name: str, folder: _Path, *, frames: int | None = None, size: tuple[int, int] | None = None
) -> Dataset:
    """A scene with exact poses, rendered into `folder` if it does not exist yet. It does not replace your own images.
    With `frames`, only the first so many frames are rendered. `size` is (width, height)."""
    return Dataset.open(native_scene(name, folder, frames, size))

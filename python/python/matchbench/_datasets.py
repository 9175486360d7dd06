"""Datasets from other layouts, and rendered ones for trying things out."""

import os
import warnings

from ._native import Dataset
from ._native import import_dataset as native_import
from ._native import rendered_scene as native_scene

_Path = str | os.PathLike[str]


def import_dataset(
    kind: str,
    source: _Path,
    out: _Path,
    *,
    pairs: str | None = None,
    sequence: str | None = None,
    camera: _Path | None = None,
    poses: _Path | None = None,
    tolerance: float | None = None,
    interpolate: bool = False,
    image_root: _Path | None = None,
    intrinsics: _Path | None = None,
    images: str = "reference",
) -> Dataset:
    """Brings the folder `source`, of the layout `kind` ("tum", "kitti", "folder" ...; `matchbench import --help`
    describes all), into the new folder `out`, and opens it. Options are that command's; one that the kind has not
    is refused. What should be known about the dataset is warned of."""
    notes = native_import(
        kind,
        source,
        out,
        pairs,
        sequence,
        camera,
        poses,
        tolerance,
        interpolate,
        image_root,
        intrinsics,
        images,
    )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Dataset.open(out)


def rendered_scene(
    name: str, folder: _Path, *, frames: int | None = None, size: tuple[int, int] | None = None
) -> Dataset:
    """A scene with exact poses, rendered into `folder` if it is not there yet: no substitute for your own
    images. `frames` takes the first ones only, `size` is (width, height)."""
    return Dataset.open(native_scene(name, folder, frames, size))

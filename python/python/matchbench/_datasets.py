"""Datasets imported from other layouts, made of what a program knows, or rendered to try things out."""

import os
import warnings
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._native import Camera, Dataset
from ._native import import_dataset as native_import
from ._native import rendered_scene as native_scene
from ._native import write_dataset as native_write
from ._params import path, several, text

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
    body_from_camera: _Path | None = None,
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
    folder = path("out", out, "the path of the new folder")
    named = {"sequence": sequence, "sensor": sensor, "property": property}
    sequence, sensor, property = (None if each is None else text(name, each, "text") for name, each in named.items())
    notes = native_import(
        text("kind", kind, 'the name of a layout, as in "tum"'),
        path("source", source),
        folder,
        rule,
        sequence,
        sensor,
        camera,
        poses,
        body_from_camera,
        tolerance,
        interpolate,
        image_root,
        intrinsics,
        property,
        text("images", images, '"reference", "link" or "copy"'),
    )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Dataset.open(folder)


def write_dataset(
    out: _Path,
    images: Sequence[_Path],
    cameras: Camera | Sequence[Camera],
    world_from_camera: ArrayLike,
    *,
    pairs: str | ArrayLike = "all",
    property: str = "",
    origin: str = "",
    store: Literal["reference", "link", "copy"] = "reference",
) -> Dataset:
    """Writes a dataset of your own as the new folder `out`, and opens it. Its name is that of the folder.

    `images` are the n files. `cameras` is the `Camera` of each, or one that took all; lens distortion is part of it.
    `world_from_camera` has the pose of each, n x 4 x 4 or n x 3 x 4: [R t] takes a point from the frame of the camera (x to
    the right, y down, z forward) to the world, x_world = R x_camera + t, so t is the position of the camera. OpenCV and
    COLMAP have the inverse, camera_from_world; NeRF and OpenGL have y up and z backward (`R @ diag(1, -1, -1)` turns that).
    The unit of length is yours, one for all images. Rotations may be rounded to three decimals.

    `pairs` is a rule as in `import_dataset` ("all", "window:10", "list:pairs.txt"), or k x 2 indices of images. `property`
    says in a few words what the images show, `origin` where they come from. With `store`, the dataset names the files where
    they are ("reference"), or has links to them or copies of them."""
    files = [path("images", file, "a list of paths") for file in several("images", images)]
    if not files:
        raise ValueError("images: there are none")
    count = len(files)
    taken = [cameras] * count if isinstance(cameras, Camera) else several("cameras", cameras)
    if len(taken) != count:
        raise ValueError(f"cameras: {len(taken)} for {count} images; give one for each, or one Camera for all")
    frames = list(zip(files, taken, _poses(world_from_camera, count), strict=True))
    chosen = text("pairs", pairs, "a rule") if isinstance(pairs, str) else _pairs(pairs, count)
    about = (text("origin", origin, "a line of text"), text("property", property, "a few words"))
    folder = path("out", out, "the path of the new folder")
    native_write(folder, frames, chosen, *about, text("store", store, '"reference", "link" or "copy"'))
    return Dataset.open(folder)


def _poses(given: Any, count: int) -> list[list[float]]:
    """So many matrices, each as the 16 numbers of its rows."""
    expected = f"{count} matrices, 4 x 4 or 3 x 4, one for each image"
    try:
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"world_from_camera: {error}; give {expected}") from None
    if array.shape == (count, 3, 4):
        last = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (count, 1, 4))
        array = np.concatenate([array, last], axis=1)
    if array.shape != (count, 4, 4):
        raise ValueError(f"world_from_camera: an array of shape {list(array.shape)}; give {expected}")
    return array.reshape(count, 16).tolist()


def _pairs(given: Any, count: int) -> list[tuple[int, int]]:
    """Pairs of numbers of images."""
    array = np.asarray(given)
    if array.size == 0:
        raise ValueError("pairs: there are none, so nothing would be matched")
    if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
        what = f"an array of {array.dtype} with shape {list(array.shape)}"
        raise ValueError(f'pairs: {what}; give k x 2 whole numbers, the indices of images, or a rule such as "all"')
    outside = np.flatnonzero(((array < 0) | (array >= count)).any(axis=1))
    if len(outside):
        row = int(outside[0])
        raise ValueError(f"pairs: row {row} is {array[row].tolist()}; there are {count} images, numbered from 0")
    return [(a, b) for a, b in array.tolist()]


def rendered_scene(
    name: str,
    folder: _Path,
    *,
    frames: int | None = None,
    size: Sequence[int] | NDArray[np.integer[Any]] | None = None,
) -> Dataset:
    """A scene with exact poses, rendered into `folder` if it does not exist yet. It does not replace your own images.
    With `frames`, only the first so many frames are rendered. `size` is (width, height)."""
    scene = text("name", name, 'the name of a scene, as in "cabinet"')
    return Dataset.open(native_scene(scene, path("folder", folder, "the path of a folder"), frames, size))

"""What the scripts of this folder read from a dataset of matchbench. What they cannot take into account is refused."""

import re
import sys
import tomllib

import numpy as np

# Endings of the files in `Images` that are images, as matchbench has them.
IMAGES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm", ".pnm"}


def manifest_of(folder):
    """The content of `dataset.toml`, empty if there is none; no camera has a lens and no image is turned."""
    path = folder / "dataset.toml"
    manifest = tomllib.loads(path.read_text()) if path.exists() else {}
    frames = manifest.get("frames", [])
    if manifest.get("distortion") or any(frame.get("camera", {}).get("distortion") for frame in frames):
        sys.exit(f"{path}: lens distortion is not supported here")
    if any(frame.get("turn") for frame in frames):
        sys.exit(f"{path}: turns of images are not supported here")
    return manifest


def images_of(folder):
    """The paths of the images, by their numbers where the manifest does not name them."""
    manifest = manifest_of(folder)
    frames = manifest.get("frames", [])
    if frames and "image" in frames[0]:
        root = folder / manifest.get("image_root", ".")
        return [root / frame["image"] for frame in frames]
    images = [path for path in (folder / "Images").iterdir() if path.suffix.lower() in IMAGES]
    numbered = [path for path in images if path.stem.isascii() and path.stem.isdigit()]
    return sorted(numbered, key=lambda path: int(path.stem))


def images_in(folder):
    """The images of any folder, in the order of the numbers in their names (`2.png` before `10.png`), as `import folder`."""
    images = [path for path in folder.iterdir() if path.suffix.lower() in IMAGES and not path.name.startswith(".")]
    parts = lambda path: [int(part) if part.isdigit() else part for part in re.split("([0-9]+)", path.name)]  # noqa: E731
    return sorted(images, key=parts)


def cameras_of(folder):
    """K of `camera.txt`, None if there is none, and K of each frame that has its own."""
    path = folder / "camera.txt"
    rows = path.read_text(encoding="utf-8-sig").splitlines() if path.exists() else []
    numbers = [float(word) for row in rows for word in row.partition("#")[0].split()]
    if numbers and any(numbers[9:]):
        sys.exit(f"{path}: lens distortion is not supported here")
    own = {}
    for index, frame in enumerate(manifest_of(folder).get("frames", [])):
        if camera := frame.get("camera"):
            own[index] = np.array(
                [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]]
            )
    return np.reshape(numbers[:9], (3, 3)) if numbers else None, own


def one_camera(folder):
    """K of all images, for scripts that have one camera for all."""
    shared, own = cameras_of(folder)
    known = [shared, *own.values()] if shared is not None else [*own.values()]
    if not known or not all(np.array_equal(k, known[0]) for k in known):
        sys.exit(f"{folder}: this script needs one camera for all images")
    return known[0]


def read_dataset(folder):
    """Image paths, K of each image, and the pairs of a dataset folder."""
    images = images_of(folder)
    shared, own = cameras_of(folder)
    cameras = [own.get(index, shared) for index in range(len(images))]
    return images, cameras, list(true_poses(folder))


def rows_of(path):
    """The words of each row that is neither empty nor a comment."""
    rows = (line.split() for line in path.read_text(encoding="utf-8-sig").splitlines())
    return [row for row in rows if row and not row[0].startswith("#")]


def true_poses(folder):
    """The pairs (a, b) of `pairs.txt`, in their order, each with its true pose [R t], 3 x 4."""
    rows = rows_of(folder / "pairs.txt")
    return {(int(row[0]), int(row[1])): np.array(row[2:14], float).reshape(3, 4) for row in rows}


def true_homographies(folder):
    """The pairs (a, b) of `homographies.txt`, each with its true homography."""
    rows = rows_of(folder / "homographies.txt")
    return {(int(row[0]), int(row[1])): np.array(row[2:11], float).reshape(3, 3) for row in rows}

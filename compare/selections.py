"""Compares the matches that each `selection` keeps with Kornia's, for the same SIFT features: ratio, mutual, smnn, fginn;
and RootSIFT.

    python compare/selections.py DATASET --programs target/release [--pairs N]

`--programs` has `matchbench` and `extract` of this folder. Needs kornia and numpy. Prints a row
per selection: number of matches of ours, of theirs and in both, over the first N pairs. Matches are the same if their two
points are. `match_fginn` of Kornia 0.8.2 measures distances from the neighbours of the first feature for all features. So
there is also a row for the definition, computed from all distances.
"""

import argparse
import re
import subprocess
import tempfile
from pathlib import Path

import kornia.feature as kf
import numpy as np
import torch

from dataset import images_of

RATIO, RADIUS = 0.8, 10.0


def features(program, image, folder):
    """Points and descriptors of an image, as `extract` writes them."""
    subprocess.run([program, "sift", image, "1", folder / "f"], check=True, stdout=subprocess.DEVNULL)
    points = np.load(folder / "f.keypoints.npy").reshape(-1, 6)[:, :2]
    return points, torch.from_numpy(np.load(folder / "f.descriptors.npy").astype(np.float32))


def fginn(a, b):
    """By the definition: the second neighbour is the nearest of all features farther than the radius from the first."""
    distances = torch.cdist(a[1].double(), b[1].double()).numpy()
    first = distances.argmin(axis=1)
    apart = np.linalg.norm(b[0][None] - b[0][first][:, None], axis=2) > RADIUS
    second = np.where(apart, distances, np.inf).min(axis=1)
    rows = np.arange(len(first))
    kept = (distances[rows, first] < RATIO * second) & np.isfinite(second)
    return np.stack([rows[kept], first[kept]], axis=1)


def theirs(a, b):
    """The matches for each row, as indices."""
    laf = lambda points: kf.laf_from_center_scale_ori(torch.from_numpy(points)[None])  # noqa: E731
    roots = [torch.sqrt(torch.nn.functional.normalize(d, p=1, dim=1)) for d in (a[1], b[1])]
    return {
        "ratio": kf.match_snn(a[1], b[1], RATIO)[1].numpy(),
        "mutual": kf.match_mnn(a[1], b[1])[1].numpy(),
        "smnn": kf.match_smnn(a[1], b[1], RATIO)[1].numpy(),
        "fginn, by definition": fginn(a, b),
        "fginn, Kornia's": kf.match_fginn(a[1], b[1], laf(a[0]), laf(b[0]), RATIO, RADIUS)[1].numpy(),
        "rootsift, ratio": kf.match_snn(*roots, RATIO)[1].numpy(),
    }


def ours(program, dataset, pairs, folder):
    """The matched points of each pair, for each row of the table."""
    found = {}
    for name in ("ratio", "mutual", "smnn", "fginn", "rootsift"):
        matcher = "rootsift" if name == "rootsift" else "sift"
        change = [] if name == "rootsift" else ["--set", f"sift.selection={name}"]
        run = [program, "run", dataset, "--matchers", matcher, *change, "--limit", str(pairs), "--out", folder / name]
        subprocess.run(run, check=True, capture_output=True)
        subprocess.run([program, "export", folder / name, folder / f"{name}-matches", "--format", "npz"],
                       check=True, capture_output=True)  # fmt: skip
        for file in (folder / f"{name}-matches").rglob("*.npz"):
            a, b = map(int, re.findall(r"\d+", file.stem))
            points = np.load(file)
            found[name, a, b] = set(map(tuple, np.hstack([points["a"], points["b"]]).astype(np.float32).tolist()))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--images", type=Path, nargs="*", help="the frames in their order, if not where the dataset says")
    parser.add_argument("--pairs", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    images = arguments.images or images_of(arguments.dataset)
    counts = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        mine = ours(arguments.programs / "matchbench", arguments.dataset, arguments.pairs, folder)
        for a, b in sorted({(a, b) for _, a, b in mine}):
            one, other = (features(arguments.programs / "extract", images[frame], folder) for frame in (a, b))
            for row, indices in theirs(one, other).items():
                points = np.hstack([one[0][indices[:, 0]], other[0][indices[:, 1]]]).astype(np.float32)
                kept, known = mine[row.split(",")[0], a, b], set(map(tuple, points.tolist()))
                counts.setdefault(row, np.zeros(3, int))
                counts[row] += [len(kept), len(known), len(kept & known)]
    print("| selection | ours | theirs | both |\n| --- | ---: | ---: | ---: |")
    for row, (kept, known, both) in counts.items():
        print(f"| {row} | {kept} | {known} | {both} |")


if __name__ == "__main__":
    main()

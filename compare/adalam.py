"""Compares our AdaLAM with Kornia's: do both select the same matches, from the same keypoints and putative matches?

    python compare/adalam.py IMAGE_A IMAGE_B [IMAGE_A IMAGE_B ...] [--programs target/release] [--rounds 3]

SIFT features come from `extract` of this folder, and all nearest neighbours from numpy. Both programs get the same
keypoints and matches. First the results are checked, one line per pair of images:

    seeds, neighbourhoods   those of the definition (below, in numpy) that Kornia's functions find too, in double precision
    definition              our decisions that are those of the definition, with and without the last fit
    ours, theirs, both      matches that are kept, and share of equal decisions

Then times are measured with the defaults of both, in turn, with one thread each. Kornia draws eight of its 128 pairs
twice; with 120 both draw the same. Kornia keeps matches by other rules (see `crates/vision/src/matching/adalam/mod.rs`),
so only `both` can be compared. Needs kornia, numpy, opencv. Build first: cargo build --release -p matchbench-compare
"""

import argparse
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from kornia.feature.adalam.adalam import AdalamFilter, get_adalam_default_config
from kornia.feature.adalam.core import extract_neighborhood_sets, select_seeds
from kornia.feature.adalam.utils import dist_matrix

from pixels import GRAY

EXPANSION, TURN, GROWTH, CONFIDENCE, LEAST, STRETCH = 4.0, 30.0, 1.5, 200.0, 6, 5.0


def features(program, image, folder):
    """Keypoints (x, y, size, angle in radians) and descriptors, as `extract` writes them."""
    subprocess.run([program, "sift", image, "1", folder / "f"], check=True, stdout=subprocess.DEVNULL)
    keypoints = np.load(folder / "f.keypoints.npy").reshape(-1, 6)[:, :4].astype(np.float32)
    keypoints[:, 3] = np.radians(keypoints[:, 3])
    return keypoints, np.load(folder / "f.descriptors.npy").astype(np.float64)


def nearest(a, b):
    """For each descriptor of a: the nearest of b, the distances to the nearest and second nearest, and whether both are
    each other's nearest."""
    squared = (a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2 * a @ b.T
    first = squared.argmin(axis=1)
    rows = np.arange(len(a))
    mutual = squared.argmin(axis=0)[first] == rows
    two = np.sqrt(np.maximum(np.partition(squared, 1, axis=1)[:, :2], 0)).astype(np.float32)
    return first, two, mutual


def definition(a, b, ambiguity, mutual, radii, samples, refit):
    """Seeds, neighbourhoods and decisions, as the text in `adalam/mod.rs` defines them."""
    order = np.argsort(ambiguity, kind="stable")
    place_a, place_b = a[:, :2].astype(float), b[:, :2].astype(float)
    turn, growth = np.degrees(b[:, 3].astype(float) - a[:, 3]), b[:, 2].astype(float) / a[:, 2]
    clear = [i for i in order if mutual[i] and ambiguity[i] < np.float32(0.8)]
    seeds = []
    for at, i in enumerate(clear):
        if not (np.linalg.norm(place_a[clear[:at]] - place_a[i], axis=1) < radii[0]).any():
            seeds.append(i)
    kept, around = np.zeros(len(a), bool), {}
    for seed in seeds:
        apart = np.abs(turn - turn[seed]) % 360
        rate = growth[seed] / growth
        member = np.linalg.norm(place_a - place_a[seed], axis=1) < EXPANSION * radii[0]
        member &= np.linalg.norm(place_b - place_b[seed], axis=1) < EXPANSION * radii[1]
        member &= (np.minimum(apart, 360 - apart) < TURN) & (rate < GROWTH) & (rate * GROWTH > 1)
        members = order[member[order]]
        if len(members) < LEAST:
            continue
        around[seed] = set(members.tolist())
        x = (place_a[members] - place_a[seed]) / (EXPANSION * radii[0])
        y = (place_b[members] - place_b[seed]) / (EXPANSION * radii[1])
        kept[members[inliers(x, y, list(members).index(seed), samples, refit)]] = True
    return around, kept


def support(x, y, linear, fixed):
    """How many inliers a map has besides those that determine it, how many more than by chance, and all of them."""
    stretch = np.linalg.svd(linear, compute_uv=False)
    if stretch[0] > STRETCH or stretch[1] < 1 / STRETCH:
        return 0, 0, []
    squared = ((x @ linear.T - y) ** 2).sum(axis=1)
    others = np.setdiff1d(np.arange(len(x)), fixed)
    by_distance = others[np.argsort(squared[others], kind="stable")]
    many = np.arange(1, len(others) + 1)
    enough = many >= CONFIDENCE * len(others) * squared[by_distance]
    if not enough.any():
        return 0, 0, []
    count = many[enough].max()
    by_chance = len(others) * squared[by_distance[count - 1]]
    return count, count - by_chance, np.concatenate([fixed, by_distance[:count]])


def inliers(x, y, seed, samples, refit):
    """The members of a neighbourhood that are kept."""
    best = 0, 0, []
    pairs = [(i, j) for j in range(1, len(x)) for i in range(j)][:samples]
    for pair in map(list, pairs):
        cross = np.linalg.det(x[pair])
        if abs(cross) > 1e-4 * (x[pair] ** 2).sum():
            found = support(x, y, np.linalg.solve(x[pair], y[pair]).T, [seed, *pair])
            best = found if found[0] > best[0] else best
    if refit and best[0]:
        linear = np.linalg.lstsq(x[best[2]], y[best[2]], rcond=None)[0].T
        best = support(x, y, linear, [seed])
    return np.array(best[2] if best[1] >= LEAST else [], int)


def tensors(a, b, ambiguity, dtype):
    """The arguments of Kornia's functions: places, squared ratios, orientations in degrees, sizes; matches are i to i."""
    of = lambda rows: torch.from_numpy(np.asarray(rows, float)).to(dtype)  # noqa: E731
    return {
        "k1": of(a[:, :2]),
        "k2": of(b[:, :2]),
        "scores": of(ambiguity.astype(float) ** 2),
        "o1": of(np.degrees(a[:, 3])),
        "o2": of(np.degrees(b[:, 3])),
        "s1": of(a[:, 2]),
        "s2": of(b[:, 2]),
    }


def seeds_of_kornia(given, mutual, radii):
    """The neighbourhood of each seed, computed by Kornia's functions."""
    same = torch.arange(len(mutual))
    between = dist_matrix(given["k1"], given["k1"])
    seeds = select_seeds(between, radii[0], given["scores"], same, torch.from_numpy(mutual))
    mask, _, seeds, _ = extract_neighborhood_sets(
        given["o1"], given["o2"], given["s1"], given["s2"], between, *seeds, given["k1"], given["k2"], *radii,
        same, TURN, GROWTH, EXPANSION, LEAST,
    )  # fmt: skip
    return {int(seed): set(torch.where(row)[0].tolist()) for seed, row in zip(seeds, mask, strict=True)}


def kornia(given, mutual, sizes, **config):
    """The matches that Kornia keeps."""
    adalam = AdalamFilter({**get_adalam_default_config(), **config})
    same = torch.arange(len(mutual))
    kept = adalam.filter_matches(
        putative_matches=same, mnn=torch.from_numpy(mutual), im1shape=sizes[0], im2shape=sizes[1], **given
    )
    mask = np.zeros(len(mutual), bool)
    mask[kept[:, 0].numpy()] = True
    return mask


def ours(program, path, samples, refit):
    """Milliseconds, and the matches that ours keeps."""
    command = [program, path, str(samples), str(int(refit))]
    milliseconds, digits = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return float(milliseconds), np.frombuffer(digits.encode(), "u1") == ord("1")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=Path, nargs="+", help="two images for each pair")
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    images = arguments.images
    equal = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for image_a, image_b in zip(images[::2], images[1::2], strict=True):
            sizes = [cv2.imread(str(image), GRAY).shape[::-1] for image in (image_a, image_b)]
            (a, rows_a), (b, rows_b) = (
                features(arguments.programs / "extract", image, folder) for image in (image_a, image_b)
            )
            first, two, mutual = nearest(rows_a, rows_b)
            b, ambiguity = b[first], two[:, 0] / two[:, 1]
            path = folder / "matches.bin"
            with open(path, "wb") as file:
                file.write(np.array(sizes, "<u4").tobytes())
                file.write(np.hstack([a, b, two, mutual[:, None]]).astype("<f4").tobytes())
            radii = [(width * height / (100 * np.pi)) ** 0.5 for width, height in sizes]
            double = tensors(a, b, ambiguity, torch.float64)
            theirs = seeds_of_kornia(double, mutual, radii)
            line = f"{image_a.name} {image_b.name}: {len(a)} matches"
            for samples, refit in ((120, False), (128, True)):
                around, defined = definition(a, b, ambiguity, mutual, radii, samples, refit)
                mine = ours(arguments.programs / "adalam", path, samples, refit)[1]
                kept = kornia(double, mutual, sizes, ransac_iters=samples, refit=refit)
                if not refit:
                    same = sum(theirs.get(seed) == members for seed, members in around.items())
                    line += f", seeds {len(around)} and {len(theirs)}, neighbourhoods equal {same}"
                line += (
                    f"; {'refitted' if refit else 'not refitted'}: definition {(mine == defined).mean():.2%}, ours "
                    f"{mine.sum()}, theirs {kept.sum()}, both {(mine & kept).sum()}, equal {(mine == kept).mean():.2%}"
                )
                equal &= bool((mine == defined).all())
            print(line)
            single = tensors(a, b, ambiguity, torch.float32)
            times = {"ours": [], "theirs": []}
            for _ in range(arguments.rounds):
                times["ours"].append(ours(arguments.programs / "adalam", path, 128, True)[0])
                start = time.perf_counter()
                kornia(single, mutual, sizes)
                times["theirs"].append(1e3 * (time.perf_counter() - start))
            mine, kept = (statistics.median(times[side]) for side in ("ours", "theirs"))
            print(f"    ours {mine:.1f} ms, theirs {kept:.1f} ms ({kept / mine:.0f} x)")
    if not equal:
        raise SystemExit("a decision is not that of the definition")


if __name__ == "__main__":
    main()

"""Compares our exact search with OpenCV's brute-force matcher (and our kd-trees with FLANN), one thread each.

Takes SIFT, ORB (256 bits, 100,000 features) and BRISK (512 bits) descriptors of two images with
OpenCV, gives the same descriptors to both programs in turn, checks that neighbours and distances
agree, and prints the median times. Build first: cargo build --release -p matchbench-compare
"""

import argparse
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

from pixels import GRAY

ROOT = pathlib.Path(__file__).resolve().parent.parent
SIZES = [500, 1_000, 2_000, 10_000, None]
# Least number of distances that either program computes in a round. A small set is searched several times, since a
# program that has just started is slower than one that has been running.
DISTANCES_OF_A_ROUND = 40_000_000
FOUND = np.dtype([("a", "<u4"), ("b", "<u4"), ("distance", "<f4"), ("second", "<f4")])


def write(path, rows):
    """Writes descriptors in the format that src/bin/search.rs documents."""
    binary = rows.dtype == np.uint8
    length = rows.shape[1] * 8 if binary else rows.shape[1]
    with open(path, "wb") as file:
        file.write(np.array([binary, length, len(rows)], "<u4").tobytes())
        file.write(rows.tobytes() if binary else rows.astype("<f4").tobytes())


def timed(function, repetitions):
    """The result of `function` and the median of its times in milliseconds."""
    elapsed = []
    for _ in range(repetitions):
        start = time.perf_counter()
        result = function()
        elapsed.append(1e3 * (time.perf_counter() - start))
    return result, statistics.median(elapsed)


def knn_table(matches):
    """OpenCV's two neighbours of each row as arrays (index, distance, second distance)."""
    return (
        np.array([m[0].trainIdx for m in matches]),
        np.array([m[0].distance for m in matches], np.float32),
        np.array([m[1].distance for m in matches], np.float32),
    )


def disagreements(ours, theirs, a, b, binary):
    """Number of rows with another distance, and of rows with another neighbour at another distance."""
    index, nearest, second = theirs
    assert np.array_equal(ours["a"], np.arange(len(a)))
    distances = (ours["distance"] != nearest) | (ours["second"] != second)
    other = np.flatnonzero(ours["b"] != index)
    wrong = 0
    for row in other:  # another neighbour is only right if it has exactly the same distance
        pair = b[[ours["b"][row], index[row]]]
        if binary:
            both = np.bitwise_count(pair ^ a[row]).sum(1)
        else:
            both = ((pair.astype(np.int64) - a[row].astype(np.int64)) ** 2).sum(1)
        wrong += both[0] != both[1]
    return int(distances.sum()), len(other), int(wrong)


def compare(name, a, b, binary, rounds, folder, program):
    """Runs both programs in turn on the same descriptors and prints one line."""
    paths = [folder / "a.bin", folder / "b.bin", folder / "found.bin"]
    write(paths[0], a)
    write(paths[1], b)
    brute_force = cv2.BFMatcher(cv2.NORM_HAMMING if binary else cv2.NORM_L2)
    repetitions = max(3, DISTANCES_OF_A_ROUND // (len(a) * len(b)))
    columns = {"ours": [], "bf": [], "flann": [], "kdforest": []}

    def run(paths, search):
        command = [program, *paths, str(repetitions), search]
        return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    for _ in range(rounds):
        columns["ours"].append(run(paths, "exact"))
        matches, elapsed = timed(lambda: brute_force.knnMatch(a, b, k=2), repetitions)
        columns["bf"].append(elapsed)
        if not binary:
            def flann():
                matcher = cv2.FlannBasedMatcher({"algorithm": 1, "trees": 4}, {"checks": 32})
                return matcher.knnMatch(a, b, k=2)

            approximate, elapsed = timed(flann, repetitions)
            columns["flann"].append(elapsed)
            columns["kdforest"].append(run([*paths[:2], folder / "kdforest.bin"], "kdforest"))
    ours = np.fromfile(paths[2], FOUND)
    distances, other, wrong = disagreements(ours, knn_table(matches), a, b, binary)
    median = {key: statistics.median(value) for key, value in columns.items() if value}
    line = (
        f"{name:5} {len(a):6} x {len(b):6}: ours {median['ours']:9.2f} ms, "
        f"BFMatcher {median['bf']:9.1f} ms ({median['bf'] / median['ours']:5.2f} x)"
    )
    if not binary:
        recall = np.mean(knn_table(approximate)[0] == ours["b"])
        trees = np.mean(np.fromfile(folder / "kdforest.bin", FOUND)["b"] == ours["b"])
        line += (
            f", FLANN {median['flann']:7.1f} ms ({median['flann'] / median['ours']:5.2f} x, "
            f"finds {100 * recall:.1f} % of the nearest), kd-trees {median['kdforest']:7.1f} ms "
            f"({median['flann'] / median['kdforest']:5.2f} x FLANN's speed, {100 * trees:.1f} %)"
        )
    print(f"{line}; {distances} distances differ, {other} ties resolved otherwise, {wrong} wrong")
    sys.stdout.flush()
    return distances + wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("a", help="first image")
    parser.add_argument("b", help="second image")
    parser.add_argument("--rounds", type=int, default=5, help="times that each program runs")
    parser.add_argument("--program", default=str(ROOT / "target/release/search"))
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if hasattr(os, "sched_setaffinity"):
        # Both programs on the same processor: another may be slower or busier.
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    images = [cv2.imread(path, GRAY) for path in (arguments.a, arguments.b)]
    if any(image is None for image in images):
        parser.error("an image cannot be read")

    print(f"OpenCV {cv2.__version__}, medians of {arguments.rounds} interleaved rounds")
    failures = 0
    for name, extractor in [
        ("SIFT", cv2.SIFT_create()),
        ("ORB", cv2.ORB_create(100_000)),
        ("BRISK", cv2.BRISK_create()),
    ]:
        # A fixed shuffle, so that a prefix is a fair sample of the image.
        a, b = (
            np.random.default_rng(0).permutation(extractor.detectAndCompute(image, None)[1])
            for image in images
        )
        with tempfile.TemporaryDirectory() as folder:
            for size in SIZES:
                if size is None or size < max(len(a), len(b)):
                    folder = pathlib.Path(folder)
                    failures += compare(
                        name, a[:size], b[:size], a.dtype == np.uint8, arguments.rounds, folder, arguments.program
                    )
    sys.exit(failures > 0)


if __name__ == "__main__":
    main()

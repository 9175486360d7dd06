"""Compares our GMS with OpenCV's matchGMS: do both select the same, from the same keypoints and putative matches?

    python gms.py IMAGE_A IMAGE_B [--features 10000] [--rounds 5]

Extracts ORB and its nearest neighbours with OpenCV, gives both programs the same matches, and prints
for each variant how many matches both keep, how many only one of them keeps, and the median times of the selection.
OpenCV's time includes the conversion of the keypoints and matches from Python's lists, which its interface asks for. The
first call of each is not timed. Ends with an error if a decision differs.
Build first: cargo build --release -p matchbench-compare
"""

import argparse
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

from pixels import GRAY

PROGRAM = pathlib.Path(__file__).resolve().parent.parent / "target/release/gms"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("a", help="first image")
    parser.add_argument("b", help="second image")
    parser.add_argument("--features", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--program", default=PROGRAM)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    images = [cv2.imread(path, GRAY) for path in (arguments.a, arguments.b)]
    orb = cv2.ORB_create(arguments.features, fastThreshold=0)
    (keys_a, rows_a), (keys_b, rows_b) = (orb.detectAndCompute(image, None) for image in images)
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).match(rows_a, rows_b)
    sizes = [(image.shape[1], image.shape[0]) for image in images]
    points = np.array([(*keys_a[m.queryIdx].pt, *keys_b[m.trainIdx].pt) for m in matches], "<f4")
    print(f"OpenCV {cv2.__version__}, {len(matches)} matches")
    different = 0
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "matches.bin"
        with open(path, "wb") as file:
            file.write(np.array([*sizes[0], *sizes[1]], "<u4").tobytes())
            file.write(points.tobytes())
        for scales in (False, True):
            for rotations in (False, True):
                times = {"ours": [], "theirs": []}
                for turn in range(-1, arguments.rounds):
                    start = time.perf_counter()
                    kept = cv2.xfeatures2d.matchGMS(
                        *sizes, keys_a, keys_b, matches, withRotation=rotations, withScale=scales
                    )
                    seconds = time.perf_counter() - start
                    command = [arguments.program, path, str(int(scales)), str(int(rotations))]
                    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                    milliseconds, mask = printed.split()
                    if turn >= 0:
                        times["theirs"].append(1e3 * seconds)
                        times["ours"].append(float(milliseconds))
                theirs = np.zeros(len(matches), bool)
                theirs[[m.queryIdx for m in kept]] = True
                ours = np.frombuffer(mask.encode(), "u1") == ord("1")
                different += (ours != theirs).sum()
                ours_ms, theirs_ms = (statistics.median(times[side]) for side in ("ours", "theirs"))
                print(
                    f"scales {scales!s:5} rotations {rotations!s:5}: both {(ours & theirs).sum()}, "
                    f"ours alone {(ours & ~theirs).sum()}, theirs alone {(theirs & ~ours).sum()}, "
                    f"agreement {100 * (ours == theirs).mean():.2f} %; "
                    f"ours {ours_ms:.2f} ms, theirs {theirs_ms:.2f} ms ({theirs_ms / ours_ms:.1f} x)"
                )
    if different:
        sys.exit(f"{different} decisions differ")


if __name__ == "__main__":
    main()

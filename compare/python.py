"""Compares the Python package with cv2, poselib and pycolmap: time and agreement, in one run, on one core.

    pip install '.[peers]'
    python compare/python.py IMAGE_A IMAGE_B FOCAL [--repeats 5]

FOCAL is the focal length in pixels; the principal point is assumed in the middle of the image. Times are medians
of interleaved repetitions. A ratio above 1 means that the other library takes that many times as long.
"""

import argparse
import os
import statistics
import time

for variable in ("OMP_NUM_THREADS", "RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2
import matchbench as mb
import numpy as np
import poselib
import pycolmap

from judge import rotation_angle
from machine import processor
from pixels import GRAY

def race(ours, theirs, repeats, fresh=None):
    """Results of both, and their median times in milliseconds. `fresh` makes the argument of both anew each time."""
    results, times = [None, None], [[], []]
    for _ in range(repeats):
        for side, work in enumerate((ours, theirs)):
            given = () if fresh is None else (fresh(),)
            start = time.perf_counter()
            results[side] = work(*given)
            times[side].append(1e3 * (time.perf_counter() - start))
    return results, [statistics.median(each) for each in times]


def near(ours, theirs, radius=0.5):
    """Share of their points that have a point of ours within the radius."""
    index = cv2.flann_Index(np.ascontiguousarray(ours, np.float32), {"algorithm": 1, "trees": 1})
    _, squared = index.knnSearch(np.ascontiguousarray(theirs, np.float32), 1, params={"checks": -1})
    return float((squared[:, 0] <= radius**2).mean())


def row(name, peer, times, agreement):
    print(f"| {name} | {peer} | {times[0]:.1f} | {times[1]:.1f} | {times[1] / times[0]:.2f} | {agreement} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", nargs=2)
    parser.add_argument("focal", type=float)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    a, b = (cv2.imread(path, GRAY) for path in options.images)
    height, width = a.shape
    print(f"{width}x{height}, {processor()}, cv2 {cv2.__version__}, pycolmap {pycolmap.__version__}, "
          f"poselib {poselib.__version__}\n")  # fmt: skip
    print("| what | beside | ours, ms | theirs, ms | ratio | agreement |\n| --- | --- | --- | --- | --- | --- |")
    for name in ("SIFT", "ORB", "AKAZE"):
        few = {"nfeatures": 10_000} if name == "ORB" else {}
        ours, theirs = getattr(mb, f"{name}_create")(**few).extractor, getattr(cv2, f"{name}_create")(**few)
        (found, (keys, _)), times = race(
            lambda: ours.extract(a), lambda: theirs.detectAndCompute(a, None), options.repeats
        )
        share = near(found.keypoints, np.array([key.pt for key in keys]))
        row(f"{name}, {len(found)} features", "cv2", times, f"{share:.1%} of their {len(keys)} keypoints within 0.5 px")

    colmap = pycolmap.Sift(device=pycolmap.Device.cpu)
    (found, (keys, _)), times = race(lambda: mb.SIFT().extract(a), lambda: colmap.extract(a), options.repeats)
    share = near(found.keypoints, np.asarray(keys)[:, :2] - 0.5, 1.5)
    row(f"SIFT, {len(found)} features", "pycolmap", times, f"{share:.1%} of their {len(keys)} keypoints within 1.5 px")

    features = [mb.SIFT().extract(image) for image in (a, b)]
    rows = [np.array(each.descriptors) for each in features]
    brute = cv2.BFMatcher(cv2.NORM_L2)
    # What a search prepares of the candidates stays with them, so each search gets new ones.
    (found, two), times = race(
        lambda candidates: mb.match(features[0], candidates),
        lambda _: brute.knnMatch(*rows, k=2),
        options.repeats,
        fresh=lambda: features[1].select(np.arange(len(features[1]))),
    )
    kept = {(m.queryIdx, m.trainIdx) for m, second in two if m.distance < 0.8 * second.distance}
    same = len(kept & {tuple(pair) for pair in found.indices.tolist()})
    row(f"exact search for a ratio test, {len(rows[0])} x {len(rows[1])}", "cv2", times, f"{same} of {len(kept)} matches")

    indices = found.indices
    points = features[0].keypoints[indices[:, 0]].astype(float), features[1].keypoints[indices[:, 1]].astype(float)
    camera = {"model": "PINHOLE", "width": width, "height": height,
              "params": [options.focal, options.focal, (width - 1) / 2, (height - 1) / 2]}  # fmt: skip
    ours = mb.Camera(*camera["params"])
    best = mb.estimator("best")
    (pose, (peer, info)), times = race(
        lambda: best.estimate(*points, ours, ours, ambiguity=found.ambiguity),
        lambda: poselib.estimate_relative_pose(*points, camera, camera, {"max_epipolar_error": 1.0}, {}),
        options.repeats,
    )
    apart = rotation_angle(pose.R, np.asarray(peer.R))
    row(f"best, {len(indices)} matches", "poselib", times,
        f"{apart:.3f} degrees apart, {pose.num_inliers} and {info['num_inliers']} inliers")  # fmt: skip


if __name__ == "__main__":
    main()

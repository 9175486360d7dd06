"""Run the paper's protocol with OpenCV on a matchbench dataset.

Writes OUT/<dataset>/<matcher>.txt in the format of the paper's authors, so that
`matchbench eval OUT --datasets DIR` scores OpenCV with the same code as matchbench:

    python opencv_run.py DATASET... --matchers sift,orb --out OUT [--search flann|exact] [--every N] [--threads N]

The protocol: OpenCV's default parameters (ORB with 100,000 features), two nearest neighbours,
ratio 0.8, findEssentialMat (RANSAC, 0.999, 1.0 px), recoverPose over all matches; fewer than 20
matches or fewer than 10 supporting matches is a failure, which is a missing row.
"""

import argparse
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np

from dataset import read_dataset
from judge import MIN_SELECTED, MIN_SUPPORT, ratio_matches
from pixels import GRAY

# id -> (detector, describer or None if one object does both, norm)
MATCHERS = {
    "sift": (cv2.SIFT_create, None, cv2.NORM_L2),
    "orb": (lambda: cv2.ORB_create(100_000), None, cv2.NORM_HAMMING),
    "brisk": (cv2.BRISK_create, None, cv2.NORM_HAMMING),
    "kaze": (cv2.KAZE_create, None, cv2.NORM_L2),
    "akaze": (cv2.AKAZE_create, None, cv2.NORM_HAMMING),
    "freak-sift": (cv2.SIFT_create, cv2.xfeatures2d.FREAK_create, cv2.NORM_HAMMING),
    "latch": (cv2.SIFT_create, cv2.xfeatures2d.LATCH_create, cv2.NORM_HAMMING),
    "daisy": (cv2.SIFT_create, cv2.xfeatures2d.DAISY_create, cv2.NORM_L2),
    # VGG (100: 120 values) and BoostDesc (302: BinBoost, 256 bits) with the settings of the paper's evaluation for keypoints of SIFT.
    "dlco": (
        cv2.SIFT_create,
        lambda: cv2.xfeatures2d.VGG_create(100, 1.4, True, True, 6.75, False),
        cv2.NORM_L2,
    ),
    "binboost": (
        cv2.SIFT_create,
        lambda: cv2.xfeatures2d.BoostDesc_create(302, True, 6.75),
        cv2.NORM_HAMMING,
    ),
}


def extract(matcher, path):
    make_detector, make_describer, _ = MATCHERS[matcher]
    image = cv2.imread(str(path), GRAY)
    if image is None:
        raise SystemExit(f"{path}: cannot be read")
    detector = make_detector()
    if make_describer is None:
        keypoints, descriptors = detector.detectAndCompute(image, None)
    else:
        keypoints, descriptors = make_describer().compute(image, detector.detect(image))
    points = np.array([k.pt for k in keypoints], np.float64).reshape(-1, 2)
    return points, descriptors


def match(matcher, search, a, b):
    """Indices of the matches that pass the ratio test."""
    norm = MATCHERS[matcher][2]
    approximate = norm == cv2.NORM_L2 and search == "flann"
    return ratio_matches(a, b, cv2.FlannBasedMatcher() if approximate else cv2.BFMatcher(norm))


def estimate(points_a, points_b, camera_a, camera_b):
    """R, t and support, or None."""
    if len(points_a) < MIN_SELECTED:
        return None
    if np.array_equal(camera_a, camera_b):
        camera = camera_a
        essential, _ = cv2.findEssentialMat(
            points_a, points_b, camera, method=cv2.RANSAC, prob=0.999, threshold=1.0
        )
    else:
        essential, _ = cv2.findEssentialMat(
            points_a, points_b, camera_a, None, camera_b, None,
            method=cv2.RANSAC, prob=0.999, threshold=1.0,
        )
        points_a = cv2.undistortPoints(points_a.reshape(-1, 1, 2), camera_a, None).reshape(-1, 2)
        points_b = cv2.undistortPoints(points_b.reshape(-1, 1, 2), camera_b, None).reshape(-1, 2)
        camera = np.eye(3)
    if essential is None or essential.shape != (3, 3):
        return None
    support, rotation, translation, _ = cv2.recoverPose(essential, points_a, points_b, camera)
    return (rotation, translation, support) if support >= MIN_SUPPORT else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("datasets", nargs="+", type=Path)
    parser.add_argument("--matchers", required=True)
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--search", choices=["flann", "exact"], default="exact")
    parser.add_argument("--every", type=int, default=1, help="only every Nth pair")
    parser.add_argument("--threads", type=int, default=1, help="threads of OpenCV (its own default: one for each processor)")
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    for folder in arguments.datasets:
        images, cameras, pairs = read_dataset(folder)
        pairs = pairs[:: arguments.every]
        for matcher in arguments.matchers.split(","):
            start = perf_counter()
            used = sorted({index for pair in pairs for index in pair})
            features = {index: extract(matcher, images[index]) for index in used}
            extracted = perf_counter()
            rows = []
            for a, b in pairs:
                matches = match(matcher, arguments.search, features[a][1], features[b][1])
                pose = estimate(
                    features[a][0][matches[:, 0]], features[b][0][matches[:, 1]], cameras[a], cameras[b]
                )
                if pose is not None:
                    rotation, translation, support = pose
                    numbers = np.hstack([rotation, translation]).ravel()
                    rows.append(f"{a} {b} {support} " + " ".join(f"{x:.9g}" for x in numbers))
            target = arguments.out / folder.resolve().name / f"{matcher}.txt"
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text("\n".join(rows) + "\n")
            print(
                f"{target}: {len(rows)} of {len(pairs)} pairs have a pose; "
                f"extraction {extracted - start:.1f} s, pairs {perf_counter() - extracted:.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()

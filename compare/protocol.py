"""Compares SuperGlue's protocol in OpenCV with ours, on any dataset: images of 640x480, SIFT and ORB, ratio test.

    matchbench import superglue PAIRS.txt scannet --image-root IMAGES
    matchbench run scannet --matchers sift,orb --protocol superglue --repeat 10 --out runs/superglue
    python compare/protocol.py scannet --out opencv.csv          # --every N: only every Nth pair, `run --sample` for ours
    matchbench eval runs/superglue --protocol superglue

Here OpenCV does the same as the evaluation of SuperGlue: K divided by the ratio of the sizes, a threshold of
1 pixel over the mean of fx of the first and fy of the second camera, findEssentialMat (RANSAC, 0.99999), recoverPose of
the inliers with depths up to 1e9; errors `max(R, min(t, 180 - t))`; AUC under the recall curve, by trapezoids. OpenCV
resets its random generator at each call, so its runs differ by permutations of the matches. The mean and the standard
deviation over the runs can be compared with those of `matchbench eval`.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from dataset import read_dataset, true_poses
from judge import direction_angle, exact_auc, ratio_matches, rotation_angle
from opencv_run import MATCHERS
from pixels import GRAY

SIZE = (640, 480)


def features(matcher, path):
    """Points in the resized image, descriptors, and the ratios of the sizes."""
    image = cv2.imread(str(path), GRAY)
    ratios = np.array([image.shape[1] / SIZE[0], image.shape[0] / SIZE[1]])
    keypoints, descriptors = MATCHERS[matcher][0]().detectAndCompute(cv2.resize(image, SIZE), None)
    return np.array([k.pt for k in keypoints], np.float64).reshape(-1, 2), descriptors, ratios


def error(points, cameras, truth):
    """The error in degrees; infinite if there is no pose."""
    if len(points[0]) < 5:
        return np.inf
    threshold = 1.0 / np.mean([cameras[0][0, 0], cameras[1][1, 1]])
    a, b = [(p - k[[0, 1], 2]) / k[[0, 1], [0, 1]] for p, k in zip(points, cameras)]
    found, mask = cv2.findEssentialMat(a, b, np.eye(3), method=cv2.RANSAC, prob=0.99999, threshold=threshold)
    if found is None:
        return np.inf
    most, pose = 0, None
    for essential in np.split(found, len(found) // 3):
        count, rotation, translation, _ = cv2.recoverPose(essential, a, b, np.eye(3), 1e9, mask=mask.copy())
        if count > most:
            most, pose = count, (rotation, translation[:, 0])
    if pose is None:
        return np.inf
    rotation, translation = pose
    moved = direction_angle(translation, truth[:, 3])
    return max(rotation_angle(rotation, truth[:, :3]), min(moved, 180 - moved))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--matchers", default="sift,orb")
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    images, cameras, pairs = read_dataset(arguments.dataset)
    pairs, truth = pairs[:: arguments.every], true_poses(arguments.dataset)
    lines = ["matcher,pairs,exact_auc_5,exact_auc_5_deviation,exact_auc_10,exact_auc_10_deviation,"
             "exact_auc_20,exact_auc_20_deviation"]
    for matcher in arguments.matchers.split(","):
        used = {frame: features(matcher, images[frame]) for frame in sorted({f for p in pairs for f in p})}
        scaled = {f: np.diag([1 / r[0], 1 / r[1], 1]) @ cameras[f] for f, (_, _, r) in used.items()}
        finder = cv2.BFMatcher(MATCHERS[matcher][2])
        matches = {(a, b): ratio_matches(used[a][1], used[b][1], finder) for a, b in pairs}
        aucs = []
        for run in range(arguments.runs):
            errors = []
            for a, b in pairs:
                order = np.random.default_rng([run, a, b]).permutation(len(matches[a, b]))
                shuffled = matches[a, b][order]
                points = used[a][0][shuffled[:, 0]], used[b][0][shuffled[:, 1]]
                errors.append(error(points, (scaled[a], scaled[b]), truth[a, b]))
            aucs.append([exact_auc(errors, limit) for limit in (5, 10, 20)])
        mean, deviation = np.mean(aucs, axis=0), np.std(aucs, axis=0, ddof=1)
        columns = [f"{x:.4f}" for pair in zip(mean, deviation) for x in pair]
        lines.append(",".join([matcher, str(len(pairs)), *columns]))
        total = np.mean([len(m) for m in matches.values()])
        print(f"{lines[-1]}  ({total:.1f} matches a pair)", flush=True)
    arguments.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

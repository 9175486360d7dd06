"""Compares the reference estimator with OpenCV's, on the same matches with the same ground truth.

    python compare/pose.py IMAGES DATASET [--seeds 5] [--every 1] [--width 768]

IMAGES is a folder of images in the order of the dataset's frames; DATASET holds `camera.txt` (one camera) and
`pairs.txt` in the authors' format. Matches are OpenCV's SIFT with the ratio test (0.8). OpenCV resets
its random generator at each call, so its "seeds" are permutations of the matches; ours get both the
same permutation and a seed. Needs `cargo build --release -p matchbench-compare`.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

from dataset import images_in, one_camera, true_poses
from judge import MIN_SELECTED, judged, mean_auc, pose_error, ratio_matches
from pixels import GRAY

ROOT = pathlib.Path(__file__).resolve().parent.parent
POSE = ROOT / "target" / "release" / "pose"
CHUNK = 24


def sift_features(images, width):
    sift = cv2.SIFT_create()
    for path in images:
        image = cv2.imread(str(path), GRAY)
        scale = 1.0
        if width and width < image.shape[1]:
            scale = width / image.shape[1]
            size = (width, round(image.shape[0] * scale))
            image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        keypoints, descriptors = sift.detectAndCompute(image, None)
        yield np.array([k.pt for k in keypoints], float).reshape(-1, 2), descriptors, scale


def opencv(points_a, points_b, k):
    """Pose, inliers and seconds."""
    start = time.perf_counter()
    e, mask = cv2.findEssentialMat(points_a, points_b, k, cv2.RANSAC, 0.999, 1.0)
    if e is None or e.shape != (3, 3):
        return None, 0, time.perf_counter() - start
    _, r, t, _ = cv2.recoverPose(e, points_a, points_b, k)
    return (r, t), int(mask.sum()), time.perf_counter() - start


def ours(pairs, k, seed):
    """The same for many (name, points_a, points_b) with our program, and the number of iterations."""
    camera = " ".join(repr(float(x)) for x in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        for name, a, b in pairs:
            file.write(f"pair {name}\n{camera} {camera}\n")
            for row in np.hstack([a, b]).tolist():
                file.write(" ".join(map(repr, row)) + "\n")
        file.flush()
        lines = subprocess.run([POSE, file.name, "1", str(seed)], check=True, capture_output=True, text=True)
    for line in lines.stdout.splitlines():
        words = line.split()
        if words[2] == "none":
            yield words[0], (None, 0, float(words[3]) * 1e-6, 0)
        else:
            inliers, iterations = int(words[2]), int(words[4])
            numbers = np.array(words[6:], float)
            pose = numbers[:9].reshape(3, 3), numbers[9:]
            yield words[0], (pose, inliers, float(words[5]) * 1e-6, iterations)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=pathlib.Path)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--every", type=int, default=1, help="take every n-th pair")
    parser.add_argument("--width", type=int, default=768, help="resize images to this width; 0 to keep them")
    options = parser.parse_args()
    cv2.setNumThreads(1)

    k = one_camera(options.dataset)
    features = list(sift_features(images_in(options.images), options.width))
    scale = features[0][2]
    # Pixel centres are at integers, so the principal point is moved by half a pixel, scaled and moved back.
    k = np.array([[k[0, 0] * scale, 0, (k[0, 2] + 0.5) * scale - 0.5],
                  [0, k[1, 1] * scale, (k[1, 2] + 0.5) * scale - 0.5], [0, 0, 1]])
    truth, matches, finder = {}, [], cv2.BFMatcher(cv2.NORM_L2)
    for (a, b), pose in list(true_poses(options.dataset).items())[:: options.every]:
        truth[f"{a}-{b}"] = pose
        indices = ratio_matches(features[a][1], features[b][1], finder)
        matches.append((f"{a}-{b}", features[a][0][indices[:, 0]], features[b][0][indices[:, 1]]))
    enough = [pair for pair in matches if len(pair[1]) >= MIN_SELECTED]
    print(f"{len(matches)} pairs, {len(enough)} with {MIN_SELECTED} matches or more, "
          f"median {int(np.median([len(m[1]) for m in matches]))} matches, OpenCV {cv2.__version__}")

    results = {"opencv": [], "ours": []}
    times = {"opencv": [], "ours": []}
    hopeless = []
    inliers = []
    for seed in range(options.seeds):
        rng = np.random.default_rng(seed)
        shuffled = [(name, a[order], b[order]) for name, a, b in enough for order in [rng.permutation(len(a))]]
        errors = {who: [180.0] * (len(matches) - len(enough)) for who in results}
        for first in range(0, len(shuffled), CHUNK):
            chunk = shuffled[first:first + CHUNK]
            found = dict(ours(chunk, k, seed))
            for name, a, b in chunk:
                mine, theirs = found[name], opencv(a, b, k)
                hopeless.append(mine[3] == 1000)
                inliers.append((theirs[1], mine[1]))
                for who, (pose, _, seconds) in (("opencv", theirs), ("ours", mine[:3])):
                    pose = judged(pose, np.hstack([a, b]), k)
                    errors[who].append(180.0 if pose is None else pose_error(pose, truth[name]))
                    times[who].append(seconds)
        for who in results:
            results[who].append(mean_auc(errors[who]))
        print(f"seed {seed}: AUC opencv {results['opencv'][-1]:.4f}, ours {results['ours'][-1]:.4f}")
        sys.stdout.flush()

    for who, scores in results.items():
        t = 1e3 * np.array(times[who])
        print(f"{who:7} AUC {np.mean(scores):.4f} +- {np.std(scores, ddof=min(1, len(scores) - 1)):.4f} | ms: mean "
              f"{t.mean():.2f} median {np.median(t):.2f} p90 {np.percentile(t, 90):.2f} | "
              f"pairs with 1000 iterations: {np.median(t[hopeless]):.2f}")
    theirs, mine = np.array(times["opencv"]), np.array(times["ours"])
    counts = np.array(inliers)
    print(f"opencv / ours: total time {theirs.sum() / mine.sum():.1f}, median pair {np.median(theirs / mine):.1f}, "
          f"pairs with 1000 iterations {np.median(theirs[hopeless] / mine[hopeless]):.1f}; "
          f"mean inliers {counts[:, 0].mean():.1f} and {counts[:, 1].mean():.1f}")


if __name__ == "__main__":
    main()

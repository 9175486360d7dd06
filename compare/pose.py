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

from dataset import images_in, one_camera
from pixels import GRAY

ROOT = pathlib.Path(__file__).resolve().parent.parent
POSE = ROOT / "target" / "release" / "pose"
MIN_SELECTED, MIN_SUPPORT = 20, 10
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
        yield np.array([k.pt for k in keypoints]), descriptors, scale


def ratio_matches(a, b, ratio=0.8):
    two = cv2.BFMatcher(cv2.NORM_L2).knnMatch(a[1], b[1], k=2)
    kept = [m for m, second in two if m.distance < ratio * second.distance]
    rows_a = [m.queryIdx for m in kept]
    rows_b = [m.trainIdx for m in kept]
    return a[0][rows_a].reshape(-1, 2), b[0][rows_b].reshape(-1, 2)


def pose_error(r, t, r_true, t_true):
    """The larger of the two angles in degrees; the sign of the translation counts."""
    rotation = np.arccos(np.clip((np.trace(r.T @ r_true) - 1) / 2, -1, 1))
    cosine = t.ravel() @ t_true / np.linalg.norm(t) / np.linalg.norm(t_true)
    return np.degrees(max(rotation, np.arccos(np.clip(cosine, -1, 1))))


def opencv(points_a, points_b, k):
    """Pose, inliers, support and seconds."""
    start = time.perf_counter()
    e, mask = cv2.findEssentialMat(points_a, points_b, k, cv2.RANSAC, 0.999, 1.0)
    if e is None or e.shape != (3, 3):
        return None, 0, 0, time.perf_counter() - start
    support, r, t, _ = cv2.recoverPose(e, points_a, points_b, k)
    return (r, t), int(mask.sum()), support, time.perf_counter() - start


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
            yield words[0], (None, 0, 0, float(words[3]) * 1e-6, 0)
        else:
            inliers, support, iterations = map(int, words[2:5])
            numbers = np.array(words[6:], float)
            pose = numbers[:9].reshape(3, 3), numbers[9:]
            yield words[0], (pose, inliers, support, float(words[5]) * 1e-6, iterations)


def auc(errors):
    errors = np.array(errors)
    return np.mean([np.mean(errors < k) for k in range(1, 16)])


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
    rows = np.loadtxt(options.dataset / "pairs.txt")[:: options.every]
    features = list(sift_features(images_in(options.images), options.width))
    scale = features[0][2]
    # Pixel centres are at integers, so the principal point is moved by half a pixel, scaled and moved back.
    k = np.array([[k[0, 0] * scale, 0, (k[0, 2] + 0.5) * scale - 0.5],
                  [0, k[1, 1] * scale, (k[1, 2] + 0.5) * scale - 0.5], [0, 0, 1]])
    truth, matches = {}, []
    for row in rows:
        a, b = int(row[0]), int(row[1])
        pose = row[2:14].reshape(3, 4)
        truth[f"{a}-{b}"] = pose[:, :3], pose[:, 3]
        matches.append((f"{a}-{b}", *ratio_matches(features[a], features[b])))
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
                hopeless.append(mine[4] == 1000)
                inliers.append((theirs[1], mine[1]))
                for who, (pose, _, support, seconds) in (("opencv", theirs), ("ours", mine[:4])):
                    good = pose is not None and support >= MIN_SUPPORT
                    errors[who].append(pose_error(*pose, *truth[name]) if good else 180.0)
                    times[who].append(seconds)
        for who in results:
            results[who].append(auc(errors[who]))
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

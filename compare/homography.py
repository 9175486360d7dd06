"""Compares our estimators of homographies with those of OpenCV and PoseLib, on matches that a run has stored.

    python compare/homography.py RUN DATASET_FOLDER [--matchers sift orb] [--seeds 5] [--program PATH]

RUN is the folder of a `matchbench run` with all matches kept. DATASET_FOLDER is the imported dataset with its
`homographies.txt`; its images are where `dataset.toml` says, or in `Images`. For each pair and seed all estimators run one
after the other, so that changes in the speed of the machine affect all of them, each with one thread. OpenCV resets its
random generator at each call, so its "seeds" are permutations of the matches, which the others get too. The error of a
homography is the mean distance of the corners of image a; the AUC is the exact one (as SuperGlue's). Needs `cargo build --release -p
matchbench-compare`, and poselib from PyPI (`requirements.txt`).
"""

import argparse
import pathlib
import subprocess
import tempfile
import time

import cv2
import numpy as np
import poselib

from dataset import images_of, true_homographies
from judge import exact_auc
from pixels import GRAY
from stored import stored

ROOT = pathlib.Path(__file__).resolve().parent.parent
LIMITS = (1, 3, 5, 10)
OURS = ("best-h", "ransac-h")


def opencv(method):
    def estimate(matches, _seed):
        found, _ = cv2.findHomography(matches[:, :2], matches[:, 2:4], method, 3.0)
        return found

    return estimate


def peer_poselib(matches, seed):
    options = {"max_reproj_error": 3.0, "seed": seed}
    found, info = poselib.estimate_homography(matches[:, :2], matches[:, 2:4], options, {})
    return found if info["num_inliers"] >= 4 else None


PEERS = {
    "OpenCV RANSAC": opencv(cv2.RANSAC),
    "OpenCV USAC_MAGSAC": opencv(cv2.USAC_MAGSAC),
    "PoseLib": peer_poselib,
}


def ours(program, name, matches, seed):
    with tempfile.NamedTemporaryFile("w", suffix=".matches") as file:
        file.write("pair x\n")
        file.writelines(" ".join(map(repr, map(float, m[:5]))) + "\n" for m in matches)
        file.flush()
        command = [program, file.name, name, "1", str(seed)]
        words = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    if words[2] == "none":
        return None, float(words[3]) / 1e6
    return np.array(words[5:], float).reshape(3, 3), float(words[4]) / 1e6


def peer(estimate, matches, seed):
    start = time.perf_counter()
    found = estimate(np.ascontiguousarray(matches), seed) if len(matches) >= 4 else None
    seconds = time.perf_counter() - start
    return (None if found is None or found.shape != (3, 3) else found), seconds


def corner_error(estimate, truth, size):
    if estimate is None:
        return np.inf
    right, bottom = size[0] - 1, size[1] - 1
    corners = np.array([[0, 0, 1], [right, 0, 1], [0, bottom, 1], [right, bottom, 1]], float)
    seen = [corners @ h.T for h in (estimate, truth)]
    with np.errstate(all="ignore"):
        a, b = (s[:, :2] / s[:, 2:] for s in seen)
        error = np.linalg.norm(a - b, axis=1).mean()
    return error if np.isfinite(error) else np.inf


def dataset(folder):
    """The true homographies, and the size of each first image."""
    truth = true_homographies(folder)
    images = images_of(folder)
    return truth, {a: cv2.imread(str(images[a]), GRAY).shape[::-1] for a, _ in truth}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--matchers", nargs="+", default=["sift"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--program", default=ROOT / "target" / "release" / "homography")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    truth, sizes = dataset(args.dataset)
    results = {}
    for matcher in args.matchers:
        for key, matches in stored(args.run / "matches" / args.dataset.name / f"{matcher}.bin"):
            for seed in range(args.seeds):
                given = matches[np.random.default_rng(seed).permutation(len(matches))]
                for name in (*OURS, *PEERS):
                    if name in PEERS:
                        found, seconds = peer(PEERS[name], given, seed)
                    else:
                        found, seconds = ours(args.program, name, given, seed)
                    error = corner_error(found, truth[key], sizes[key[0]])
                    results.setdefault((matcher, name), []).append((error, seconds))
    print(f"{'matcher':<10}{'estimator':<22}" + "".join(f"AUC@{k:<6}" for k in LIMITS) + "median ms   mean ms")
    for (matcher, name), rows in results.items():
        errors, seconds = np.array(rows).T
        scores = "".join(f"{exact_auc(errors, k):<10.3f}" for k in LIMITS)
        print(f"{matcher:<10}{name:<22}{scores}{1e3 * np.median(seconds):9.2f}{1e3 * seconds.mean():10.2f}")


if __name__ == "__main__":
    main()

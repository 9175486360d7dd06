"""Compares our estimators with those of PoseLib, COLMAP, OpenCV and SupeRANSAC, on matches that a run has stored.

    python compare/estimators.py RUN DATASET MATCHER --truth DATASET_FOLDER [--every 3] [--seeds 5] [--only "best;COLMAP"]

RUN is the folder of a `matchbench run`; DATASET_FOLDER holds `camera.txt` (one camera, no distortion) and `pairs.txt`.
Pairs are divided into chunks. Within a chunk all estimators run one after the other, so that changes in the speed of the
machine affect all of them. AUC is the mean over seeds, with its standard deviation. OpenCV has one seed, so its matches are
given in another order each time. A pose of any of them counts if at least 10 of at least 20 matches lie in front of both
cameras, as in matchbench (`judge.py`). Needs `cargo build --release -p matchbench-compare`, and poselib and pycolmap from
PyPI (`requirements.txt`). pysuperansac is on PyPI only for Python 3.11 on Linux; if it is not installed, it is left out
with a message.
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
import poselib
import pycolmap

import superansac
from dataset import one_camera, true_poses
from judge import judged, mean_auc, pose_error
from pose import POSE
from stored import stored


def preset(name, iterations=20000):
    """The settings of `best` or `adaptive`, with at most so many iterations."""
    return f"preset={name} min={min(1000, iterations)} iterations={iterations}"


OURS = {
    "ransac-e": "",
    "best": preset("best"),
    "best, 1000 iterations": preset("best", 1000),
    "adaptive": preset("adaptive"),
}
POSELIB = {"PoseLib": {}, "PoseLib, 1000 iterations": {"max_iterations": 1000}}
COLMAP = {"COLMAP": {}, "COLMAP, 1 px": {"max_error": 1.0}}
SUPERANSAC = {"SupeRANSAC": {}, "SupeRANSAC, 1000 iterations": {"max_iterations": 1000}}
OPENCV = {
    "OpenCV RANSAC": cv2.RANSAC,
    "OpenCV USAC_DEFAULT": cv2.USAC_DEFAULT,
    "OpenCV USAC_MAGSAC": cv2.USAC_MAGSAC,
}
CHUNK = 8


def ours(chunk, k, settings, seed):
    camera = " ".join(repr(float(x)) for x in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))
    with tempfile.NamedTemporaryFile("w", suffix=".matches") as file:
        for (a, b), matches in chunk:
            file.write(f"pair {a}-{b}\n{camera} {camera}\n")
            file.writelines(" ".join(map(repr, map(float, m))) + "\n" for m in matches)
        file.flush()
        command = [POSE, file.name, "1", str(seed), *settings.split()]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    for line in lines:
        words = line.split()
        if words[2] == "none":
            yield None, float(words[3]) / 1e6
        else:
            numbers = np.array(words[6:], float)
            yield (numbers[:9].reshape(3, 3), numbers[9:]), float(words[5]) / 1e6


def peer_poselib(matches, k, options, seed):
    camera = {"model": "PINHOLE", "width": 1, "height": 1, "params": [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]}
    options = {"max_epipolar_error": 1.0, "seed": seed, **options}
    start = time.perf_counter()
    if len(matches) < 5:
        return None, time.perf_counter() - start
    pose, info = poselib.estimate_relative_pose(matches[:, :2], matches[:, 2:4], camera, camera, options, {})
    seconds = time.perf_counter() - start
    # Where it finds none, it returns a pose that no match agrees with.
    return ((pose.R, pose.t) if info["num_inliers"] else None), seconds


def peer_colmap(matches, k, options, seed):
    params = [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]
    camera = pycolmap.Camera(model="PINHOLE", width=1, height=1, params=params)
    options = pycolmap.RANSACOptions({"random_seed": seed, **options})
    start = time.perf_counter()
    if len(matches) < 5:
        return None, time.perf_counter() - start
    found = pycolmap.estimate_essential_matrix(matches[:, :2], matches[:, 2:4], camera, camera, options)
    seconds = time.perf_counter() - start
    if found is None:
        return None, seconds
    pose = found["cam2_from_cam1"].matrix()
    return (pose[:, :3], pose[:, 3]), seconds


def peer_opencv(matches, k, method, samples=1000, threshold=1.0):
    start = time.perf_counter()
    if len(matches) < 5:
        return None, time.perf_counter() - start
    a, b = np.ascontiguousarray(matches[:, :2]), np.ascontiguousarray(matches[:, 2:4])
    e, _ = cv2.findEssentialMat(a, b, k, method, 0.999, threshold, samples)
    if e is None or e.shape != (3, 3):
        return None, time.perf_counter() - start
    _, r, t, _ = cv2.recoverPose(e, a, b, k)
    return (r, t.ravel()), time.perf_counter() - start


def shuffled(key, matches, seed):
    """The matches of a pair in an order that depends on the seed, for estimators that take none."""
    return matches[np.random.default_rng([seed, *key]).permutation(len(matches))]


def check_names(names, only):
    """Ends the program if `--only` lists an unknown name."""
    unknown = set(only.split(";") if only else []) - set(names)
    if unknown:
        sys.exit(f"--only: no {', '.join(sorted(unknown))}; there are {'; '.join(names)}")


def chosen_names(names, only):
    """The names that `--only` lists, or all. SupeRANSAC is left out with a message if it is not installed."""
    chosen = [name for name in names if not only or name in only.split(";")]
    if superansac.INSTALLED or not any(name.startswith("SupeRANSAC") for name in chosen):
        return chosen
    print("SupeRANSAC is left out: pysuperansac is not installed", file=sys.stderr)
    return [name for name in chosen if not name.startswith("SupeRANSAC")]


def versions():
    """The versions of the other libraries, as text."""
    found = [f"OpenCV {cv2.__version__}", f"PoseLib {poselib.__version__}", f"COLMAP {pycolmap.__version__}"]
    return ", ".join(found + ([superansac.version()] if superansac.INSTALLED else []))


def arguments(about, seeds):
    """The arguments of programs that estimate poses from the matches of a run."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("dataset")
    parser.add_argument("matcher")
    parser.add_argument("--truth", type=pathlib.Path, required=True)
    parser.add_argument("--every", type=int, default=1, help="take every n-th pair")
    parser.add_argument("--seeds", type=int, default=seeds)
    parser.add_argument("--only", help="names as printed, separated by semicolons; all of them otherwise")
    return parser


def read(args):
    """The camera matrix, the stored matches of the chosen pairs, and a function that gives the error of a pose."""
    k = one_camera(args.truth)
    truth = true_poses(args.truth)
    pairs = sorted(stored(args.run / "matches" / args.dataset / f"{args.matcher}.bin"), key=lambda p: p[0])
    pairs = pairs[:: args.every]
    matches = dict(pairs)

    def error(key, pose):
        pose = judged(pose, matches[key], k)
        return 180.0 if pose is None else pose_error(pose, truth[key])

    return k, pairs, error


def main():
    args = arguments(__doc__, seeds=5).parse_args()
    groups = (OURS, POSELIB, COLMAP, OPENCV, SUPERANSAC)
    check_names([name for group in groups for name in group], args.only)
    chosen = [{name: group[name] for name in chosen_names(group, args.only)} for group in groups]
    cv2.setNumThreads(1)
    k, pairs, error = read(args)
    results = {}

    for seed in range(args.seeds):

        def note(name, key, outcome):
            pose, seconds = outcome
            results.setdefault(name, [[] for _ in range(args.seeds)])[seed].append((error(key, pose), seconds))

        for start in range(0, len(pairs), CHUNK):
            chunk = pairs[start : start + CHUNK]
            for name, settings in chosen[0].items():
                for (key, _), outcome in zip(chunk, ours(chunk, k, settings, seed)):
                    note(name, key, outcome)
            for key, matches in chunk:
                for name, options in chosen[1].items():
                    note(name, key, peer_poselib(matches, k, options, seed))
                for name, options in chosen[2].items():
                    note(name, key, peer_colmap(matches, k, options, seed))
                for name, method in chosen[3].items():
                    note(name, key, peer_opencv(shuffled(key, matches, seed), k, method))
                for name, options in chosen[4].items():
                    note(name, key, superansac.peer(superansac.clearest_first(matches), k, options))
    print(f"{args.dataset}, {args.matcher}: {len(pairs)} pairs, {args.seeds} seeds, {versions()}")
    print(f"{'':28} {'AUC':>6} {'+-':>6} {'median ms':>10} {'90 % ms':>10}")
    for name, by_seed in results.items():
        aucs = [mean_auc([error for error, _ in rows]) for rows in by_seed]
        deviation = statistics.stdev(aucs) if len(aucs) > 1 else 0.0
        low, high = np.percentile([seconds * 1e3 for rows in by_seed for _, seconds in rows], [50, 90])
        print(f"{name:28} {statistics.mean(aucs):6.3f} {deviation:6.3f} {low:10.2f} {high:10.2f}")


if __name__ == "__main__":
    main()

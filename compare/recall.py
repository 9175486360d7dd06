"""Which stage of a matcher loses the true matches.

    python compare/recall.py DATASET NAME=RUN/MATCHER[+ESTIMATOR] ... [--pixels 3] [--step 30]

Each NAME is a stage, in the order of the pipeline. It is given by the folder of a run and the matcher in it whose selected
matches are counted. The numbers of later stages are shares of the first. A run keeps only selected matches, so an early
stage is a run of a matcher that rejects less: `asift` with `--set asift.ratio=1` is the input of `code` and `repmatch`,
`sift` that of `kvld`, `orb` that of `gms`. With `+ESTIMATOR`, only matches within PIXELS of the epipolar lines of the
estimated pose are counted. DATASET is the folder with `camera.txt` (one camera, no distortion) and `pairs.txt`.

A match is true if both its points lie within PIXELS of the true epipolar lines. About a share of PIXELS * 2 / height of the
wrong matches does so too. The column `chance` says how many that would be if all matches were wrong. With --step there is a row for each STEP degrees of the angle between the two views.
"""

import argparse
import collections
import json
import pathlib

import numpy as np

from dataset import one_camera, true_poses
from stored import stored


def selected(run, dataset, matcher):
    """The matches (x, y in a; x, y in b; ambiguity) of each pair, in its first repetition."""
    for pair, matches in stored(run / "matches" / dataset / f"{matcher}.bin"):
        yield pair, matches[:, :5]


def estimated(run, dataset, matcher, estimator):
    """The estimated pose [R t] of each pair, in its first repetition."""
    poses = {}
    path = run / "records" / dataset / f"{matcher}+{estimator}.jsonl"
    for line in path.read_text().splitlines():
        record = json.loads(line)
        task, outcome = record["task"], record["outcome"]
        if task["repetition"] == 0 and outcome["kind"] == "pose":
            rotation = np.reshape(outcome["rotation"], (3, 3))
            poses[task["a"], task["b"]] = np.c_[rotation, outcome["translation"]]
    return poses


def near(matches, pose, inverse_k, pixels):
    """Which matches lie within so many pixels of their epipolar lines in both images."""
    x, y, z = pose[:, 3]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    fundamental = inverse_k.T @ cross @ pose[:, :3] @ inverse_k
    a = np.c_[matches[:, :2], np.ones(len(matches))]
    b = np.c_[matches[:, 2:4], np.ones(len(matches))]
    in_b, in_a = a @ fundamental.T, b @ fundamental
    residual = np.abs((b * in_b).sum(1))
    return residual < pixels * np.minimum(
        np.hypot(in_a[:, 0], in_a[:, 1]), np.hypot(in_b[:, 0], in_b[:, 1])
    )


def view_angle(pose):
    return np.degrees(np.arccos(np.clip(pose[2, 2], -1, 1)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("stages", nargs="+", metavar="NAME=RUN/MATCHER[+ESTIMATOR]")
    parser.add_argument("--pixels", type=float, default=3.0)
    parser.add_argument("--step", type=float)
    arguments = parser.parse_args()
    dataset, pixels = arguments.dataset.resolve(), arguments.pixels
    camera = one_camera(dataset)
    inverse_k, height = np.linalg.inv(camera), 2 * camera[1, 2]
    truth = true_poses(dataset)

    first = {}
    for stage in arguments.stages:
        name, where = stage.split("=", 1)
        run, matcher = pathlib.Path(where).parent, pathlib.Path(where).name
        matcher, _, estimator = matcher.partition("+")
        poses = estimated(run, dataset.name, matcher, estimator) if estimator else None
        counts = collections.defaultdict(list)
        for pair, matches in selected(run, dataset.name, matcher):
            if pair not in truth:
                continue
            if poses is not None:
                found = poses.get(pair)
                kept = near(matches, found, inverse_k, pixels) if found is not None else []
                matches = matches[kept] if found is not None else matches[:0]
            true = near(matches, truth[pair], inverse_k, pixels).sum()
            counts["all"].append((len(matches), true))
            if arguments.step:
                angle = view_angle(truth[pair]) // arguments.step * arguments.step
                counts[angle].append((len(matches), true))
        for group in ["all"] + sorted(key for key in counts if key != "all"):
            number, true = np.mean(counts[group], axis=0)
            of_first = true / max(first.setdefault(group, true), 1e-9)
            enough = np.mean([true >= 20 for _, true in counts[group]])
            label = "all" if group == "all" else f"from {group:.0f} deg"
            print(
                f"{name:12} {label:12} {len(counts[group]):4} pairs  "
                f"matches {number:8.0f}  true {true:7.0f} ({true / max(number, 1e-9):5.1%}, "
                f"chance {2 * pixels / height * number:5.0f})  of the first {of_first:6.1%}  "
                f"20 or more true {enough:5.1%}"
            )


if __name__ == "__main__":
    main()

"""AUC over time of our estimators and those of PoseLib, OpenCV, COLMAP and SupeRANSAC, each with several limits of samples.

    python compare/over_time.py RUN DATASET MATCHER --truth DATASET_FOLDER --out FOLDER [--every 6] [--seeds 5]
        [--threshold 1.0]

Arguments, matches, estimators and the order of their runs are those of `estimators.py`. Each estimator gives a curve, and
each budget (limit of samples) a point of it: the mean AUC over seeds with its deviation, and the median time of an
estimation on one thread. `adaptive` draws 100 samples more than its budget, to estimate the noise. OpenCV has one seed, so
its matches are given in another order each time. If the order has a meaning (PROSAC of PoseLib, OpenCV and SupeRANSAC), the
clearest match comes first, and only the seed changes. So OpenCV's USAC_PROSAC, which has one order and one seed, gives one
result, however many seeds are asked for. SupeRANSAC takes no seed: version 1.0 draws other samples at every call, and later
sources the same ones, which is one result too. One result has no deviation. `superansac.py` says how SupeRANSAC is called.
If it is not installed, it is left out.
`--threshold` is that of PoseLib, OpenCV and COLMAP in pixels: 1, as in the published curves, or another, to see whether it
serves them better.
`FOLDER` gets `DATASET-MATCHER.csv` and a plot of it, and a `table.md` of all these files in it.
"""

import csv
import pathlib
import statistics

import cv2
import matplotlib
import numpy as np

import estimators
import superansac
from judge import mean_auc
from machine import processor

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402

plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "matchbench"})

CURVES = {
    "best": [100, 200, 500, 1000, 2000, 5000, 20000],
    "adaptive": [100, 200, 500, 1000, 2000, 5000, 20000],
    "adaptive, one hypothesis": [100, 200, 500, 1000, 2000, 5000, 20000],
    "best, turns": [100, 200, 500, 1000, 2000, 5000, 20000],
    "adaptive, points alone": [100, 200, 500, 1000, 2000, 5000, 20000],
    "LO-RANSAC": [200, 1000, 5000, 20000],
    "PoseLib": [100, 200, 1000, 5000, 20000],
    "PoseLib, PROSAC": [100, 200, 1000, 5000, 20000],
    "OpenCV USAC_MAGSAC": [200, 1000, 5000],
    "OpenCV USAC_PROSAC": [200, 1000, 5000],
    "COLMAP": [1000, 5000],
    "SupeRANSAC": [200, 1000, 5000, 20000],
}

# Colours and lines: one colour for each program, and for `best` and `adaptive`, which are dashed if they see points alone;
# dotted with one hypothesis.
STYLES = {
    "best": ("C0", "--"),
    "best, turns": ("C0", "-"),
    "adaptive": ("C1", "-"),
    "adaptive, one hypothesis": ("C1", ":"),
    "adaptive, points alone": ("C1", "--"),
    "LO-RANSAC": ("C7", "-"),
    "PoseLib": ("C3", "--"),
    "PoseLib, PROSAC": ("C3", "-"),
    "OpenCV USAC_MAGSAC": ("C2", "--"),
    "OpenCV USAC_PROSAC": ("C2", "-"),
    "COLMAP": ("C4", "-"),
    "SupeRANSAC": ("C5", "-"),
}

# The settings of our estimators. `LO-RANSAC` is what `SampleConsensus` of the library does by default: MSAC at 1 px with local
# optimisation. `turns` says whether the rotation of keypoints is used, and with several hypotheses, as `adaptive` has them,
# their growth is too; the other libraries cannot use them.
OURS = {
    "best": lambda budget: estimators.preset("best", budget),
    "best, turns": lambda budget: estimators.preset("best", budget) + " turns=true",
    "adaptive": lambda budget: estimators.preset("adaptive", budget),
    "adaptive, one hypothesis": lambda budget: estimators.preset("adaptive", budget) + " hypotheses=1",
    "adaptive, points alone": lambda budget: estimators.preset("adaptive", budget) + " turns=false",
    "LO-RANSAC": lambda budget: f"iterations={budget}",
}


def estimate(curve, budget, chunk, k, seed, threshold):
    """A pose and its seconds for each pair of the chunk."""
    if curve in OURS:
        yield from estimators.ours(chunk, k, OURS[curve](budget), seed)
        return
    # The default of PoseLib, COLMAP and `best`.
    least = min(1000, budget)
    for key, matches in chunk:
        clearest = superansac.clearest_first(matches)
        shuffled = estimators.shuffled(key, matches, seed)
        if curve == "PoseLib":
            options = {"max_iterations": budget, "min_iterations": least, "max_epipolar_error": threshold}
            yield estimators.peer_poselib(shuffled, k, options, seed)
        elif curve == "PoseLib, PROSAC":
            options = {"max_iterations": budget, "min_iterations": least, "max_epipolar_error": threshold}
            yield estimators.peer_poselib(clearest, k, {**options, "progressive_sampling": True}, seed)
        elif curve == "OpenCV USAC_MAGSAC":
            yield estimators.peer_opencv(shuffled, k, cv2.USAC_MAGSAC, budget, threshold)
        elif curve == "OpenCV USAC_PROSAC":
            yield estimators.peer_opencv(clearest, k, cv2.USAC_PROSAC, budget, threshold)
        elif curve == "SupeRANSAC":
            options = {"max_iterations": budget, "min_iterations": least}
            yield superansac.peer(clearest, k, options)
        else:
            options = {"max_num_trials": budget, "min_num_trials": least, "max_error": threshold}
            yield estimators.peer_colmap(shuffled, k, options, seed)


def measure(pairs, error, k, seeds, curves, threshold):
    """Errors and seconds by (curve, budget) and seed."""
    errors, seconds = {}, {}
    for seed in range(seeds):
        for start in range(0, len(pairs), estimators.CHUNK):
            chunk = pairs[start : start + estimators.CHUNK]
            for curve in curves:
                for budget in CURVES[curve]:
                    found = estimate(curve, budget, chunk, k, seed, threshold)
                    for ((key, _), (pose, time)) in zip(chunk, found):
                        found_errors = errors.setdefault((curve, budget), [[] for _ in range(seeds)])
                        found_errors[seed].append(error(key, pose))
                        seconds.setdefault((curve, budget), []).append(time)
    return errors, seconds


def spread(row):
    """` ± DEVIATION` of a row, or nothing if all its seeds gave one result."""
    deviation = float(row["deviation"])
    return f" ± {deviation:.3f}" if deviation else ""


def draw(rows, title, path):
    figure, axes = plt.subplots(figsize=(9, 4.5))
    for curve in dict.fromkeys(row["estimator"] for row in rows):
        points = [row for row in rows if row["estimator"] == curve]
        colour, line = STYLES[curve]
        axes.errorbar(
            [row["median_ms"] for row in points],
            [row["auc"] for row in points],
            yerr=[row["deviation"] for row in points],
            color=colour,
            linestyle=line,
            marker="o",
            markersize=4,
            linewidth=2.2 if curve.startswith(("best", "adaptive")) else 1.2,
            label=curve,
        )
    axes.set(xscale="log", xlabel="median time of an estimation, ms, one thread", ylabel="AUC", title=title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def tabulate(folder):
    """One table for each file of results in the folder."""
    with open(folder / "table.md", "w") as table:
        for path in sorted(folder.glob("*.csv")):
            about, *lines = path.read_text().splitlines()
            table.write(f"## {path.stem}\n\n{about.removeprefix('# ')}\n\n")
            table.write("| estimator | samples | AUC | median ms | ms of 90 % |\n| --- | ---: | ---: | ---: | ---: |\n")
            for row in csv.DictReader(lines):
                score = f"{float(row['auc']):.3f}{spread(row)}"
                times = f"{float(row['median_ms']):.2f} | {float(row['ms_of_90_percent']):.2f}"
                table.write(f"| {row['estimator']} | {row['samples']} | {score} | {times} |\n")
            table.write("\n")


def main():
    parser = estimators.arguments(__doc__, seeds=5)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--threshold", type=float, default=1.0, help="pixels, of PoseLib, OpenCV and COLMAP")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    k, pairs, error = estimators.read(args)
    estimators.check_names(CURVES, args.only)
    curves = estimators.chosen_names(CURVES, args.only)
    errors, seconds = measure(pairs, error, k, args.seeds, curves, args.threshold)
    rows = []
    for (curve, budget), by_seed in errors.items():
        scores = [mean_auc(list(found)) for found in by_seed]
        low, high = np.percentile(np.array(seconds[curve, budget]) * 1e3, [50, 90])
        row = {
            "estimator": curve,
            "samples": budget,
            "auc": round(statistics.fmean(scores), 4),
            "deviation": round(statistics.stdev(scores), 4) if len(scores) > 1 else 0.0,
            "median_ms": round(float(low), 3),
            "ms_of_90_percent": round(float(high), 3),
        }
        rows.append(row)
        print(f"{curve:20} {budget:6} {row['auc']:.3f}{spread(row):8} {low:9.2f} ms {high:9.2f} ms")
    args.out.mkdir(parents=True, exist_ok=True)
    name = f"{args.dataset}-{args.matcher}"
    with open(args.out / f"{name}.csv", "w", newline="") as file:
        others = "" if args.threshold == 1.0 else f", threshold {args.threshold} px"
        file.write(f"# {processor()}; {len(pairs)} pairs, {args.seeds} seeds; {estimators.versions()}{others}\n")
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    tabulate(args.out)
    draw(rows, f"{args.dataset}, {args.matcher}, {len(pairs)} pairs, {args.seeds} seeds", args.out / f"{name}.svg")


if __name__ == "__main__":
    main()

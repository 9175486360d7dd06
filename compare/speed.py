"""Compares all speeds with OpenCV's, in one table with the name of the processor.

    cargo build --release --workspace
    python compare/speed.py SMALL_A SMALL_B LARGE_A LARGE_B --dataset FOLDER [--out FOLDER] [--repeats 5]

SMALL and LARGE are two images each of one scene, for example 640 x 480 and 3072 x 2048. The dataset is one that `matchbench
import` made. Three parts are run: the features (`features.py`), the exact searches (`search.py`), and the whole protocol
with SIFT from files to scores, ours and that of `opencv_run.py` with FLANN, on one thread each and on as many as there are
processors. The first two run both sides in turn. The rows of the protocol are measured once each, one after the other.
Each part checks the results in the same run, and stops with an error if they differ by more than is known: the features by
the shares of keypoints with a twin and by the descriptors of twins, the searches by every distance, and the protocol by its
AUC. OpenCV is measured twice: as it comes, and in a process that keeps all freed memory (by variables of the C library of
GNU), since matchbench keeps some too. OUT gets table.md, machine.txt and the output of the parts.
No other program should run at the same time; the load at the beginning is written to machine.txt. With
MATCHBENCH_SIMD=avx2 OPENCV_CPU_DISABLE=AVX512-SKX in the environment, neither side uses AVX-512.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from machine import processor

HERE = Path(__file__).resolve().parent
PROGRAMS = HERE.parent / "target/release"
FEATURES = ["sift", "orb", "brisk", "akaze", "kaze", "latch", "daisy", "freak-sift"]
# The least share, in percent, of keypoints of either side that must have a twin on the other.
MIN_TWINS = 97.0
# The largest allowed distances of the descriptors of twins, relative to their norm, or as a share of bits. The median is at most
# 5e-6 in `docs/results/speed-*`.
MOST_MEDIAN = 1e-4
# About one and a half times the largest distances there (but not below 0.02). A few of KAZE are up to 1.35, so that its median alone
# is limited.
MOST = {"sift": 0.25, "orb": 0.02, "brisk": 0.11, "akaze": 0.02, "latch": 0.11, "daisy": 0.03, "freak-sift": 0.13}
# The least share, in percent, of twins with the same bits. It is 93.77 and more there.
LEAST_EQUAL = {"orb": 99.0, "brisk": 99.0, "akaze": 99.0, "latch": 90.0, "freak-sift": 90.0}
# The largest allowed difference of the AUC of the two implementations.
AUC_TOLERANCE = 0.03
# Variables that limit the instruction sets of the two sides; they are written to machine.txt.
LIMITS = ["MATCHBENCH_SIMD", "OPENCV_CPU_DISABLE"]
# A process with these variables returns no freed memory to the system, and so has few page faults. Our programs have
# bounds of their own, which they set themselves.
KEPT = {"MALLOC_MMAP_THRESHOLD_": str(1 << 30), "MALLOC_TRIM_THRESHOLD_": str(1 << 34)}


def printed(command, out, **options):
    """The output of a part, which is also written to a file; its messages are shown as they come."""
    run = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True, **options)
    out.write_text(run.stdout)
    if run.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit status {run.returncode}, see {out}")
    return run.stdout


def measured_features(name, images, repeats, out, environment):
    """The rows that `features.py` prints, as dictionaries; every row has enough twins, and their descriptors are alike."""
    script = [sys.executable, HERE / "features.py", name, *images, "--repeats", repeats]
    text = printed(script, out, env={**os.environ, **environment})
    heads, *lines = [line.split(" | ") for line in text.splitlines() if " | " in line]
    rows = [dict(zip(heads, line)) for line in lines]
    for row in rows:
        # For a descriptor alone, these are twins of SIFT's keypoints.
        row["twins"] = min(float(row["theirs>ours %"]), float(row["ours>theirs %"]))
        if row["twins"] < MIN_TWINS:
            sys.exit(f"{name} on {row['image']}: {row['twins']:.1f} % of the keypoints have a twin")
        median, most, equal = (float(row[head]) for head in ("desc med", "desc max", "desc equal %"))
        if not (median <= MOST_MEDIAN and most <= MOST.get(name, np.inf) and equal >= LEAST_EQUAL.get(name, 0)):
            sys.exit(f"{name} on {row['image']}: descriptors of twins are {median} apart in the median and {most} at most, {equal} % are equal")
    return rows


def features(images, repeats, out):
    """Rows of the table: each feature on each image."""
    rows = []
    for name in FEATURES:
        plain = measured_features(name, images, repeats, out / f"features-{name}.txt", {})
        kept = measured_features(name, images, repeats, out / f"features-{name}-kept.txt", KEPT)
        for row, kept_row in zip(plain, kept):
            rows.append(
                f"| `{name}` | {row['pixels']} | {float(row['ours ms']):.1f} | {float(row['theirs ms']):.1f} | "
                f"{float(row['speed-up']):.1f} x | {float(kept_row['theirs ms']):.1f} | {float(kept_row['speed-up']):.1f} x | "
                f"{row['twins']:.1f} % | {float(row['ours MiB']):.0f}, {float(row['theirs MiB']):.0f} |"
            )
            print(rows[-1], flush=True)
    return rows


def searches(images, repeats, out):
    """Rows of the table: each search at each size."""
    text = printed([sys.executable, HERE / "search.py", *images, "--rounds", repeats], out / "search.txt")
    rows = []
    line = re.compile(r"(\w+) +(\d+) x +(\d+): ours +([\d.]+) ms, BFMatcher +([\d.]+) ms \( *([\d.]+) x\)(?:.*?FLANN +[\d.]+ ms \( *([\d.]+) x)?")
    for name, a, b, ours, theirs, ratio, flann in line.findall(text):
        beside = f", {float(flann):.1f} x FLANN" if flann else ""
        rows.append(f"| {name} | {a} x {b} | {float(ours):.2f} | {float(theirs):.1f} | {float(ratio):.1f} x{beside} |")
        print(rows[-1], flush=True)
    return rows


def protocol(dataset, counts, out):
    """Rows of the table: the whole run with SIFT, ours and OpenCV's, with each number of threads."""
    rows = []

    def timed(label, threads, name, command, results, *also, environment={}):
        start = time.perf_counter()
        printed([*command, "--threads", threads], out / f"run-{name}-{threads}.txt", stderr=subprocess.DEVNULL, env={**os.environ, **environment})
        seconds = time.perf_counter() - start
        scored = [PROGRAMS / "matchbench", "eval", results, *also, "--format", "csv"]
        heads, values = printed(scored, out / f"run-{name}-{threads}.csv").splitlines()
        auc = float(dict(zip(heads.split(","), values.split(",")))["auc"])
        rows.append((label, threads, seconds, auc))
        print(f"{label}, threads: {threads}, {seconds:.1f} s, AUC {auc:.3f}", flush=True)

    plain = "OpenCV with FLANN"
    with tempfile.TemporaryDirectory() as scratch:
        for threads in counts:
            run = Path(scratch) / f"ours-{threads}"
            command = [PROGRAMS / "matchbench", "run", dataset, "--matchers", "sift", "--estimator", "ransac-e"]
            timed("ours", threads, "ours", [*command, "--out", run], run)
            command = [sys.executable, HERE / "opencv_run.py", dataset, "--matchers", "sift", "--search", "flann"]
            also = ["--datasets", dataset.resolve().parent]
            for name, label, environment in [("opencv-kept", f"{plain}, freed memory kept", KEPT), ("opencv", plain, {})]:
                theirs = Path(scratch) / f"{name}-{threads}"
                timed(label, threads, name, [*command, "--out", theirs], theirs, *also, environment=environment)
    if max(auc for *_, auc in rows) - min(auc for *_, auc in rows) > AUC_TOLERANCE:
        sys.exit("the protocols come to different scores")
    theirs = {threads: seconds for label, threads, seconds, _ in rows if label == plain}
    return [f"| {label} | {threads} | {seconds:.1f} | {auc:.3f} | {theirs[threads] / seconds:.1f} x |" for label, threads, seconds, auc in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", nargs=4, metavar="IMAGE", type=Path)
    parser.add_argument("--dataset", required=True, type=Path)
    parser.add_argument("--out", type=Path, default=Path("speed"))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    version = subprocess.run([PROGRAMS / "matchbench", "--version"], capture_output=True, text=True, check=True).stdout
    limits = [f"{name}={os.environ[name]}" for name in LIMITS if name in os.environ]
    machine = (
        f"{' '.join([processor(), *limits])}\n{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at the beginning, {platform.system()}\n"
        f"{version.strip()}, OpenCV {cv2.__version__}, features and searches: medians of {arguments.repeats} repetitions by turns\n"
    )
    (out / "machine.txt").write_text(machine)
    print(machine, flush=True)
    small, large = arguments.images[:2], arguments.images[2:]
    parts = [
        "| features, one thread | image | ours, ms | OpenCV, ms | speed | freed memory kept, ms | speed | twins | MiB, ours and OpenCV's |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        *features([small[0], large[0]], arguments.repeats, out),
        "",
        "| exact search, one thread | descriptors | ours, ms | `BFMatcher`, ms | speed |",
        "| --- | --- | ---: | ---: | ---: |",
        *searches(large, arguments.repeats, out),
        "",
        "| SIFT, from files to poses, each row measured once | threads | s | AUC | speed, same threads |",
        "| --- | ---: | ---: | ---: | ---: |",
        *protocol(arguments.dataset, sorted({1, arguments.threads}), out),
    ]
    (out / "table.md").write_text("\n".join(["# Beside OpenCV", "", *machine.splitlines(), "", *parts]) + "\n")
    print(f"\n{out / 'table.md'}")


if __name__ == "__main__":
    main()

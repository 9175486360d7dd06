"""Measures a run by its number of threads: records a second, processor time, memory, and where it stops to scale.

    python3 compare/threads.py PROGRAM DATASET --matchers sift,orb --estimator best [--threads 1,2,4,8,16] [--repeats 3]

Each row is a whole run, from image files to records, with nothing kept from before. Of the repetitions that with the
least time counts. Checks that all runs have the same records, except for the times. The columns tell where time goes:

- *busy* is the share of its threads' time that a run computes. The rest is waiting: for a lock, for the other threads
  at the end, or in the parts of a run that have one thread.
- *processor s* grows with threads when cores share something: memory bandwidth, caches, the clock, or one core's units
  between two hyperthreads.
- *apart* is the speed-up of as many processes with one thread each, at the same time, each with a whole run. They
  share no lock, so it is what the machine itself allows. Only the numbers of --apart have it.

Needs a Unix system, and only the standard library.
"""

import argparse
import os
import shutil
import subprocess
import time
from pathlib import Path

from machine import processor
from scale import check, measured


def run_of(arguments, threads, out):
    """The command of a run with this many threads, which writes to `out`."""
    what = ["--matchers", arguments.matchers, "--estimator", arguments.estimator, "--keep-matches", "none"]
    return [arguments.program, "run", arguments.dataset, *what, "--threads", str(threads), "--out", out]


def together(commands):
    """Wall-clock seconds until the last of some commands ends, all started at once."""
    begin = time.monotonic()
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    children = [subprocess.Popen([str(word) for word in command], **quiet) for command in commands]
    if any([child.wait() for child in children]):
        raise SystemExit(f"{commands[0]} failed")
    return time.monotonic() - begin


def records_in(run):
    return sum(len(file.read_text().splitlines()) for file in (run / "records").rglob("*") if file.is_file())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--matchers", default="sift")
    parser.add_argument("--estimator", default="ransac-e")
    parser.add_argument("--threads", default="1,2,4,8,16")
    parser.add_argument("--apart", default="2,4,8,16")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--scratch", type=Path, default=Path("threads-scratch"), help="a folder for the runs, made and removed")
    arguments = parser.parse_args()
    numbers = [int(word) for word in arguments.threads.split(",")]
    if numbers[0] != 1:
        raise SystemExit("--threads begins with 1, which the others are compared with")
    arguments.program = arguments.program.resolve()
    apart_too = [int(word) for word in arguments.apart.split(",")]
    scratch = arguments.scratch
    scratch.mkdir()
    print(f"{processor()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at the beginning")
    print(f"{arguments.dataset.name}, {arguments.matchers}, {arguments.estimator}, the best of {arguments.repeats}\n")
    print("| threads | s | records/s | speed-up | apart | busy | processor s | MiB |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    whole = scratch / "whole"
    alone = None
    try:
        for threads in numbers:
            times = []
            for repetition in range(arguments.repeats):
                out = scratch / f"{threads}-{repetition}"
                times.append(measured(*run_of(arguments, threads, out)))
                if whole.exists():
                    check(out, whole)
                    shutil.rmtree(out)
                else:
                    out.rename(whole)
                    records = records_in(whole)
            seconds, computed, memory = min(times)
            if alone is None:
                alone = seconds
            apart = ""
            if threads > 1 and threads in apart_too:
                outs = [scratch / f"apart-{process}" for process in range(threads)]
                slowest = []
                for _ in range(arguments.repeats):
                    slowest.append(together([run_of(arguments, 1, out) for out in outs]))
                    for out in outs:
                        check(out, whole)
                        shutil.rmtree(out)
                apart = f"{threads * alone / min(slowest):.1f} x"
            print(
                f"| {threads} | {seconds:.2f} | {records / seconds:.0f} | {alone / seconds:.1f} x | {apart} | "
                f"{100 * computed / (seconds * threads):.0f} % | {computed:.1f} | {memory:.0f} |",
                flush=True,
            )
    finally:
        shutil.rmtree(scratch)


if __name__ == "__main__":
    main()

"""Compares our features with OpenCV's on the same pixels: are keypoints and descriptors the same, and how fast are both?

    python features.py EXTRACTOR IMAGE... [--repeats N] [--program PATH] [--max-distance PX] [--given]
                       [--threads N | --cpu]

Both sides get the grey pixels of `cv2.imread`, as they are stored, and one thread, or N threads. A keypoint has a twin in the other
set if there is one within 0.5 px, 5 % in size and 5 degrees. With --given, both describe the keypoints of OpenCV's
detector, which is not timed. Prints one row per image and a summary. README.md says what the columns mean.
"""

import argparse
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from pixels import GRAY

ROOT = Path(__file__).resolve().parent.parent

# Number of extractions whose processor time is measured together, since it is known only to 10 ms.
CPU_REPEATS = 20


class Chain:
    """A detector and a descriptor as one extractor. Keypoints are moved by -`shift` in between."""

    def __init__(self, detector, describer, shift=(0, 0)):
        self.detector, self.describer, self.shift = detector, describer, shift

    def detect(self, gray, mask):
        keypoints = self.detector.detect(gray, mask)
        for k in keypoints:
            k.pt = (k.pt[0] - self.shift[0], k.pt[1] - self.shift[1])
        return keypoints

    def detectAndCompute(self, gray, mask):
        return self.describer.compute(gray, self.detect(gray, mask))


class Given:
    """Describes given keypoints."""

    def __init__(self, keypoints, describer):
        self.keypoints, self.describer = keypoints, describer

    def detectAndCompute(self, gray, mask):
        return self.describer.compute(gray, self.keypoints)


def on_sift(describer):
    return Chain(cv2.SIFT_create(), describer, SIFT_SHIFT)


# OpenCV halves positions in the doubled image without correcting its half-pixel offset.
SIFT_SHIFT = (0.25, 0.25)


# Our id: (OpenCV's extractor, the known shift (x, y) of OpenCV's positions).
EXTRACTORS = {
    "brisk": (lambda: cv2.BRISK_create(), (0, 0)),
    "akaze": (lambda: cv2.AKAZE_create(), (0, 0)),
    "freak": (lambda: Chain(cv2.xfeatures2d.SURF_create(), cv2.xfeatures2d.FREAK_create()), (0, 0)),
    "freak-sift": (lambda: on_sift(cv2.xfeatures2d.FREAK_create()), (0, 0)),
    "daisy": (lambda: on_sift(cv2.xfeatures2d.DAISY_create()), (0, 0)),
    # Ours were learned again on other scenes, so times can be compared but not descriptors.
    "dlco": (lambda: on_sift(cv2.xfeatures2d.VGG_create(100, 1.4, True, True, 6.75, False)), (0, 0)),
    "binboost": (lambda: on_sift(cv2.xfeatures2d.BoostDesc_create(302, True, 6.75)), (0, 0)),
    "latch": (lambda: on_sift(cv2.xfeatures2d.LATCH_create()), (0, 0)),
    "kaze": (lambda: cv2.KAZE_create(), (0, 0)),
    "orb": (lambda: cv2.ORB_create(100_000), (0, 0)),
    "orb-gms": (lambda: cv2.ORB_create(10_000, fastThreshold=0), (0, 0)),
    "sift": (lambda: cv2.SIFT_create(), SIFT_SHIFT),
    "surf": (lambda: cv2.xfeatures2d.SURF_create(), (0, 0)),  # only in OpenCV 3.4.2
}


def opencv(extractor, gray, clock):
    """Keypoints as rows x y size angle, descriptors, seconds."""
    start = clock()
    keypoints, descriptors = extractor.detectAndCompute(gray, None)
    seconds = clock() - start
    rows = np.array([(*k.pt, k.size, k.angle) for k in keypoints], np.float32).reshape(-1, 4)
    return rows, descriptors, seconds


def opencv_memory(name, path):
    """MiB by which the peak memory of a process grows when it extracts from an image."""

    def peak():  # the peak of `getrusage` would include the size of the parent
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])

    cv2.setNumThreads(1)
    gray = cv2.imread(path, GRAY)
    extractor = EXTRACTORS[name][0]()
    before = peak()
    extractor.detectAndCompute(gray, None)
    return (peak() - before) / 1024


def ours(program, extractor, pgm, threads, given, repeats):
    """Keypoints as rows x y size angle, descriptors, seconds for an image, peak MiB of the process and
    its seconds on processors."""
    out = str(pgm.with_suffix(""))
    # Started by `time`, since the child of a large process is counted with the memory of its parent.
    command = ["/usr/bin/time", "-f", "%M %U %S", program, extractor, str(pgm), str(repeats), out, *given]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    run = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    keypoints = np.load(out + ".keypoints.npy")
    descriptors = np.load(out + ".descriptors.npy")
    peak, *cpu = map(float, run.stderr.split())
    return keypoints[:, :4], descriptors, float(run.stdout) / 1e3, peak / 1024, sum(cpu)


def twins(a, b, max_distance):
    """For each row of `a` the index of its twin in `b`, or -1."""
    twin = np.full(len(a), -1)
    if len(b) == 0:
        return twin
    order = np.argsort(b[:, 0], kind="stable")
    sorted_x = b[order, 0]
    first = np.searchsorted(sorted_x, a[:, 0] - max_distance, "left")
    last = np.searchsorted(sorted_x, a[:, 0] + max_distance, "right")
    for i, row in enumerate(a):
        near = order[first[i] : last[i]]
        distance = np.hypot(b[near, 0] - row[0], b[near, 1] - row[1])
        turn = np.abs((b[near, 3] - row[3] + 180) % 360 - 180)
        size = np.abs(b[near, 2] / row[2] - 1)
        fits = (distance <= max_distance) & (size <= 0.05) & (turn <= 5)
        if fits.any():
            # If there are several directions at one place, the one that is nearest in all respects.
            cost = distance / max_distance + size / 0.05 + turn / 5
            twin[i] = near[np.argmin(np.where(fits, cost, np.inf))]
    return twin


def descriptor_distances(a, b):
    """Distances of rows: relative to the norm, or the share of differing bits."""
    if a.dtype == np.uint8:
        return np.unpackbits(a ^ b, axis=1).mean(axis=1)
    return np.linalg.norm(a - b, axis=1) / np.maximum(np.linalg.norm(a, axis=1), 1e-9)


def compare(name, path, program, repeats, max_distance, scratch, are_given, threads, cpu):
    make, shift = EXTRACTORS[name]
    gray = cv2.imread(str(path), GRAY)
    if gray is None:
        sys.exit(f"{path}: not an image")
    pgm = scratch / f"{Path(path).stem}.pgm"
    cv2.imwrite(str(pgm), gray)
    extractor = make()
    given = []
    if are_given:
        keypoints = extractor.detect(gray, None)
        extractor = Given(keypoints, extractor.describer)
        given = [str(scratch / "given.npy")]
        rows = [(*k.pt, k.size, k.angle, k.response, 0) for k in keypoints]
        np.save(given[0], np.array(rows, np.float32))
    clock = time.process_time if cpu else time.perf_counter
    opencv(extractor, gray, clock)  # not timed: first use
    times = []
    for _ in range(repeats):  # interleaved, so that changes in the speed of the machine affect both
        reference, reference_rows, theirs = opencv(extractor, gray, clock)
        found, rows, mine, peak, _ = ours(program, name, pgm, threads, given, 1)
        if cpu:
            none, many = (ours(program, name, pgm, 1, given, n)[-1] for n in (0, CPU_REPEATS))
            mine = max(many - none, 1e-6) / CPU_REPEATS
        times.append((mine, theirs))
    with multiprocessing.get_context("spawn").Pool(1) as fresh:
        their_peak = fresh.apply(opencv_memory, (name, str(pgm)))
    there = twins(reference, found, max_distance)
    back = twins(found, reference, max_distance)
    matched = there >= 0
    distance = descriptor_distances(reference_rows[matched], rows[there[matched]])
    offset = np.median(reference[matched, :2] - found[there[matched], :2], axis=0)
    centred = reference - np.array([*shift, 0, 0], np.float32)
    close = twins(centred, found, 0.05)
    row = {
        "image": f"{Path(path).parent.name}/{Path(path).name}",
        "pixels": f"{gray.shape[1]}x{gray.shape[0]}",
        "theirs": len(reference),
        "ours": len(found),
        "theirs>ours %": 100 * matched.mean(),
        "ours>theirs %": 100 * (back >= 0).mean(),
        "shift": f"{offset[0]:+.2f},{offset[1]:+.2f}",
        "<0.05px %": 100 * (close >= 0).mean(),
        "desc med": float(np.median(distance)),
        "desc max": float(np.max(distance)),
        "desc equal %": 100 * float((distance == 0).mean()),
        "ours ms": 1e3 * statistics.median(t[0] for t in times),
        "theirs ms": 1e3 * statistics.median(t[1] for t in times),
        "speed-up": statistics.median(t[1] / t[0] for t in times),
        "best/best": min(t[1] for t in times) / min(t[0] for t in times),
        "ours MiB": peak,
        "theirs MiB": their_peak,
    }
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("extractor", choices=sorted(EXTRACTORS))
    parser.add_argument("images", nargs="+")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--max-distance", type=float, default=0.5, help="pixels")
    parser.add_argument("--program", default=str(ROOT / "target/release/extract"))
    parser.add_argument("--given", action="store_true", help="describe OpenCV's keypoints")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--cpu", action="store_true", help="time on processors, not on the wall; one thread")
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    if arguments.cpu and arguments.threads > 1:
        parser.error("--cpu is for one thread")
    threads = f"{arguments.threads} thread{'s' if arguments.threads > 1 else ''}"
    print(f"OpenCV {cv2.__version__}, {threads}, {arguments.repeats} interleaved repetitions")
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for path in arguments.images:
            row = compare(
                arguments.extractor, path, arguments.program, arguments.repeats,
                arguments.max_distance, Path(scratch), arguments.given, arguments.threads,
                arguments.cpu,
            )
            if not rows:
                print(" | ".join(row))
            rows.append(row)
            cells = (f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values())
            print(" | ".join(cells), flush=True)
    print(
        "worst: theirs>ours {:.2f} %, ours>theirs {:.2f} %, desc med {:.4f}, speed-up {:.2f}".format(
            min(r["theirs>ours %"] for r in rows),
            min(r["ours>theirs %"] for r in rows),
            max(r["desc med"] for r in rows),
            min(r["speed-up"] for r in rows),
        )
    )


if __name__ == "__main__":
    main()

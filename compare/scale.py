"""Measures the cost of a plan, its shards and their merging, by the number of pairs: seconds and peak memory of each.

    python3 compare/scale.py PROGRAM FOLDER --images 64,200,632,1415 --shards 16

Makes a dataset with all pairs of images of a wall of grey patches, photographed from places side by side. Runs it as one
run, and in shards one after the other, with one thread. Checks that the merged records equal those of the one run, except
for the times. 1415 images are 1,000,405 pairs. A dataset in FOLDER from before is used again; results from before are
refused, since a run that is finished costs nothing. Needs a Unix system, and only the standard library.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path

WIDTH, HEIGHT = 160, 120


def wall(shift: int) -> bytes:
    """A PGM file of patches of 9 x 7 pixels, seen from `shift` pixels to the side."""
    rows = bytearray()
    for y in range(HEIGHT):
        for x in range(WIDTH):
            patch = ((x + shift) // 9) * 7919 + (y // 7) * 104729
            grey = ((patch ^ (patch >> 5)) * 2654435761 & 0xFFFFFFFFFFFFFFFF) >> 13
            rows.append(40 + grey % 170)
    return b"P5 %d %d 255\n" % (WIDTH, HEIGHT) + bytes(rows)


def dataset(folder: Path, images: int) -> Path:
    """A dataset that pairs every image with every later one; neighbours are 2 pixels apart."""
    if (folder / "pairs.txt").exists():
        return folder
    (folder / "Images").mkdir(parents=True)
    for frame in range(images):
        (folder / f"Images/{frame:04}.pgm").write_bytes(wall(2 * frame))
    (folder / "camera.txt").write_text(f"100 0 {(WIDTH - 1) / 2}\n0 100 {(HEIGHT - 1) / 2}\n0 0 1\n")
    with (folder / "pairs.txt").open("w") as file:
        for a in range(images):
            for b in range(a + 1, images):
                file.write(f"{a} {b} 1 0 0 {-0.02 * (b - a):.2f} 0 1 0 0 0 0 1 0\n")
    return folder


def measured(*command: str | Path) -> tuple[float, float, float]:
    """Wall-clock and processor seconds, and peak memory in MiB."""
    begin = time.monotonic()
    child = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(f"{command} failed")
    return time.monotonic() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def timeless(line: str) -> dict[str, object]:
    record = json.loads(line)
    return {name: value for name, value in record.items() if name not in ("times", "check")}


def files_of(run: Path) -> set[Path]:
    """The files of a run, without those that are not results."""
    files = {path.relative_to(run) for path in run.rglob("*") if path.is_file()}
    return {path for path in files if path.parts[0] not in ("cache", ".lock")}


def check(merged: Path, whole: Path) -> None:
    """Checks that both runs have the same files, with the same records."""
    if odd := files_of(merged) ^ files_of(whole):
        raise SystemExit(f"only one of {merged} and {whole} has {', '.join(sorted(map(str, odd)))}")
    for inside in sorted(files_of(whole)):
        file = whole / inside
        if inside.parts[0] == "records":
            with file.open() as one, (merged / inside).open() as other:
                for line, (a, b) in enumerate(zip(one, other, strict=True), 1):
                    if timeless(a) != timeless(b):
                        raise SystemExit(f"{inside}:{line} differs")
        elif file.read_bytes() != (merged / inside).read_bytes():
            raise SystemExit(f"{inside} differs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--images", default="64,200,632")
    parser.add_argument("--shards", type=int, default=16)
    parser.add_argument("--matcher", default="orb")
    parser.add_argument("--keep-matches", default="none")
    arguments = parser.parse_args()
    program, shards = arguments.program, arguments.shards
    counts = [int(word) for word in arguments.images.split(",")]
    made = ["whole", "plan", "merged", *(f"cache{k}" for k in range(1, shards + 1))]
    for there in (arguments.folder / str(images) / name for images in counts for name in made):
        if there.exists():
            raise SystemExit(f"{there} is there already, so not all work would be measured; delete it or choose another folder")
    print("| pairs | | processor s | us a pair | MiB | disk, bytes a pair |\n| ---: | --- | ---: | ---: | ---: | ---: |")
    for images in counts:
        pairs = images * (images - 1) // 2
        here = arguments.folder / str(images)
        data = dataset(here / "wall", images)
        what = [data, "--matchers", arguments.matcher, "--keep-matches", arguments.keep_matches]
        plan = here / "plan"

        def tell(name: str, seconds: float, memory: float, disk: int | None = None, pairs: int = pairs) -> None:
            size = "" if disk is None else f"{disk / pairs:.0f}"
            print(f"| {pairs} | {name} | {seconds:.1f} | {1e6 * seconds / pairs:.0f} | {memory:.0f} | {size} |", flush=True)

        _, seconds, memory = measured(program, "run", *what, "--threads", "1", "--out", here / "whole")
        records = here / "whole/records"
        tell("run", seconds, memory, sum(f.stat().st_size for f in records.rglob("*") if f.is_file()))
        _, seconds, memory = measured(program, "plan", *what, "--shards", str(shards), "--out", plan)
        tell("plan", seconds, memory, (plan / "plan.json").stat().st_size)
        each = [
            measured(program, "work", plan, "--shard", str(k), "--threads", "1", "--cache", here / f"cache{k}")
            for k in range(1, shards + 1)
        ]
        tell(f"work, all {shards}", sum(s for _, s, _ in each), max(m for _, _, m in each))
        _, seconds, memory = measured(program, "merge", plan, "--out", here / "merged")
        tell("merge", seconds, memory)
        check(here / "merged", here / "whole")


if __name__ == "__main__":
    main()

"""The shards of a plan on a Ray cluster: `pip install ray`, and one version of matchbench on every machine.

A plan is what `matchbench plan` writes. Each of its shards is one task of Ray. A shard whose worker is killed is
started again and no other; where its folder is still there, it goes on from its last record.
The merged run is that of one machine, bit for bit but for the times.
"""

import importlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

from ._native import Dataset, Error, command_line
from ._progress import shown

_Path = str | os.PathLike[str]
_Files = list[tuple[str, Any]]
"""Files by their paths within a folder, each with its bytes or where these are in Ray's object store."""

_NO_RESULTS = ("cache", ".lock")
"""What the folder of a shard has beside its results."""


def run(
    plan: _Path,
    address: str | None = None,
    *,
    out: _Path | None = None,
    shared: bool = True,
    cpus: int = 1,
    memory: int | None = None,
    retries: int = 3,
    at_once: int | None = None,
    progress: bool | Callable[[int, int, str, str], None] = True,
) -> Path:
    """Does the shards of the plan in the folder `plan` on a Ray cluster, merges them, and returns the folder of the
    run: `out`, or `run` in that of the plan.

    `address` is that of the cluster, as `ray.init` takes it. Where Ray was started already, that cluster is used;
    without an address, one on this machine.

    `shared`: all machines see the plan and the datasets under the paths that they have here. Otherwise images,
    matches from files and results travel through Ray's object store, and a machine keeps what it was sent in
    `matchbench-...` of its temporary folder. A matcher from outside must be at its path on every machine.

    A shard takes `cpus` threads, and `memory` bytes where that is said; Ray starts as many as there is room for. It is
    handed at most `at_once` of them (default: two for each that fits), so that results do not pile up. A shard whose
    worker or machine is lost is started again up to `retries` times. `progress` may be a function of (done,
    total, "shards", "").

    A shard that cannot be done holds no other up. All of these are named in the error that is raised at the end; the
    same call goes on from there.
    """
    try:
        ray: Any = importlib.import_module("ray")
    except ImportError as error:
        raise ImportError("matchbench.ray needs Ray: pip install ray") from error
    home = Path(plan).absolute()
    home = home.parent if home.is_file() else home
    text = (home / "plan.json").read_bytes()
    planned: dict[str, Any] = json.loads(text)
    shards = len(planned["cut"]["parts"])
    folder = home / "run" if out is None else Path(out)
    if cpus < 1 or (at_once is not None and at_once < 1):
        raise ValueError("a shard needs at least one thread, and one shard at least must be at work")
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init(address=address)
    failed: dict[int, str] = {}
    try:
        most = at_once or 2 * max(1, int(ray.cluster_resources().get("CPU", 1)) // cpus)
        needs: dict[str, Any] = {"num_cpus": cpus, "max_retries": retries, "retry_exceptions": [_Lost]}
        if memory is not None:
            needs["memory"] = memory
        if shared:
            task: Any = ray.remote(**needs)(_work)
            start: Callable[[int], Any] = lambda number: task.remote(number, str(home), cpus)
        else:
            task = ray.remote(**needs)(_work_on_what_was_sent)
            sent = (ray.put(text), _inputs(ray, planned), planned["hash"][:16], cpus)
            start = lambda number: task.remote(number, _results(_shard(home, number)), *sent)
        numbers = iter(range(1, shards + 1))
        waiting = {start(number): number for number in islice(numbers, most)}
        with shown(progress) as bar:
            for done in range(1, shards + 1):
                [ready], _ = ray.wait(list(waiting))
                number = waiting.pop(ready)
                try:
                    _write_files(_shard(home, number), ray.get(ready))
                except Exception as error:
                    failed[number] = _last_line(getattr(error, "cause", None) or error)
                del ready  # its results leave the object store
                waiting.update({start(number): number for number in islice(numbers, 1)})
                if bar is not None:
                    bar(done, shards, "shards", "")
    finally:
        if is_ours:
            ray.shutdown()
    if failed:
        reasons = "; ".join(f"shard {number}: {reason}" for number, reason in sorted(failed.items()))
        raise Error(f"{len(failed)} of {shards} shards were not done; the same call tries them again. {reasons}")
    _merge(home, folder)
    return folder


def _shard(home: Path, number: int) -> Path:
    return home / "shards" / str(number)


class _Lost(Exception):
    """Something killed the process that did a shard."""


def _work(number: int, home: str, cpus: int, *more: str) -> _Files:
    """Does a shard in a worker of Ray; there are no results to send."""
    words = ["work", home, "--shard", str(number), "--threads", str(cpus), *more]
    # A process of its own, which ends with this one: a worker does many shards, and a command lives in one process.
    child = subprocess.Popen(
        [sys.executable, "-m", __name__, *words], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    with child:
        assert child.stderr is not None
        said = child.stderr.read().decode(errors="replace").strip()
        code = child.wait()
    if code < 0:
        raise _Lost(f"matchbench work was ended by signal {-code}")
    # 2: some tasks failed, which is a result too.
    if code not in (0, 2):
        raise RuntimeError(said or f"matchbench work ended with code {code}")
    return []


def _end_with_the_worker() -> None:
    """Ends this process when nobody holds the other end of its standard input any more."""
    # Not by `sys.stdin`, whose lock the interpreter wants at its end.
    while os.read(0, 4096):
        pass
    os._exit(1)


def _work_on_what_was_sent(
    number: int, earlier: _Files, plan: bytes, inputs: list[tuple[str, str, _Files]], name: str, cpus: int
) -> _Files:
    """Does a shard on a machine that sees no folder of the others, and returns its results."""
    ray: Any = importlib.import_module("ray")
    home = Path(tempfile.gettempdir()) / f"matchbench-{name}"
    _write_files(home, [("plan.json", plan)])
    if not _shard(home, number).exists():
        _write_files(_shard(home, number), earlier)
    more: list[str] = []
    for option, place, files in inputs:
        for inside, where in files:
            # What is there is whole: another shard on this machine was sent the same.
            if not (home / inside).exists():
                _write_files(home, [(inside, ray.get(where))])
        more += [option, place.format(home=home)]
    _work(number, str(home), cpus, *more)
    return _results(_shard(home, number))


def _inputs(ray: Any, planned: dict[str, Any]) -> list[tuple[str, str, _Files]]:
    """What a machine is sent: an option of `matchbench work`, its value below `{home}`, and the files."""

    def sent(root: Path, to: str) -> _Files:
        paths = sorted(path for path in root.rglob("*") if path.is_file()) if root.is_dir() else [root]
        root = root if root.is_dir() else root.parent
        return [(f"{to}/{path.relative_to(root).as_posix()}", ray.put(path.read_bytes())) for path in paths]

    inputs: list[tuple[str, str, _Files]] = []
    for dataset in planned["plan"]["datasets"]:
        root, to = Path(dataset["path"]).resolve(), f"data/{dataset['name']}"
        for image in Dataset.open(root).images:
            if not Path(image).resolve().is_relative_to(root):
                raise ValueError(f"{image} is not in {root}, which is sent as a whole; share the folders instead")
        inputs.append(("--data", f"{{home}}/{to}", sent(root, to)))
    for matches in planned["asked"].get("matches", []):
        places: list[str] = []
        files: _Files = []
        for path in map(Path, matches["files"]):
            root = path if path.is_dir() else path.parent
            # Names are part of the plan.
            to = f"matches/{matches['name']}/{root.name}"
            files += sent(path, to)
            places.append(f"{{home}}/{to}" if path.is_dir() else f"{{home}}/{to}/{path.name}")
        inputs.append(("--matches", f"{matches['name']}={','.join(places)}", files))
    return inputs


def _results(folder: Path) -> _Files:
    """The files of a shard, if there are any."""
    files = [path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()]
    return [(inside.as_posix(), (folder / inside).read_bytes()) for inside in files if inside.parts[0] not in _NO_RESULTS]


def _write_files(folder: Path, files: _Files) -> None:
    """Writes files of a folder, each whole or not at all."""
    for inside, content in files:
        path = folder / inside
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(part, path)


def _last_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


def _merge(home: Path, out: Path) -> None:
    words = [sys.executable, "-m", "matchbench", "merge", str(home), "--out", str(out)]
    merged = subprocess.run(words, capture_output=True, text=True)
    if merged.returncode == 2:
        warnings.warn(merged.stderr.strip(), stacklevel=3)
    elif merged.returncode != 0:
        raise Error(merged.stderr.strip())


if __name__ == "__main__":
    threading.Thread(target=_end_with_the_worker, daemon=True).start()
    sys.exit(command_line(["matchbench", *sys.argv[1:]]))

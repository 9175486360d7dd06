"""Runs the shards of a plan on a Ray cluster. It needs `pip install ray` and the same version of matchbench on every
machine.

`matchbench plan` writes a plan. Each of its shards is one Ray task. If the worker of a shard is killed, this shard is
started again, and no other. If its folder still exists, it continues after its last record. The merged run equals that of
one machine, bit for bit except for the times.
"""

import hashlib
import importlib
import json
import os
import stat
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
"""Files by their paths within a folder, each with its bytes or with their reference in Ray's object store."""

_NO_RESULTS = ("cache", ".lock")
"""Files in the folder of a shard that are not results."""


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
    """Runs the shards of the plan in the folder `plan` on a Ray cluster, merges them, and returns the folder of the run:
    `out`, or `run` in the folder of the plan.

    `address` is the address of the cluster, as `ray.init` takes it. If Ray was started already, its cluster is used.
    Otherwise, without an address, a cluster is started on this machine.

    With `shared`, all machines see the plan and the datasets under the same paths as here. Without it, images, matches
    from files and results are sent through Ray's object store, and a machine keeps them in `matchbench-USER` in its
    temporary folder (USER is the number of the user), in a folder for each plan and content of what was sent: results of
    images that were replaced are not taken for those of the new ones. A matcher from outside must be at the same path on
    every machine.

    A shard uses `cpus` threads, and `memory` bytes if that is given. Ray runs as many shards at a time as fit. It is
    given at most `at_once` of them (default: two for each that fits), so that results do not pile up. If the worker or
    the machine of a shard is lost, the shard is started again, up to `retries` times. `progress` may be a function of
    (done, total, "shards", "").

    A shard that fails does not stop the others. All that failed are named in the error that is raised at the end. The
    same call continues from there.
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
            inputs, digest = _inputs(ray, planned)
            sent = (ray.put(text), inputs, f"{planned['hash'][:16]}-{digest[:16]}", cpus)
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
    """The process of a shard was killed."""


def _work(number: int, home: str, cpus: int, *more: str) -> _Files:
    """Runs a shard in a Ray worker that shares the folders, so no results are sent."""
    words = ["work", home, "--shard", str(number), "--threads", str(cpus), *more]
    # In a process of its own that ends with this one: a worker runs many shards, but a process runs only one command.
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
    """Ends this process when the other end of its standard input is closed."""
    # Not with `sys.stdin`, whose lock the interpreter needs when it exits.
    while os.read(0, 4096):
        pass
    os._exit(1)


def _work_on_what_was_sent(
    number: int, earlier: _Files, plan: bytes, inputs: list[tuple[str, str, _Files]], name: str, cpus: int
) -> _Files:
    """Runs a shard on a machine that shares no folder with the others, and returns its results. `name` is another for
    other inputs."""
    ray: Any = importlib.import_module("ray")
    home = _folder_of_the_user() / name
    _write_files(home, [("plan.json", plan)])
    if not _shard(home, number).exists():
        _write_files(_shard(home, number), earlier)
    more: list[str] = []
    for option, place, files in inputs:
        for inside, where in files:
            # An existing file is complete and has this content: another shard on this machine was sent the same file.
            if not (home / inside).exists():
                _write_files(home, [(inside, ray.get(where))])
        more += [option, place.format(home=home)]
    _work(number, str(home), cpus, *more)
    return _results(_shard(home, number))


def _folder_of_the_user() -> Path:
    """The folder of this user in the temporary folder, where others may have made one of this name before."""
    if sys.platform == "win32":
        return Path(tempfile.gettempdir()) / "matchbench"  # the temporary folder is the user's own
    user = os.getuid()
    folder = Path(tempfile.gettempdir()) / f"matchbench-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != user or found.st_mode & 0o022:
        raise PermissionError(f"{folder} is no folder that user {user} alone can write to; remove it, or set TMPDIR")
    return folder


def _inputs(ray: Any, planned: dict[str, Any]) -> tuple[list[tuple[str, str, _Files]], str]:
    """All that a machine is sent: an option of `matchbench work`, its value below `{home}`, and the files. Also a digest of
    the paths and contents of these files."""
    digest = hashlib.sha256()

    def sent(root: Path, to: str) -> _Files:
        paths = sorted(path for path in root.rglob("*") if path.is_file()) if root.is_dir() else [root]
        root = root if root.is_dir() else root.parent
        files: _Files = []
        for path in paths:
            inside, content = f"{to}/{path.relative_to(root).as_posix()}", path.read_bytes()
            digest.update(f"{hashlib.sha256(content).hexdigest()} {inside}\0".encode(errors="surrogateescape"))
            files.append((inside, ray.put(content)))
        return files

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
            # The names must stay, since they are part of the plan.
            to = f"matches/{matches['name']}/{root.name}"
            files += sent(path, to)
            places.append(f"{{home}}/{to}" if path.is_dir() else f"{{home}}/{to}/{path.name}")
        inputs.append(("--matches", f"{matches['name']}={','.join(places)}", files))
    return inputs, digest.hexdigest()


def _results(folder: Path) -> _Files:
    """The files of a shard, if there are any."""
    files = [path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()]
    return [(inside.as_posix(), (folder / inside).read_bytes()) for inside in files if inside.parts[0] not in _NO_RESULTS]


def _write_files(folder: Path, files: _Files) -> None:
    """Writes the files of a folder, each completely or not at all."""
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

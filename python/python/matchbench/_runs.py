"""Runs: every matcher and estimator on every pair, recorded as it goes, and their reports."""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ._matchers import Matcher
from ._native import Dataset, Estimator
from ._native import report as native_report
from ._native import run as native_run
from ._params import to_json
from ._progress import shown

_Path = str | os.PathLike[str]


@dataclass(frozen=True)
class Run:
    """A run that ended: its folder, and how many tasks (pair x matcher x estimator) it has."""

    path: Path
    total: int
    before: int
    """Tasks that were recorded before this call."""
    now: int
    """Tasks that this call recorded."""
    failed: int
    """Recorded tasks that broke; they count as wrong, and their records say why."""

    @property
    def is_complete(self) -> bool:
        """Whether every task is recorded."""
        return self.before + self.now == self.total


def run(
    dataset: Dataset | _Path | Sequence[Dataset | _Path],
    matchers: Any | Sequence[Any],
    estimators: str | Estimator | Sequence[str | Estimator] = (),
    *,
    out: _Path,
    settings: str | Sequence[str] = (),
    seed: int = 0,
    repeat: int = 1,
    limit: int | None = None,
    time_budget_ms: int | None = None,
    keep_matches: Literal["all", "inliers", "none"] = "all",
    retry_failed: bool = False,
    cache: _Path | None = None,
    threads: int | None = None,
    progress: bool | Callable[[int, int, str, str], None] = True,
) -> Run:
    """Does what is not yet recorded in the folder `out`: what `matchbench run` does, record for record.
    Datasets, matchers, estimators and settings may be one or several: "sift" is ["sift"].

    A matcher is a name ("sift"), the path of a manifest ("./aliked.toml"), what `matcher(...)` returns, or
    Python: a function of two images, or an object with `extract(image)` and `match(features_a, features_b)`.
    Images are grey arrays; the answer is `(points_a, points_b)` or `(points_a, points_b, ambiguity)`, or
    `Matches`. Its name in tables is `name`, or that of the function or class; `version` and `params` are
    recorded if it has them. It may be called from several threads, one at a time unless it releases the
    interpreter. An exception costs the pair, which is tried again when the call is repeated;
    `retry_failed` tries again whatever failed.

    Estimators are names or what `estimator(...)` returns; without any, each matcher has its own, and one written
    in Python has "best". `settings` are as on the command line: ["sift.ratio=0.7"]. In tables, names come
    first, then matchers written in Python, then what `matcher(...)` returned. `progress` may be a function of
    (done, total, dataset, matcher).

    `keep_matches` says which matches stay on disk, at 20 bytes each: "all" that were selected, from which
    estimators that are added later start, the "inliers" of each estimator, or "none".

    Ctrl-C finishes the pairs in flight and is then raised; the same call goes on from there.
    """
    contenders = [_any_matcher(each) for each in _several(matchers)]
    if not contenders:
        raise ValueError('matchers: an empty list; give at least one, as in ["sift"]')
    for name, count in (("repeat", repeat), ("time_budget_ms", time_budget_ms), ("threads", threads)):
        if count is not None and count < 1:
            raise ValueError(f"{name}: {count}, must be at least 1")
    datasets = [each if isinstance(each, Dataset) else Dataset.open(each) for each in _several(dataset)]
    with shown(progress) as bar:
        counts, absent = native_run(
            datasets,
            contenders,
            _several(estimators),
            out,
            _several(settings),
            seed,
            repeat,
            limit,
            time_budget_ms,
            keep_matches,
            retry_failed,
            cache,
            threads,
            bar,
        )
    for reason in absent:
        warnings.warn(reason, stacklevel=2)
    return Run(Path(out), *counts)


def report(
    run: Run | _Path,
    *,
    out: _Path | None = None,
    bundle: _Path | None = None,
    pictures: int = 16,
) -> Path:
    """Writes the report of a run and returns its page: `report/index.html` in the folder of the run, or in
    `out`, or all of it as the one file `bundle`. What is missing in it is warned of."""
    folder = run.path if isinstance(run, Run) else run
    page, notes = native_report(folder, out, bundle, pictures)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Path(page)


def _several(given: Any) -> list[Any]:
    """What is given, as a list: a name, or what has no parts, is one."""
    return [given] if isinstance(given, str) or not hasattr(given, "__iter__") else list(given)


def _any_matcher(given: Any) -> Any:
    if isinstance(given, str):
        return given
    if isinstance(given, os.PathLike):
        return os.fspath(given)  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
    if isinstance(given, Matcher):
        return given.native
    matching = getattr(given, "match", None)
    extract = getattr(given, "extract", None)
    if not (callable(matching) and callable(extract)):
        matching, extract = given, None
    if not callable(matching):
        raise TypeError(
            f"a matcher is a name, a manifest's path, matcher(...), a function of two images or an object with "
            f"extract and match; this is {type(given).__name__}"
        )
    name = getattr(given, "name", None) or getattr(given, "__name__", None) or type(given).__name__
    version = str(getattr(given, "version", "unversioned"))
    return (str(name), version, to_json(getattr(given, "params", {})), matching, extract)

"""Runs: every matcher and estimator on every pair, recorded as it goes, and their reports."""

import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ._contenders import any_dataset, any_estimator, any_matcher, changes, listed, some
from ._estimators import Estimator
from ._native import Dataset
from ._native import join as native_join
from ._native import pair_seed as native_pair_seed
from ._native import report as native_report
from ._native import run as native_run
from ._params import path, seed_of, text, whole
from ._progress import shown

_Path = str | os.PathLike[str]
# Records hold these in 32 bits.
_MOST = {"repeat": 2**32 - 1, "time_budget_ms": 2**32 - 1}


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
    """Recorded tasks that broke, as a matcher did that raised an exception or returned what is no answer; they count as wrong.
    `run` warns of the most frequent reasons. The column `broken` of `evaluate` counts them; its column `failed` also counts
    pairs whose matches determine no pose."""

    @property
    def is_complete(self) -> bool:
        """Whether every task is recorded."""
        return self.before + self.now == self.total


def run(
    dataset: Dataset | _Path | Sequence[Dataset | _Path],
    matchers: Any | Sequence[Any],
    estimators: str | Estimator | Sequence[str | Estimator] | None = None,
    *,
    out: _Path,
    protocols: str | Sequence[str] = (),
    settings: str | Sequence[str] | Mapping[str, Any] = (),
    seed: int = 0,
    repeat: int | None = None,
    limit: int | None = None,
    sample: int | None = None,
    time_budget_ms: int | None = None,
    keep_matches: Literal["all", "inliers", "none"] = "all",
    retry_failed: bool = False,
    cache: _Path | None = None,
    threads: int | None = None,
    progress: bool | Callable[[int, int, str, str], None] = True,
) -> Run:
    """Runs all tasks that are not yet recorded in the folder `out`. The records are the same as those of `matchbench run`.
    Datasets, matchers, estimators and settings may be one or several: "sift" means ["sift"].

    A matcher is a name ("sift"), the path of a manifest ("./aliked.toml"), what `matcher(...)` returns, matches from
    files, or Python code: a function of two images, or an object with `extract(image)` and `match(features_a, features_b)`.
    Images are grey arrays (height x width), or RGB (height x width x 3) if it has `color = True`; the result is
    `(points_a, points_b)` or `(points_a, points_b, ambiguity)`, or `Matches`. An ambiguity is from 0 (certain) to 1 (a
    second candidate is as good), and 0.5 where none are returned; a tool that has confidences returns `1 - confidence`.
    It is above 1 where another candidate than the nearest was chosen; a run counts that of `Matches` as 1, and
    refuses it in arrays.
    Its name in tables is `name`, or that of the function or class; `params` are recorded if it has them, and so is
    `version`. Without one, a digest of its code, its constants and, unless it has `params`, its simple attributes is its
    version, so a run that was begun with others is refused; what the code calls elsewhere, arrays and weights are not
    seen.
    A run calls it for one pair at a time, from any of its threads. One whose calls may run at the same time says for how
    many pairs, by `workers = 4`; its results must not depend on that. If it raises an exception, the pair failed; it is
    tried again when this call is repeated. `retry_failed` tries everything again that failed.

    What other tools have matched is read from their files by `MatchesFrom(name, files)`.

    Estimators are names or what `estimator(...)` returns; without any, each matcher has its own, and a matcher
    written in Python has "best", and so have matches from files. `settings` are as on the command line,
    ["sift.ratio=0.7"], or a dict, {"sift.ratio": 0.7}. In tables, matches from files come after the matchers of the library, and those written in Python
    last. `progress` may be a function of (done, total, dataset, matcher).

    `protocols` are evaluation protocols ("superglue"; `matchbench list protocols` describes them), or "all". A protocol
    sets the size of images of the library's matchers, the estimator, the unit of its threshold and the repetitions; several
    share one set of matches. The parameters that `matcher(...)` or `estimator(...)` was given, and `settings`, come before
    those of a protocol. A program and a function see images as they are: a program is given its size by hand, if it has a
    parameter for it (`settings="ID.max_size=640"`), and a function resizes them itself. `repeat` runs every pair so many
    times with other random choices: once, unless a protocol says otherwise.

    `limit` takes the first pairs of each dataset alone, and `sample` so many pairs, evenly spread (out of the first
    ones, if there is a limit).

    `keep_matches` says which matches are kept on disk, at 20 to 28 bytes each: "all" selected matches, which estimators that
    are added later can use; the "inliers" of each estimator; or "none".

    After Ctrl-C, the pairs that are being matched are finished, and then the interrupt is raised; pairs that wait for
    their turn with a matcher written in Python are not begun, and a pair that was finished behind one of them is matched
    again. The same call continues from there. A call with more
    datasets, matchers, estimators, pairs or repetitions than before, into the same folder, computes only these.
    """
    datasets = some("dataset", dataset, "give at least one")
    contenders = [any_matcher("matchers", each) for each in some("matchers", matchers, 'give at least one, as in ["sift"]')]
    own = "leave it out for those that belong to each matcher"
    named = [] if estimators is None else some("estimators", estimators, own)
    judges = [any_estimator("estimators", each) for each in named]
    views = [text("protocols", each, 'a name, as in "superglue"') for each in listed("protocols", protocols)]
    counts = {"repeat": repeat, "limit": limit, "sample": sample, "time_budget_ms": time_budget_ms, "threads": threads}
    for name, count in counts.items():
        if count is not None:
            whole(name, count, 1, most=_MOST.get(name, sys.maxsize))
    set_to, drawn = changes(settings), seed_of(seed)
    folder = path("out", out, "the path of the folder of the run")
    kept = None if cache is None else path("cache", cache, "the path of a folder, or None")
    opened = [any_dataset("dataset", each) for each in datasets]
    with shown(progress) as bar:
        tasks, notes = native_run(
            opened,
            contenders,
            judges,
            views,
            folder,
            set_to,
            drawn,
            repeat,
            limit,
            sample,
            time_budget_ms,
            text("keep_matches", keep_matches, '"all", "inliers" or "none"'),
            retry_failed,
            kept,
            threads,
            bar,
        )
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Run(Path(folder), *tasks)


def join(runs: Sequence[Run | _Path], *, out: _Path) -> Run:
    """Makes one run, in the folder `out`, of several with other matchers, estimators or datasets, as `matchbench join` does:
    of learned matchers on a machine with a GPU, and of others elsewhere. They must have the same version, seed, pairs
    and repetitions. What is missing in it can be run by `run` into that folder."""
    folders = [folder_of(run, "runs") for run in some("runs", runs, "give at least one")]
    folder = path("out", out, "the path of the folder of the new run")
    planned, recorded, failed = native_join(folders, folder)
    return Run(Path(folder), planned, recorded, 0, failed)


def pair_seed(dataset: str, matcher: str, a: int, b: int, *, seed: int = 0, repetition: int = 0) -> int:
    """The seed of a pair in a run: with it, `match` and `estimate` give the same results as the run."""
    names = text("dataset", dataset, "a name"), text("matcher", matcher, "a name")
    return native_pair_seed(*names, a, b, seed, repetition)


def report(
    run: Run | _Path,
    *,
    out: _Path | None = None,
    bundle: _Path | None = None,
    pictures: int | Literal["all"] = 16,
) -> Path:
    """Writes the report of a run and returns the path of its page: `report/index.html` in the folder of the run, or in
    `out`, or everything as the one file `bundle`. So many pairs of each dataset have `pictures`; "all" is every pair.
    Whatever is missing in it is given as a warning."""
    if out is not None and bundle is not None:
        raise ValueError("out is a folder and bundle one file that holds all of it; give one of the two")
    drawn = sys.maxsize if pictures == "all" else whole("pictures", pictures, 0, 'a whole number, or "all"')
    pages = None if out is None else path("out", out, "the path of a folder, or None")
    whole_report = None if bundle is None else path("bundle", bundle, "the path of a file, or None")
    page, notes = native_report(folder_of(run), pages, whole_report, drawn)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Path(page)


def folder_of(run: Any, name: str = "run") -> Path:
    """The folder of a run."""
    return run.path if isinstance(run, Run) else Path(path(name, run, "a Run or the path of its folder"))

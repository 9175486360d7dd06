"""Scores of a run and results of its pairs, as tables."""

import os
import warnings
from collections.abc import Sequence
from html import escape
from typing import Any, overload

import numpy as np

from ._contenders import some
from ._native import evaluate as native_evaluate
from ._native import evaluate_under as native_evaluate_under
from ._native import pairs as native_pairs
from ._params import text
from ._runs import Run, folder_of
from ._tables import Table

_Run = Run | str | os.PathLike[str]
_ROW = ("dataset", "matcher", "estimator", "pairs", "failed")
_OF_POSES = ("auc", "sp5", "rotation_auc", "translation_auc", "ap5")
_OF_HOMOGRAPHIES = ("auc_h1", "auc_h3", "auc_h5", "mma3")


class Scores(Table):
    """One row per dataset, matcher and estimator. The columns are those of `tables/scores.csv` of the report: every score, and
    the ends `_low` and `_high` of its 95 % interval if it has one; curves, failures by their reasons, and times. `verdicts`
    says in sentences which method is best on each dataset, and whether that is significant."""

    verdicts: list[str]

    def shown(self) -> list[str]:
        """The names of the most important columns: those of poses, of homographies, or both, if any row has them."""
        known = [name for name in _OF_POSES + _OF_HOMOGRAPHIES if not np.isnan(np.asarray(self[name])).all()]
        return [*_ROW, *known]

    def rows(self) -> list[list[str]]:
        """The columns of `shown`, as text."""
        columns = [[_text(value) for value in self[name]] for name in self.shown()]
        return [list(row) for row in zip(*columns, strict=True)]

    def __str__(self) -> str:
        rows = [self.shown(), *self.rows()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in rows]
        return "\n".join([*(line.rstrip() for line in lines), *self.verdicts])

    def _repr_html_(self) -> str:
        def row(tag: str, cells: list[str]) -> str:
            return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        rows = [row("th", self.shown()), *(row("td", cells) for cells in self.rows())]
        return f"<table>{''.join(rows)}</table><p>{'<br>'.join(map(escape, self.verdicts))}</p>"


class ProtocolScores(Table):
    """One row per dataset, matcher, estimator and protocol; of several datasets the mean comes last. The columns are those of
    `matchbench eval --protocol` as CSV: each score of a protocol, the ends `_low` and `_high` of its 95 % interval and its
    `_deviation` over repetitions, and what the run did `otherwise` than the protocol asks. As text it is what that command
    prints, with the meaning of the scores."""

    printed: str

    def __str__(self) -> str:
        return self.printed.rstrip("\n")

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


class Pairs(Table):
    """One row per pair, repetition, matcher and estimator. The columns are those of `tables/pairs.csv` of the report: the frames
    `a` and `b`, how they lie to each other, errors in degrees or pixels, counts of matches, and the `outcome` in words."""


@overload
def evaluate(run: _Run, *, protocol: None = None) -> Scores: ...
@overload
def evaluate(run: _Run, *, protocol: str | Sequence[str]) -> ProtocolScores: ...
def evaluate(run: _Run, *, protocol: str | Sequence[str] | None = None) -> Scores | ProtocolScores:
    """The scores of a run, from its folder; with a `protocol` ("superglue", several, or "all"), those of that protocol. It
    warns if the run is not finished, or if the truth of a dataset looks wrong."""
    if protocol is None:
        table, verdicts, doubts = native_evaluate(folder_of(run))
        scores = Scores.of_csv(table)
        scores.verdicts = verdicts
    else:
        named = some("protocol", protocol, "leave it out for all scores of the run")
        asked = [text("protocol", each, 'a name, as in "superglue"') for each in named]
        table, printed, doubts = native_evaluate_under(folder_of(run), asked)
        scores = ProtocolScores.of_csv(table)
        scores.printed = printed
    for doubt in doubts:
        warnings.warn(doubt, stacklevel=2)
    return scores


def pairs(run: _Run) -> Pairs:
    """The results of a run pair by pair, from its folder. It warns of what is missing, as `report` does."""
    table, notes = native_pairs(folder_of(run))
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return Pairs.of_csv(table)


def _text(value: Any) -> str:
    return f"{value:.3f}" if isinstance(value, (float, np.floating)) else str(value)


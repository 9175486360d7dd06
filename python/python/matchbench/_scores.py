"""Scores of a run as a table: a dict of columns, which can be converted to a data frame."""

import importlib
import os
import warnings
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import evaluate as native_evaluate
from ._runs import Run

_ROW = ("dataset", "matcher", "estimator", "pairs", "failed")
_OF_POSES = ("auc", "sp5", "rotation_auc", "translation_auc", "ap5")
_OF_HOMOGRAPHIES = ("auc_h1", "auc_h3", "auc_h5", "mma3")


class Scores(dict[str, "list[str] | NDArray[Any]"]):
    """One row per dataset, matcher and estimator. Columns are names (lists) and numbers (arrays): every score of the
    report, and the ends `_low` and `_high` of its 95 % interval if it has one. `verdicts` says in sentences which
    method is best on each dataset, and whether that is significant."""

    verdicts: list[str]

    def to_pandas(self) -> Any:
        """As a pandas.DataFrame."""
        return _module("pandas").DataFrame(dict(self))

    def to_polars(self) -> Any:
        """As a polars.DataFrame."""
        return _module("polars").DataFrame(dict(self))

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


def evaluate(run: Run | str | os.PathLike[str]) -> Scores:
    """The scores of a run, from its folder. It warns if the run is not finished, or if the truth of a dataset looks wrong."""
    columns, verdicts, doubts = native_evaluate(run.path if isinstance(run, Run) else Path(run))
    for doubt in doubts:
        warnings.warn(doubt, stacklevel=2)
    scores = Scores(columns)
    scores.verdicts = verdicts
    return scores


def _text(value: Any) -> str:
    return f"{value:.3f}" if isinstance(value, (float, np.floating)) else str(value)


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{name} is not installed; `pip install {name}`, or use the columns as they are") from error

"""Tables as dicts of columns, which can be converted to data frames."""

import csv
import importlib
import io
from typing import Any, Literal, TypeVar, get_args, overload

import numpy as np
from numpy.typing import NDArray

_Name = Literal["dataset", "matcher", "estimator", "group", "protocol", "outcome", "otherwise"]
_NAMES = frozenset(get_args(_Name))
_Kind = TypeVar("_Kind", bound="Table")


class Table(dict[str, "list[str] | NDArray[Any]"]):
    """A dict of columns: names are lists of text, and numbers are arrays, with NaN for what is not known."""

    @overload
    def __getitem__(self, column: _Name, /) -> list[str]: ...  # pyright: ignore[reportOverlappingOverload]
    @overload
    def __getitem__(self, column: str, /) -> NDArray[Any]: ...
    def __getitem__(self, column: str, /) -> list[str] | NDArray[Any]:
        return super().__getitem__(column)

    def to_pandas(self) -> Any:
        """As a pandas.DataFrame."""
        return _module("pandas").DataFrame(dict(self))

    def to_polars(self) -> Any:
        """As a polars.DataFrame."""
        return _module("polars").DataFrame(dict(self))

    @classmethod
    def of_csv(cls: type[_Kind], text: str) -> _Kind:
        """The table in a CSV file of a report."""
        head, *rows = csv.reader(io.StringIO(text, newline=""))
        columns = zip(*rows, strict=True) if rows else [()] * len(head)
        return cls({name: _column(name, fields) for name, fields in zip(head, columns, strict=True)})

    def __repr__(self) -> str:
        rows = max(map(len, self.values()), default=0)
        return f"{type(self).__name__}({rows} row{'s' * (rows != 1)} of {', '.join(self)})"


def _column(name: str, fields: tuple[str, ...]) -> list[str] | NDArray[Any]:
    if name in _NAMES:
        return [_plain(field) for field in fields]
    if fields and all(map(str.isdigit, fields)):
        return np.array(fields, np.int64)
    return np.array([field or "nan" for field in fields], np.float64)


def _plain(field: str) -> str:
    """A name without the apostrophe that keeps spreadsheets from taking it for a formula."""
    return field[1:] if field.startswith(("'=", "'+", "'-", "'@", "'\t", "'\r")) else field


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{name} is not installed; `pip install {name}`, or use the columns as they are") from error

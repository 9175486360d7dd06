"""Converts arguments for the compiled module: parameters to JSON, one or several values to a list. The compiled module
checks values; what has a wrong type is refused here, with the name of the argument and what it takes."""

import json
import math
import operator
import os
from collections.abc import Mapping
from typing import Any, cast


def to_json(params: Mapping[str, Any]) -> str:
    """The parameters as JSON; numpy scalars become numbers."""

    return json.dumps(plain("params", params))


def several(name: str, given: Any, instead: str = "give a list") -> list[Any]:
    """The given values of the argument `name` as a list. A text, or any value that cannot be iterated over, is one value. Of
    a dict only the keys would be left; `instead` says what is given in its place."""
    if isinstance(given, Mapping):
        raise TypeError(f"{name}: a dict, whose values would be lost; {instead}")
    return [given] if isinstance(given, str) or not hasattr(given, "__iter__") or _is_matcher(given) else list(given)


def _is_matcher(given: Any) -> bool:
    """Whether it is one matcher written in Python, even if it can be iterated over, as the layers of a network can."""
    return callable(given) or all(callable(getattr(given, name, None)) for name in ("match", "extract"))


def plain(name: str, value: Any) -> Any:
    """The value of the parameter `name`, converted to types of JSON."""
    if hasattr(value, "item") and math.prod(value.shape) == 1:
        value = value.item()
    if isinstance(value, Mapping):
        given = cast("Mapping[str, Any]", value)
        return {text(name, inner, "names that are text"): plain(inner, each) for inner, each in given.items()}
    if isinstance(value, (list, tuple)):
        return [plain(name, each) for each in cast("list[Any]", value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name}: {value}, must be a finite number")
    if isinstance(value, str):
        return text(name, value, "text")
    if value is None or isinstance(value, (int, float)):
        return value
    raise refusal(name, value, "numbers, text, bool, None, a list or a dict")


def whole(name: str, given: Any, least: int, expected: str = "a whole number", most: int | None = None) -> int:
    """The argument `name`, which is what is `expected`, as a whole number from `least` to `most`."""
    try:
        number = operator.index(given)
    except TypeError:
        raise refusal(name, given, expected) from None
    if number < least:
        raise ValueError(f"{name}: {number}, must be at least {least}")
    if most is not None and number > most:
        raise ValueError(f"{name}: {number}, must be at most {most}")
    return number


def seed_of(given: Any, name: str = "seed") -> int:
    """The argument `name` as a seed, which has 64 bits."""
    return whole(name, given, 0, most=2**64 - 1)


def text(name: str, given: Any, expected: str) -> str:
    """The argument `name` as a text, which is what is `expected`. A surrogate is half of a character; Python has one for each
    byte of the name of a file that is no text."""
    if not isinstance(given, str):
        raise refusal(name, given, expected)
    if any("\ud800" <= character <= "\udfff" for character in given):
        raise ValueError(f"{name}: {given!r} has surrogates, which are no characters; give {expected}")
    return given


def path(name: str, given: Any, expected: str = "a path") -> str:
    """The argument `name` as a path, which is what is `expected`. An empty one would be the working folder. It may hold bytes
    that are no text."""
    name_of_file = os.fspath(cast("os.PathLike[str]", given)) if isinstance(given, os.PathLike) else given
    if name_of_file == "":
        raise ValueError(f"{name}: an empty text; give {expected}")
    if not isinstance(name_of_file, str):
        raise refusal(name, name_of_file, expected)
    return name_of_file


def refusal(name: str, given: Any, expected: str) -> TypeError:
    """The error for the argument `name` with a value of a wrong type."""
    return TypeError(f"{name}: a value of type {type(given).__name__}; give {expected}")

"""Converts arguments for the compiled module, which checks them: parameters to JSON, one or several values to a list."""

import json
import math
from collections.abc import Mapping
from typing import Any, cast


def to_json(params: Mapping[str, Any]) -> str:
    """The parameters as JSON; numpy scalars become numbers."""

    return json.dumps(_plain("params", params))


def several(given: Any) -> list[Any]:
    """The given values as a list. A name, or any value that cannot be iterated over, is one value."""
    return [given] if isinstance(given, str) or not hasattr(given, "__iter__") else list(given)


def _plain(name: str, value: Any) -> Any:
    """The value of the parameter `name`, converted to types of JSON."""
    if hasattr(value, "item") and math.prod(value.shape) == 1:
        value = value.item()
    if isinstance(value, Mapping):
        given = cast("Mapping[str, Any]", value)
        return {inner: _plain(inner, each) for inner, each in given.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(name, each) for each in cast("list[Any]", value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name}: {value}, must be a finite number")
    if value is None or isinstance(value, (str, int, float)):
        return value
    raise TypeError(f"{name}: a value of type {type(value).__name__}; give numbers, text, bool, None, a list or a dict")

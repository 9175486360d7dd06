"""Parameters as they cross to the compiled part, which checks them: JSON."""

import json
from collections.abc import Mapping
from typing import Any


def to_json(params: Mapping[str, Any]) -> str:
    """The parameters as JSON; numpy's numbers are numbers."""

    def plain(value: Any) -> Any:
        if hasattr(value, "item"):
            return value.item()
        message = f"a parameter has a value of type {type(value).__name__}; give numbers, text, bool, None or a dict"
        raise TypeError(message)

    return json.dumps(params, default=plain, allow_nan=False)

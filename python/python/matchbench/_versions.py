"""The version of a matcher written in Python that states none: a digest of its code.

A run is refused if it was begun with other code, as with another version of a program. The digest has the bytecode,
constants, defaults and simple values in closures of a function, or of all methods of a class. It does not see what is
called elsewhere, nor weights: whoever changes these states a `version`.
"""

import functools
import hashlib
import types
from typing import Any

_SIMPLE = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))


def version_of(given: Any) -> str:
    """What the matcher says, or `code` and eight digits."""
    stated = getattr(given, "version", None)
    if stated is not None:
        return str(stated)
    digest = hashlib.sha256()
    is_code = isinstance(given, (types.FunctionType, types.MethodType, functools.partial))
    _feed(digest, given if is_code else type(given), set())
    return f"code {digest.hexdigest()[:8]}"


def _feed(digest: Any, value: Any, seen: set[int]) -> None:
    """Adds a value to the digest, each function and class once."""
    if isinstance(value, _SIMPLE):
        digest.update(f"{type(value).__name__} {value!r};".encode())
        return
    if id(value) in seen:
        return
    seen.add(id(value))
    digest.update(f"{type(value).__name__}:".encode())
    for part in _parts(value):
        _feed(digest, part, seen)


def _parts(value: Any) -> list[Any]:
    """What a value is made of, in an order that does not depend on the process; nothing if that is not known."""
    match value:
        case types.CodeType():
            return [value.co_code, *value.co_names, *value.co_varnames, *value.co_consts]
        case types.FunctionType():
            return [value.__code__, value.__defaults__, value.__kwdefaults__, *map(_content, value.__closure__ or ())]
        case types.MethodType() | staticmethod() | classmethod():
            return [value.__func__]
        case property():
            return [value.fget, value.fset, value.fdel]
        case functools.partial():
            return [value.func, value.args, value.keywords]
        case type():
            classes = [each for each in value.__mro__ if each is not object]
            return [part for each in classes for _, part in sorted(vars(each).items(), key=lambda item: item[0])]
        case tuple() | list():
            return list(value)
        case set() | frozenset():
            return sorted(map(repr, value))
        case dict():
            return [part for key, item in sorted(value.items(), key=lambda item: repr(item[0])) for part in (key, item)]
        case _:
            return []


def _content(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None

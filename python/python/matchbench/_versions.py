"""The version of a matcher written in Python that states none: a digest of its code.

A run is refused if it was begun with other code, as with another version of a program. The digest has the bytecode,
constants, defaults, closures and global constants of a function, or of all methods of a class with the constants of the
class and, unless it has `params`, the attributes of the object; of a method also those of the object that it belongs to.
All of that as far as it is numbers, text, tuples and functions, and what the code itself does not change, with the
functions inside of it. Attributes called `workers`, which change no result, are left out.
It does not see what is called elsewhere, nor arrays or weights: whoever changes these states a `version`. Each version
of Python has bytecode of its own, so the version of the matcher names it.
"""

import dis
import functools
import hashlib
import sys
import types
from typing import Any

# Attributes on which no result depends.
_WITHOUT_EFFECT = {"workers"}
_SIMPLE = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))


def version_of(given: Any) -> str:
    """What the matcher says, or as in `code 1a2b3c4d of Python 3.12`."""
    stated = getattr(given, "version", None)
    if stated is not None:
        return str(stated)
    digest = hashlib.sha256()
    is_code = isinstance(given, (types.FunctionType, types.MethodType, functools.partial))
    seen: set[int] = set()
    _feed(digest, given if is_code else type(given), seen)
    if not is_code and getattr(given, "params", None) is None:
        for part in _items(_state(given)):
            _feed(digest, part, seen)
    major, minor, *_ = sys.version_info
    return f"code {digest.hexdigest()[:8]} of Python {major}.{minor}"


def _feed(digest: Any, value: Any, seen: set[int]) -> None:
    """Adds a value to the digest, each function and class once."""
    value = _plain(value)
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
    """What a value is made of, in an order that does not depend on the process. Nothing of what may change while the
    program runs (lists, dictionaries, objects), or is not known."""
    parts: Any = value
    match value:
        case types.CodeType():
            return [parts.co_code, *parts.co_names, *parts.co_varnames, *parts.co_consts]
        case types.FunctionType():
            own = [parts.__code__, parts.__defaults__, *_items(parts.__kwdefaults__)]
            return [*own, *_closure(parts), *_items(_globals(parts))]
        case types.MethodType():
            # A class has its constants, which are among its parts. Of an object the simple attributes decide.
            whose = parts.__self__
            return [parts.__func__, *([whose] if isinstance(whose, type) else [type(whose), *_items(_state(whose))])]
        case staticmethod() | classmethod():
            return [parts.__func__]
        case property():
            return [parts.fget, parts.fset, parts.fdel]
        case functools.partial():
            return [parts.func, parts.args, *_items(parts.keywords)]
        case type():
            return [part for each in parts.__mro__ if each is not object for part in _items(_own(each))]
        case tuple():
            return list(parts)
        case frozenset():
            return sorted(map(repr, parts))
        case _:
            return []


def _own(given: type) -> dict[str, Any]:
    """The methods and constants of a class that decide on results, without what Python notes of it by itself
    (`__firstlineno__`, `__doc__`)."""
    methods = (types.FunctionType, staticmethod, classmethod, property)
    noted = {name for name in vars(given) if name.startswith("__") and name.endswith("__")} | _WITHOUT_EFFECT
    return {name: value for name, value in vars(given).items() if name not in noted or isinstance(value, methods)}


def _state(given: object) -> dict[str, Any]:
    """The simple attributes of an object that none of its methods but `__init__` sets."""
    methods = [item for each in type(given).__mro__ for item in _own(each).items()]
    codes = [call.__code__ for name, call in methods if name != "__init__" and isinstance(call, types.FunctionType)]
    changed = {name for code in codes for name in _named(code, "STORE_ATTR")} | _WITHOUT_EFFECT
    values = {**_slots(given), **getattr(given, "__dict__", {})}
    return {name: value for name, value in values.items() if _is_simple(value) and name not in changed}


def _slots(given: object) -> dict[str, Any]:
    """The attributes of an object that stand in `__slots__` of its classes, not in its `__dict__`."""
    slots = [item for each in type(given).__mro__ for item in vars(each).items()]
    names = [name for name, slot in slots if isinstance(slot, types.MemberDescriptorType)]
    return {name: getattr(given, name) for name in names if hasattr(given, name)}


def _globals(function: types.FunctionType) -> dict[str, Any]:
    """The simple global values that a function reads and does not set."""
    code = function.__code__
    names = {name for name in _named(code, "LOAD_GLOBAL") if not name.startswith("__")}
    values = {name: function.__globals__[name] for name in names if name in function.__globals__}
    changed = _named(code, "STORE_GLOBAL")
    return {name: value for name, value in values.items() if _is_simple(value) and name not in changed}


def _is_simple(value: Any) -> bool:
    return isinstance(_plain(value), (*_SIMPLE, tuple))


def _plain(value: Any) -> Any:
    """A single number of numpy, or of what has arrays as it has, as the number of Python; other values as they are."""
    item, shape = getattr(value, "item", None), getattr(value, "shape", None)
    # The numbers of numpy that are numbers of Python too (`float64`) stay what they are.
    if item is None or isinstance(value, (*_SIMPLE, type)) or not (isinstance(shape, tuple) and shape == ()):
        return value
    number: Any = item()
    return number if isinstance(number, _SIMPLE) else value


def _named(code: types.CodeType, operation: str) -> set[str]:
    """The names that code sets, or reads, by this operation, with the functions, generators and comprehensions inside of it,
    which have code of their own."""
    named = {step.argval for step in dis.get_instructions(code) if step.opname == operation}
    inner = [part for part in code.co_consts if isinstance(part, types.CodeType)]
    return named.union(*(_named(part, operation) for part in inner))


def _items(values: Any) -> list[Any]:
    """Names and values, by name."""
    names: list[str] = sorted(values or ())
    return [part for name in names for part in (name, values[name])]


def _closure(function: Any) -> list[Any]:
    """The values that a function has from where it was defined, but for those that it changes, as a count of its calls."""
    changed = _named(function.__code__, "STORE_DEREF")
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return [_content(cell) for name, cell in cells if name not in changed]


def _content(cell: types.CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None

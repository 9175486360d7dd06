"""What a run is made of: datasets, matchers and estimators as users give them, in the form that the compiled module takes."""

import json
import os
import sys
from collections.abc import Mapping
from typing import Any, cast

from ._estimators import Estimator
from ._matchers import Matcher
from ._matches_from import MatchesFrom
from ._native import Dataset
from ._native import Estimator as NativeEstimator
from ._params import path, plain, refusal, several, text, to_json, whole
from ._versions import version_of

_MATCHER = (
    "a name, a manifest's path, matcher(...), MatchesFrom(...), a function of two images or an object with extract and match"
)
_LISTS = {
    "matchers": 'give a list, and parameters by matcher("orb", ratio=0.5) or in settings',
    "estimators": 'give a list, and parameters by estimator("best", threshold_px=1) or in settings',
}


def listed(name: str, given: Any) -> list[Any]:
    """One or several. Several names in one text, as on the command line, are refused."""
    found = several(name, given, _LISTS.get(name, "give a list"))
    for each in found:
        if isinstance(each, str) and "," in each and not os.path.exists(each):
            raise ValueError(f"{name}: {each!r} is one name; give a list: {[part.strip() for part in each.split(',')]}")
    return found


def some(name: str, given: Any, remedy: str) -> list[Any]:
    """One or several, but not none."""
    found = listed(name, given)
    if not found:
        raise ValueError(f"{name}: an empty list; {remedy}")
    return found


def changes(given: Any) -> list[str]:
    """Settings as on the command line: one text, several, or a dict of values."""
    expected = 'text, as in ["sift.ratio=0.7"], or a dict, as in {"sift.ratio": 0.7}'
    if not isinstance(given, Mapping):
        return [text("settings", each, expected) for each in several("settings", given)]
    values = cast("Mapping[Any, Any]", given)
    return [f"{text('settings', name, expected)}={json.dumps(plain(name, each))}" for name, each in values.items()]


def any_dataset(name: str, given: Any) -> Dataset:
    """A dataset, which is opened if it is given by the path of its folder."""
    return given if isinstance(given, Dataset) else Dataset.open(path(name, given, "a Dataset or the path of its folder"))


def any_estimator(name: str, given: Any) -> str | NativeEstimator:
    """An estimator as the compiled module takes it."""
    if isinstance(given, Estimator):
        if type(given) is not Estimator:
            own = f"{type(given).__name__} is a kind of Estimator, whose own methods a run would not call"
            raise TypeError(f"{name}: {own}; give what estimator(...) returns")
        return given.native
    return text(name, given, 'a name, as in "best", or estimator(...)')


def any_matcher(name: str, given: Any) -> Any:
    """A matcher as the compiled module takes it."""
    if isinstance(given, (str, os.PathLike)):
        expected = "a name or a manifest's path"
        return text(name, path(name, given, expected), expected)
    if isinstance(given, type):
        raise TypeError(f"{name}: {given.__name__} is a class; give an instance of it")
    if isinstance(given, MatchesFrom):
        return given.parts
    if isinstance(given, Matcher):
        if type(given) is not Matcher:
            own = f"{type(given).__name__} is a kind of Matcher, whose own methods a run would not call"
            raise TypeError(f"{name}: {own}; give an object with extract and match that uses one")
        return given.native
    matching = getattr(given, "match", None)
    extract = getattr(given, "extract", None)
    if not (callable(matching) and callable(extract)):
        matching, extract = given, None
    if not callable(matching):
        raise refusal(name, given, _MATCHER)
    called = str(getattr(given, "name", None) or getattr(given, "__name__", None) or type(given).__name__)
    text(f"{name}.name", called, "a name")
    color = bool(getattr(given, "color", False))
    workers = whole(f"{called}.workers", getattr(given, "workers", 1), 1)
    # More than can ever be at work are all of them.
    workers = min(workers, sys.maxsize)
    version = text(f"{called}.version", version_of(given), "text")
    return (called, version, to_json(getattr(given, "params", {})), matching, extract, color, workers)

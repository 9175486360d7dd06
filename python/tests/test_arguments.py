"""Arguments of a wrong type or form are refused with the name of the argument, and what it takes."""

import matchbench as mb
import numpy as np
import pytest


def refused(call, *words, kind=TypeError):
    """The call is refused in one line with all of these words."""
    with pytest.raises(kind) as caught:
        call()
    told = str(caught.value)
    assert all(word in told for word in words) and "\n" not in told, told


def test_matches_from_files_are_checked_where_they_are_described():
    def made(**options):
        return mb.MatchesFrom("lightglue", "matches.h5", **options)

    assert made(resized="640x480").parts == made(resized=(640, 480)).parts == made(resized=np.array([640, 480])).parts
    assert made(pixel_center=np.float32(0.5)).parts == made(pixel_center=0.5).parts
    assert made(notes={"v": 1, "threshold": 0.5}).parts[-1] == {"v": "1", "threshold": "0.5"}
    assert mb.MatchesFrom("one", ["a.h5", "b.h5"]).parts[1] == ["a.h5", "b.h5"]
    for size in ("640 x 480", "640", "640x-480", (640,), (640, 480, 3), 640):
        refused(lambda size=size: made(resized=size), "resized: ", '(640, 480) or "640x480"', kind=ValueError)
    refused(lambda: made(resized=(640, 480.5)), "resized: a value of type float; give a whole number")
    refused(lambda: made(resized="0x480"), "resized: 0, must be at least 1", kind=ValueError)
    for center in ("corner", 1, 0.25, float("nan")):
        refused(lambda center=center: made(pixel_center=center), "pixel_center: ", "give 0 ", "0.5", kind=ValueError)
    refused(lambda: made(notes=["v"]), "notes: a value of type list; give a dict")
    refused(lambda: made(notes={1: "v"}), "notes: a value of type int; give names")
    refused(lambda: made(format=7), "format: a value of type int")
    refused(lambda: made(verified="no"), "verified: a value of type str; give True or False")
    refused(lambda: mb.MatchesFrom("one", [7]), "files: a value of type int; give a path")
    refused(lambda: mb.MatchesFrom(7, "matches.h5"), "name: a value of type int; give a name")


def test_what_a_run_is_made_of_is_named_where_it_is_wrong(dataset, tmp_path):
    def start(data=dataset, matchers="orb", estimators="best", **options):
        return lambda: mb.run(data, matchers, estimators, out=tmp_path / "run", progress=False, **options)

    refused(start([dataset, 7]), "dataset: a value of type int; give a Dataset or the path of its folder")
    refused(start(matchers=["orb", 7]), "matchers: a value of type int; give a name", "a function of two images")
    refused(start(matchers=[mb.ORB]), "matchers: ORB is a class; give an instance of it")
    refused(start(estimators=[mb.matcher("orb")]), "estimators: a value of type Matcher; give a name", "estimator(...)")
    refused(start(protocols=["roma", 7]), "protocols: a value of type int; give a name")
    refused(start(settings=[7]), 'settings: a value of type int; give text, as in "sift.ratio=0.7"')
    for name in ("seed", "repeat", "limit", "sample", "time_budget_ms", "threads"):
        for wrong in ("3", 1.5):
            refused(start(**{name: wrong}), f"{name}: a value of type {type(wrong).__name__}; give a whole number")
    refused(start(seed=-1), "seed: -1, must be at least 0", kind=ValueError)
    assert not (tmp_path / "run").exists()
    assert mb.run(str(dataset.path), "orb", out=tmp_path / "run", limit=np.int64(1), progress=False).total == 1

    refused(lambda: mb.show(7, 0, 1), "dataset: a value of type int")
    refused(lambda: mb.show(dataset, "0", 1), "a: a value of type str; give a whole number")
    refused(lambda: mb.show(dataset, 0, 1, ["orb"]), "matcher: a value of type list; give a name")
    refused(lambda: mb.show(dataset, 0, 1, "orb", ["best"]), "estimator: a value of type list; give a name")

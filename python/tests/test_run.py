"""Runs from Python: matchers written there, Ctrl-C, tables, reports."""

import _thread
import dataclasses
import functools
import json
import os
import pathlib
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings

import matchbench as mb
import numpy as np
import pytest
from conftest import command, stored_matches
from matchbench._versions import version_of


def by_orb(image_a, image_b):
    """A function of two images."""
    a, b = (mb.ORB().extract(image) for image in (image_a, image_b))
    found = mb.match(a, b)
    return a.keypoints[found.indices[:, 0]], b.keypoints[found.indices[:, 1]], found.ambiguity


class Staged:
    """Features first, then their matches."""

    name = "staged-sift"
    version = "1.2"
    params = {"ratio": 0.7}

    def __init__(self):
        self.extracted = 0

    def extract(self, image):
        self.extracted += 1
        return mb.SIFT().extract(image)

    def match(self, a, b):
        found = mb.match(a, b, ratio=self.params["ratio"])
        return a.keypoints[found.indices[:, 0]], b.keypoints[found.indices[:, 1]], found.ambiguity


def outcomes(run, name):
    files = list(run.path.glob(f"records/*/{name}+*.jsonl"))
    return [json.loads(line)["outcome"] for path in files for line in path.read_text().splitlines()]


def test_a_sample_is_taken_out_of_what_the_limit_leaves(dataset, tmp_path):
    assert len(dataset.pairs) == 3
    for name, options, tasks in [("sample", {"sample": 2}, 2), ("both", {"limit": 1, "sample": 2}, 1)]:
        run = mb.run(dataset, "orb", "ransac-e", out=tmp_path / name, progress=False, **options)
        assert run.total == tasks and run.is_complete
        assert json.loads((run.path / "plan.json").read_text())["settings"]["sample"] == 2


def test_a_run_grows_and_runs_are_joined(dataset, tmp_path):
    """A part first, then more pairs and repetitions; another matcher elsewhere; all of it in one run."""
    first = mb.run(dataset, "orb", "ransac-e", out=tmp_path / "a", sample=1)
    grown = mb.run(dataset, "orb", "ransac-e", out=tmp_path / "a", repeat=2)
    assert (grown.before, grown.is_complete) == (first.total, True) and grown.total > first.total
    other = mb.run(dataset, "brisk", "ransac-e", out=tmp_path / "b", repeat=2)
    joined = mb.join([grown, tmp_path / "b"], out=tmp_path / "all")
    assert joined.is_complete and joined.total == grown.total + other.total
    both = mb.run(dataset, ["orb", "brisk"], "ransac-e", out=tmp_path / "both", repeat=2)
    scores = [mb.evaluate(run) for run in (joined, both)]
    for name in ("matcher", "auc", "pairs"):
        np.testing.assert_array_equal(scores[0][name], scores[1][name])
    with pytest.raises(mb.Error, match="holds a run already"):
        mb.join([grown, other], out=tmp_path / "all")
    with pytest.raises(ValueError, match="give at least one"):
        mb.join([], out=tmp_path / "none")


def test_matchers_written_in_python_stand_beside_the_others(dataset, tmp_path):
    staged = Staged()
    matchers = ["sift", mb.matcher("orb", ratio=0.8), by_orb, staged]
    run = mb.run(dataset, matchers, ["best"], out=tmp_path / "run", threads=1, progress=False)
    assert run.is_complete and run.failed == 0
    assert staged.extracted == len(dataset)
    # The same matches, as points alone; the seeds differ by the name.
    natives, ours = (stored_matches(run.path / "matches" / dataset.name / f"{name}.bin") for name in ("orb", "by_orb"))
    assert natives.keys() == ours.keys()
    for pair, matches in ours.items():
        assert natives[pair].shape[1] == 7 and np.array_equal(matches, natives[pair][:, :5])
    plan = json.loads((run.path / "plan.json").read_text())
    entry = next(matcher for matcher in plan["matchers"] if matcher["id"] == "staged-sift")
    assert entry["version"] == "1.2" and entry["params"] == {"ratio": 0.7}
    scores = mb.evaluate(run)
    assert scores["matcher"] == ["sift", "orb", "by_orb", "staged-sift"]
    assert scores["auc"].shape == (4,) and scores["auc"].max() > 0
    assert np.isnan(scores["auc_low"]).all()  # three pairs are too few for an interval
    assert "by_orb" in str(scores) and "<table>" in scores._repr_html_()
    assert mb.report(run, pictures=1).read_text().count("staged-sift") > 0


def test_a_matcher_that_breaks_costs_its_pairs_and_is_tried_again(dataset, tmp_path):
    def broken(a, b):
        raise RuntimeError("out of luck")

    answers = {
        "out of luck": broken,
        "a matcher returns": lambda a, b: 7,
        "this one returned a tuple of 4 values": lambda a, b: ([1], [2], [3], [4]),
        "this one returned an array of float64 with shape [5, 4]": lambda a, b: np.zeros((5, 4)),
        "points_b": lambda a, b: (np.zeros((3, 2)), np.zeros((3, 3))),
        "3 points in a, 2 in b": lambda a, b: (np.zeros((3, 2)), np.zeros((2, 2))),
        "ambiguity": lambda a, b: (np.zeros((1, 2)), np.zeros((1, 2)), np.array([2.0])),
        "`points_a` has 100000000000 rows; 5000000 are the most": lambda a, b: (
            np.broadcast_to(np.float32(1), (10**11, 2)),
            np.broadcast_to(np.float32(1), (10**11, 2)),
        ),
        "`points_b` has (-7, 1), outside": lambda a, b: (np.ones((1, 2)), np.array([[-7.0, 1.0]])),
    }
    for number, (words, broken_matcher) in enumerate(answers.items()):
        broken_matcher.__name__ = "one"
        out = tmp_path / str(number)
        run = mb.run(dataset, [broken_matcher], ["best"], out=out, limit=1, progress=False)
        (outcome,) = outcomes(run, "one")
        assert run.failed == 1 and words in outcome["reason"], outcome
    assert "test_run.py:" in outcomes(mb.run(dataset, [answers["out of luck"]], ["best"], out=tmp_path / "0",
                                             limit=1, progress=False), "one")[0]["reason"]  # fmt: skip

    with pytest.warns(UserWarning, match="out of luck"):
        mb.run(dataset, [answers["out of luck"]], ["best"], out=tmp_path / "0", limit=1, progress=False)

    def mended(a, b):
        return by_orb(a, b)

    mended.__name__ = "one"
    with pytest.raises(mb.Error, match="the code of the matcher `one` was another, `code "):
        mb.run(dataset, [mended], ["best"], out=tmp_path / "0", limit=1, progress=False)
    plan = json.loads((tmp_path / "0" / "plan.json").read_text())
    mended.version = plan["matchers"][0]["version"]  # the other results stay as they are
    run = mb.run(dataset, [mended], ["best"], out=tmp_path / "0", limit=1, progress=False)
    assert run.failed == 0 and outcomes(run, "one")[0]["kind"] == "pose"


def test_other_code_is_another_version():
    def one(ratio, words=("a", 1.5), names=frozenset({"x", "y"})):
        return lambda a, b: (ratio, a, words, len(names))

    def other(ratio, words=("a", 1.5), names=frozenset({"x", "y"})):
        return lambda a, b: (ratio, b, words, len(names))

    class Staged:
        def __init__(self, size):
            self.size = size

        def extract(self, image):
            return image[: self.size]

        def match(self, a, b):
            return a, b

    class Inverse(Staged):
        def match(self, a, b):
            return b, a

    assert version_of(one(0.5)) == version_of(one(0.5)) != version_of(one(0.6))
    versions = [version_of(given) for given in (one(0.5), other(0.5), one, other, Staged(3), Inverse(3))]
    assert len(set(versions)) == len(versions) and all(version.startswith("code ") for version in versions)
    assert version_of(Staged(3)) == version_of(Staged(3)) != version_of(Staged(4))

    class Counting(Staged):
        def match(self, a, b):
            self.size += 1
            return a, b

    class Stated(Staged):
        params = {"what": "decides"}

    assert version_of(Counting(3)) == version_of(Counting(4)), "what a method sets is what it remembers"
    assert version_of(Stated(3)) == version_of(Stated(4)), "params say what decides"

    class Parallel(Staged):
        workers = 2

    class Serial(Staged):
        pass

    with_workers = Staged(3)
    with_workers.workers = 4
    assert version_of(with_workers) == version_of(Staged(3)), "workers change no result"
    assert version_of(Parallel(3)) == version_of(Serial(3))
    by_constant = [eval("lambda a, b: (a, b, LIMIT)", {"LIMIT": limit}) for limit in (1, 1, 2)]
    assert version_of(by_constant[0]) == version_of(by_constant[1]) != version_of(by_constant[2])
    assert version_of(functools.partial(one, 1)) != version_of(functools.partial(one, 2))
    seen = []
    counting = one(0.5, words=seen)
    before = version_of(counting)
    seen.append(1)
    assert version_of(counting) == before, "what a matcher remembers is not its code"
    calls = 0

    def counted(a, b):
        nonlocal calls
        calls += 1

    before = version_of(counted)
    counted(1, 2)
    assert calls == 1 and version_of(counted) == before
    stated = one(0.5)
    stated.version = 2
    assert version_of(stated) == "2"
    # Code inside of a function has globals of its own, which are read but not set.
    for inner in ("[a for _ in b if LIMIT]", "sum(LIMIT for _ in b)", "(lambda: LIMIT)()", "[[LIMIT for _ in a] for _ in b]"):
        first, same, another = (version_of(eval(f"lambda a, b: {inner}", {"LIMIT": limit})) for limit in (1, 1, 2))
        assert first == same != another, inner
    within = {"CALLS": 0}
    exec("def counting(a, b):\n    def count():\n        global CALLS\n        CALLS += 1\n    count()", within)
    before = version_of(within["counting"])
    within["counting"](1, 2)
    assert within["CALLS"] == 1 and version_of(within["counting"]) == before
    # What a method belongs to is an object with attributes, or a class with constants.
    assert version_of(Staged(3).match) == version_of(Staged(3).match) != version_of(Staged(4).match)
    assert version_of(Counting(3).extract) == version_of(Counting(4).extract)
    small, same, large = (type("Sized", (), {"size": size, "pair": classmethod(one)}).pair for size in (1, 1, 2))
    assert version_of(small) == version_of(same) != version_of(large)

    @dataclasses.dataclass(slots=True)
    class Slotted:
        ratio: object
        calls: int = 0

        def __call__(self, a, b):
            self.calls += 1

    class Derived(Slotted):
        pass

    for kind in (Slotted, Derived):
        assert version_of(kind(0.7)) == version_of(kind(0.7, calls=1)) != version_of(kind(0.8)), kind
    # One number of numpy is a number, wherever it stands.
    for number in (np.float32, np.int64, np.array):
        for made in (Slotted, Staged, one, lambda value: eval("lambda a, b: LIMIT", {"LIMIT": value})):
            first, same, another = (version_of(made(number(value))) for value in (1, 1, 2))
            assert first == same != another, (number, made)
    assert version_of(Staged(np.ones(2))) == version_of(Staged(np.zeros(2))), "arrays are not seen"


def test_a_version_does_not_depend_on_the_process_or_the_line():
    code = """
from matchbench._versions import version_of
def matcher(a, b, names=frozenset(("x", "y", "z"))):
    return a if b in {"one", "two", "three"} else sorted(names)
class Matcher:
    ratio = RATIO
    def extract(self, image):
        return image
    def match(self, a, b):
        return a, b
print(version_of(matcher), version_of(Matcher()))
"""
    def printed(seed, code):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        return subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True).stdout

    code, other = code.replace("RATIO", "0.8"), code.replace("RATIO", "0.7")
    moved = code.replace("class Matcher:", '\n\nclass Matcher:\n    """What it is."""\n')
    versions = printed("1", code)
    assert versions == printed("2", code) == printed("1", moved)
    assert versions.split() != printed("1", other).split()
    assert versions.count(b"of Python %d.%d" % sys.version_info[:2]) == 2


def test_a_matcher_may_see_colours(tmp_path):
    gradient = np.dstack(np.broadcast_arrays(np.arange(64), np.arange(48)[:, None], 255 - np.arange(64))).astype(np.uint8)
    (tmp_path / "images").mkdir()
    for number in range(2):
        header = f"P6 64 48 255\n".encode()
        (tmp_path / "images" / f"{number}.ppm").write_bytes(header + gradient.tobytes())
    (tmp_path / "camera.txt").write_text("50 0 32\n0 50 24\n0 0 1\n")
    (tmp_path / "poses.txt").write_text("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n")
    seen = []

    def by_colour(a, b):
        seen.append(a)
        raise RuntimeError("enough")

    by_colour.color = True
    dataset = mb.import_dataset("folder", tmp_path, tmp_path / "out", pairs="all")
    with pytest.warns(UserWarning, match="enough"):
        mb.run(dataset, by_colour, ["best"], out=tmp_path / "run", progress=False)
    assert np.array_equal(seen[0], gradient)


def test_evaluate_warns_of_a_run_that_is_not_finished(dataset, tmp_path):
    run = mb.run(dataset, "orb", ["best"], out=tmp_path / "run", progress=False)
    (records,) = (run.path / "records").rglob("*.jsonl")
    lines = records.read_text().splitlines(keepends=True)
    records.write_text("".join(lines[:-1]))
    with pytest.warns(UserWarning, match="2 of 3 planned tasks"):
        mb.evaluate(run)


def test_an_interrupt_loses_nothing(dataset, tmp_path):
    calls = []

    def slow(a, b):
        calls.append(None)
        if len(calls) == 2:
            _thread.interrupt_main()
            time.sleep(0.3)
        return by_orb(a, b)

    with pytest.raises(KeyboardInterrupt):
        mb.run(dataset, [slow], ["best"], out=tmp_path / "run", threads=1, progress=False)
    done = len(calls)
    assert 2 <= done < len(dataset.pairs)
    run = mb.run(dataset, [slow], ["best"], out=tmp_path / "run", threads=1, progress=False)
    assert run.before == done and run.is_complete and len(calls) == len(dataset.pairs)
    whole = mb.run(dataset, [slow], ["best"], out=tmp_path / "whole", threads=2, progress=False)
    assert outcomes(run, "slow") == outcomes(whole, "slow")


def test_other_threads_go_on_meanwhile(images):
    """The interpreter is released while features are found."""
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.wait(0.001):
            ticks.append(None)

    clock = threading.Thread(target=tick)
    clock.start()
    before = len(ticks)
    large = np.tile(images[0], (3, 3))
    mb.SIFT().extract(large)
    during = len(ticks) - before
    stop.set()
    clock.join()
    assert during > 5


def test_progress_is_told_and_may_interrupt(dataset, tmp_path):
    told = []
    mb.run(dataset, ["orb"], ["best"], out=tmp_path / "a", progress=lambda *state: told.append(state))
    assert told[-1] == (len(dataset.pairs), len(dataset.pairs), dataset.name, "orb")

    def enough(done, total, *_):
        raise StopIteration

    with pytest.raises(StopIteration):
        mb.run(dataset, ["orb"], ["best"], out=tmp_path / "b", progress=enough)


def test_progress_that_raises_is_not_called_again(dataset, tmp_path):
    calls = []

    def slow(image_a, image_b):
        time.sleep(0.3)
        return np.zeros((0, 2)), np.zeros((0, 2))

    def breaks(*state):
        calls.append(state)
        raise ValueError(f"call {len(calls)}")

    with pytest.raises(ValueError, match="call 1"):
        mb.run(dataset, [slow], ["best"], out=tmp_path / "run", threads=1, progress=breaks)
    assert len(calls) == 1


def test_wrong_runs_are_refused_in_words(dataset, tmp_path):
    def start(matchers=("sift",), estimators=("best",), **options):
        return mb.run(dataset, matchers, estimators, out=tmp_path / "run", progress=False, **options)

    with pytest.raises(ValueError, match="did you mean `sift`"):
        start(["sfit"])
    with pytest.raises(ValueError, match="did you mean `best`"):
        start(estimators=["bset"])
    with pytest.raises(ValueError, match="is not part of this run"):
        start(settings=["orb.ratio=0.7"])
    with pytest.raises(TypeError, match="a function of two images"):
        start([7])
    with pytest.raises(ValueError, match="matchers: an empty list; give at least one"):
        start([])
    with pytest.raises(ValueError, match="estimators: an empty list; leave it out"):
        start(estimators=[])
    with pytest.raises(ValueError, match="dataset: an empty list; give at least one"):
        mb.run([], "sift", out=tmp_path / "run", progress=False)
    for name in ("threads", "repeat", "time_budget_ms", "limit", "sample"):
        for count in (0, -1):
            with pytest.raises(ValueError, match=f"^{name}: {count}, must be at least 1"):
                start(**{name: count})
    with pytest.raises(mb.Error, match="nothing"):
        mb.Dataset.open(tmp_path / "nothing")
    with pytest.raises(mb.Error, match="nothing"):
        mb.evaluate(tmp_path / "nothing")
    started = start(["orb"], threads=10**9)  # no more than the cores make use of
    with pytest.raises(mb.Error, match="plan"):
        start(["orb"], seed=1)
    with pytest.raises(mb.Error, match="is a dataset, and a run needs a folder of its own"):
        mb.run(dataset, "orb", out=dataset.path, progress=False)
    with pytest.raises(ValueError, match="give one of the two"):
        mb.report(started, out=tmp_path / "report", bundle=tmp_path / "report.html")


def test_one_is_a_list_of_one(dataset, tmp_path):
    def plan(name, *arguments, **options):
        mb.run(dataset, *arguments, out=tmp_path / name, limit=1, progress=False, **options)
        return json.loads((tmp_path / name / "plan.json").read_text())

    lists = plan("lists", ["orb"], ["best"], settings=["orb.ratio=0.7"])
    assert plan("one", "orb", "best", settings="orb.ratio=0.7") == lists
    assert plan("objects", mb.matcher("orb", ratio=0.7), mb.estimator("best")) == lists
    assert [matcher["id"] for matcher in plan("function", by_orb)["matchers"]] == ["by_orb"]
    with pytest.raises(ValueError, match="did you mean `sift`"):
        plan("wrong", "sfit")


def test_a_matcher_that_can_be_iterated_over_is_one(dataset, tmp_path):
    class Layers:
        """As the layers of a network."""

        def __iter__(self):
            return iter(["orb", "brisk"])

    class Staged(Layers):
        def extract(self, image):
            return image.shape

        def match(self, a, b):
            return np.ones((3, 2)), np.ones((3, 2))

    class Called(Layers):
        def __call__(self, a, b):
            return np.ones((3, 2)), np.ones((3, 2))

    for matcher, names in [(Staged(), ["Staged"]), (Called(), ["Called"]), (Layers(), ["orb", "brisk"])]:
        run = mb.run(dataset, matcher, "best", out=tmp_path / names[0], limit=1, progress=False)
        assert run.failed == 0 and mb.evaluate(run)["matcher"] == names


def without_times(folder):
    """The plan of a run, and its records by file."""
    kept = {"plan": json.loads((folder / "plan.json").read_text())}
    for path in folder.glob("records/*/*.jsonl"):
        records = [json.loads(line) for line in path.read_text().splitlines()]
        for record in records:
            record.pop("times"), record.pop("check")  # of the line, times and all
        kept[path.name] = records
    return kept


def test_protocols_are_those_of_the_command_line(dataset, tmp_path):
    run = mb.run(dataset, ["orb"], out=tmp_path / "python", protocols=["superglue", "roma"], progress=False)
    options = ("--matchers", "orb", "--protocol", "superglue,roma", "--out", tmp_path / "command")
    assert command("run", dataset.path, *options).returncode == 0
    found = without_times(run.path)
    assert found == without_times(tmp_path / "command") and len(found) == 3
    # RoMa's protocol repeats; a number that is given wins.
    repeats = found["plan"]["settings"]["repetitions"]
    assert repeats > 1
    once = mb.run(dataset, "orb", out=tmp_path / "once", protocols="roma", repeat=1, progress=False)
    assert once.total == 3 and run.total == 2 * 3 * repeats
    # One protocol alone says how large images are, unless the matcher does.
    asked = mb.matcher("orb", extractor={"max_size": 200})
    run = mb.run(dataset, [asked], out=tmp_path / "asked", protocols="roma", repeat=1, progress=False)
    sizes = [without_times(each.path)["plan"]["matchers"][0]["params"]["extractor"] for each in (once, run)]
    assert "max_size" not in sizes[0] or sizes[0]["max_size"] != 200
    assert sizes[1]["max_size"] == 200
    with pytest.raises(ValueError, match="did you mean `superglue`"):
        mb.run(dataset, "orb", out=tmp_path / "wrong", protocols="superglu", progress=False)


def test_objects_have_what_a_protocol_sets_but_for_what_they_were_given(dataset, tmp_path):
    def plan(name, matcher, estimator):
        out = tmp_path / name
        mb.run(dataset, matcher, estimator, out=out, protocols="loftr", limit=1, progress=False)
        return json.loads((out / "plan.json").read_text())

    by_name = plan("name", "orb", "ransac-e-inliers")
    objects = mb.matcher("orb"), mb.estimator("ransac-e-inliers")
    assert plan("objects", *objects) == by_name
    assert plan("copies", *(pickle.loads(pickle.dumps(each)) for each in objects)) == by_name
    given = plan("given", mb.matcher("orb", ratio=0.7), mb.estimator("ransac-e-inliers", threshold_px=1))
    (own,), (other,) = (each["matchers"] for each in (by_name, given))
    judged = [matcher["estimators"][0]["params"] for matcher in (own, other)]
    assert [params["threshold_px"] for params in judged] == [0.5, 1]
    assert judged[1] == {**judged[0], "threshold_px": 1} and judged[0]["confidence"] == 0.99999
    assert other["params"] == {**own["params"], "ratio": 0.7} and own["params"]["extractor"]["max_size"] == 840


def test_matches_are_read_from_files(dataset, tmp_path):
    folder = tmp_path / "matches"
    folder.mkdir()
    found = {}
    for a, b in dataset.pairs[:2]:
        points_a, points_b, _ = by_orb(dataset.read(a), dataset.read(b))
        found[int(a), int(b)] = points = np.column_stack([points_a, points_b]).astype(np.float32)
        stems = [dataset.images[frame].stem for frame in (a, b)]
        np.savez(
            folder / f"{stems[0]}_{stems[1]}_matches.npz",
            keypoints0=points[:, :2],
            keypoints1=points[:, 2:],
            matches=np.arange(len(points)),
            match_confidence=np.ones(len(points), np.float32),
        )
    files = mb.MatchesFrom("orb-files", folder, resized=(320, 240), notes={"device": "none"})
    with pytest.warns(UserWarning, match="orb-files on cabinet: absent: 1 pair"):
        run = mb.run(dataset, ["sift", files], "best", out=tmp_path / "run", progress=False)
    assert run.total == 6 and run.failed == 1
    kept = stored_matches(run.path / "matches" / dataset.name / "orb-files.bin")
    assert kept.keys() == found.keys()
    for pair, points in found.items():
        np.testing.assert_array_equal(kept[pair][:, :4], points)
    plan = json.loads((run.path / "plan.json").read_text())
    assert [matcher["id"] for matcher in plan["matchers"]] == ["sift", "orb-files"]
    # Read for images of half that size, points are twice as far.
    half = mb.MatchesFrom("half", [folder], format="superglue", resized=(160, 120))
    with pytest.raises(mb.Error, match="matches of half: .*outside"):
        mb.run(dataset, half, out=tmp_path / "half", progress=False)
    for wrong, words in [
        (mb.MatchesFrom("sift", folder, resized=(320, 240)), "that name is taken"),
        (mb.MatchesFrom("one", folder, format="superglu"), "superglue"),
    ]:
        with pytest.raises(ValueError, match=words):
            mb.run(dataset, wrong, out=tmp_path / "wrong", progress=False)
    with pytest.raises(mb.Error, match="nowhere"):
        mb.run(dataset, mb.MatchesFrom("one", tmp_path / "nowhere"), out=tmp_path / "wrong", progress=False)


def test_parameters_are_given_in_one_place(dataset, tmp_path):
    for matcher, estimator, setting in [
        (mb.matcher("orb"), "best", "orb.ratio=0.7"),
        ("orb", mb.estimator("best"), "best.threshold_px=2"),
    ]:
        with pytest.raises(ValueError, match="give them in one place"):
            mb.run(dataset, matcher, estimator, out=tmp_path / "run", settings=setting, progress=False)


def test_none_is_no_ambiguity(dataset, tmp_path):
    def certain(a, b):
        return *by_orb(a, b)[:2], None

    run = mb.run(dataset, certain, "best", out=tmp_path / "run", limit=1, progress=False)
    assert run.failed == 0
    (kept,) = stored_matches(run.path / "matches" / dataset.name / "certain.bin").values()
    assert len(kept) > 0 and (kept[:, 4] == 0.5).all(), "as of a matcher that returns none"


def test_what_python_code_must_not_do_is_refused_or_fails_its_pairs(dataset, tmp_path):
    def start(matcher, out, **options):
        return mb.run(dataset, ["orb", matcher], ["best"], out=tmp_path / out, limit=1, progress=False, **options)

    def sift(a, b):
        return np.empty((0, 2)), np.empty((0, 2))

    with pytest.raises(mb.Error, match="`sift` is the name of something built in"):
        start(sift, "forged")  # it would be the baseline of the tables
    assert not (tmp_path / "forged" / "plan.json").exists()

    def painted(a, b):
        raise RuntimeError("\x1b[31mred\u202e")

    with pytest.warns(UserWarning) as said:
        start(painted, "painted")
    words = "".join(str(warning.message) for warning in said)
    assert "\\u001b[31mred\\u202e" in words and "\x1b" not in words
    painted.version = "\x1b[31m1"
    with pytest.raises(ValueError, match="version: .* cannot be printed"):
        start(painted, "version")

    def endless(a, b):
        return range(10**12)

    with pytest.warns(UserWarning, match="a matcher returns"):
        assert start(endless, "endless").failed == 1
    with pytest.raises(ValueError, match="distortion: 1000000000000 values"):
        mb.Camera(1, 1, 1, 1, range(10**12))

    def gone(a, b):
        shutil.rmtree(tmp_path / "gone")
        return by_orb(a, b)

    with pytest.raises(mb.Error, match="removed while it ran"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start(gone, "gone")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_child_that_a_matcher_forks_does_not_go_on_with_the_run(dataset, tmp_path):
    script = f"""
import os, sys
import matchbench as mb
import numpy as np
def forking(a, b):
    if os.fork():
        os.wait()
    points = np.random.default_rng(0).uniform(10, 200, (40, 2))
    return points, points
dataset = mb.Dataset.open({str(dataset.path)!r})
run = mb.run(dataset, forking, ["best"], out={str(tmp_path / "run")!r}, threads=1, progress=False)
print(run.now)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.stdout == "3\n", done.stderr
    (records,) = (tmp_path / "run" / "records").glob("*/forking+best.jsonl")
    assert len(records.read_text().splitlines()) == 3


def test_nothing_is_written_over_a_run_or_a_dataset(dataset, command_line_run, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(command_line_run, run)
    for target in (run / "plan.json", *run.glob("records/*/orb+best.jsonl"), dataset.path / "pairs.txt"):
        before = target.read_bytes()
        with pytest.raises(mb.Error, match="it belongs to the (run|dataset)"):
            mb.report(run, bundle=target)
        done = command("eval", run, "--out", target)
        assert done.returncode == 1 and "choose another" in done.stderr
        assert target.read_bytes() == before
    with pytest.raises(mb.Error, match="it belongs to the run"):
        mb.report(run, out=run / "records")
    assert mb.report(run, bundle=run / "report.html").is_file()


def test_a_manifest_beside_a_name(dataset, tmp_path):
    manifest = tmp_path / "absent.toml"
    manifest.write_text('name = "absent"\nsummary = "a program that is not there"\nreference = ""\ncommand = ["./none"]\n')
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = mb.run(dataset, ["orb", str(manifest)], ["best"], out=tmp_path / "run", progress=False)
    assert run.is_complete and any("absent" in str(warning.message) for warning in said)


def test_a_table_shows_the_scores_that_a_run_has(dataset, command_line_run, tmp_path):
    of_poses = mb.evaluate(command_line_run)
    assert str(of_poses).splitlines()[0].split()[5:9] == ["auc", "sp5", "rotation_auc", "translation_auc"]
    wall = mb.rendered_scene("mural", tmp_path / "scenes", frames=3, size=(160, 120))
    run = mb.run(wall, "orb", "best-h", out=tmp_path / "run", progress=False)
    scores = mb.evaluate(run)
    head, row = (line.split() for line in str(scores).splitlines()[:2])
    assert head[5:] == ["auc_h1", "auc_h3", "auc_h5", "mma3"] and len(row) == len(head) and "nan" not in row
    assert "<th>auc_h3</th>" in scores._repr_html_() and "<th>auc</th>" not in scores._repr_html_()


def test_tables_become_data_frames_where_there_is_a_library(dataset, command_line_run):
    scores = mb.evaluate(command_line_run)
    assert len(scores["auc"]) == 4
    for name, convert in (("pandas", scores.to_pandas), ("polars", scores.to_polars)):
        try:
            __import__(name)
        except ImportError:
            with pytest.raises(ImportError, match=f"pip install {name}"):
                convert()
        else:
            assert list(convert().columns) == list(scores)


def test_datasets_are_imported(dataset, images, tmp_path):
    source = tmp_path / "source"
    (source / "images").mkdir(parents=True)
    for number, path in enumerate(dataset.images):
        data = open(path, "rb").read()
        (source / "images" / f"{number}.png").write_bytes(data)
    camera = dataset.camera(0)
    (source / "K.txt").write_text(f"{camera.fx} 0 {camera.cx}\n0 {camera.fy} {camera.cy}\n0 0 1\n")
    lines = [f"{i} {i} 0 0 0 0 0 1" for i in range(len(dataset))]
    (source / "poses.txt").write_text("\n".join(lines) + "\n")
    imported = mb.import_dataset("folder", source, tmp_path / "out", pairs="all", property="a cabinet")
    assert 'property = "a cabinet"' in (tmp_path / "out" / "dataset.toml").read_text()
    assert len(imported) == 4 and len(imported.pairs) == 6 and imported.camera(3) == camera
    assert np.array_equal(mb.read_gray(imported.images[0]), images[0])
    # The body goes along its x, which is up for the camera on it.
    (source / "on-body.txt").write_text("0 -1 0 0\n1 0 0 0\n0 0 1 0\n")
    mb.import_dataset("folder", source, tmp_path / "on-body", pairs="all", body_from_camera=source / "on-body.txt")
    first = np.array((tmp_path / "on-body" / "pairs.txt").read_text().split()[2:14], float).reshape(3, 4)
    assert np.allclose(first, np.column_stack([np.eye(3), [0, 1, 0]]))
    with pytest.raises(mb.Error, match="use one of"):
        mb.import_dataset("flickr", source, tmp_path / "other")
    with pytest.raises(ValueError, match="link"):
        mb.import_dataset("folder", source, tmp_path / "other", images="steal")


def test_true_homographies_are_rows_of_their_file(dataset, tmp_path):
    folder = tmp_path / "plane"
    shutil.copytree(dataset.path, folder)
    truth = [1.1, 0.1, 20, -0.2, 0.9, 5, 1e-4, -2e-4, 1]
    a, b = dataset.pairs[1]
    (folder / "homographies.txt").write_text(f"{a} {b} {' '.join(map(str, truth))}\n")
    opened = mb.Dataset.open(folder)
    assert np.array_equal(opened.pairs, dataset.pairs) and np.isnan(dataset.homographies).all()
    found = opened.homographies[1]
    np.testing.assert_allclose(found / found[2, 2], np.reshape(truth, (3, 3)), rtol=1e-12)
    assert np.isnan(opened.homographies[[0, 2]]).all()


def test_ctrl_c_from_the_outside(dataset, tmp_path):
    """A real signal, to a process of its own."""
    script = f"""
import os, signal, sys, time
import matchbench as mb
signal.signal(signal.SIGINT, signal.default_int_handler)
calls = []
def slow(a, b):
    calls.append(a)
    if len(calls) == 2:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(3)
    return mb.matcher("orb").match(a, b)
try:
    mb.run({str(dataset.path)!r}, [slow], ["best"], out={str(tmp_path / "run")!r}, threads=1, progress=False)
except KeyboardInterrupt:
    sys.exit(3)
"""
    done = subprocess.run([sys.executable, "-c", script], timeout=120, capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    files = list((tmp_path / "run").glob("records/*/*.jsonl"))
    recorded = sum(len(path.read_text().splitlines()) for path in files)
    assert recorded == 2 < len(dataset.pairs), "the pair in flight is finished, and no other begun"


@pytest.mark.parametrize("call", ["run", "show"])
def test_ctrl_c_while_a_program_starts(dataset, tmp_path, call):
    (tmp_path / "slow.py").write_text("import time; open('started', 'w').close(); time.sleep(60)")
    manifest = tmp_path / "slow.toml"
    manifest.write_text(f'name = "slow"\ncommand = [{json.dumps(sys.executable)}, "slow.py"]\n')

    def interrupt():
        while not (tmp_path / "started").exists():
            time.sleep(0.05)
        _thread.interrupt_main()

    threading.Thread(target=interrupt).start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        if call == "run":
            mb.run(dataset, manifest, "best", out=tmp_path / "run", progress=False)
        else:
            mb.show(dataset, 0, 1, manifest)
    assert time.monotonic() - begin < 30, "the program is not waited for"


def test_ctrl_c_ends_a_command_that_has_nothing_to_finish(command_line_run):
    # It writes more than a pipe holds, and nobody reads on.
    words = [sys.executable, "-m", "matchbench", "report", command_line_run, "--bundle", "-"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as command:
        assert command.stdout.read(1)
        command.send_signal(signal.SIGINT)
        assert command.wait(timeout=60) == -signal.SIGINT


def test_a_pair_is_drawn(dataset, tmp_path):
    a, b = dataset.pairs[0].tolist()
    picture = mb.show(dataset, a, b, "sift", "best", settings=["sift.ratio=0.7"])
    assert picture.png.startswith(b"\x89PNG") and picture._repr_png_() == picture.png
    assert picture.save(tmp_path / "pair.png").read_bytes() == picture.png
    assert mb.show(dataset, a, b, "sift", "best", settings="sift.ratio=0.7").png == picture.png
    assert mb.show(dataset.path, a, b, "sift", "best", keypoints=True).png != picture.png
    with pytest.raises(mb.Error, match="no pair 0 0"):
        mb.show(dataset, 0, 0)
    with pytest.raises(ValueError, match="did you mean `sift`"):
        mb.show(dataset, a, b, "sfit")
    with pytest.raises(ValueError, match="one matcher"):
        mb.show(dataset, a, b, "all")


def test_whatever_runs_is_drawn(dataset, tmp_path):
    a, b = dataset.pairs[0].tolist()
    by_name = mb.show(dataset, a, b, "orb", "best", settings=["orb.ratio=0.7", "best.threshold_px=2"])
    by_object = mb.show(dataset, a, b, mb.matcher("orb", ratio=0.7), mb.estimator("best", threshold_px=2))
    assert by_object.png == by_name.png
    points_a, points_b, ambiguity = by_orb(dataset.read(a), dataset.read(b))
    stems = [dataset.images[frame].stem for frame in (a, b)]
    np.savez(
        tmp_path / f"{stems[0]}_{stems[1]}_matches.npz",
        keypoints0=points_a,
        keypoints1=points_b,
        matches=np.arange(len(points_a)),
        match_confidence=1 - ambiguity,
    )
    files = mb.MatchesFrom("files", tmp_path, resized=(320, 240))
    with pytest.warns(UserWarning, match="absent"):
        from_files = mb.show(dataset, a, b, files)
    # Drawn alike but for the caption, which has the name, and the inliers, which follow from it.
    assert len({by_name.png, from_files.png, mb.show(dataset, a, b, by_orb).png}) == 3

    manifest = tmp_path / "absent.toml"
    manifest.write_text('name = "absent"\nsummary = ""\nreference = ""\ncommand = ["sh", "-c", "echo why >&2; exit 3"]\n')
    with pytest.raises(mb.Error) as refused:
        mb.show(dataset, a, b, str(manifest))
    (log,) = (word.strip(",;:()") for word in str(refused.value).split() if "absent.log" in word)
    assert "why" in pathlib.Path(log).read_text(), "the log that the message names is there"

    def broken(image_a, image_b):
        raise ValueError("out of luck")

    with pytest.raises(mb.Error, match="out of luck"):
        mb.show(dataset, a, b, broken)


def test_a_forked_process_has_threads_of_its_own(dataset, command_line_run, tmp_path):
    script = f"""
import os, signal, warnings
import matchbench as mb
dataset = mb.Dataset.open({str(dataset.path)!r})
image = dataset.read(0)
def work():
    return mb.ASIFT().extract(image).keypoints.tobytes(), mb.evaluate({str(command_line_run)!r})["auc"].tolist()
def broken(a, b):
    raise ValueError("out of luck")
def run_breaks():
    # So many records are read by several threads.
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = mb.run(dataset, broken, "best", out={str(tmp_path / "run")!r}, repeat=60, progress=False)
    return run.failed == 180 and any("out of luck" in str(warning.message) for warning in said)
expected = work()
child = os.fork()
if child == 0:
    signal.alarm(60)
    os._exit(0 if work() == expected == work() and run_breaks() else 3)
raise SystemExit(os.waitpid(child, 0)[1] != 0)
"""
    done = subprocess.run([sys.executable, "-c", script], timeout=120, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

"""Arguments of a wrong type or form are refused with the name of the argument, and what it takes."""

import json

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
    for kind, given in ((mb.Matcher, "matchers"), (mb.Estimator, "estimators")):
        own = type("Mine", (kind,), {})({"matchers": "orb", "estimators": "best"}[given])
        refused(start(**{given: own}), f"{given}: Mine is a kind of {kind.__name__}, whose own methods a run would not call")
    refused(start(protocols=["roma", 7]), "protocols: a value of type int; give a name")
    refused(start(settings=[7]), 'settings: a value of type int; give text, as in ["sift.ratio=0.7"]')
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


def test_an_empty_path_is_not_the_working_folder(dataset, command_line_run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def start(out="run", matcher="orb", **options):
        return lambda: mb.run(dataset, matcher, "best", out=out, progress=False, **options)

    refused(start(""), "out: an empty text; give the path of the folder of the run", kind=ValueError)
    refused(start(None), "out: a value of type NoneType; give the path of the folder of the run")
    refused(start(cache=""), "cache: an empty text; give the path of a folder, or None", kind=ValueError)
    refused(start(cache=7), "cache: a value of type int; give the path of a folder, or None")
    refused(start(matcher=""), "matchers: an empty text; give a name or a manifest's path", kind=ValueError)
    refused(lambda: mb.join([command_line_run], out=""), "out: an empty text; give the path of", kind=ValueError)
    refused(lambda: mb.report(command_line_run, out=""), "out: an empty text; give the path of a folder", kind=ValueError)
    refused(lambda: mb.report(command_line_run, bundle=""), "bundle: an empty text; give the path of a file", kind=ValueError)
    refused(lambda: mb.evaluate(""), "run: an empty text; give a Run or the path of its folder", kind=ValueError)
    refused(lambda: mb.MatchesFrom("one", ""), "files: an empty text; give a path, or a list of paths", kind=ValueError)
    camera, poses = dataset.camera(0), [np.eye(4)] * len(dataset)
    new = "an empty text; give the path of the new folder"
    refused(lambda: mb.rendered_scene("cabinet", ""), "folder: an empty text; give the path of a folder", kind=ValueError)
    refused(lambda: mb.import_dataset("folder", dataset.path, ""), f"out: {new}", kind=ValueError)
    refused(lambda: mb.import_dataset("folder", "", "out"), "source: an empty text; give a path", kind=ValueError)
    refused(lambda: mb.write_dataset("", dataset.images, camera, poses), f"out: {new}", kind=ValueError)
    assert not list(tmp_path.iterdir())


def test_a_table_is_asked_for_under_some_protocol(command_line_run):
    for none in ([], ()):
        call = lambda none=none: mb.evaluate(command_line_run, protocol=none)  # noqa: E731
        refused(call, "protocol: an empty list; leave it out for all scores of the run", kind=ValueError)


def test_a_dict_is_no_list(dataset, tmp_path):
    given = {"dataset": dataset, "matchers": "orb", "estimators": "best", "protocols": ()}
    for name, wrong, instead in [
        ("dataset", {str(dataset.path): None}, "give a list"),
        ("matchers", {"orb": {"ratio": 0.5}}, 'give a list, and parameters by matcher("orb", ratio=0.5) or in settings'),
        ("estimators", {"best": {}}, 'give a list, and parameters by estimator("best", threshold_px=1) or in settings'),
        ("protocols", {"roma": 1}, "give a list"),
    ]:
        start = lambda changed={name: wrong}: mb.run(**{**given, **changed}, out=tmp_path / "run")  # noqa: E731
        refused(start, f"{name}: a dict, whose values would be lost; {instead}")
    refused(lambda: mb.MatchesFrom("one", {"matches.h5": 1}), "files: a dict, whose values would be lost; give a list")


def test_several_names_in_one_text_are_no_list(dataset, tmp_path):
    def start(data=dataset, matchers="orb", estimators=None, **options):
        return lambda: mb.run(data, matchers, estimators, out=tmp_path / "run", progress=False, **options)

    for call, words in [
        (start(matchers="sift, orb"), "matchers: 'sift, orb' is one name; give a list: ['sift', 'orb']"),
        (start(matchers=["brisk", "sift,orb"]), "matchers: 'sift,orb' is one name; give a list: ['sift', 'orb']"),
        (start(estimators="best,ransac-e"), "estimators: 'best,ransac-e' is one name; give a list"),
        (start(protocols="roma,loftr"), "protocols: 'roma,loftr' is one name; give a list"),
        (start(f"{dataset.path},{dataset.path}"), "is one name; give a list"),
    ]:
        refused(call, words, kind=ValueError)
    odd = mb.rendered_scene("cabinet", tmp_path / "a,b", frames=2, size=(32, 24))
    assert mb.run(str(odd.path), "orb", out=tmp_path / "odd", progress=False).is_complete


def test_settings_may_be_a_dict(dataset, tmp_path):
    def plan(name, settings):
        mb.run(dataset, "gms", "best", out=tmp_path / name, limit=1, settings=settings, progress=False)
        return json.loads((tmp_path / name / "plan.json").read_text())

    by_dict = {"gms.budget": "authors", "best.threshold_px": np.float32(1.5), "gms.selection.rotations": True}
    assert plan("dict", by_dict) == plan("texts", ["gms.budget=authors", "best.threshold_px=1.5", "gms.selection.rotations=true"])
    a, b = dataset.pairs[0].tolist()
    pictures = [mb.show(dataset, a, b, "orb", settings=given) for given in ({"orb.ratio": 0.7}, "orb.ratio=0.7")]
    assert pictures[0].png == pictures[1].png != mb.show(dataset, a, b, "orb").png
    refused(lambda: plan("wrong", {7: 0.5}), "settings: a value of type int; give text")
    refused(lambda: plan("wrong", {"orb.ratio": object()}), "orb.ratio: a value of type object; give numbers")
    refused(lambda: plan("wrong", {"orb": 0.5}), "expected ID.NAME=VALUE", kind=ValueError)


def test_a_run_has_each_matcher_and_estimator_once(dataset, tmp_path):
    def start(matchers, estimators="best"):
        return lambda: mb.run(dataset, matchers, estimators, out=tmp_path / "run", progress=False)

    orbs = [mb.matcher("orb", ratio=ratio) for ratio in (0.7, 0.8)]
    bests = [mb.estimator("best", threshold_px=threshold) for threshold in (1, 2)]
    words = "two of them are `{}`, and a run has each once. For other parameters make another run", "matchbench compare"
    for twice in (orbs, ["orb", orbs[0]], [orbs[0], "orb"], ["orb", "orb"]):
        refused(start(twice), "matchers: " + words[0].format("orb"), words[1], kind=ValueError)
    refused(start("orb", bests), "estimators: " + words[0].format("best"), words[1], kind=ValueError)


def test_a_manifest_is_given_to_a_run():
    for path in ("./mine.toml", "mine.toml", "tools/mine"):
        refused(lambda path=path: mb.matcher(path), f"`{path}` is the path of a manifest", "`run`", kind=ValueError)


def test_pictures_of_a_report_may_be_all(command_line_run, dataset, tmp_path):
    def pages(pictures):
        page = mb.report(command_line_run, out=tmp_path / str(pictures), pictures=pictures)
        return len(list((page.parent / "pairs").rglob("*.html")))

    assert pages("all") == len(dataset.pairs) > pages(1) == 1
    for wrong in ("every", 1.5):
        refused(lambda wrong=wrong: pages(wrong), 'pictures: a value of type', 'give a whole number, or "all"')
    refused(lambda: pages(-1), "pictures: -1, must be at least 0", kind=ValueError)


def test_pairs_of_an_import_are_a_rule(dataset, tmp_path):
    call = lambda: mb.import_dataset("folder", dataset.path, tmp_path / "out", pairs=[(0, 1)])  # noqa: E731
    refused(call, "pairs: a value of type list; give a rule as text", '"list:pairs.txt"')


def test_text_that_is_none_is_refused_where_it_is_given(dataset, tmp_path):
    def start(matchers="orb", estimators="best", **options):
        return lambda: mb.run(dataset, matchers, estimators, out=tmp_path / "run", progress=False, **options)

    def named(a, b):
        return np.empty((0, 2)), np.empty((0, 2))

    odd = "or\udc80b"
    named.name = odd
    arrays = np.zeros((3, 2)), np.zeros((3, 8), np.float32)
    features = mb.Features.from_arrays(*arrays, (10, 10))
    for call, name in [
        (lambda: mb.matcher(odd), "id"),
        (lambda: mb.estimator(odd), "id"),
        (lambda: mb.matcher("orb", search=odd), "search"),
        (lambda: mb.matcher("orb", **{odd: 1}), "params"),
        (start(odd), "matchers"),
        (start(named), "matchers.name"),
        (start(estimators=odd), "estimators"),
        (start(protocols=odd), "protocols"),
        (start(settings=odd), "settings"),
        (start(settings={"orb.search": odd}), "orb.search"),
        (start(keep_matches=odd), "keep_matches"),
        (lambda: mb.MatchesFrom(odd, "matches.h5"), "name"),
        (lambda: mb.MatchesFrom("one", "matches.h5", notes={"v": odd}), "notes"),
        (lambda: mb.rendered_scene(odd, tmp_path), "name"),
        (lambda: mb.import_dataset(odd, dataset.path, tmp_path / "out"), "kind"),
        (lambda: mb.import_dataset("folder", dataset.path, tmp_path / "out", property=odd), "property"),
        (lambda: mb.pair_seed(odd, "orb", 0, 1), "dataset"),
        (lambda: mb.Camera(1, 1, 0, 0, origin=odd), "origin"),
        (lambda: mb.Camera.from_matrix(np.eye(3), origin=odd), "origin"),
        (lambda: mb.Camera.from_model("PINHOLE", [1, 1, 0, 0], origin=odd), "origin"),
        (lambda: mb.Camera.from_model(odd, [1, 1, 0, 0], origin="center"), "model"),
        (lambda: mb.Features.from_arrays(*arrays, (10, 10), origin=odd), "origin"),
        (lambda: features.to_dict(origin=odd), "origin"),
        (lambda: mb.match(features, features, odd), "method"),
    ]:
        refused(call, f"{name}: 'or\\udc80b' has surrogates, which are no characters; give ", kind=ValueError)
    for call, name in [(lambda: mb.Camera(1, 1, 0, 0, origin=5), "origin"), (lambda: mb.match(features, features, 5), "method")]:
        refused(call, f"{name}: a value of type int; give ", kind=TypeError)
    # The name of a file need be no text.
    assert mb.MatchesFrom("one", odd).parts[1] == [odd]


def test_numbers_beyond_their_range_are_refused_by_name(dataset, tmp_path):
    points, camera = np.zeros((30, 2)), mb.Camera(100, 100, 50, 50)
    best, image = mb.estimator("best"), np.zeros((40, 50), np.uint8)

    def start(**options):
        return lambda: mb.run(dataset, "orb", "best", out=tmp_path / "run", progress=False, **options)

    for call in [
        start(seed=2**64),
        lambda: best.estimate(points, points, camera, camera, seed=2**64),
        lambda: mb.estimator("best-h").estimate_homography(points, points, seed=2**64),
        lambda: mb.matcher("orb").match(image, image, seed=2**64),
        lambda: mb.show(dataset, 0, 1, seed=2**64),
        lambda: mb.estimate_relative_pose(points, points, camera, camera, {"seed": 2**64}),
    ]:
        refused(call, "seed: 18446744073709551616, must be at most 18446744073709551615", kind=ValueError)
    refused(start(repeat=2**32), "repeat: 4294967296, must be at most 4294967295", kind=ValueError)
    refused(start(limit=2**64), "limit: 18446744073709551616, must be at most", kind=ValueError)
    refused(lambda: mb.pair_seed("room", "orb", 0, 2**32), "4294967296 is negative, or too large", kind=ValueError)


def test_a_relative_pose_asks_for_points_and_dicts():
    points, camera = np.zeros((30, 2)), mb.Camera(100, 100, 50, 50)

    def pose(a=points, b=points, camera_a=camera, ransac_opt={}, bundle_opt={}):
        return lambda: mb.estimate_relative_pose(a, b, camera_a, camera, ransac_opt, bundle_opt)

    refused(pose(5, 5), "`points_a` must be an array of numbers, n x 2", "a value of type int")
    refused(pose(None, None), "`points_a` must be an array of numbers, n x 2", "a value of type NoneType")
    refused(pose(ransac_opt=5), "ransac_opt: a value of type int; give a dict")
    refused(pose(bundle_opt=["loss_type"]), "bundle_opt: a value of type list; give a dict")
    refused(pose(bundle_opt={"loss_type": ["CAUCHY"]}), "loss_type is TRUNCATED or CAUCHY", kind=ValueError)
    refused(pose(ransac_opt={"seed": "1"}), "ransac_opt: seed: a value of type str; give a whole number")
    refused(pose(camera_a={"model": 5, "params": [5]}), "camera1: model: a value of type int; give a name")

"""`adapters/matchbench_serve.py`: the protocol in Python, spoken with a matcher that misbehaves; its images."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import matchbench as mb
import numpy as np
import pytest

ADAPTERS = Path(__file__).parents[2] / "adapters"
MATCHER = f"""
import subprocess, sys
sys.path.insert(0, {str(ADAPTERS)!r})
from matchbench_serve import serve


def match(a, b, params):
    # Either would take the next request, or wait for it.
    left = sys.stdin.read()
    taken = subprocess.run(["cat"], capture_output=True, text=True).stdout
    print("found nothing", left, taken)
    return [[1, 2]], [[3, 4]]


serve(match=match, defaults={{"word": ""}})
"""


def test_a_matcher_that_reads_standard_input_takes_no_request(tmp_path: Path) -> None:
    script = tmp_path / "matcher.py"
    script.write_text(MATCHER)
    pair = {"type": "match", "a": "/a", "b": "/b", "size_a": [9, 9], "size_b": [9, 9]}
    pairs = [{**pair, "pair": [0, b], "out": str(tmp_path / f"{b}.f32")} for b in (1, 2)]
    hello = {"type": "hello", "protocol": 1, "params": {"word": "bye"}}
    requests = "".join(json.dumps(each) + "\n" for each in [hello, *pairs, {"type": "bye"}])
    done = subprocess.run(
        [sys.executable, os.fspath(script)], input=requests, capture_output=True, text=True, timeout=60, check=True
    )
    kinds = [json.loads(line)["type"] for line in done.stdout.splitlines()]
    assert kinds == ["ready", "matched", "matched"], done.stderr
    assert done.stderr.count("found nothing") == 2
    for b in (1, 2):
        assert np.fromfile(tmp_path / f"{b}.f32", "<f4").tolist() == [1, 2, 3, 4, 0]


STAGED = f"""
import sys
sys.path.insert(0, {str(ADAPTERS)!r})
from matchbench_serve import serve


def extract(image, params):
    return {{"keypoints": [[1, 2]]}}


def match(of_a, of_b, params):
    return of_a["keypoints"], of_b["keypoints"]


serve(extract=extract, match=match, keep=1)
"""


def test_the_time_of_an_image_is_half_of_that_of_two(dataset: mb.Dataset, tmp_path: Path) -> None:
    (tmp_path / "staged.py").write_text(STAGED)
    manifest = tmp_path / "staged.toml"
    manifest.write_text(f'name = "staged"\ncommand = [{json.dumps(sys.executable)}, "staged.py"]\n')
    run = mb.run(dataset, manifest, "best", out=tmp_path / "run", progress=False)
    (records,) = run.path.glob("records/*/*.jsonl")
    times = [json.loads(line)["times"] for line in records.read_text().splitlines()]
    # Only the second image of a pair is kept for the next, which begins with another.
    assert len(times) == 3 and all(each["extract_a"] == each["extract_b"] > 0 for each in times)


@pytest.mark.parametrize(
    ("given", "changed"),
    [("keep=1", "keep=0"), ("[[1, 2]]", "[[[1, 2], [3, 4]]]"), ("[[1, 2]]", "[[[1, 2]], [[3, 4]]]")],
)
def test_features_may_be_kept_of_no_image_and_be_a_batch_of_one(
    dataset: mb.Dataset, tmp_path: Path, given: str, changed: str
) -> None:
    assert given in STAGED
    (tmp_path / "staged.py").write_text(STAGED.replace(given, changed))
    manifest = tmp_path / "staged.toml"
    manifest.write_text(f'name = "staged"\ncommand = [{json.dumps(sys.executable)}, "staged.py"]\n')
    run = mb.run(dataset, manifest, "best", out=tmp_path / "run", progress=False)
    assert run.failed == 0
    (records,) = run.path.glob("records/*/*.jsonl")
    counts = [json.loads(line)["counts"] for line in records.read_text().splitlines()]
    keypoints = 1 if given == "keep=1" else 2
    assert {(each["features_a"], each["selected"]) for each in counts} == {(keypoints, keypoints)}


FEATURES = f"""
import sys
import numpy as np
sys.path.insert(0, {str(ADAPTERS)!r})
from matchbench_serve import serve


def describe(image, params):
    if "0000" in image.path:
        return [], None  # as OpenCV has it
    rng = np.random.default_rng(0)
    return rng.uniform(0, 200, (30, 2)), rng.uniform(size=(30, 8)).astype(np.float32)


serve(describe=describe)
"""
MANIFEST = """
name = "described"
summary = ""
reference = ""
command = [{python}, "described.py"]
kind = "features"

[matching]
hamming = {hamming}
"""


def test_an_image_without_features_has_no_matches_and_breaks_nothing(dataset: mb.Dataset, tmp_path: Path) -> None:
    manifest = tmp_path / "described.toml"
    for hamming in (False, True):
        bits = ".view(np.uint8)" if hamming else ""
        script = FEATURES.replace(".astype(np.float32)", ".astype(np.float32)" + bits)
        (tmp_path / "described.py").write_text(script)
        manifest.write_text(MANIFEST.format(python=json.dumps(sys.executable), hamming=str(hamming).lower()))
        run = mb.run(dataset, manifest, "best", out=tmp_path / f"run-{hamming}", progress=False)
        assert run.is_complete and run.failed == 0
        (records,) = run.path.glob("records/*/*.jsonl")
        counts = [json.loads(line)["counts"] for line in records.read_text().splitlines()]
        assert {each["features_b"] for each in counts} == {30}
        assert {each["features_a"] for each in counts} >= {0}
        assert all(each["selected"] == 0 for each in counts if each["features_a"] == 0)


def test_an_image_of_an_exact_size_is_resampled_as_native_matchers_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(os.fspath(ADAPTERS))
    serve = importlib.import_module("matchbench_serve")

    def image(pixels: np.ndarray) -> Any:
        monkeypatch.setattr(serve, "_read", lambda path, gray: pixels if gray else np.dstack([pixels, pixels // 2, pixels]))
        return serve.Image("image", pixels.shape[::-1])

    # The numbers of the test of `image::resize`.
    assert image(np.array([[0, 255, 100, 201]], np.uint8)).gray(size=(3, 1)).tolist() == [[43, 178, 184]]
    y, x = np.mgrid[:40, :60]
    ramp = image((3 * x + y).astype(np.uint8))
    resized, coloured = ramp.gray(size=(50, 50)), ramp.rgb(size=(50, 50))
    assert resized.dtype == np.uint8 and coloured.shape == (50, 50, 3)
    points = ramp.original([[0, 0], [49, 49], [20, 30]])
    np.testing.assert_allclose(points, [[0.1, -0.1], [58.9, 39.1], [24.1, 23.9]])
    assert abs(resized[30, 20] - (3 * 24.1 + 23.9)) <= 0.51 and (coloured[..., 0] == resized).all()
    with pytest.raises(ValueError, match="leave one out"):
        ramp.gray(50, size=(50, 50))


def test_points_are_n_by_2(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(os.fspath(ADAPTERS))
    image = importlib.import_module("matchbench_serve").Image("image", (640, 480))
    points = np.arange(12.0).reshape(6, 2)
    for same in (points, points.tolist(), points[:, None], points[None], points.astype(np.float32)):
        assert np.array_equal(image.original(same), points)
    for empty in ([], np.zeros((0, 3)), np.zeros((2, 0)), np.zeros((0, 1, 2)), [[]]):
        assert image.original(empty).shape == (0, 2)
    # Each of them was read as so many other points.
    for wrong, shape in [
        (points.T, "2 x 6"),
        (np.c_[points, np.ones(6)], "6 x 3"),
        (np.c_[points, points], "6 x 4"),
        (points.ravel(), "12"),
        (points.T[None], "2 x 6"),
        (points.reshape(3, 2, 2), "3 x 2 x 2"),
        (7.0, "a single number"),
    ]:
        with pytest.raises(ValueError, match=rf"^points: an array of shape {shape}; give n x 2 \(x, y\)$"):
            image.original(wrong)


def test_certainty_is_from_0_to_1_or_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(os.fspath(ADAPTERS))
    certainty = importlib.import_module("matchbench_serve")._certainty
    assert certainty(None, 3).tolist() == [1, 1, 1]
    assert certainty([0, 0.25, 1], 3).tolist() == [0, 0.25, 1]
    assert certainty(np.array([[0.5], [0.75]], np.float32), 2).tolist() == [0.5, 0.75]
    assert certainty(np.array([-1e-4, 1.0005]), 2).tolist() == [0, 1], "rounding"
    assert certainty([], 0).shape == (0,)
    # All of the first were certain, in silence.
    for wrong, words in [
        ([9, 9], "row 0 is 9"),
        ([1, 1.01], "row 1 is 1.01"),
        ([0.5, -0.2], "row 1 is -0.2"),
        ([0.5, float("nan")], "row 1 is nan"),
    ]:
        with pytest.raises(ValueError, match=f"^certainty: {words}; give values from 0 to 1, 1 is certain, or None$"):
            certainty(wrong, 2)
    for wrong, shape in [([1, 1, 1], "3"), (np.ones((2, 2)), "2 x 2"), (1.0, "a single number")]:
        with pytest.raises(ValueError, match=f"^certainty: an array of shape {shape} for 2 matches; give one for each$"):
            certainty(wrong, 2)


MISTAKEN = f"""
import sys
import numpy as np
sys.path.insert(0, {str(ADAPTERS)!r})
from matchbench_serve import serve

points = np.arange(24.0).reshape(12, 2)
serve({{}})
"""


def test_none_is_no_certainty(dataset: mb.Dataset, tmp_path: Path) -> None:
    (tmp_path / "mistaken.py").write_text(MISTAKEN.format("match=lambda a, b, params: (points, points, None)"))
    manifest = tmp_path / "mistaken.toml"
    manifest.write_text(f'name = "mistaken"\ncommand = [{json.dumps(sys.executable)}, "mistaken.py"]\n')
    run = mb.run(dataset, manifest, "best", out=tmp_path / "run", limit=1, progress=False)
    assert run.failed == 0 and mb.pairs(run)["selected"].tolist() == [12]


@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("match=lambda a, b, params: (points.T, points.T)", "points: an array of shape 2 x 12; give n x 2"),
        ("match=lambda a, b, params: (points, points, [1] * 11 + [9])", "certainty: row 11 is 9; give values from 0 to 1"),
        ("describe=lambda image, params: (points.T, np.ones((12, 8), np.float32))", "points: an array of shape 2 x 12"),
    ],
)
def test_a_wrong_answer_fails_its_pair_with_the_remedy(
    dataset: mb.Dataset, tmp_path: Path, function: str, words: str
) -> None:
    (tmp_path / "mistaken.py").write_text(MISTAKEN.format(function))
    manifest = tmp_path / "mistaken.toml"
    kind = "features" if function.startswith("describe") else "matches"
    manifest.write_text(
        f'name = "mistaken"\ncommand = [{json.dumps(sys.executable)}, "mistaken.py"]\nkind = "{kind}"\n'
    )
    with pytest.warns(UserWarning) as said:
        assert mb.run(dataset, manifest, "best", out=tmp_path / "run", limit=1, progress=False).failed == 1
    assert any(words in str(warning.message) for warning in said), [str(warning.message) for warning in said]


def test_without_opencv_grey_pixels_of_16_bits_are_their_upper_8(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pillow = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.syspath_prepend(str(ADAPTERS))
    from matchbench_serve import Image

    stored = (np.arange(8 * 12, dtype=np.uint16) * 683).reshape(8, 12)
    for ending in ("png", "tiff"):
        path = tmp_path / f"deep.{ending}"
        pillow.fromarray(stored).save(path)
        image = Image(str(path), (12, 8))
        assert (image.gray() == stored >> 8).all(), ending
        assert (image.rgb() == (stored >> 8)[..., None]).all(), ending
    big_endian = tmp_path / "deep.pgm"
    big_endian.write_bytes(b"P5 12 8 65535\n" + stored.astype(">u2").tobytes())
    assert (Image(str(big_endian), (12, 8)).gray() == stored >> 8).all()
    for dtype in (np.int32, np.float32):
        pillow.fromarray(np.full((8, 12), 1 << 20, dtype)).save(tmp_path / "deeper.tiff")
        with pytest.raises(ValueError, match="more than 16 bits"):
            Image(str(tmp_path / "deeper.tiff"), (12, 8)).gray()

"""What Python computes is what the command line computes, bit for bit."""

import json
import struct

import matchbench as mb
import numpy as np
import pytest
from conftest import ESTIMATORS, MATCHERS, stored_matches


def records(folder):
    """The records of a run without their times, file by file."""
    found = {}
    for path in sorted(folder.glob("records/*/*.jsonl")):
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        for row in rows:
            row.pop("times")
            row.pop("check")  # of the line, times and all
        found[path.relative_to(folder)] = rows
    return found


def cached_features(folder):
    """Keypoints (x, y, size, response, angle), octaves and descriptors in the files of the feature cache."""
    for path in folder.rglob("cache/**/*"):
        data = path.read_bytes() if path.is_file() else b""
        if not data.startswith(b"MBFEAT02"):
            continue
        width, height, count, layout, columns, frames = struct.unpack_from("<QQQBQB", data, 40)
        at = 40 + struct.calcsize("<QQQBQB")
        kind = np.dtype([("numbers", "<f4", 5), ("angle", "u1"), ("octave", "<i2")])
        keypoints = np.frombuffer(data, kind, count, at)
        at += 23 * count + 16 * count * frames
        row = {0: 4 * columns, 1: columns, 2: 8 * -(-columns // 64)}[layout]
        rows = np.frombuffer(data, np.uint8, count * row, at).reshape(count, row)
        if layout == 0:
            rows = rows.view("<f4")
        elif layout == 2:
            rows = rows[:, : -(-columns // 8)]
        yield (width, height), keypoints, rows


def test_a_run_from_python_leaves_the_same_records_and_matches(dataset, command_line_run, tmp_path):
    run = mb.run(dataset, MATCHERS, ESTIMATORS, out=tmp_path / "run", progress=False)
    assert run.is_complete and run.failed == 0 and run.total == len(dataset.pairs) * 4
    ours, theirs = records(run.path), records(command_line_run)
    assert ours == theirs and len(ours) == 4
    for path in run.path.glob("matches/*/*.bin"):
        assert path.read_bytes() == (command_line_run / path.relative_to(run.path)).read_bytes()
    again = mb.run(dataset, MATCHERS, ESTIMATORS, out=tmp_path / "run", progress=False)
    assert (again.now, again.before) == (0, run.total)


def test_keypoints_and_descriptors_are_those_of_the_command_line(dataset, command_line_run):
    cached = list(cached_features(command_line_run))
    for extractor in (mb.SIFT(), mb.ORB()):
        for path in dataset.images:
            found = extractor.extract(mb.read_gray(path))
            assert len(found) > 100
            angles = np.nan_to_num(found.angles)
            columns = [*found.keypoints.T, found.sizes, found.responses, angles]
            numbers = np.stack(columns, axis=1)
            descriptors = found.descriptors
            same = [
                size == found.image_size
                and np.array_equal(keypoints["numbers"], numbers)
                and np.array_equal(keypoints["octave"], found.octaves)
                and np.array_equal(rows.astype(descriptors.dtype), descriptors)
                for size, keypoints, rows in cached
            ]
            assert sum(same) == 1, (type(extractor), path)


@pytest.mark.parametrize("name", MATCHERS)
def test_matches_and_poses_step_by_step_are_those_of_the_command_line(name, dataset, command_line_run):
    matcher = mb.matcher(name)
    stored = stored_matches(command_line_run / "matches" / dataset.name / f"{name}.bin")
    recorded = records(command_line_run)
    cameras = [dataset.camera(frame) for frame in range(len(dataset))]
    images = [dataset.read(frame) for frame in range(len(dataset))]
    poses = 0
    for a, b in dataset.pairs.tolist():
        seed = mb.pair_seed(dataset.name, name, a, b)
        matches = matcher.match(images[a], images[b], cameras[a], cameras[b], seed=seed)
        parts = [matches.points_a, matches.points_b, matches.ambiguity, matches.turns, matches.growths]
        ours = np.column_stack(parts).astype(np.float32)
        assert np.array_equal(ours, stored[a, b])
        for id in ESTIMATORS:
            rows = next(rows for path, rows in recorded.items() if path.name == f"{name}+{id}.jsonl")
            outcome = next(row["outcome"] for row in rows if (row["task"]["a"], row["task"]["b"]) == (a, b))
            if outcome["kind"] != "pose":
                continue
            found = mb.estimator(id).estimate(
                matches.points_a, matches.points_b, cameras[a], cameras[b], ambiguity=matches.ambiguity, seed=seed
            )
            assert found.R.ravel().tolist() == outcome["rotation"]
            assert found.t.tolist() == outcome["translation"]
            assert (found.num_inliers, found.support) == (outcome["inliers"], outcome["support"])
            poses += 1
    assert poses > 0


def test_stages_are_the_matcher(images):
    """Extraction, search and selector one by one come to what the matcher does at once."""
    for name, extract, select in [
        ("sift", mb.SIFT().extract, lambda a, b: mb.match(a, b, "ratio")),
        ("gms", mb.matcher("gms").extract, mb.gms),
        ("kvld", mb.SIFT().extract, lambda a, b: mb.kvld(a, b, images=tuple(images))),
        ("adalam", mb.matcher("adalam").extract, mb.adalam),
    ]:
        whole = mb.matcher(name).match(*images)
        a, b = map(extract, images)
        kept = select(a, b)
        assert len(whole) > 10
        assert np.array_equal(kept.indices, whole.indices), name
        assert np.array_equal(a.keypoints[kept.indices[:, 0]], whole.points_a), name
        assert np.array_equal(kept.ambiguity, whole.ambiguity), name


def test_the_command_is_the_program():
    from conftest import command

    listed = command("list", "matchers")
    assert listed.returncode == 0 and "repmatch" in listed.stdout
    assert command("rnu").returncode == 1
    assert command("--version").stdout.startswith("matchbench")


def test_refined_matches_are_the_same_at_other_places(images):
    plain, refined = (mb.matcher("orb", **params).match(*images) for params in ({}, {"refine": True}))
    assert np.array_equal(plain.indices, refined.indices)
    assert np.array_equal(plain.points_a, refined.points_a)
    moved = np.linalg.norm(plain.points_b - refined.points_b, axis=1)
    assert (moved > 0).mean() > 0.5 and np.median(moved) < 2

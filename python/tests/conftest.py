"""What the tests share: a small rendered dataset, a run of the command line on it."""

import json
import os
import signal
import struct
import subprocess
import sys

import matchbench as mb
import numpy as np
import pytest

# A shell that starts programs in the background lets them ignore Ctrl-C; tests of it need Python's own handler.
signal.signal(signal.SIGINT, signal.default_int_handler)

# With MATCHBENCH_NO_SKIPS=1 a test that would be skipped fails, and says what is missing.
NO_SKIPS = os.environ.get("MATCHBENCH_NO_SKIPS", "") not in ("", "0")


def _refuse_skip(report):
    if NO_SKIPS and report.skipped and not hasattr(report, "wasxfail"):
        *_, reason = report.longrepr
        report.outcome, report.longrepr = "failed", f"MATCHBENCH_NO_SKIPS is set. {reason}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """The report of one test."""
    return _refuse_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    """The report of a file of tests, which may be skipped as a whole."""
    return _refuse_skip((yield))


MATCHERS = ["sift", "orb"]
ESTIMATORS = ["ransac-e", "best"]


@pytest.fixture(scope="session")
def dataset(tmp_path_factory):
    """Four images of a cabinet, with exact poses."""
    return mb.rendered_scene("cabinet", tmp_path_factory.mktemp("scenes"), frames=4, size=(320, 240))


@pytest.fixture(scope="session")
def images(dataset):
    """Its first two images, grey."""
    return [dataset.read(frame) for frame in (0, 1)]


@pytest.fixture(scope="session")
def features(images):
    """Their SIFT features."""
    return [mb.SIFT().extract(image) for image in images]


def command(*arguments):
    """The installed command."""
    words = [sys.executable, "-m", "matchbench", *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="session")
def command_line_run(dataset, tmp_path_factory):
    """A run of the command line."""
    out = tmp_path_factory.mktemp("command-line") / "run"
    done = command(
        "run", dataset.path, "--matchers", ",".join(MATCHERS), "--estimator", ",".join(ESTIMATORS), "--out", out
    )
    assert done.returncode == 0, done.stderr
    return out


def results(run):
    """The files of a run, records without their times."""
    found = {}
    for path in run.rglob("*"):
        inside = path.relative_to(run)
        if path.is_dir() or inside.parts[0] in ("cache", ".lock"):
            continue
        content = path.read_bytes()
        if inside.parts[0] == "records":
            records = [json.loads(line) for line in content.splitlines()]
            content = [{k: v for k, v in record.items() if k not in ("times", "check")} for record in records]
        found[inside] = content
    return found


def stored_matches(path):
    """Matches by pair: m x 5 (x_a, y_a, x_b, y_b, ambiguity), and one more for turns and one for growths where they are."""
    data, at, found = path.read_bytes(), 8, {}
    while at < len(data):
        a, b, _, _, _, _, count = struct.unpack_from("<7I", data, at)
        columns, count = (count >> 31) + (count >> 30 & 1), count & 0x3FFFFFFF
        found[a, b] = np.frombuffer(data, "<f4", 5 * count, at + 28).reshape(count, 5)
        at += 28 + 20 * count
        for _ in range(columns):
            found[a, b] = np.column_stack([found[a, b], np.frombuffer(data, "<f4", count, at)])
            at += 4 * count
        at += 8
    return found

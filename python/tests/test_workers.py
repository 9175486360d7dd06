"""Matchers written in Python are called for one pair at a time, or for as many as they have workers."""

import _thread
import json
import threading
import time

import matchbench as mb
import numpy as np
import pytest


class Together:
    """Two pairs are matched at the same time, or the barrier breaks and both fail."""

    workers = 2

    def __init__(self):
        self.barrier = threading.Barrier(2)

    def extract(self, image):
        return len(image)

    def match(self, a, b):
        self.barrier.wait(timeout=60)
        return np.zeros((0, 2)), np.zeros((0, 2))


class Watched:
    """Counts how many of its calls run at the same time, and waits a little for others."""

    pause = 0.2

    def __init__(self):
        self.lock = threading.Lock()
        self.at_once = self.most = 0

    def extract(self, image):
        self.seen()
        return mb.ASIFT(sift={"limit": 20}).extract(image[:60, :80])  # releases the interpreter, and uses threads

    def match(self, a, b):
        self.seen()
        return np.zeros((0, 2)), np.zeros((0, 2))

    def seen(self):
        with self.lock:
            self.at_once += 1
            self.most = max(self.most, self.at_once)
        time.sleep(self.pause)
        with self.lock:
            self.at_once -= 1


def test_a_matcher_is_called_by_one_thread_at_a_time_unless_it_has_workers(dataset, tmp_path):
    def start(matcher, name, **options):
        return mb.run(dataset, matcher, ["best"], out=tmp_path / name, threads=4, progress=False, **options)

    alone = Watched()
    assert start(alone, "alone").failed == 0 and alone.most == 1
    # Waiting for the turn is in no time: a pair takes three pauses, so all but the first would have at least four.
    (records,) = (tmp_path / "alone").glob("records/*/Watched+best.jsonl")
    times = [json.loads(line)["times"] for line in records.read_text().splitlines()]
    assert len(times) == 3 and all(Watched.pause <= each["search"] < 3 * Watched.pause for each in times), times
    assert start(Together(), "together", limit=2).failed == 0
    two = Watched()
    two.workers = 2
    assert start(two, "two").failed == 0 and two.most <= 2

    def by_default(a, b):
        return np.zeros((0, 2)), np.zeros((0, 2))

    for workers, kind, words in [
        (0, ValueError, "^by_default.workers: 0, must be at least 1"),
        ("two", TypeError, "^by_default.workers: a value of type str; give a whole number"),
        (1.5, TypeError, "^by_default.workers: a value of type float"),
    ]:
        by_default.workers = workers
        with pytest.raises(kind, match=words):
            start(by_default, "wrong")
    by_default.workers = 10**30  # no more than the threads
    assert start(by_default, "many").failed == 0


def test_an_interrupt_does_not_wait_for_pairs_that_wait_for_their_turn(dataset, tmp_path):
    calls = []

    def slow(a, b):
        calls.append(None)
        if len(calls) == 1:
            _thread.interrupt_main()
        time.sleep(0.5)
        return np.zeros((0, 2)), np.zeros((0, 2))

    with pytest.raises(KeyboardInterrupt):
        mb.run(dataset, [slow], ["best"], out=tmp_path / "run", threads=4, progress=False)
    assert len(calls) == 1, "the others wait"
    run = mb.run(dataset, [slow], ["best"], out=tmp_path / "run", threads=4, progress=False)
    # The one that was finished is lost if a pair before it was not begun.
    assert run.is_complete and run.before in (0, 1) and len(calls) == 1 + run.now

"""A plan on a real cluster of Ray on this machine: two workers, one of which is killed."""

import os
import pathlib
import signal
import sys
import threading
import time

import matchbench as mb
import pytest
from conftest import command, results

ray = pytest.importorskip("ray", reason="Ray is not installed")

from matchbench import ray as mb_ray  # noqa: E402

SHARDS = 4


@pytest.fixture(scope="module")
def cluster():
    ray.init(num_cpus=2, include_dashboard=False)
    yield
    ray.shutdown()


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A folder with a dataset, a run of it, matches of that run in files, and how to plan the same."""
    folder = tmp_path_factory.mktemp("ray")
    scene = mb.rendered_scene("cabinet", folder / "scenes", frames=8, size=(320, 240))
    what = [scene.path, "--matchers", "sift,orb", "--estimator", "ransac-e,best", "--repeat", 3]
    done = command("run", *what, "--out", folder / "single")
    assert done.returncode == 0, done.stderr

    def plan(name, *more):
        done = command("plan", *what, *more, "--shards", SHARDS, "--out", folder / name)
        assert done.returncode == 0, done.stderr
        return folder / name

    return folder, scene.path, plan


def worker_at(folder):
    """The worker whose child has begun to write records into the folder of a shard; Linux tells."""
    begun = any(path.stat().st_size > 0 for path in folder.glob("records/*/*.jsonl"))
    for process in pathlib.Path("/proc").glob("[0-9]*") if begun else ():
        try:
            if any(os.readlink(link) == str(folder / ".lock") for link in (process / "fd").iterdir()):
                return int((process / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue  # it ended, or is another user's
    return None


@pytest.mark.skipif(sys.platform != "linux", reason="the worker is found in /proc")
def test_a_killed_worker_costs_its_shard_alone(cluster, planned):
    folder, _, plan = planned
    home = plan("killed")
    killed = []

    def kill():
        patience = time.monotonic() + 120
        while not killed and time.monotonic() < patience:
            if worker := worker_at(home / "shards" / "2"):
                os.kill(worker, signal.SIGKILL)
                killed.append(worker)
            time.sleep(0.001)

    killer = threading.Thread(target=kill)
    killer.start()
    told = []
    run = mb_ray.run(home, progress=lambda *state: told.append(state))
    killer.join()
    assert killed, "no worker was caught at work"
    assert run == home / "run" and told == [(k, SHARDS, "shards", "") for k in range(1, SHARDS + 1)]
    assert results(run) == results(folder / "single")


def test_folders_may_travel_through_the_object_store(cluster, planned, tmp_path):
    folder, scene, plan = planned
    exported = command("export", folder / "single", tmp_path / "out", "--format", "npz")
    assert exported.returncode == 0, exported.stderr
    found = tmp_path / "out" / "sift"
    matches = ["--matches", f"mine={found}", "--pixel-center", 0]
    home = plan("sent", *matches)
    run = mb_ray.run(home, shared=False, at_once=2, out=tmp_path / "run", progress=False)
    single = command("run", scene, "--matchers", "sift,orb", *matches, "--estimator",
                     "ransac-e,best", "--repeat", 3, "--out", tmp_path / "single")  # fmt: skip
    assert single.returncode == 0, single.stderr
    assert results(run) == results(tmp_path / "single")

"""What a worker of Ray keeps of what it was sent, with a cluster that is this process."""

import os
import shutil
import sys
import tempfile
import types

import matchbench as mb
import pytest
from conftest import command, results
from matchbench import ray as mb_ray


class Ref:
    """Something in the object store, or what a task returned."""

    def __init__(self, value):
        self.value = value


class Task:
    """A function that is run at once; references that it is given are followed, as Ray does."""

    def __init__(self, function):
        self.function = function

    def remote(self, *given):
        return Ref(self.function(*(one.value if isinstance(one, Ref) else one for one in given)))


@pytest.fixture
def cluster(monkeypatch, tmp_path):
    """Ray, and an empty temporary folder."""
    ray = types.SimpleNamespace(
        is_initialized=lambda: True,
        cluster_resources=lambda: {"CPU": 1},
        put=Ref,
        get=lambda ref: ref.value,
        remote=lambda **_: Task,
        wait=lambda waiting: (waiting[:1], waiting[1:]),
    )
    monkeypatch.setitem(sys.modules, "ray", ray)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    return temporary


def test_results_of_images_that_were_replaced_are_not_taken_for_those_of_the_new_ones(cluster, tmp_path):
    scene = mb.rendered_scene("cabinet", tmp_path / "scenes", frames=3, size=(160, 120))
    what = [scene.path, "--matchers", "orb", "--estimator", "ransac-e"]

    def sent(name):
        planned = command("plan", *what, "--shards", 2, "--out", tmp_path / name)
        assert planned.returncode == 0, planned.stderr
        run = mb_ray.run(tmp_path / name, shared=False, progress=False)
        single = command("run", *what, "--out", tmp_path / f"{name}-single")
        assert single.returncode == 0, single.stderr
        assert results(run) == results(tmp_path / f"{name}-single")
        return results(run)

    before = sent("before")
    kept = sorted(cluster.glob("*/*"))
    assert len(kept) == 1
    assert sent("again") == before and sorted(cluster.glob("*/*")) == kept
    shutil.copy(scene.images[1], scene.images[0])
    after = sent("after")
    assert [path for path in before if before[path] != after[path]], "it saw other images"
    assert len(list(cluster.glob("*/*"))) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="the temporary folder is the user's own")
def test_a_folder_that_others_can_write_to_is_refused(cluster, tmp_path, monkeypatch):
    folder = mb_ray._folder_of_the_user()
    assert folder.parent == cluster and folder.stat().st_mode & 0o777 == 0o700
    assert mb_ray._folder_of_the_user() == folder
    folder.chmod(0o777)
    with pytest.raises(PermissionError, match="alone can write"):
        mb_ray._folder_of_the_user()
    folder.rmdir()
    folder.symlink_to(tmp_path)
    with pytest.raises(PermissionError, match="alone can write"):
        mb_ray._folder_of_the_user()
    folder.unlink()
    folder.mkdir(mode=0o700)
    made_by = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: made_by + 1)
    folder.rename(cluster / f"matchbench-{made_by + 1}")
    with pytest.raises(PermissionError, match="alone can write"):
        mb_ray._folder_of_the_user()

"""Datasets that are made of what a program knows."""

import matchbench as mb
import numpy as np
import pytest


@pytest.fixture(scope="module")
def poses(dataset):
    """Of four cameras, as far as pairs tell: the world is the frame of the first."""
    known = {int(b): np.linalg.inv(b_from_a) for (a, b), b_from_a in zip(dataset.pairs, dataset.b_from_a) if a == 0}
    return np.stack([known.get(frame, np.eye(4)) for frame in range(len(dataset))])


def test_a_dataset_of_arrays_is_the_one_they_come_from(dataset, poses, tmp_path):
    camera = dataset.camera(0)
    folder = tmp_path / dataset.name  # seeds depend on the name
    made = mb.write_dataset(folder, dataset.images, camera, poses, pairs=dataset.pairs, property="a cabinet")
    assert made.name == dataset.name and made.images == [path.resolve() for path in dataset.images]
    assert [made.camera(frame) for frame in range(4)] == [camera] * 4
    assert np.array_equal(made.pairs, dataset.pairs)
    np.testing.assert_allclose(made.b_from_a, dataset.b_from_a, atol=1e-12)
    assert 'property = "a cabinet"' in (folder / "dataset.toml").read_text()
    runs = [mb.run(each, "orb", "best", out=tmp_path / out, progress=False) for each, out in ((made, "a"), (dataset, "b"))]
    assert all(run.is_complete and run.failed == 0 for run in runs)
    ours, theirs = (mb.pairs(run)["pose_error"] for run in runs)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


def test_cameras_and_pairs_may_differ(dataset, poses, tmp_path):
    cameras = [mb.Camera(300 + index, 300, 159.5, 119.5, (0.1, 0, 0, 0)) for index in range(4)]
    rows = [pose[:3].tolist() for pose in poses]
    made = mb.write_dataset(tmp_path / "mine", map(str, dataset.images), cameras, rows, pairs="window:1", store="copy")
    assert made.pairs.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert [made.camera(index) for index in range(4)] == cameras
    assert all(path.is_relative_to((tmp_path / "mine").resolve()) for path in made.images)
    np.testing.assert_allclose(made.b_from_a[1], np.linalg.inv(poses[2]) @ poses[1], atol=1e-12)
    every = mb.write_dataset(tmp_path / "every", dataset.images, cameras, poses)
    assert len(every.pairs) == 6


def test_what_is_no_dataset_is_refused_in_words(dataset, poses, tmp_path):
    camera = dataset.camera(0)

    def refused(words, kind=ValueError, images=dataset.images, cameras=camera, poses=poses, **options):
        with pytest.raises(kind, match=words):
            mb.write_dataset(tmp_path / "mine", images, cameras, poses, **options)
        assert not (tmp_path / "mine").exists()

    refused("cameras: 3 for 4 images", cameras=[camera] * 3)
    refused("a camera is a Camera", TypeError, cameras=[camera] * 3 + [camera.K])
    shape = r"world_from_camera: an array of shape \[3, 4, 4\]; give 4 matrices, 4 x 4 or 3 x 4"
    refused(shape, poses=poses[:3])
    refused("world_from_camera: .*; give 4 matrices", poses=[np.eye(4), np.eye(3), np.eye(4), np.eye(4)])
    refused("world_from_camera: matrix 0: the last row", poses=poses.transpose(0, 2, 1) + np.eye(4)[3])
    mirrored = poses.copy()
    mirrored[2, :3, :3] *= -1
    refused("world_from_camera: matrix 2: the 3x3 block is a reflection", poses=mirrored)
    refused("pairs: row 1 is \\[0, 4\\]; there are 4 images", pairs=[[0, 1], [0, 4]])
    refused("pairs: row 0 is \\[-1, 2\\]", pairs=[[-1, 2]])
    refused("pairs: row 0: frame 2 is matched with itself", pairs=[[2, 2]])
    refused("pairs: row 1: the pair stands here a second time", pairs=[[2, 1], [2, 1]])
    refused("pairs: an array of float64", pairs=[[0.5, 1]])
    refused("pairs: there are none", pairs=np.zeros((0, 2), int))
    refused("unknown pair rule `some`", pairs="some")
    refused('store is "reference", "link" or "copy", not "move"', store="move")
    refused("nowhere.png", mb.Error, images=[*dataset.images[:3], tmp_path / "nowhere.png"])
    mb.write_dataset(tmp_path / "there", dataset.images, camera, poses)
    with pytest.raises(mb.Error, match="there is something already"):
        mb.write_dataset(tmp_path / "there", dataset.images, camera, poses)

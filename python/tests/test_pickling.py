"""Values cross to other processes, and are copied, without losing a bit."""

import copy
import multiprocessing
import pickle

import matchbench as mb
import numpy as np
import pytest

WAYS = [
    *(lambda value, protocol=protocol: pickle.loads(pickle.dumps(value, protocol)) for protocol in (0, 2, 5)),
    copy.copy,
    copy.deepcopy,
]
FEATURES = ["keypoints", "sizes", "angles", "responses", "octaves", "lafs", "descriptors", "image_size", "bits"]
MATCHES = ["points_a", "points_b", "ambiguity", "turns", "growths", "indices"]
POSE = ["R", "t", "q", "inliers", "num_inliers", "support", "pose_probability", "overlap_probability", "iterations"]
HOMOGRAPHY = ["H", "inliers", "num_inliers", "iterations"]
DATASET = ["name", "path", "images", "pairs", "b_from_a", "homographies"]


def same(value, again, names):
    assert type(again) is type(value)
    for name in names:
        expected, found = getattr(value, name), getattr(again, name)
        if isinstance(expected, np.ndarray):
            assert found.dtype == expected.dtype and found.shape == expected.shape, name
            assert found.tobytes() == expected.tobytes(), name
        else:
            assert found == expected, name


@pytest.fixture(params=WAYS, ids=["protocol 0", "protocol 2", "protocol 5", "copy", "deepcopy"])
def again(request):
    return request.param


@pytest.fixture(scope="module")
def matched(dataset, images):
    camera = dataset.camera(0)
    return mb.matcher("sift").match(*images, camera, camera)


def test_cameras(again):
    cameras = [
        mb.Camera(500.1, 499.9, 320, 240),
        mb.Camera(5e2, 5e2, 0.1, -0.0, (0.1, -0.2, 1e-3, 2e-3, 0.3)),
        mb.Camera(5e2, 5e2, 0.1, -0.0, fisheye=(0.1, -0.2, 1e-3, 2e-3)),
    ]
    for camera in cameras:
        assert again(camera) == camera


def test_features_of_every_kind(again, images):
    extractors = mb.ORB(features=50), mb.DSPSIFT(affine_shape=True, sift={"limit": 50})
    binary, affine = (extractor.extract(images[0]) for extractor in extractors)
    none = mb.SIFT().extract(np.zeros((20, 30), np.uint8))
    odd = mb.Features.from_arrays(np.ones((3, 2)), np.full((3, 2), 255, np.uint8), (9, 9), bits=13, sizes=[0, 1, 2])
    for features in [binary, affine, none, odd]:
        same(features, again(features), FEATURES)
    assert mb.match(again(binary), again(binary), "nn").distances.max() == 0


def test_matches_hold_their_features(again, matched):
    found = again(matched)
    same(matched, found, MATCHES)
    same(matched.features_a, found.features_a, FEATURES)
    same(matched.features_b, found.features_b, FEATURES)


def test_matches_of_candidates_that_are_not_the_nearest(again, dataset, images):
    """Their ambiguity is above 1, and an estimator takes it."""
    small = [image[60:180, 80:240] for image in images]
    matched = mb.matcher("gaim", extractor={"views": {"shears": 1}}).match(*small)
    assert matched.ambiguity.max() > 1
    same(matched, again(matched), MATCHES)
    camera = dataset.camera(0)
    mb.estimator("best-h").estimate_homography(matched.points_a, matched.points_b, ambiguity=matched.ambiguity)
    assert hash(camera) == hash(again(camera))


def test_estimates(again, dataset, matched):
    points, camera = (matched.points_a, matched.points_b), dataset.camera(0)
    pose = mb.estimator("best").estimate(*points, camera, camera)
    same(pose, again(pose), POSE)
    homography = mb.estimator("best-h").estimate_homography(*points)
    same(homography, again(homography), HOMOGRAPHY)


def test_matchers_and_estimators_keep_their_parameters(again, images):
    matcher = mb.matcher("sift", ratio=0.7, extractor={"sigma": 1.2, "max_size": 200})
    same(matcher, again(matcher), ["id", "params"])
    same(matcher.match(*images), again(matcher).match(*images), MATCHES)
    orb = mb.ORB(features=30)
    same(orb, again(orb), ["params"])
    estimator = mb.estimator("best", threshold_px=1.25)
    same(estimator, again(estimator), ["id", "params", "of_homographies"])
    assert again(estimator).params["threshold_px"] == 1.25


def test_datasets_are_opened_again(again, dataset, tmp_path):
    same(dataset, again(dataset), DATASET)
    assert (again(dataset).read(1) == dataset.read(1)).all()


def test_correspondences_and_errors(again, features):
    matches = mb.match(*features)
    same(matches, again(matches), ["indices", "distances", "second", "ambiguity", "turns", "growths"])
    for error in [mb.NoModel("too few"), mb.Error("broken")]:
        found = again(error)
        assert type(found) is type(error) and found.args == error.args


def test_other_processes_match(images):
    """As multiprocessing starts them where it does not fork."""
    sift = mb.SIFT(limit=100)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.apply(sift.extract, (images[0],))
    same(sift.extract(images[0]), found, FEATURES)


def test_what_was_pickled_is_checked_when_it_comes_back(matched):
    caller, (kind,) = matched.__reduce__()
    assert kind is mb.Matches and len(caller(kind)) == len(matched)
    few = matched.features_a.select([0])
    columns = (matched.points_a, matched.points_b, matched.ambiguity, matched.turns, matched.growths)
    parts = (*columns, matched.indices, few, few)
    with pytest.raises(ValueError, match="of image a, which has 1"):
        mb.Matches._of_parts(*parts)

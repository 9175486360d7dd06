"""Searches and selectors, against their definitions in numpy."""

import dataclasses

import matchbench as mb
import numpy as np
import pytest


def by_hand(a, b):
    """Distances of all pairs of descriptors, in double precision."""
    return np.sqrt(((a.descriptors[:, None, :].astype(float) - b.descriptors[None, :, :]) ** 2).sum(axis=2))


def test_methods_are_what_they_say(features):
    a, b = (one.select(np.arange(100)) for one in features)
    distances = by_hand(a, b)
    order = np.sort(distances, axis=1)
    back = np.sort(distances, axis=0)
    nearest, back_nearest = distances.argmin(axis=1), distances.argmin(axis=0)
    rows = np.arange(100)
    clear = order[:, 0] < 0.8 * order[:, 1]
    mutual = back_nearest[nearest] == rows
    clear_back = (back[0] < 0.8 * back[1])[nearest]
    for method, kept in [
        ("nn", np.full(100, True)),
        ("ratio", clear),
        ("mutual", mutual),
        ("smnn", clear & mutual & clear_back),
    ]:
        indices, found = mb.match(a, b, method)
        assert np.array_equal(indices, np.column_stack([rows, nearest])[kept]), method
        np.testing.assert_allclose(found, order[kept, 0], rtol=1e-6)
    assert mb.match(a, b, ratio=0.6).indices.shape[0] < mb.match(a, b).indices.shape[0]
    assert 0 < clear.sum() < 100


def test_bits_are_counted(images):
    a, b = (mb.ORB().extract(image) for image in images)
    indices, distances = mb.match(a, b, "nn")
    differ = a.descriptors[indices[:, 0]] ^ b.descriptors[indices[:, 1]]
    assert np.array_equal(np.unpackbits(differ, axis=1).sum(axis=1), distances)


def test_wrong_searches_are_refused_in_words(features, images):
    a, b = features
    with pytest.raises(ValueError, match="does nothing"):
        mb.match(a, b, "mutual", ratio=0.8)
    with pytest.raises(ValueError, match="smnn"):
        mb.match(a, b, "flann")
    with pytest.raises(ValueError, match="ratio"):
        mb.match(a, b, ratio=1.5)
    with pytest.raises(ValueError, match="different kinds"):
        mb.match(a, mb.ORB().extract(images[1]))
    with pytest.raises(TypeError, match="from_arrays"):
        mb.match(a.descriptors, b.descriptors)


def test_selectors_keep_some_of_what_they_are_given(features, images, dataset):
    a, b = features
    putative = mb.match(a, b, "nn")
    given = {tuple(pair) for pair in putative.indices.tolist()}
    cameras = (dataset.camera(0), dataset.camera(1))
    for kept in [
        mb.gms(a, b, putative),
        mb.gms(a, b, putative, factor=3, scales=True),
        mb.kvld(a, b, putative, images=tuple(images)),
        mb.code(a, b, putative),
        mb.repmatch(a, b, putative, cameras=cameras),
        mb.adalam(a, b, putative),
    ]:
        assert {tuple(pair) for pair in kept.indices.tolist()} <= given and len(kept.indices) > 0
    # Its candidates are several for each feature, so it makes them itself.
    simulated = [mb.ShearedSURF(views={"shears": 1}).extract(image[60:180, 80:240]) for image in images]
    assert len(mb.gaim(*simulated).indices) > 0
    for none in (mb.Correspondences([], [], []), mb.Correspondences(np.zeros((0, 2), int), [], [])):
        assert mb.gms(a, b, none).indices.shape == (0, 2) and len(mb.adalam(a, b, none)) == 0
    one = mb.Correspondences(np.array([[0, 0]]), np.ones(1, np.float32), np.full(1, 2, np.float32))
    with pytest.raises(ValueError, match="different kinds"):
        mb.adalam(a, mb.ORB().extract(images[1]), one)
    with pytest.raises(TypeError, match="match\\(\\) returns"):
        mb.gms(a, b, putative.indices)
    with pytest.raises(ValueError, match="fcator"):
        mb.gms(a, b, putative, fcator=2)
    wrong = mb.Correspondences(np.array([[0, len(b)]]), np.ones(1, np.float32), np.ones(1, np.float32))
    with pytest.raises(ValueError, match="image b, which has"):
        mb.gms(a, b, wrong)
    for indices in (np.array([[0.9, 1.9]]), np.array([[True, False]])):
        wrong = mb.Correspondences(indices, np.ones(1, np.float32), np.ones(1, np.float32))
        with pytest.raises((TypeError, ValueError), match="whole numbers"):
            mb.gms(a, b, wrong)


def test_pixels_of_another_image_are_refused_by_size(features, images):
    a, b = features
    for wrong, words in [
        ((images[0][:100], images[1]), "image a is 320x100, but its features are of an image of 320x240"),
        ((images[0], images[1][:, :100]), "image b is 100x240, but its features are of an image of 320x240"),
    ]:
        with pytest.raises(ValueError, match=f"images: {words}; give the image that they were found in"):
            mb.kvld(a, b, images=wrong)
    small = [mb.SIFT(max_size=200).extract(image) for image in images]
    assert len(mb.kvld(*small, images=tuple(images)).indices) > 0  # positions are those of the whole image


def test_a_distance_that_is_no_number_is_refused_by_row(features):
    a, b = features
    indices = np.array([[0, 1], [2, 3]])
    one, broken = np.ones(2, np.float32), np.array([1, np.nan], np.float32)
    with pytest.raises(ValueError, match="`distances` is NaN in row 1"):
        mb.gms(a, b, mb.Correspondences(indices, broken, one))
    with pytest.raises(ValueError, match="`second` is NaN in row 1.*infinity where there is no second"):
        mb.gms(a, b, mb.Correspondences(indices, one, broken))
    alone = mb.match(a.select([0, 1, 2]), b.select([0]), "nn")
    assert np.isinf(alone.second).all()  # no second candidate
    mb.gms(a.select([0, 1, 2]), b.select([0]), alone)


def test_matches_know_how_keypoints_turned_and_grew_as_in_a_run(features, images, dataset):
    a, b = features
    found, whole = mb.match(a, b), mb.matcher("sift").match(*images)
    assert np.array_equal(found.indices, whole.indices)
    assert found.turns.tobytes() == whole.turns.tobytes() and found.growths.tobytes() == whole.growths.tobytes()
    of_a, of_b = found.indices.T
    np.testing.assert_allclose(found.turns, (b.angles[of_b] - a.angles[of_a]) % (2 * np.pi), atol=1e-6)
    np.testing.assert_allclose(found.growths, np.log(b.sizes[of_b] / a.sizes[of_a]), atol=1e-6)

    def pose(points_a, points_b, matches):
        options = {name: getattr(matches, name) for name in ("ambiguity", "turns", "growths")}
        return mb.estimator("adaptive").estimate(points_a, points_b, dataset.camera(0), dataset.camera(1), **options)

    one, other = pose(a.keypoints[of_a], b.keypoints[of_b], found), pose(whole.points_a, whole.points_b, whole)
    assert np.array_equal(one.R, other.R) and np.array_equal(one.inliers, other.inliers)

    putative = mb.match(a, b, "nn")
    rows = {tuple(pair): row for row, pair in enumerate(putative.indices.tolist())}
    kept = mb.gms(a, b, putative)
    chosen = [rows[tuple(pair)] for pair in kept.indices.tolist()]
    assert np.array_equal(kept.turns, putative.turns[chosen]) and np.array_equal(kept.growths, putative.growths[chosen])
    places = (mb.Features.from_arrays(one.keypoints, one.descriptors, one.image_size) for one in features)
    unknown = mb.match(*places)
    assert len(unknown) == len(found) and unknown.turns is None and unknown.growths is None


def test_replacing_a_field_of_correspondences_keeps_second(features):
    matches = mb.match(*features)
    halved = dataclasses.replace(matches, distances=matches.distances / 2)
    assert (halved.second == matches.second).all() and len(halved) == len(matches)
    assert np.allclose(halved.ambiguity, matches.ambiguity / 2)
    indices, distances = halved
    assert indices is matches.indices and distances is halved.distances

"""Pose estimation: ours, and by PoseLib's arguments and keys."""

import sys

import matchbench as mb
import numpy as np
import pytest
from matchbench import _pose


@pytest.fixture(scope="module")
def matches(dataset):
    a, b = dataset.pairs[0]
    images = [dataset.read(frame) for frame in (a, b)]
    return mb.matcher("sift").match(*images)


def angle(a, b):
    """Degrees between two rotations or directions."""
    cosine = (np.trace(a.T @ b) - 1) / 2 if a.ndim == 2 else a @ b / np.linalg.norm(b)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def rotation(q):
    """The matrix of a quaternion w, x, y, z."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def poselib_camera(camera, shift=0.0):
    params = [camera.fx, camera.fy, camera.cx + shift, camera.cy + shift]
    return {"model": "PINHOLE", "width": 320, "height": 240, "params": params}


def test_the_pose_is_near_the_truth(dataset):
    """Of points at many depths, which determine it well; the few matches of the small pictures do not."""
    random = np.random.default_rng(4)
    camera, turn = dataset.camera(0), dataset.b_from_a[0][:3, :3]
    shift = np.array([1.0, 0.2, -0.1])
    points_a = random.uniform([-2, -1.5, 4], [2, 1.5, 12], (80, 3))
    points_b = points_a @ turn.T + shift

    def seen(points):
        x, y, z = points.T
        exact = np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=1)
        return exact + random.normal(0, 0.2, exact.shape)

    pose = mb.estimator("best").estimate(seen(points_a), seen(points_b), camera, camera)
    assert angle(pose.R, turn) < 0.5 and angle(pose.t, shift) < 3


def test_the_pose_of_pictures_is_near_the_truth(tmp_path):
    dataset = mb.rendered_scene("cabinet", tmp_path, frames=4, size=(640, 480))
    a, b = dataset.pairs[0]
    matches = mb.matcher("sift").match(dataset.read(a), dataset.read(b))
    cameras = dataset.camera(a), dataset.camera(b)
    pose = mb.estimator("best").estimate(matches.points_a, matches.points_b, *cameras, ambiguity=matches.ambiguity)
    truth = dataset.b_from_a[0]
    assert angle(pose.R, truth[:3, :3]) < 2 and angle(pose.t, truth[:3, 3]) < 10


def test_what_a_pose_says_of_itself(matches, dataset):
    a, b = dataset.pairs[0]
    camera = dataset.camera(a)
    pose = mb.estimator("best").estimate(
        matches.points_a, matches.points_b, camera, dataset.camera(b), ambiguity=matches.ambiguity
    )
    assert pose.inliers.sum() == pose.num_inliers and len(pose.inliers) == len(matches)
    random = np.random.default_rng(0).permutation(len(matches))
    wrong = mb.estimator("best").estimate(matches.points_a, matches.points_b[random], camera, camera)
    assert 0 <= wrong.pose_probability < pose.pose_probability / 2 and pose.pose_probability <= 1
    assert wrong.overlap_probability < 0.5 < pose.overlap_probability
    assert angle(pose.R, np.eye(3)) > 1 and angle(pose.R, pose.R.T) > 1
    np.testing.assert_allclose(rotation(pose.q), pose.R, atol=1e-12)


def test_poselibs_function(matches, dataset):
    a, b = matches.points_a, matches.points_b
    camera = dataset.camera(0)
    pose, info = mb.estimate_relative_pose(
        a, b, poselib_camera(camera), camera, {"max_epipolar_error": 2.0, "seed": 3}, {"loss_type": "TRUNCATED"}
    )
    assert info["num_inliers"] == sum(info["inliers"]) and len(info["inliers"]) == len(a)
    assert info["inlier_ratio"] == info["num_inliers"] / len(a) and info["iterations"] > 0
    assert np.array_equal(pose.Rt, np.column_stack([pose.R, pose.t])) and np.linalg.det(pose.R) == pytest.approx(1)
    np.testing.assert_allclose(rotation(pose.q), pose.R, atol=1e-12)
    ours = mb.estimator("best", sampler="uniform", threshold_px=2, final_loss="truncated").estimate(
        a, b, camera, camera, seed=3
    )
    assert np.array_equal(pose.R, ours.R) and np.array_equal(pose.t, ours.t)
    few, strict = mb.estimate_relative_pose(a, b, camera, camera, {"max_epipolar_error": 0.2})
    assert strict["num_inliers"] < info["num_inliers"] and few is not None
    for options in ({"max_iterations": 100}, {"max_iterations": 100, "success_prob": 1.0}):
        _, short = mb.estimate_relative_pose(a, b, camera, camera, options)
        assert 0 < short["iterations"] <= 100


def test_the_least_number_of_samples_is_that_of_best():
    assert mb.estimator("best").params["min_iterations"] == _pose._LEAST_ITERATIONS


def test_an_estimator_is_like_a_matcher():
    by_class, by_name = mb.Estimator("best", threshold_px=np.float32(1.5)), mb.estimator("best", threshold_px=1.5)
    assert by_class.params == by_name.params and by_class.params["threshold_px"] == 1.5
    assert by_class.params.keys() == mb.estimator("best").params.keys()
    assert eval(repr(by_class), {"estimator": mb.estimator}).params == by_class.params
    assert (mb.estimator("best").of_homographies, mb.estimator("best-h").of_homographies) == (False, True)
    with pytest.raises(TypeError, match="positional argument"):
        mb.Estimator("best", '{"threshold_px": 1.5}')


def test_colmaps_origin_is_taken_off(matches, dataset):
    a, b = matches.points_a, matches.points_b
    camera = dataset.camera(0)
    corner = poselib_camera(camera, 0.5)
    centred, _ = mb.estimate_relative_pose(a, b, camera, camera)
    moved, _ = mb.estimate_relative_pose(a, b, corner, corner, origin="corner")
    np.testing.assert_allclose(moved.R, centred.R, atol=1e-12)
    lens = (0.01, -0.02, 0.001, 0.002, 0.003)
    bent = mb.Camera(camera.fx, camera.fy, camera.cx, camera.cy, lens)
    bent_corner = mb.Camera(camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, lens)
    # Not the camera of the images; but the pose depends on every number of it.
    found, _ = mb.estimate_relative_pose(a, b, bent, bent)
    moved, _ = mb.estimate_relative_pose(a, b, bent_corner, bent_corner, origin="corner")
    unmoved, _ = mb.estimate_relative_pose(a, b, bent_corner, bent_corner)
    np.testing.assert_allclose(moved.R, found.R, atol=1e-12)
    assert angle(found.R, centred.R) > 1e-3 and angle(found.R, unmoved.R) > 1e-4
    assert mb.Camera(500, 500, 320, 240, origin="corner").cx == 319.5
    with pytest.raises(ValueError, match="origin"):
        mb.estimate_relative_pose(a, b, camera, camera, origin="middle")


@pytest.mark.parametrize(
    ("ransac", "bundle", "words"),
    [
        ({"max_epipolar_eror": 1}, {}, "unknown key 'max_epipolar_eror'.*max_epipolar_error.*progressive_sampling, seed"),
        ({"dyn_num_trials_mult": 3.0}, {}, "would do nothing"),
        ({"max_error": 1, "max_epipolar_error": 1}, {}, "by another name"),
        ({"max_epipolar_error": -1}, {}, "threshold_px"),
        ({"max_prosac_iterations": 10}, {}, "prosac_horizon"),
        ({}, {"loss_scale": 1}, "unknown key 'loss_scale'; there are max_iterations, loss_type"),
        ({}, {"loss_type": "HUBER"}, "TRUNCATED or CAUCHY"),
    ],
)
def test_keys_that_do_nothing_are_errors(ransac, bundle, words, matches):
    camera = mb.Camera(300, 300, 160, 120)
    with pytest.raises(ValueError, match=words):
        mb.estimate_relative_pose(matches.points_a, matches.points_b, camera, camera, ransac, bundle)


def test_a_camera_by_its_matrix():
    k = np.array([[300.0, 0, 160], [0, 301, 120], [0, 0, 1]])
    assert mb.Camera.from_matrix(k) == mb.Camera(300, 301, 160, 120)
    assert mb.Camera.from_matrix(k, [0.1, 0, 0, 0]).distortion[0] == 0.1
    with pytest.raises(ValueError):
        mb.Camera.from_matrix(np.eye(3) * np.nan)
    camera = mb.Camera(300, 301, 160, 120, origin="corner")
    assert camera.K.dtype == np.float64 and camera.K.tolist() == [[300, 0, 159.5], [0, 301, 119.5], [0, 0, 1]]
    assert mb.Camera.from_matrix(camera.K) == camera


def test_distortion_in_the_shapes_of_cv2():
    """calibrateCamera returns 1 x 5 or 5 x 1, and that of fisheye 4 x 1."""
    bent = mb.Camera(300, 301, 160, 120, (0.1, -0.2, 0.001, 0.002, 0.3))
    for shape in ((5,), (1, 5), (5, 1)):
        assert mb.Camera(300, 301, 160, 120, np.reshape(bent.distortion, shape)) == bent
        assert mb.Camera.from_matrix(bent.K, np.reshape(bent.distortion, shape)) == bent
    assert mb.Camera(300, 301, 160, 120, [list(bent.distortion)]) == bent
    fisheye = mb.Camera(300, 301, 160, 120, fisheye=[0.1, -0.2, 0.01, 0.02])
    assert mb.Camera(300, 301, 160, 120, fisheye=np.array([[0.1], [-0.2], [0.01], [0.02]])) == fisheye
    for options, words in [
        ({"distortion": np.zeros((1, 8))}, "distortion is .* not 8 numbers"),
        ({"distortion": np.zeros((4, 14))}, "distortion: 56 values, at most 16"),
        ({"distortion": [range(10**6)]}, "distortion: 1000000 values, at most 16"),
        ({"fisheye": np.zeros((1, 5))}, r"fisheye is \(k1, k2, k3, k4\), not 5 numbers"),
    ]:
        with pytest.raises(ValueError, match=words):
            mb.Camera(300, 301, 160, 120, **options)
    for wrong in (7, "abcd", ["a", 0, 0, 0]):
        with pytest.raises((TypeError, ValueError), match="`distortion` must be a few numbers|not 1 numbers"):
            mb.Camera(300, 301, 160, 120, wrong)


def test_a_matrix_is_no_camera(images):
    points, k = np.zeros((9, 2)), np.eye(3)
    told = r"Camera.from_matrix\(K\) makes one of a calibration matrix"
    for call, name in [
        (lambda: mb.estimator("best").estimate(points, points, k, k), "camera_a"),
        (lambda: mb.estimator("best").estimate(points, points, mb.Camera(1, 1, 0, 0), k), "camera_b"),
        (lambda: mb.matcher("sift").match(*images, k, k), "camera_a"),
        (lambda: mb.estimate_relative_pose(points, points, k, k), "camera1"),
    ]:
        with pytest.raises(TypeError, match=told) as caught:
            call()
        notes = getattr(caught.value, "__notes__", [])  # since Python 3.11
        assert name in " ".join([str(caught.value), *notes]) or sys.version_info < (3, 11)


def test_points_in_the_shape_of_cv2_are_told_how_to_be_reshaped():
    points = np.zeros((9, 1, 2), np.float32)
    camera = mb.Camera(1, 1, 0, 0)
    with pytest.raises(ValueError, match=r"`points_a` must be .*n x 2.*\[9, 1, 2\]; .* by points_a.reshape\(-1, 2\)$"):
        mb.estimator("best").estimate(points, points, camera, camera)


def test_cameras_by_colmaps_names():
    bent = mb.Camera.from_model("OPENCV", [500, 501, 320, 240, 0.1, -0.2, 0.001, 0.002], origin="center")
    assert bent.distortion == (0.1, -0.2, 0.001, 0.002, 0.0)
    assert bent == mb.Camera(500, 501, 320, 240, (0.1, -0.2, 0.001, 0.002))
    fisheye = mb.Camera.from_model("OPENCV_FISHEYE", [500, 501, 320, 240, 0.1, -0.2, 0.01, 0.02], origin="center")
    assert fisheye == mb.Camera(500, 501, 320, 240, fisheye=(0.1, -0.2, 0.01, 0.02))
    assert fisheye.distortion is None and fisheye.fisheye == (0.1, -0.2, 0.01, 0.02)
    radial = mb.Camera.from_model("RADIAL_FISHEYE", [500, 320, 240, 0.1, -0.2], origin="center")
    assert radial == mb.Camera(500, 500, 320, 240, fisheye=(0.1, -0.2, 0, 0))
    assert repr(fisheye) == "Camera(500, 501, 320, 240, fisheye=(0.1, -0.2, 0.01, 0.02))"
    with pytest.raises(ValueError, match="not both"):
        mb.Camera(500, 501, 320, 240, (0.1, 0, 0, 0), (0.1, 0, 0, 0))
    for model, params, expected in [
        ("SIMPLE_PINHOLE", [500, 320, 240], mb.Camera(500, 500, 320, 240)),
        ("PINHOLE", [500, 501, 320, 240], mb.Camera(500, 501, 320, 240)),
        ("SIMPLE_RADIAL", [500, 320, 240, 0.1], mb.Camera(500, 500, 320, 240, (0.1, 0, 0, 0))),
        ("RADIAL", [500, 320, 240, 0.1, -0.2], mb.Camera(500, 500, 320, 240, (0.1, -0.2, 0, 0))),
        ("RADIAL", [500, 320, 240, 0, 0], mb.Camera(500, 500, 320, 240)),
        (
            "FULL_OPENCV",
            [500, 501, 320, 240, 0.1, -0.2, 0.001, 0.002, 0.3, 0, 0, 0],
            mb.Camera(500, 501, 320, 240, (0.1, -0.2, 0.001, 0.002, 0.3)),
        ),
    ]:
        assert mb.Camera.from_model(model, params, origin="center") == expected
        corner = mb.Camera.from_model(model, params, origin="corner")
        assert (corner.cx, corner.cy) == (319.5, 239.5) and corner.distortion == expected.distortion
    for model, params, words in [
        ("FOV", [1], "FOV is not supported: .*SIMPLE_RADIAL"),
        ("PINHOLE", [500, 320, 240], "3 parameters.*PINHOLE, which has fx fy cx cy"),
        ("FULL_OPENCV", [1] * 12, "without k4, k5 and k6"),
    ]:
        with pytest.raises(ValueError, match=words):
            mb.Camera.from_model(model, params, origin="center")
    with pytest.raises(ValueError, match="positive"):
        mb.Camera(-1, 1, 0, 0)
    with pytest.raises(ValueError, match="not 3 numbers"):
        mb.Camera(1, 1, 0, 0, (1, 2, 3))
    with pytest.raises(ValueError, match="camera1 has the keys"):
        mb.estimate_relative_pose([[0, 0]], [[0, 0]], {"focal": 1}, bent)


def test_a_bent_lens_is_straightened(dataset, matches):
    """Points that a lens has moved give the pose of those that it has not, if the camera says so."""
    camera = dataset.camera(0)
    k1 = 0.1
    centre, focal = np.array([camera.cx, camera.cy]), np.array([camera.fx, camera.fy])

    def bend(points):
        x = (points - centre) / focal
        return x * (1 + k1 * (x**2).sum(axis=1, keepdims=True)) * focal + centre

    bent = {"model": "SIMPLE_RADIAL", "params": [camera.fx, camera.cx, camera.cy, k1]}
    assert camera.fx == camera.fy
    straight, _ = mb.estimate_relative_pose(matches.points_a, matches.points_b, camera, camera)
    curved, _ = mb.estimate_relative_pose(bend(matches.points_a), bend(matches.points_b), bent, bent)
    assert angle(straight.R, curved.R) < 0.01 and angle(straight.t, curved.t) < 0.1


def test_too_few_matches_are_no_pose():
    camera = mb.Camera(300, 300, 160, 120)
    points = np.arange(8.0).reshape(4, 2)
    with pytest.raises(mb.NoModel, match="too few matches: 4"):
        mb.estimator("best").estimate(points, points, camera, camera)
    pose, info = mb.estimate_relative_pose(points, points, camera, camera)
    assert pose is None and info["num_inliers"] == 0 and "too few" in info["no_pose"]
    for none in (np.zeros((0, 2)), np.array([]), [], ()):
        with pytest.raises(mb.NoModel, match="too few matches: 0"):
            mb.estimator("best").estimate(none, none, camera, camera, ambiguity=[])
        with pytest.raises(mb.NoModel, match="too few matches: 0"):
            mb.estimator("best-h").estimate_homography(none, none)
        pose, info = mb.estimate_relative_pose(none, none, camera, camera)
        assert pose is None and info["inliers"] == [] and "too few" in info["no_pose"]
    for other in ("", {}, None, [[]], np.zeros((0, 3))):
        with pytest.raises((ValueError, TypeError), match="points_b.*n x 2"):
            mb.estimator("best").estimate([], other, camera, camera)
    with pytest.raises(ValueError, match="4 points in image a and 3"):
        mb.estimator("best").estimate(points, points[:3], camera, camera)
    for ambiguity in (-1, np.nan):
        with pytest.raises(ValueError, match="from 0.*row 3") as refused:
            mb.estimator("best").estimate(points, points, camera, camera, ambiguity=[0, 0, 0, ambiguity])
        assert "and above 1 where another candidate than the nearest was chosen" in str(refused.value)
    with pytest.raises(ValueError, match="`turns`.*row 1.*leave them out"):
        mb.estimator("adaptive").estimate(points, points, camera, camera, turns=[0, np.nan, 0, 0])
    with pytest.raises(TypeError, match="turns.*4 numbers"):
        mb.estimator("adaptive").estimate(points, points, camera, camera, turns=[0, 1])
    with pytest.raises(ValueError, match="did you mean"):
        mb.estimator("bset")
    with pytest.raises(ValueError, match="treshold"):
        mb.estimator("best", treshold=1)


@pytest.mark.parametrize("number", [-1, 2**64, 10**30])
def test_a_number_out_of_range_is_an_argument_like_any_other(number, matches, dataset):
    points, camera = (matches.points_a, matches.points_b), dataset.camera(0)
    beyond = f"the whole number {number} is negative, or too large"
    for call, words in (
        (lambda: mb.estimator("best").estimate(*points, camera, camera, seed=number), f"seed: {number}, must be at "),
        (lambda: mb.pair_seed("d", "m", number, 0), beyond),
        (lambda: mb.Features.from_arrays(np.zeros((1, 2)), np.zeros((1, 2), np.float32), (number, 5)), beyond),
    ):
        with pytest.raises(ValueError, match=words):
            call()
    with pytest.raises(IndexError):
        dataset.read(number)


def test_turns_are_refused_where_they_would_do_nothing(matches, dataset):
    points, camera = (matches.points_a, matches.points_b), dataset.camera(0)

    def pose(estimator, turns):
        return estimator.estimate(*points, camera, camera, turns=turns)

    unlike = np.linspace(0, 6, len(matches), dtype=np.float32)
    for estimator in (mb.estimator("adaptive"), mb.estimator("best", turns=True)):
        found = [pose(estimator, turns).R.tobytes() for turns in (None, matches.turns, unlike)]
        assert len(set(found)) > 1
    for id, params, remedy in [
        ("best", {}, r'estimator\("best", turns=True\)'),
        ("adaptive", {"turns": False}, r'estimator\("adaptive", turns=True\)'),
        ("ransac-e", {}, "leave them out, or use"),
        ("lmeds-e", {}, "leave them out, or use"),
    ]:
        estimator = mb.estimator(id, **params)
        with pytest.raises(ValueError, match=f"`turns` would do nothing: this `{id}` uses points alone; .*{remedy}"):
            pose(estimator, matches.turns)
        assert pose(estimator, None).num_inliers > 0
    flat = np.random.default_rng(0).uniform(0, 300, (20, 2))
    with pytest.raises(ValueError, match="`turns` would do nothing.*best-h"):
        mb.estimator("best-h").estimate_homography(flat, flat, turns=np.zeros(20))
    assert mb.estimator("best-h", turns=True).estimate_homography(flat, flat, turns=np.zeros(20)).num_inliers == 20


def test_growths_are_used_by_several_hypotheses_and_refused_elsewhere(matches, dataset):
    points, camera = (matches.points_a, matches.points_b), dataset.camera(0)

    def pose(estimator, **columns):
        return estimator.estimate(*points, camera, camera, **columns)

    adaptive = mb.estimator("adaptive")
    assert pose(adaptive, turns=matches.turns, growths=matches.growths).num_inliers > 0
    for id, params, remedy in [
        ("adaptive", {"hypotheses": 1}, r'keeps the best model alone; make it by estimator\("adaptive", turns=True, hypotheses=8\)'),
        ("best", {}, r'uses points alone; make it by estimator\("best", turns=True\)'),
        ("ransac-e", {}, "uses points alone; leave them out"),
    ]:
        with pytest.raises(ValueError, match=f"`growths` would do nothing: this `{id}` {remedy}"):
            pose(mb.estimator(id, **params), growths=matches.growths)
    with pytest.raises(ValueError, match="`growths`.*row 2 is not finite.*leave them out"):
        pose(adaptive, growths=[0, 0, np.inf, *[0] * (len(matches) - 3)])
    with pytest.raises(ValueError, match="`hypotheses` does nothing"):
        mb.estimator("best", hypotheses=8)


def test_how_keypoints_changed_decides_between_two_motions():
    """More matches move towards the camera, but no keypoint grew, as those of the other motion."""
    random = np.random.default_rng(5)
    camera, shifts = mb.Camera(500, 500, 320, 240), np.array([[0.1, 0.1, -1.8], [-1.0, 0.3, 0.0]])

    def seen(points):
        x, y, z = points.T
        return np.stack([500 * x / z + 320, 500 * y / z + 240], axis=1) + random.normal(0, 0.2, (len(x), 2))

    scene = random.uniform([-1, -0.8, 3], [1, 0.8, 7], (200, 3))
    moved = scene + np.repeat(shifts, [110, 90], axis=0)
    points, unchanged = (seen(scene), seen(moved)), np.zeros(200, np.float32)
    adaptive = mb.estimator("adaptive")
    for columns, right in [({}, 0), ({"turns": unchanged, "growths": unchanged}, 1)]:
        pose = adaptive.estimate(*points, camera, camera, **columns)
        assert angle(pose.t, shifts[right] / np.linalg.norm(shifts[right])) < 3, columns


def test_an_array_without_an_end_is_an_error():
    endless = np.broadcast_to(np.zeros((1, 2)), (10**13, 2))
    camera = mb.Camera(100, 100, 50, 50)
    with pytest.raises(MemoryError, match="no memory for an array of 10000000000000"):
        mb.estimator("best").estimate(endless, endless, camera, camera)


class Boundless:
    """Says that it has more elements than there is memory for, and has none."""

    def __len__(self):
        return 2**62

    def __getitem__(self, index):
        raise IndexError


def test_a_list_is_not_believed_to_be_as_long_as_it_says():
    camera = mb.Camera(100, 100, 50, 50)
    endless = np.broadcast_to(np.float32(1), (10**11, 2))  # one number in memory
    points = np.zeros((3, 2))
    for turns in [endless, endless[:, 0]]:
        with pytest.raises((TypeError, ValueError), match="`turns` must be an array of 3 numbers"):
            mb.estimator("adaptive").estimate(points, points, camera, camera, turns=turns)
    with pytest.raises(MemoryError):
        mb.estimator("adaptive").estimate(points, points, camera, camera, turns=Boundless())
    with pytest.raises(MemoryError):
        mb.estimator("best").estimate(endless, points, camera, camera)


def test_what_is_no_real_number_is_refused():
    camera = mb.Camera(100, 100, 50, 50)
    points = np.zeros((30, 2))
    for other in [points + 1j, points.astype("M8[s]"), points.astype("m8[s]"), points.astype(str)]:
        with pytest.raises(TypeError, match="`points_a` must be an array of numbers"):
            mb.estimator("best").estimate(other, points, camera, camera)
        with pytest.raises(TypeError, match="`ambiguity` must be an array of 30 numbers"):
            mb.estimator("best").estimate(points, points, camera, camera, ambiguity=other[:, 0])


def test_a_list_of_the_wrong_length_is_told_by_its_length():
    camera = mb.Camera(100, 100, 50, 50)
    points, best = np.zeros((30, 2)), mb.estimator("best")
    with pytest.raises(TypeError, match="`ambiguity` must be an array of 30 numbers; this is a list of 20 values$"):
        best.estimate(points, points, camera, camera, ambiguity=[0.5] * 20)
    with pytest.raises(TypeError, match="`points_a` must be .* a tuple of 2 values$"):
        best.estimate(([1, 2], [3]), points, camera, camera)
    with pytest.raises(TypeError, match="`points_a` must be .* a value of type int$"):
        best.estimate(7, points, camera, camera)


def test_a_homography_is_found_among_wrong_matches():
    truth = np.array([[0.9, 0.1, 20.0], [-0.1, 1.1, 5.0], [1e-4, -1e-4, 1.0]])
    rng = np.random.default_rng(0)
    a = rng.uniform(0, 480, (90, 2))
    seen = np.column_stack([a, np.ones(90)]) @ truth.T
    b = seen[:, :2] / seen[:, 2:]
    b[60:] = rng.uniform(0, 480, (30, 2))
    best = mb.estimator("best-h")
    found = best.estimate_homography(a, b, seed=3)
    assert best.of_homographies and found.num_inliers >= 60 and found.inliers[:60].all()
    np.testing.assert_allclose(found.H / found.H[2, 2], truth, atol=1e-5)
    with pytest.raises(ValueError, match="estimate_homography"):
        camera = mb.Camera(500.0, 500.0, 320.0, 240.0)
        best.estimate(a, b, camera, camera)
    with pytest.raises(ValueError, match="estimates poses"):
        mb.estimator("best").estimate_homography(a, b)
    with pytest.raises(mb.NoModel):
        best.estimate_homography(a[:3], b[:3])

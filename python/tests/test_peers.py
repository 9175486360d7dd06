"""Beside cv2, poselib and pycolmap on the same input: agreement; each skipped where it is not installed."""

import matchbench as mb
import numpy as np
import pytest


def share_found(ours, theirs, radius=0.5):
    """Share of their points that have one of ours within the radius."""
    distances = np.linalg.norm(theirs[:, None] - ours[None], axis=2)
    return (distances.min(axis=1) < radius).mean()


@pytest.mark.parametrize("name", ["SIFT_create", "ORB_create", "AKAZE_create", "BRISK_create"])
def test_the_keypoints_are_opencvs(name, images):
    cv2 = pytest.importorskip("cv2", reason="opencv-python is not installed")
    if not hasattr(cv2, name):
        pytest.skip(f"OpenCV {cv2.__version__} has no cv2.{name}")
    theirs, _ = getattr(cv2, name)().detectAndCompute(images[0], None)
    ours, _ = getattr(mb, name)().detectAndCompute(images[0], None)
    points = [np.array([key.pt for key in keys]) for keys in (ours, theirs)]
    assert isinstance(ours[0], cv2.KeyPoint)
    # OpenCV may have one at the threshold that ours has not: its sums are in another order.
    assert min(share_found(*points), share_found(*points[::-1])) > 0.98


def test_the_nearest_neighbours_are_opencvs(features):
    cv2 = pytest.importorskip("cv2", reason="opencv-python is not installed")
    a, b = features
    two = cv2.BFMatcher(cv2.NORM_L2).knnMatch(a.descriptors.copy(), b.descriptors.copy(), k=2)
    theirs = [(m.queryIdx, m.trainIdx) for m, second in two if m.distance < 0.8 * second.distance]
    assert mb.match(a, b).indices.tolist() == [list(pair) for pair in theirs]


def test_the_pose_agrees_with_poselibs(tmp_path):
    """On larger pictures than the other tests have, whose few matches do not determine it well."""
    poselib = pytest.importorskip("poselib", reason="poselib is not installed")
    dataset = mb.rendered_scene("cabinet", tmp_path, frames=4, size=(640, 480))
    matches = mb.matcher("sift").match(dataset.read(0), dataset.read(1))
    camera = dataset.camera(0)
    theirs = {"model": "PINHOLE", "width": 640, "height": 480, "params": [camera.fx, camera.fy, camera.cx, camera.cy]}
    call = (matches.points_a, matches.points_b, theirs, theirs, {"max_epipolar_error": 1.0}, {})
    pose, info = mb.estimate_relative_pose(*call)
    peer, peer_info = poselib.estimate_relative_pose(*call)
    cosine = (np.trace(pose.R.T @ peer.R) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 1
    assert set(info) <= set(peer_info) and info["num_inliers"] > 0.8 * peer_info["num_inliers"]


def test_the_keypoints_agree_with_colmaps(images):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    keypoints, _ = pycolmap.Sift(device=pycolmap.Device.cpu).extract(images[0])
    ours = mb.SIFT().extract(images[0]).keypoints
    # Another implementation, with a lower threshold; and its origin is the corner.
    theirs = np.asarray(keypoints)[:, :2] - 0.5
    assert len(theirs) > len(ours) and share_found(theirs, ours, radius=1.5) > 0.75

"""How the scripts of this folder match, and judge poses: one rule for all, which is that of matchbench."""

import cv2
import numpy as np

RATIO = 0.8
# With fewer matches, or fewer of them in front of both cameras, a pose is a failure.
MIN_SELECTED, MIN_SUPPORT = 20, 10
# Points farther away than this, times the distance of the cameras, support no pose.
MAX_DEPTH = 50.0


def ratio_matches(a, b, finder):
    """The rows (index in a, index in b) of the matches of descriptors that pass the ratio test. None where there are too few
    descriptors for one: `a` and `b` may be None, as OpenCV returns no descriptors."""
    if a is None or b is None or len(a) == 0 or len(b) < 2:
        return np.empty((0, 2), int)
    kept = [m[0] for m in finder.knnMatch(a, b, k=2) if len(m) == 2 and m[0].distance < RATIO * m[1].distance]
    return np.array([(m.queryIdx, m.trainIdx) for m in kept], int).reshape(-1, 2)


def support(pose, matches, k):
    """How many of all matches (rows with x and y in both images, in pixels) lie in front of both cameras of the pose, and not
    too far away: the number that OpenCV's `recoverPose` returns."""
    rotation, translation = pose
    translation = np.ravel(translation)
    camera = np.column_stack([rotation, translation / np.linalg.norm(translation)])
    # Column-wise x and y, both cameras being K.
    a, b = (((matches[:, first : first + 2] - k[[0, 1], 2]) / k[[0, 1], [0, 1]]).T for first in (0, 2))
    points = cv2.triangulatePoints(np.eye(3, 4), camera, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        points = points / points[3]
        depths = points[2], camera[2] @ points
    return int(np.all([(depth > 0) & (depth < MAX_DEPTH) for depth in depths], axis=0).sum())


def judged(pose, matches, k):
    """The pose (R, t), or None if too few matches support it; whichever program it is from."""
    if pose is None or len(matches) < MIN_SELECTED or support(pose, matches, k) < MIN_SUPPORT:
        return None
    return pose


def rotation_angle(a, b):
    """Degrees between two rotations."""
    return np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)))


def direction_angle(a, b):
    """Degrees between two directions; the sign counts."""
    cosine = np.ravel(a) @ np.ravel(b) / np.linalg.norm(a) / np.linalg.norm(b)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def pose_error(pose, truth):
    """The larger of the two angles in degrees; `truth` is the 3 x 4 matrix [R t]."""
    return max(rotation_angle(pose[0], truth[:, :3]), direction_angle(pose[1], truth[:, 3]))


def mean_auc(errors):
    """The paper's AUC: the mean share of errors below 1, 2, ... 15 degrees."""
    errors = np.array(errors)
    return np.mean([np.mean(errors < k) for k in range(1, 16)])


def exact_auc(errors, limit):
    """The area under the recall curve up to the limit, by trapezoids, as SuperGlue has it."""
    errors = np.sort(errors)
    recall = np.arange(1, len(errors) + 1) / len(errors)
    below = errors < limit
    x = np.r_[0.0, errors[below], limit]
    y = np.r_[0.0, recall[below]]
    y = np.r_[y, y[-1]]
    return float(np.sum((x[1:] - x[:-1]) * (y[1:] + y[:-1]) / 2) / limit)

"""SIFT, ORB or AKAZE of OpenCV with its brute-force search, the ratio test, and the mutual check if asked for."""

import sys
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from matchbench_serve import serve

DEFAULTS = {"detector": "SIFT", "max_features": 0, "ratio": 0.8, "mutual": False, "max_size": None}
DETECTORS = {
    "SIFT": lambda n: (cv2.SIFT_create(nfeatures=n), cv2.NORM_L2),
    "ORB": lambda n: (cv2.ORB_create(nfeatures=n or 100000), cv2.NORM_HAMMING),
    # Older versions do not take `max_points`; then a number of features is refused by `prepare`.
    "AKAZE": lambda n: (cv2.AKAZE_create(**({"max_points": n} if n else {})), cv2.NORM_HAMMING),
}


def prepare(params):
    """Refuses a detector that is not there, or that cannot take the parameters."""
    DETECTORS[params["detector"]](params["max_features"])


def extract(image, params):
    detector, norm = DETECTORS[params["detector"]](params["max_features"])
    keypoints, descriptors = detector.detectAndCompute(image.gray(params["max_size"]), None)
    return {"keypoints": [k.pt for k in keypoints], "descriptors": descriptors, "norm": norm}


def match(a, b, params):
    if min(len(a["keypoints"]), len(b["keypoints"])) < 2:
        return [], []
    search = lambda x, y: cv2.BFMatcher(x["norm"]).knnMatch(x["descriptors"], y["descriptors"], k=2)
    good = [(m, s) for m, s in search(a, b) if m.distance < params["ratio"] * s.distance]
    if params["mutual"]:
        back = [m.trainIdx for m, _ in search(b, a)]
        good = [(m, s) for m, s in good if back[m.trainIdx] == m.queryIdx]
    points_a = [a["keypoints"][m.queryIdx] for m, _ in good]
    points_b = [b["keypoints"][m.trainIdx] for m, _ in good]
    return points_a, points_b, [1 - m.distance / s.distance for m, s in good]


serve(match=match, extract=extract, prepare=prepare, name="OpenCV", version=cv2.__version__,
      defaults=DEFAULTS)

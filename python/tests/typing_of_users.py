"""Code as users write it, for pyright alone: it is read in strict mode and never run."""

import matchbench as mb
import numpy as np
from numpy.typing import NDArray


def pose_of(path_a: str, path_b: str) -> NDArray[np.float64]:
    a, b = (mb.SIFT(limit=2000).extract(mb.read_gray(path)) for path in (path_a, path_b))
    found = mb.match(a, b, "smnn", ratio=0.9)
    indices, distances = found
    nearest: np.float32 = distances.min()
    assert nearest >= 0
    camera = mb.Camera(500, 500, 320, 240)
    points_a, points_b = a.keypoints[indices[:, 0]], b.keypoints[indices[:, 1]]
    pose = mb.estimator("best").estimate(points_a, points_b, camera, camera, ambiguity=found.ambiguity)
    return pose.R


def of_colmap(params: NDArray[np.float64], keypoints: NDArray[np.float32], descriptors: NDArray[np.float32]) -> mb.Features:
    camera = mb.Camera.from_model("SIMPLE_RADIAL", params, origin="corner")
    assert camera.fx > 0
    return mb.Features.from_arrays(keypoints, descriptors, [640, 480], origin="corner")


def table(folder: str) -> mb.Scores:
    run = mb.run(folder, ["sift", mb.matcher("orb")], [mb.estimator("best", threshold_px=1)], out="run")
    again = mb.run(folder, "sift", "best", out="run", settings="sift.ratio=0.7")
    assert again.path == run.path
    return mb.evaluate(run)


def best_of(folder: str) -> str:
    scores = mb.evaluate(folder)
    mean: np.float64 = scores["auc"].mean()
    names: list[str] = scores["matcher"]
    assert mean > 0
    return names[int(scores["auc"].argmax())]


def superglue(folder: str) -> NDArray[np.float64]:
    return mb.evaluate(folder, protocol="superglue")["exact_auc_5"]


def failed(folder: str) -> list[tuple[int, int]]:
    pairs = mb.pairs(folder)
    wrong = [outcome != "pose" for outcome in pairs["outcome"]]
    return list(zip(pairs["a"][wrong].tolist(), pairs["b"][wrong].tolist(), strict=True))


def of_cv2(folder: str, k: NDArray[np.float64], distortion: NDArray[np.float64]) -> list[str]:
    dataset = mb.Dataset.open(folder)
    camera = mb.Camera.from_matrix(k, distortion)
    assert camera.K.shape == (3, 3) and (dataset.path / "pairs.txt").is_file()
    run = mb.run(dataset, "sift", out="run", settings={"sift.ratio": 0.7})
    mb.report(run, pictures="all")
    return [image.stem for image in dataset.images]

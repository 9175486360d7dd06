"""Runs SupeRANSAC (Barath, arXiv 2506.04803, 2025) for comparison, if its package `pysuperansac` is installed.

    python compare/superansac.py

It is called as in its authors' tests. It gets pixels and both cameras, and the clearest match first, since its sampler is
PROSAC. The pose is computed from its essential matrix and the matches that agree with it. All settings except the limit of
samples are its defaults, among them 1.5 px. The installed version may have a known error: the package 1.0 on PyPI and the
sources of 25 December 2025 return wrong five-point models (transposed; the latter with two wrong signs too), which local
optimisation has to correct. If this file is run as a script, it tries 1000 samples without local optimisation on 300 exact
matches, and prints how many agree with the best model: all of them, if the five-point models are right. compare/README.md
has the repair.
"""

import importlib.metadata
import time

import cv2
import numpy as np

try:
    import pysuperansac
except ImportError:
    pysuperansac = None

INSTALLED = pysuperansac is not None
# With fewer matches it raises an error.
MIN_MATCHES = 6


def clearest_first(matches):
    """The order that PROSAC needs: by the fifth column, the ambiguity."""
    return matches[np.argsort(matches[:, 4], kind="stable")]


def essential(points, k, options):
    """The essential matrix and the rows of `points` (x and y in the one, in the other image, in pixels) that agree with it."""
    # A call divides the threshold in the settings by the focal length, so settings can be used for one call only.
    settings = pysuperansac.RANSACSettings()
    for name, value in options.items():
        setattr(settings, name, value)
    # Sizes of the images, which none of the defaults uses.
    sizes = [2 * k[1, 2] + 1, 2 * k[0, 2] + 1] * 2
    e, agreeing, _, _ = pysuperansac.estimateEssentialMatrix(points, k, k, sizes, config=settings)
    return np.ascontiguousarray(e), agreeing


def peer(matches, k, options):
    """A pose or None, and its seconds; `matches` are sorted with the clearest first."""
    start = time.perf_counter()
    if len(matches) < MIN_MATCHES:
        return None, time.perf_counter() - start
    points = np.ascontiguousarray(matches[:, :4])
    e, agreeing = essential(points, k, options)
    if len(agreeing) == 0:
        return None, time.perf_counter() - start
    a, b = np.ascontiguousarray(points[agreeing, :2]), np.ascontiguousarray(points[agreeing, 2:])
    _, r, t, _ = cv2.recoverPose(e, a, b, k)
    return (r, t.ravel()), time.perf_counter() - start


def agreeing_with_samples(matches=300):
    """Number of exact matches, out of `matches`, that agree with the best of 1000 samples without local optimisation."""
    k = np.array([[1000.0, 0.0, 640.0], [0.0, 1000.0, 480.0], [0.0, 0.0, 1.0]])
    rotation, _ = cv2.Rodrigues(np.array([0.05, 0.2, -0.1]))
    seen = np.random.default_rng(0).normal(size=(matches, 3)) + [0.0, 0.0, 8.0]
    a, b = seen @ k.T, (seen @ rotation.T + [1.0, 0.2, 0.1]) @ k.T
    points = np.hstack([a[:, :2] / a[:, 2:], b[:, :2] / b[:, 2:]])
    nothing = pysuperansac.LocalOptimizationType.Nothing
    options = {"min_iterations": 1000, "max_iterations": 1000, "local_optimization": nothing, "final_optimization": nothing}
    return len(essential(points, k, options)[1])


def version():
    """Which version is installed, and whether its five-point models are right."""
    try:
        number = importlib.metadata.version("pysuperansac")
    except importlib.metadata.PackageNotFoundError:
        number = "from its sources"
    right = agreeing_with_samples(300) == 300
    return f"SupeRANSAC {number}" + ("" if right else " (five-point models wrong)")


if __name__ == "__main__":
    if INSTALLED:
        print(f"{version()}: {agreeing_with_samples(300)} of 300 exact matches agree with the best of 1000 samples")
    else:
        print("pysuperansac is not installed")

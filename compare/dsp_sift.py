"""Compares our DSP-SIFT and our adapted ellipses with those of COLMAP, which come from VLFeat.

    python compare/dsp_sift.py IMAGE_A IMAGE_B [IMAGE_A IMAGE_B ...] --programs target/release [--rounds 3] [--smallest 0.1667]

`--programs` is a folder with `extract` of this folder. Needs numpy, opencv and pycolmap. Both get the same grey pixels,
thresholds and domain sizes: COLMAP's ten sizes. They start at the smallest, and the step is a tenth of the distance from it
to 3. Descriptors are square-rooted. One line for circles and one for ellipses:

    theirs, ours        number of keypoints
    twins               share of the keypoints of each program that have a twin, which is a keypoint of the other program
                        within 1 px, 10 % in size and 10 degrees (ellipses: within 1 px and 15 degrees, of any size)
    of one place        the same, where only place and size count
    desc                median distance between the descriptors of twins, both of length 1; and for scale, that between a
                        keypoint of theirs and the nearest other one of the same image
    adapted             share of theirs and of ours that are not circles: both keep the circle if no ellipse is found
    shape               median difference of the squared shapes (scaled to one area) of twins that are adapted on both sides
    nearest             keypoints of image a with a twin whose nearest neighbour in b is at the same place (3 px) on both sides
    ratio 0.8, same     matches of theirs by the ratio test that ours has too, and matches of ours that theirs has
    speed               median of theirs / ours over the rounds, in turn, one thread each

COLMAP normalises and clips the descriptor of each size before the mean; we do that for the mean only (as in the paper).
VLFeat samples patches of 31 x 31 pixels; ours are pixels of a layer. An ellipse of theirs keeps its shorter axis, an ellipse
of ours its area, so areas are made equal before shapes are compared.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np
import pycolmap

from pixels import GRAY

CONTRAST, EDGE = 0.04, 10.0
HIGH, SIZES = 3.0, 10


def theirs(image, affine, smallest):
    """Places, 2 x 2 frames and descriptors of length 1, and the seconds that it took."""
    options = pycolmap.FeatureExtractionOptions(use_gpu=False, num_threads=1)
    sift = options.sift
    sift.peak_threshold, sift.edge_threshold, sift.max_num_features = CONTRAST / 3, EDGE, 1_000_000
    sift.num_octaves, sift.max_num_orientations = 10, 10
    sift.domain_size_pooling, sift.estimate_affine_shape = True, affine
    sift.dsp_min_scale, sift.dsp_max_scale, sift.dsp_num_scales = smallest, HIGH, SIZES
    extractor = pycolmap.FeatureExtractor.create(options, device=pycolmap.Device.cpu)
    start = time.perf_counter()
    keypoints, descriptors = extractor.extract_from_uint8_array(image)
    seconds = time.perf_counter() - start
    places = np.array([(k.x - 0.5, k.y - 0.5) for k in keypoints])
    frames = np.array([[[k.a11, k.a12], [k.a21, k.a22]] for k in keypoints])
    descriptors = np.array(descriptors.data if hasattr(descriptors, "data") else descriptors).astype(float)
    return places, frames, descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True), seconds


def ours(program, image, affine, smallest, folder):
    """The same for ours; COLMAP's sizes are the middles of ten equal parts of a range."""
    step = (HIGH - smallest) / SIZES
    params = {"affine_shape": affine, "root": True, "domains": SIZES}
    params |= {"min_domain": smallest - step / 2, "max_domain": HIGH - step / 2}
    cv2.imwrite(str(folder / "i.pgm"), image)
    for old in folder.glob("f.*"):
        old.unlink()
    command = [program, f"dsp-sift={json.dumps(params)}", folder / "i.pgm", "1", folder / "f"]
    text = subprocess.run(command, check=True, capture_output=True, text=True, env={"RAYON_NUM_THREADS": "1"})
    keypoints = np.load(folder / "f.keypoints.npy").reshape(-1, 6).astype(float)
    descriptors = np.load(folder / "f.descriptors.npy").astype(float)
    if affine:
        frames = np.load(folder / "f.frames.npy").reshape(-1, 2, 2).astype(float)
    else:
        angle, radius = np.radians(keypoints[:, 3]), keypoints[:, 2] / 2
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        frames = np.stack([np.stack([x, -y], 1), np.stack([y, x], 1)], 1)
    return keypoints[:, :2], frames, descriptors, float(text.stdout) / 1000


def twins(a, b, sizes, angles):
    """For each of a the index of its twin in b, or -1."""
    size = [np.sqrt(np.abs(np.linalg.det(frames))) for _, frames, *_ in (a, b)]
    angle = [np.arctan2(frames[:, 1, 0], frames[:, 0, 0]) for _, frames, *_ in (a, b)]
    found = np.full(len(a[0]), -1)
    for i, place in enumerate(a[0]):
        near = np.flatnonzero(np.abs(b[0][:, 0] - place[0]) < 1)
        distance = np.linalg.norm(b[0][near] - place, axis=1)
        turn = np.abs((np.degrees(angle[1][near] - angle[0][i]) + 180) % 360 - 180)
        growth = np.abs(np.log(size[1][near] / size[0][i]))
        fits = (distance < 1) & (growth < np.log(1 + sizes)) & (turn < angles)
        if fits.any():
            found[i] = near[fits][np.argmin(distance[fits] + turn[fits] / 10)]
    return found


def two_nearest(a, b):
    squared = (a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2 * a @ b.T
    first = squared.argmin(axis=1)
    two = np.sqrt(np.maximum(np.partition(squared, 1, axis=1)[:, :2], 0))
    return first, two[:, 0] < 0.8 * two[:, 1]


def shapes(frames):
    squares = frames @ frames.transpose(0, 2, 1)
    return squares / np.sqrt(np.linalg.det(squares))[:, None, None]


def adapted(frames):
    long, short = np.linalg.svd(frames, compute_uv=False).T
    return long > 1.0001 * short


def percent(share):
    return f"{100 * np.mean(share):.1f} %" if len(share) else "none"


def row(name, pairs, speeds):
    collected = defaultdict(list)
    counts = [0, 0]
    for sides in pairs:
        for them, us in sides:
            counts[0] += len(them[0])
            counts[1] += len(us[0])
        (them_a, us_a), (them_b, us_b) = sides
        limits = (np.inf, 15) if name == "ellipses" else (0.1, 10)
        twin_a, twin_b = twins(them_a, us_a, *limits), twins(us_a, them_a, *limits)
        collected["theirs"].append(twin_a >= 0)
        collected["ours"].append(twin_b >= 0)
        collected["place"].append(twins(them_a, us_a, limits[0], 360) >= 0)
        has = np.flatnonzero(twin_a >= 0)
        collected["desc"].append(np.linalg.norm(them_a[2][has] - us_a[2][twin_a[has]], axis=1))
        inner = them_a[2] @ them_a[2].T
        apart = np.linalg.norm(them_a[0][:, None] - them_a[0][None], axis=2) > 3
        other = np.where(apart, inner, -1).max(axis=1)
        collected["other"].append(np.sqrt(np.maximum(2 - 2 * other, 0)))
        frames = them_a[1][has], us_a[1][twin_a[has]]
        are = adapted(frames[0]) & adapted(frames[1])
        both = [shapes(side[are]) for side in frames]
        collected["adapted"].append(adapted(them_a[1]))
        collected["our adapted"].append(adapted(us_a[1]))
        collected["shape"].append(np.linalg.norm(both[0] - both[1], axis=(1, 2)) / np.linalg.norm(both[0], axis=(1, 2)))
        (first_t, clear_t), (first_u, clear_u) = two_nearest(them_a[2], them_b[2]), two_nearest(us_a[2], us_b[2])
        meets = np.linalg.norm(them_b[0][first_t[has]] - us_b[0][first_u[twin_a[has]]], axis=1) < 3
        collected["nearest"].append(meets)
        both_clear = clear_u[twin_a[has]] & meets
        collected["tr"].append(both_clear[clear_t[has]])
        collected["or"].append((clear_t[has] & meets)[clear_u[twin_a[has]]])
    all_of = {key: np.concatenate(values) for key, values in collected.items()}
    cells = [name, counts[0], counts[1]]
    cells += [f"{percent(all_of['theirs'])}, {percent(all_of['ours'])}", percent(all_of["place"])]
    cells += [f"{np.median(all_of['desc']):.3f}, {np.median(all_of['other']):.3f}"]
    is_adapted = name == "ellipses"
    cells += [f"{percent(all_of['adapted'])}, {percent(all_of['our adapted'])}" if is_adapted else "–"]
    cells += [f"{np.median(all_of['shape']):.3f}" if is_adapted else "–"]
    cells += [percent(all_of["nearest"]), f"{percent(all_of['tr'])}, {percent(all_of['or'])}"]
    cells += [f"{statistics.median(speeds):.1f}"]
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", nargs="+", type=Path)
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--smallest", type=float, default=1 / 6, help="smallest size of a domain")
    arguments = parser.parse_args()
    images = [cv2.imread(str(path), GRAY) for path in arguments.images]
    program = (arguments.programs / "extract").resolve()
    print("| | theirs | ours | twins of theirs, of ours | of one place | desc, others | adapted | shape | nearest | ratio 0.8, same | speed |")
    print("| --- | " + "---: | " * 10)
    with tempfile.TemporaryDirectory() as folder:
        for name, affine in (("circles", False), ("ellipses", True)):
            speeds, sides = [], []
            for turn in range(arguments.rounds):
                for image in images:
                    them = theirs(image, affine, arguments.smallest)
                    us = ours(program, image, affine, arguments.smallest, Path(folder))
                    speeds.append(them[3] / us[3])
                    if turn == 0:
                        sides.append((them, us))
            row(name, list(zip(sides[::2], sides[1::2], strict=True)), speeds)


if __name__ == "__main__":
    main()

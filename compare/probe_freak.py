"""Recover FREAK's 512 pairs by measurement, and write them as crates/vision/src/tables/freak_pairs.bin.

FREAK compares the means over 43 receptive fields of known geometry (section 3 of the paper). Which 512 of the 903 pairs it
compares was learned from training images, and is not published. Here the pairs are measured. OpenCV describes keypoints in
images of noise, without an orientation. Bit k of each descriptor then says whether the mean over field i_k is at least that
over field j_k. Each descriptor halves the number of pairs that can explain a bit. After a few hundred descriptors exactly
one pair is left; otherwise this script stops.

    pip install -r compare/requirements.txt
    python compare/probe_freak.py

The table: 512 rows of 2 bytes, i_k and j_k. Fields are numbered from the outermost ring inwards.
"""

import hashlib
import pathlib

import cv2
import numpy as np

BITS, FIELDS = 512, 43
SCALES, OCTAVES, PATTERN, SMALLEST = 64, 4, 22, 7
TABLE = pathlib.Path(__file__).parents[1] / "crates/vision/src/tables/freak_pairs.bin"


def fields():
    """x, y and radius of the receptive fields of the upright pattern of size 1."""
    largest, smallest = 2 / 3, 2 / 24
    space = (largest - smallest) / 21
    radii = [largest - k * space for k in (0, 6, 11, 15, 18, 20)] + [smallest, 0]
    rows = []
    for ring, radius in enumerate(radii):
        count = 6 if radius else 1
        for k in range(count):
            angle = 2 * np.pi * k / count + np.pi / count * (ring % 2)
            rows.append((radius * np.cos(angle), radius * np.sin(angle), (radius or smallest) / 2))
    return np.array(rows)


def means(image, x, y, size):
    """The mean over each field about a keypoint, rounded."""
    scale = min(max(int(np.log(size / SMALLEST) * SCALES / (np.log(2) * OCTAVES) + 0.5), 0), SCALES - 1)
    integral = cv2.integral(image).astype(np.int64)
    place = fields() * PATTERN * 2 ** (OCTAVES * scale / SCALES)
    left, top = (place[:, 0] + x - place[:, 2] + 0.5).astype(int), (place[:, 1] + y - place[:, 2] + 0.5).astype(int)
    right, bottom = (place[:, 0] + x + place[:, 2] + 1.5).astype(int), (place[:, 1] + y + place[:, 2] + 1.5).astype(int)
    area = (right - left) * (bottom - top)
    sums = integral[bottom, right] - integral[bottom, left] - integral[top, right] + integral[top, left]
    return (sums + area // 2) // area


def measure(seed):
    """Means over the fields around keypoints in noise (n, 43), and their bits (n, 512)."""
    image = np.random.default_rng(seed).integers(0, 256, (480, 640), dtype=np.uint8)
    keypoints = [cv2.KeyPoint(float(x), float(y), 12, 0, 0, 0) for y in range(60, 420, 24) for x in range(60, 580, 24)]
    keypoints, descriptors = cv2.xfeatures2d.FREAK_create(orientationNormalized=False).compute(image, keypoints)
    values = [means(image, *k.pt, k.size) for k in keypoints]
    return np.array(values), np.unpackbits(descriptors, axis=1, bitorder="little")


def main():
    values, bits = (np.concatenate(parts) for parts in zip(*map(measure, range(2))))
    print(f"{len(values)} descriptors by OpenCV {cv2.__version__}")
    at_least = values[:, :, None] >= values[:, None, :]
    found = []
    for bit in range(BITS):
        explains = (at_least == (bits[:, bit] == 1)[:, None, None]).all(axis=0)
        found.append(np.argwhere(explains))
    ambiguous = [bit for bit in range(BITS) if len(found[bit]) != 1]
    if ambiguous:
        raise SystemExit(f"bits without a single explanation: {ambiguous}")
    table = np.array([pairs[0] for pairs in found], dtype=np.uint8)
    if len(np.unique(np.sort(table, axis=1), axis=0)) != BITS:
        raise SystemExit("the same pair twice")
    TABLE.write_bytes(table.tobytes())
    print(f"{TABLE.name}: {table.size} bytes, sha-256 {hashlib.sha256(table.tobytes()).hexdigest()}")


if __name__ == "__main__":
    main()

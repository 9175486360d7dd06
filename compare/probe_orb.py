"""Recover ORB's 256 tests by measurement, and write them as crates/vision/src/tables/orb_pairs.bin.

For each of its 256 bits, ORB compares the smoothed intensities at two places. The places were chosen by a greedy search over
training images, and are not printed in the paper. Here they are measured. OpenCV describes upright keypoints in images of
noise. Bit i of each descriptor then says whether S(p_i) < S(q_i), where S is the image after the 7x7 Gaussian blur. (ORB
blurs a part of a larger image. For this OpenCV does not use its fixed-point `GaussianBlur`, and rounds as `sepFilter2D`
does.) Each descriptor halves the number of pairs of places that can explain a bit. After a few hundred descriptors exactly
one pair is left; otherwise this script stops.

    pip install -r compare/requirements.txt
    python compare/probe_orb.py

The table: 256 rows of 4 signed bytes, x and y of p_i, x and y of q_i, relative to the keypoint.
"""

import hashlib
import pathlib

import cv2
import numpy as np

HALF = 15  # the patch is 31 x 31
BITS = 256
TABLE = pathlib.Path(__file__).parents[1] / "crates/vision/src/tables/orb_pairs.bin"


def measure(seed):
    """Smoothed patches (n, 31 * 31) around keypoints in noise, and their bits (n, 256)."""
    image = np.random.default_rng(seed).integers(0, 256, (480, 640), dtype=np.uint8)
    kernel = cv2.getGaussianKernel(7, 2, cv2.CV_32F)
    smooth = cv2.sepFilter2D(image, cv2.CV_8U, kernel, kernel)
    keypoints = [
        cv2.KeyPoint(float(x), float(y), 2 * HALF + 1, 0, 0, 0)
        for y in range(40, 440, 24)
        for x in range(40, 600, 24)
    ]
    keypoints, descriptors = cv2.ORB_create().compute(image, keypoints)
    centres = [(int(k.pt[0]), int(k.pt[1])) for k in keypoints]
    patches = [smooth[y - HALF : y + HALF + 1, x - HALF : x + HALF + 1].ravel() for x, y in centres]
    return np.array(patches), np.unpackbits(descriptors, axis=1, bitorder="little")


def main():
    patches, bits = (np.concatenate(parts) for parts in zip(*map(measure, range(2))))
    print(f"{len(patches)} descriptors by OpenCV {cv2.__version__}")
    signs = bits.astype(np.float32) * 2 - 1
    width = 2 * HALF + 1
    found = [[] for _ in range(BITS)]
    for p in range(width * width):
        darker = (patches[:, p : p + 1] < patches).astype(np.float32) * 2 - 1
        agreement = darker.T @ signs
        for q, bit in np.argwhere(agreement == len(patches)):
            found[bit].append((p % width - HALF, p // width - HALF, q % width - HALF, q // width - HALF))
    ambiguous = [bit for bit in range(BITS) if len(found[bit]) != 1]
    if ambiguous:
        raise SystemExit(f"bits without a single explanation: {ambiguous}")
    table = np.array([pairs[0] for pairs in found], dtype=np.int8).tobytes()
    TABLE.parent.mkdir(parents=True, exist_ok=True)
    TABLE.write_bytes(table)
    print(f"{TABLE.name}: {len(table)} bytes, sha-256 {hashlib.sha256(table).hexdigest()}")


if __name__ == "__main__":
    main()

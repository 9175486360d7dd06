"""Recover LATCH's 256 triplets by measurement, and write them as crates/vision/src/tables/latch_triplets.bin.

For each of its bits, LATCH compares the patch around an anchor with the patches around two companions. The triplets were
learned from pairs of image patches, and are not printed in the paper. Here they are measured. OpenCV describes upright
keypoints with patches of one pixel, without blur. So bit i says whether
(I(anchor) - I(first))^2 < (I(anchor) - I(second))^2.

In an image of black and white noise, if a bit is set, anchor and first companion have the same colour and the second
companion has the other. Each such bit halves the number of triplets that can explain it, until one is left. Which of the
two with the same colour is the anchor follows from noise in all greys.

    pip install -r compare/requirements.txt
    python compare/probe_latch.py

The table: 256 rows of 6 signed bytes, x and y of the anchor, of the first and of the second companion,
relative to the keypoint.
"""

import hashlib
import pathlib

import cv2
import numpy as np

BITS = 256
HALF = 24  # no companion is further away, in x or in y
TABLE = pathlib.Path(__file__).parents[1] / "crates/vision/src/tables/latch_triplets.bin"


def measure(noise):
    """Patches (n, 49 * 49) around keypoints in an image, and their bits (n, 256)."""
    keypoints = [cv2.KeyPoint(float(x), float(y), 10, 0) for y in range(30, 450, 24) for x in range(30, 610, 24)]
    latch = cv2.xfeatures2d.LATCH_create(BITS // 8, rotationInvariance=False, half_ssd_size=0, sigma=0)
    keypoints, descriptors = latch.compute(noise, keypoints)
    centres = [(int(k.pt[0]), int(k.pt[1])) for k in keypoints]
    patches = [noise[y - HALF : y + HALF + 1, x - HALF : x + HALF + 1].ravel() for x, y in centres]
    return np.array(patches, np.int32), np.unpackbits(descriptors, axis=1, bitorder="little")


def main():
    random = np.random.default_rng(0)
    colours, bits = measure(random.integers(0, 2, (480, 640), dtype=np.uint8) * 255)
    signs = (colours > 0).astype(np.float32) * 2 - 1
    greys, grey_bits = measure(random.integers(0, 256, (480, 640), dtype=np.uint8))
    print(f"{len(bits) + len(greys)} descriptors by OpenCV {cv2.__version__}")

    triplets = []
    for bit in range(BITS):
        seen = signs[bits[:, bit] == 1]
        alike = np.triu(seen.T @ seen, 1)
        explains = []
        for p, q in np.argwhere(alike == len(seen)):
            for other in np.flatnonzero(seen.T @ seen[:, p] == -len(seen)):
                for anchor, first in ((p, q), (q, p)):
                    near = (greys[:, anchor] - greys[:, first]) ** 2
                    far = (greys[:, anchor] - greys[:, other]) ** 2
                    if np.array_equal(near < far, grey_bits[:, bit] == 1):
                        explains.append((anchor, first, other))
        if len(explains) != 1:
            raise SystemExit(f"bit {bit} has {len(explains)} explanations")
        triplets.append(explains[0])

    places = np.array(triplets)
    table = np.stack([places % (2 * HALF + 1), places // (2 * HALF + 1)], axis=2) - HALF
    table = table.astype(np.int8).tobytes()
    TABLE.write_bytes(table)
    print(f"{TABLE.name}: {len(table)} bytes, sha-256 {hashlib.sha256(table).hexdigest()}")


if __name__ == "__main__":
    main()

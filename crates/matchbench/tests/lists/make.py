"""Makes the binary fixtures of the importers' tests, in the form that their authors' tools write.

    pip install numpy h5py
    python make.py

calibration_7.h5  one image of the Image Matching Challenge 2020, by h5py: K, R, T as float64
megadepth.npz     LoFTR's kind of file: a pickle (protocol 4) of object arrays, by numpy
model/*.bin       a COLMAP model with two photographs, written field by field after COLMAP's
                  documentation of its binary format
"""

import pickle
import struct
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).parent


def rotation_y(radians):
    c, s = np.cos(radians), np.sin(radians)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def calibration():
    with h5py.File(HERE / "calibration_7.h5", "w") as file:
        file["K"] = np.array([[20.0, 0, 11.5], [0, 21.0, 8.0], [0, 0, 1]])
        file["R"] = rotation_y(0.1)
        file["T"] = np.array([1.0, 2.0, 3.0])


def megadepth():
    def objects(values):
        array = np.empty(len(values), dtype=object)
        for index, value in enumerate(values):
            array[index] = value
        return array

    def pose(x):
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_y(0.1 * x)
        matrix[0, 3] = x
        return matrix

    k = np.array([[20.0, 0, 12.0], [0, 21.0, 8.5], [0, 0, 1]])
    contents = {
        "image_paths": objects(["0.png", None, "2.png", "3.png"]),
        "depth_paths": objects(["0.h5", None, "gone.h5", None]),
        "intrinsics": objects([k, None, np.asfortranarray(k), k]),
        "poses": objects([pose(0.0), None, pose(1.0), pose(2.0)]),
        "pair_infos": [
            (np.array([3, 0]), np.float64(0.2), np.array([1.0, 2, 3, 4])),
            (np.array([0, 2]), np.float64(0.4), np.array([1.0, 2, 3, 4])),
        ],
    }
    with open(HERE / "megadepth.npz", "wb") as file:
        pickle.dump(contents, file, protocol=4)


def model():
    folder = HERE / "model"
    folder.mkdir(exist_ok=True)
    with open(folder / "cameras.bin", "wb") as file:
        file.write(struct.pack("<Q", 2))
        file.write(struct.pack("<IiQQ3d", 1, 0, 24, 17, 20.0, 12.0, 8.5))
        file.write(struct.pack("<IiQQ4d", 5, 2, 24, 17, 21.0, 12.0, 8.5, 0.125))
    with open(folder / "images.bin", "wb") as file:
        file.write(struct.pack("<Q", 2))
        for number, name, camera, x, points in [
            (9, b"b.png", 5, 1.0, [7, 8, 9, -1]),
            (4, b"a.png", 1, 0.0, [9, 8, 11, 12]),
        ]:
            file.write(struct.pack("<I7dI", number, 1, 0, 0, 0, x, 0, 0, camera) + name + b"\0")
            file.write(struct.pack("<Q", len(points)))
            for point in points:
                file.write(struct.pack("<2dq", 1.5, 2.5, point))


calibration()
megadepth()
model()

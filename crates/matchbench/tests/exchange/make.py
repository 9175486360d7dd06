"""Writes fixtures.zip: the same synthetic matches of three images in the layouts of other tools.

Needs h5py, numpy and pycolmap; the archive was made with h5py 3.16, numpy 2.4 and pycolmap 4.2.1.
"""

import os
import tempfile
import zipfile

import h5py
import numpy as np
import pycolmap

IMAGES = ["db/one.png", "db/two.png", "query/one.png"]
FLAT = ["db-one", "db-two", "query-one"]
KEYPOINTS = [
    np.array(
        [[10 + 8 * i, 20 + 5 * i], [390 - 8 * i, 280 - 5 * i], [100.5 + i, 50.25], [7 * i + 200, 150]],
        np.float32,
    )
    for i in range(3)
]
# Frames a and b; keypoints of a, of b, scores.
MATCHES = [
    (0, 1, [0, 1, 3], [1, 0, 2], [0.9, 0.5, 0.25]),
    (0, 2, [1, 2], [3, 2], [1.0, 0.125]),
    (1, 2, [0, 1, 2, 3], [0, 1, 2, 3], [0.5, 0.5, 0.75, 1.0]),
]


def name(a, b, separator):
    return separator.join(IMAGES[i].replace("/", "-") for i in (a, b))


def dense(i, values, default, dtype):
    array = np.full(4, default, dtype)
    array[i] = values
    return array


def hloc_sparse(file, key, i, j, score):
    file[f"{key}/matches0"] = dense(i, j, -1, np.int16)
    file[f"{key}/matching_scores0"] = dense(i, score, 0, np.float16)


def hloc(folder):
    with h5py.File(f"{folder}/features.h5", "w") as file:
        for image, keypoints in zip(IMAGES, KEYPOINTS):
            file[f"{image}/keypoints"] = keypoints.astype(np.float16)
    with h5py.File(f"{folder}/matches.h5", "w") as file:
        for a, b, i, j, score in MATCHES:
            if (a, b) == (0, 2):  # in reverse
                hloc_sparse(file, name(b, a, "/"), j, i, score)
            else:
                hloc_sparse(file, name(a, b, "/"), i, j, score)


def hloc_old(folder):
    with h5py.File(f"{folder}/features.h5", "w", libver="latest") as file:
        for image, keypoints in zip(IMAGES, KEYPOINTS):
            file.create_dataset(f"{image}/keypoints", data=keypoints, compression="gzip")
    with h5py.File(f"{folder}/matches.h5", "w", libver="latest") as file:
        for a, b, i, j, score in MATCHES:
            hloc_sparse(file, name(a, b, "_"), i, j, score)


def hloc_dense(folder):
    with h5py.File(f"{folder}/matches.h5", "w") as file:
        for a, b, i, j, score in MATCHES:
            group = file.create_group(name(a, b, "/"))
            group["keypoints0"] = KEYPOINTS[a][i]
            group["keypoints1"] = KEYPOINTS[b][j]
            group["scores"] = np.array(score, np.float32)


def glue_factory(folder):
    with h5py.File(f"{folder}/predictions.h5", "w") as file:
        for a, b, i, j, score in MATCHES:
            group = file.create_group(name(a, b, "/"))
            group["keypoints0"] = KEYPOINTS[a] + 0.5
            group["keypoints1"] = KEYPOINTS[b] + 0.5
            group["matches0"] = dense(i, j, -1, np.int64)
            group["matches1"] = dense(j, i, -1, np.int64)
            group["matching_scores0"] = dense(i, score, 0, np.float32)
            group["matching_scores1"] = dense(j, score, 0, np.float32)


def imc(folder):
    with h5py.File(f"{folder}/keypoints.h5", "w") as file:
        for image, keypoints in zip(FLAT, KEYPOINTS):
            file[image] = keypoints
    with h5py.File(f"{folder}/matches.h5", "w") as file:
        for a, b, i, j, _ in MATCHES:
            file[f"{FLAT[b]}-{FLAT[a]}"] = np.array([j, i], np.int64)


def colmap(folder):
    database = pycolmap.Database.open(f"{folder}/database.db")
    camera = pycolmap.Camera(model="PINHOLE", width=400, height=300, params=[350, 350, 200, 150])
    camera_id = database.write_camera(camera)
    ids = [database.write_image(pycolmap.Image(name=image, camera_id=camera_id)) for image in IMAGES]
    for image_id, keypoints in zip(ids, KEYPOINTS):
        scale_and_angle = np.tile(np.array([1, 0], np.float32), (4, 1))
        database.write_keypoints(image_id, np.hstack([keypoints + 0.5, scale_and_angle]))
    for a, b, i, j, _ in MATCHES:
        matches = np.stack([i, j], 1).astype(np.uint32)
        database.write_matches(ids[a], ids[b], matches)
        verified = pycolmap.TwoViewGeometry()
        verified.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
        verified.inlier_matches = matches[:2]
        database.write_two_view_geometry(ids[a], ids[b], verified)
    database.close()


def superglue(folder):
    """As if the images had been resized to 200 x 200."""
    for a, b, i, j, score in MATCHES:
        small = [((KEYPOINTS[x] + 0.5) / [2, 1.5] - 0.5).astype(np.float32) for x in (a, b)]
        np.savez(
            f"{folder}/{FLAT[a]}_{FLAT[b]}_matches.npz",
            keypoints0=small[0],
            keypoints1=small[1],
            matches=dense(i, j, -1, np.int64),
            match_confidence=dense(i, score, 0, np.float32),
        )


def npz(folder):
    for a, b, i, j, score in MATCHES:
        points = {"a": KEYPOINTS[a][i], "b": KEYPOINTS[b][j], "score": np.array(score, np.float32)}
        np.savez_compressed(f"{folder}/{a}_{b}.npz", **points)


def packed(folder):
    rows = [
        np.hstack([KEYPOINTS[a][i], KEYPOINTS[b][j], 1 - np.array(score)[:, None]])
        for a, b, i, j, score in MATCHES
    ]
    np.savez(
        f"{folder}/matches.npz",
        pairs=np.array([match[:2] for match in MATCHES], np.int32),
        offsets=np.cumsum([0] + [len(row) for row in rows]),
        xy=np.vstack(rows).astype(np.float32),
    )


def text(folder):
    for a, b, i, j, score in MATCHES:
        rows = np.hstack([KEYPOINTS[a][i], KEYPOINTS[b][j], np.array(score)[:, None]])
        np.savetxt(f"{folder}/{a}_{b}.txt", rows, fmt="%.9g")


if __name__ == "__main__":
    here = os.path.dirname(os.path.abspath(__file__))
    with zipfile.ZipFile(f"{here}/fixtures.zip", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for make in (npz, packed, text, hloc, hloc_old, hloc_dense, glue_factory, colmap, superglue, imc):
            with tempfile.TemporaryDirectory() as folder:
                make(folder)
                for file in sorted(os.listdir(folder)):
                    archive.write(f"{folder}/{file}", f"{make.__name__}/{file}")

"""Whether the truth of a dataset can be right: the poses of a reconstruction by COLMAP, beside it.

    python compare/reconstruct.py FRAMES PAIRS OUT

FRAMES is a dataset of many images of one camera, from which COLMAP (SIFT, exhaustive matching, incremental mapping, bundle
adjustment) makes a model with that camera as it is. PAIRS is a dataset of some of these images. The relative poses of its pairs in
the model are written to OUT/<name of PAIRS>/colmap.txt as results of a matcher, so that `matchbench eval OUT --datasets
FOLDER` scores them, where FOLDER holds PAIRS. The number of inliers of a pair is that of points that both images see. A
model of many images is far more exact than a pose of two, so where it has a low score the truth contradicts the images.
"""

import argparse
import pathlib
import sys
import tempfile

import numpy as np
import pycolmap

from dataset import images_of, one_camera, true_poses


def reconstruct(images, k):
    """The largest model of the images, which have the camera K."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "images").mkdir()
        for number, image in enumerate(images):
            (folder / "images" / f"{number:06}{image.suffix}").symlink_to(image.resolve())
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = "PINHOLE"
        reader.camera_params = ",".join(str(x) for x in (k[0, 0], k[1, 1], k[0, 2], k[1, 2]))
        extraction, matching = pycolmap.FeatureExtractionOptions(), pycolmap.FeatureMatchingOptions()
        extraction.use_gpu = matching.use_gpu = False
        # One thread, so that the model is the same each time.
        extraction.num_threads = matching.num_threads = 1
        extraction.sift.peak_threshold = 0.004
        mapping = pycolmap.IncrementalPipelineOptions()
        mapping.num_threads = 1
        mapping.multiple_models = False
        mapping.ba_refine_focal_length = mapping.ba_refine_principal_point = mapping.ba_refine_extra_params = False
        database = folder / "database.db"
        single = pycolmap.CameraMode.SINGLE
        pycolmap.extract_features(
            database, folder / "images", camera_mode=single, reader_options=reader, extraction_options=extraction
        )
        pycolmap.match_exhaustive(database, matching_options=matching)
        models = pycolmap.incremental_mapping(database, folder / "images", folder, options=mapping)
    if not models:
        sys.exit("COLMAP makes no model of these images")
    return max(models.values(), key=lambda model: model.num_reg_images())


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("frames", metavar="FRAMES", type=pathlib.Path)
    parser.add_argument("pairs", metavar="PAIRS", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    args = parser.parse_args()
    numbers = {image.resolve(): number for number, image in enumerate(images_of(args.frames))}
    frames = images_of(args.pairs)
    missing = [image for image in frames if image.resolve() not in numbers]
    if missing:
        sys.exit(f"{args.frames} has no {missing[0]}")
    model = reconstruct(images_of(args.frames), one_camera(args.frames))
    print(
        f"{model.num_reg_images()} of {len(numbers)} images, {model.num_points3D()} points,"
        f" mean reprojection error {model.compute_mean_reprojection_error():.2f} px"
    )
    seen = {int(pathlib.Path(image.name).stem): image for image in model.images.values() if image.has_pose}
    out = args.out / args.pairs.resolve().name / "colmap.txt"
    out.parent.mkdir(parents=True)
    with out.open("w") as file:
        for a, b in true_poses(args.pairs):
            both = [seen.get(numbers[frames[frame].resolve()]) for frame in (a, b)]
            if None in both:
                continue
            b_from_a = both[1].cam_from_world() * both[0].cam_from_world().inverse()
            points = [{point.point3D_id for point in image.get_observation_points2D()} for image in both]
            rows = " ".join(f"{x:.9g}" for x in np.ravel(b_from_a.matrix()))
            file.write(f"{a} {b} {len(points[0] & points[1])} {rows}\n")


if __name__ == "__main__":
    main()

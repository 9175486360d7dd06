"""Features: arrays, errors that teach, OpenCV's way of calling."""

import json
import os
import struct
import subprocess
import sys
import zlib

import matchbench as mb
import numpy as np
import pytest

EVERY = [
    mb.SIFT, mb.SURF, mb.ORB, mb.BRISK, mb.KAZE, mb.AKAZE, mb.DLCO, mb.FREAK, mb.FREAKOnSIFT, mb.BinBoost,
    mb.LATCH, mb.DAISY, mb.ASIFT, mb.ShearedSURF, mb.DSPSIFT, mb.RootSIFT,
]  # fmt: skip


@pytest.mark.parametrize("kind", EVERY)
def test_every_feature_fills_every_array(kind, images):
    image = images[0][60:180, 80:240]
    found = kind().extract(image)
    count = len(found)
    assert count > 0 and found.image_size == (160, 120)
    assert found.keypoints.shape == (count, 2) and found.keypoints.dtype == np.float32
    assert found.lafs.shape == (count, 2, 3)
    assert np.array_equal(found.lafs[:, :, 2], found.keypoints)
    for column in (found.sizes, found.angles, found.responses, found.octaves):
        assert column.shape == (count,)
    assert len(found.descriptors) == count
    assert found.descriptors.dtype == (np.float32 if found.bits is None else np.uint8)
    assert not found.keypoints.flags.writeable and found.keypoints is found.keypoints
    assert json.loads(json.dumps(kind().params)) == kind(**kind().params).params


def test_rootsift_has_the_roots_of_sifts_descriptors(images):
    plain, rooted = (kind(limit=50).extract(images[0]) for kind in (mb.SIFT, mb.RootSIFT))
    assert len(plain) == 50 and np.array_equal(plain.keypoints, rooted.keypoints)
    shares = plain.descriptors / plain.descriptors.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(rooted.descriptors, np.sqrt(shares), rtol=1e-5, atol=1e-7)


@pytest.fixture(scope="module")
def rgb(images):
    """An image whose three channels are unlike each other: two pictures, and a ramp."""
    ramp = np.broadcast_to(np.linspace(0, 255, images[0].shape[1]).astype(np.uint8), images[0].shape)
    return np.stack([images[0], images[1], ramp], axis=2)


def png(rgb):
    """The bytes of a PNG file."""
    height, width, _ = rgb.shape
    rows = b"".join(b"\0" + row.tobytes() for row in rgb)
    parts = [(b"IHDR", struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    chunks = [struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def same_features(found, expected):
    equal = np.array_equal(found.keypoints, expected.keypoints)
    return equal and np.array_equal(found.descriptors, expected.descriptors)


def test_colour_is_red_green_blue_as_in_a_png_file(rgb, tmp_path):
    gray = (rgb @ np.array([9797, 19234, 3737]) >> 15).astype(np.uint8)
    path = tmp_path / "colour.png"
    path.write_bytes(png(rgb))
    assert np.array_equal(mb.read_gray(path), gray)
    expected = mb.SIFT().extract(gray)
    assert len(expected) > 20 and same_features(mb.SIFT().extract(rgb), expected)
    rounded = (rgb @ np.array([19595, 38470, 7471]) + 2**15 >> 16).astype(np.uint8)  # as in a JPEG file
    for other in (rounded, rgb[:, :, ::-1]):
        assert not same_features(mb.SIFT().extract(other), expected)
    matches = mb.matcher("sift").match(rgb, gray)
    assert len(matches) > 20 and np.array_equal(matches.points_a, matches.points_b)


def test_colour_is_blue_green_red_where_opencv_has_it_so(rgb):
    bgr = np.ascontiguousarray(rgb[:, :, ::-1])
    keypoints, descriptors = mb.SIFT_create().detectAndCompute(bgr, None)
    expected = mb.SIFT().extract(rgb)
    assert [key.pt for key in keypoints] == [tuple(at) for at in expected.keypoints.tolist()]
    assert np.array_equal(descriptors, expected.descriptors)


def test_strides_do_not_matter(images, rgb):
    for image, axes in [(images[0], (1, 0)), (rgb, (2, 0, 1))]:
        turned = np.ascontiguousarray(image.transpose(axes)).transpose(np.argsort(axes))
        assert not turned.flags.c_contiguous and np.array_equal(turned, image)
        assert same_features(mb.ORB().extract(turned), mb.ORB().extract(image))


@pytest.mark.parametrize(
    ("image", "kind", "words"),
    [
        (np.zeros((4, 4)), TypeError, ["uint8", "float64", "0 to 1 by (image * 255)", "0 to 255 by image.round()"]),
        (np.zeros((4, 4), np.int32), TypeError, ["uint8", "int32", "values to 0 to 255, then", "astype"]),
        (np.zeros((4, 4), np.int16), TypeError, ["uint8", "int16", "values to 0 to 255, then", "astype"]),
        (np.zeros((4, 4), np.uint16), TypeError, ["uint8", "uint16", "(image >> 8).astype(numpy.uint8)"]),
        (np.zeros((4, 4), bool), TypeError, ["uint8", "bool", "image * numpy.uint8(255)"]),
        (np.zeros((4, 4, 4), np.uint8), ValueError, ["(RGB)", "4, 4, 4", "fourth channel (alpha) by image[:, :, :3]"]),
        (np.zeros((4, 4, 1), np.uint8), ValueError, ["4, 4, 1", "image[:, :, 0]"]),
        (np.zeros((1, 4, 5), np.uint8), ValueError, ["1, 4, 5", "image[0]"]),
        (np.zeros((3, 4, 5), np.uint8), ValueError, ["3, 4, 5", "image.transpose(1, 2, 0)"]),
        (np.zeros(4, np.uint8), ValueError, ["height x width", "[4]"]),
        ([[1, 2]], TypeError, ["numpy array", "list"]),
        (None, TypeError, ["numpy array", "NoneType"]),
    ],
)
def test_what_is_no_image_is_refused_in_words(image, kind, words):
    with pytest.raises(kind) as caught:
        mb.SIFT().extract(image)
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize("shape", [(200_000, 200_000), (200_000, 200_000, 3), (11_586, 11_586), (65_536, 1)])
def test_an_image_beyond_the_limits_is_refused_before_it_is_copied(shape):
    image = np.broadcast_to(np.uint8(5), shape)  # one byte of memory
    words = f"{shape[1]}x{shape[0]} pixels.*limit of 134217728.*65535 on a side; make it smaller"
    with pytest.raises(ValueError, match=words):
        mb.SIFT().extract(image)
    with pytest.raises(ValueError, match=words):
        mb.matcher("sift").match(image[:9, :9], image)


@pytest.mark.parametrize(
    "image",
    [
        np.array([[0, 255], [256, 65535]], np.uint16),
        np.array([[False, True]]),
        np.array([[0.0, 1.0]]),
    ],
)
def test_the_conversion_that_is_told_keeps_order(image):
    with pytest.raises(TypeError) as caught:
        mb.SIFT().extract(image)
    told = str(caught.value).split(" by ", 1)[1].split(", ")[0]
    made = eval(told, {"image": image, "numpy": np})
    assert made.dtype == np.uint8 and made.min() == 0 and made.max() == 255
    assert (np.diff(made.ravel().astype(int)) >= 0).all()
    mb.SIFT().extract(made)


def test_masked_elements_are_not_taken_for_values(images, features):
    one = features[0]
    masked = [np.ma.masked_array(array, np.arange(array.size).reshape(array.shape) == 3) for array in
              (images[0], one.keypoints, one.descriptors, one.sizes)]  # fmt: skip
    for name, call in [
        ("image", lambda: mb.SIFT().extract(masked[0])),
        ("keypoints", lambda: mb.Features.from_arrays(masked[1], one.descriptors, one.image_size)),
        ("descriptors", lambda: mb.Features.from_arrays(one.keypoints, masked[2], one.image_size)),
        ("sizes", lambda: mb.Features.from_arrays(one.keypoints, one.descriptors, one.image_size, sizes=masked[3])),
    ]:
        with pytest.raises(ValueError, match=f"^`{name}` has masked elements, .*; leave them out, or fill them"):
            call()
    same = mb.SIFT().extract(np.ma.masked_array(images[0]))  # nothing is masked
    assert np.array_equal(same.keypoints, one.keypoints)


def test_an_image_without_content_has_no_features():
    for shape in [(0, 0), (1, 1), (90, 120)]:
        found = mb.SIFT().extract(np.zeros(shape, np.uint8))
        assert len(found) == 0 and found.descriptors.shape == (0, 128) and found.lafs.shape == (0, 2, 3)


def test_unknown_parameters_are_refused_by_name():
    for wrong in [{"sigam": 1.6}, {"sigma": -1}, {"sigma": "wide"}]:
        with pytest.raises(ValueError, match="sigam|sigma|wide"):
            mb.SIFT(**wrong)
    for value in [float("nan"), float("-inf"), np.float32("nan"), np.float64("inf"), [1.0, float("nan")]]:
        for make in (mb.SIFT, lambda **params: mb.matcher("sift", extractor=params)):
            with pytest.raises(ValueError, match="^contrast_threshold: -?(nan|inf), must be a finite number"):
                make(contrast_threshold=value)
    for value in [object(), {1, 2}, np.zeros(2)]:
        with pytest.raises(TypeError, match=f"^sigma: a value of type {type(value).__name__}; give numbers"):
            mb.SIFT(sigma=value)
    with pytest.raises(ValueError, match="did you mean `sift`"):
        mb.matcher("sfit")
    assert mb.SIFT(limit=np.int64(7)).params["limit"] == 7


def test_arrays_go_out_and_in_again(images):
    for extractor in (mb.SIFT(), mb.AKAZE(), mb.ASIFT()):
        found = extractor.extract(images[0])
        again = mb.Features.from_arrays(
            found.keypoints,
            found.descriptors,
            found.image_size,
            sizes=found.sizes,
            angles=found.angles,
            responses=found.responses,
            octaves=found.octaves,
            lafs=found.lafs,
            bits=found.bits,
        )
        for name in ("keypoints", "descriptors", "sizes", "angles", "responses", "octaves", "lafs"):
            np.testing.assert_array_equal(getattr(again, name), getattr(found, name))
        assert again.bits == found.bits and again.image_size == found.image_size
        one = found.select([3, 1])
        assert np.array_equal(one.lafs, found.lafs[[3, 1]]) and len(one) == 2
    for outside in (len(found), -1):
        with pytest.raises(IndexError, match=f"feature {outside} of"):
            found.select([outside])
    mask = np.zeros(len(found), bool)
    mask[[1, 3]] = True
    for chosen in (mask, mask.tolist(), [1, 3], np.array([1, 3], np.uint16)):
        np.testing.assert_array_equal(found.select(chosen).keypoints, found.keypoints[[1, 3]])
    assert len(found.select([])) == 0
    for wrong in ([True], [0.5], "all"):
        with pytest.raises((TypeError, ValueError), match="mask of"):
            found.select(wrong)
    with pytest.raises(ValueError, match="octaves"):
        mb.Features.from_arrays(found.keypoints, found.descriptors, found.image_size, octaves=found.octaves + 0.5)
    none = mb.SIFT().extract(np.zeros((90, 120), np.uint8))
    assert len(mb.Features.from_arrays(none.keypoints, none.descriptors, none.image_size, lafs=none.lafs)) == 0


def unaligned(array):
    """The same values, one byte off the places that numbers of this type have in memory."""
    moved = np.frombuffer(b"\0" + array.tobytes(), array.dtype, array.size, 1).reshape(array.shape)
    assert not moved.flags.aligned
    return moved


def test_arrays_need_not_be_aligned(features):
    one = features[0]
    packed = np.zeros(len(one), [("octave", "u1"), ("size", "f4"), ("at", "f8", 2), ("descriptor", "f4", 128)])
    packed["size"], packed["at"], packed["descriptor"] = one.sizes, one.keypoints, one.descriptors
    assert not packed["size"].flags.aligned
    columns = packed["at"], packed["descriptor"], packed["size"]
    for at, descriptors, sizes in [columns, tuple(unaligned(np.ascontiguousarray(column)) for column in columns)]:
        same = mb.Features.from_arrays(at, descriptors, one.image_size, sizes=sizes, lafs=unaligned(one.lafs))
        for name in ("keypoints", "descriptors", "sizes", "lafs"):
            np.testing.assert_array_equal(getattr(same, name), getattr(one, name))
    indices = np.array([3, 1])
    np.testing.assert_array_equal(one.select(unaligned(indices)).keypoints, one.select(indices).keypoints)


def test_frames_that_are_centred_elsewhere_are_refused_by_row(features):
    one = features[0]
    corner = one.keypoints + np.float64(0.5)
    lafs = one.lafs.copy()
    lafs[:, :, 2] += 0.5
    same = mb.Features.from_arrays(corner, one.descriptors, one.image_size, lafs=lafs, origin="corner")
    np.testing.assert_array_equal(same.lafs[:, :, :2], one.lafs[:, :, :2])
    lafs[3, 0, 2] += 0.01
    with pytest.raises(ValueError, match="`lafs` .* row 3 "):
        mb.Features.from_arrays(corner, one.descriptors, one.image_size, lafs=lafs, origin="corner")


class NoArray:
    """What numpy cannot make an array of."""

    def __init__(self, error):
        self.error = error

    def __array__(self, *_, **__):
        raise self.error


def test_bytes_of_a_mask_need_not_be_ones(features):
    one = features[0]
    ones = np.arange(len(one)) % 3 == 0
    twos = (2 * ones).astype(np.uint8).view(bool)
    assert np.array_equal(one.select(twos).keypoints, one.select(ones).keypoints)


def test_only_errors_about_the_value_become_refusals(features):
    one, image_size = features[0], features[0].image_size
    calls = [
        lambda value: mb.Features.from_arrays(value, one.descriptors, image_size),
        lambda value: mb.Features.from_arrays(one.keypoints, one.descriptors, image_size, sizes=value),
        one.select,
    ]
    for call in calls:
        with pytest.raises(TypeError, match="`(keypoints|sizes|indices)` must be") as refused:
            call(NoArray(ValueError("ragged")))
        assert str(refused.value.__cause__) == "ragged"
        for other in (MemoryError("full"), KeyboardInterrupt()):
            with pytest.raises(type(other)) as raised:
                call(NoArray(other))
            assert raised.value is other
    with pytest.raises(MemoryError):  # numpy would make one of another type of it
        mb.Features.from_arrays(np.broadcast_to(np.float32(1), (10**11, 2)), one.descriptors, image_size)


def test_origins_differ_by_half_a_pixel(features):
    dict_ = features[0].to_dict(origin="corner")
    assert np.array_equal(dict_["keypoints"], features[0].keypoints + np.float32(0.5))
    assert set(dict_) >= {"keypoints", "descriptors", "image_size"}
    back = mb.Features.from_arrays(dict_["keypoints"], dict_["descriptors"], (320, 240), origin="corner")
    np.testing.assert_allclose(back.keypoints, features[0].keypoints, atol=1e-4)
    with pytest.raises(ValueError, match="COLMAP"):
        features[0].to_dict(origin="colmap")


@pytest.mark.parametrize(
    ("keypoints", "descriptors", "words"),
    [
        (np.zeros((3, 3)), np.zeros((3, 8), np.float32), "keypoints.*n x 2.*3, 3"),
        (np.zeros((3, 2)), np.zeros((2, 8), np.float32), "3 keypoints with 2 descriptors"),
        (np.zeros((3, 2)), np.zeros((3, 8)), "descriptors.*float32.*float64"),
        (np.full((3, 2), np.nan), np.zeros((3, 8), np.float32), "not finite, in row 0"),
        (["a"], np.zeros((3, 8), np.float32), "keypoints.*list"),
    ],
)
def test_arrays_that_are_no_features_are_refused_in_words(keypoints, descriptors, words):
    with pytest.raises((ValueError, TypeError), match=words):
        mb.Features.from_arrays(keypoints, descriptors, (10, 10))


def test_keypoints_outside_their_image_are_refused(images, features):
    height, width = images[0].shape
    assert height < width
    keypoints, descriptors = features[0].keypoints, features[0].descriptors
    hint = r"outside an image of 240x320. image_size is \(width, height\), and not shape"
    with pytest.raises(ValueError, match=hint):
        mb.Features.from_arrays(keypoints, descriptors, images[0].shape)
    with pytest.raises(ValueError, match=r"\(width, height\), and not the shape of an image"):
        mb.Features.from_arrays(keypoints, descriptors, (height, width, 3))
    for edge, inside in [((-0.5, -0.5), True), ((9.5, 4.5), True), ((-0.6, 0), False), ((0, 4.6), False)]:
        for origin, shift in (("center", 0), ("corner", 0.5)):
            arrays = np.array([[0, 0], edge]) + shift, np.zeros((2, 8), np.float32)
            if inside:
                assert len(mb.Features.from_arrays(*arrays, (10, 5), origin=origin)) == 2
            else:
                with pytest.raises(ValueError, match=r"in row 1 lies outside an image of 10x5"):
                    mb.Features.from_arrays(*arrays, (10, 5), origin=origin)


@pytest.mark.parametrize("dtype", [np.float64, np.float16])
def test_descriptors_of_another_precision_are_told_how_to_be_converted(dtype):
    descriptors = np.ones((1, 8), dtype)
    with pytest.raises(ValueError, match="`descriptors` .*float32.*; convert it by ") as caught:
        mb.Features.from_arrays(np.zeros((1, 2)), descriptors, (10, 10))
    made = eval(str(caught.value).split(" by ", 1)[1], {"descriptors": descriptors, "numpy": np})
    assert mb.Features.from_arrays(np.zeros((1, 2)), made, (10, 10)).descriptors.dtype == np.float32


@pytest.mark.parametrize("lafs", [np.zeros((4, 2, 3)), np.zeros((3, 2, 2)), [[1, 0, 0], [0, 1, 0]]])
def test_frames_of_another_shape_are_refused_in_words(lafs):
    with pytest.raises((ValueError, TypeError), match="`lafs` must be an array 3 x 2 x 3; this is"):
        mb.Features.from_arrays(np.zeros((3, 2)), np.zeros((3, 8), np.float32), (10, 10), lafs=lafs)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
@pytest.mark.parametrize("name", ["keypoints", "descriptors", "sizes", "angles", "responses", "octaves", "lafs"])
def test_numbers_that_are_not_finite_are_refused_by_array_and_row(name, value):
    arrays = {"keypoints": np.zeros((3, 2)), "descriptors": np.zeros((3, 8), np.float32)}
    shape = {"lafs": (3, 2, 3)}.get(name, 3)
    array = arrays.setdefault(name, np.zeros(shape, np.float32))
    with np.errstate(over="ignore"):
        array[(1, *[-1] * (array.ndim - 1))] = value
    if name == "angles" and np.isnan(value):
        assert np.array_equal(mb.Features.from_arrays(image_size=(10, 10), **arrays).angles, array, equal_nan=True)
        return
    with pytest.raises(ValueError, match=f"`{name}` holds a number that is not finite, in row 1"):
        mb.Features.from_arrays(image_size=(10, 10), **arrays)


def test_descriptors_whose_distances_overflow_are_refused():
    descriptors = np.zeros((3, 8), np.float32)
    descriptors[2, 5] = -3e38
    with pytest.raises(ValueError, match="`descriptors`: row 2 has the value -3e38, .*8 values are infinite; divide all"):
        mb.Features.from_arrays(np.zeros((3, 2)), descriptors, (10, 10))
    assert len(mb.Features.from_arrays(np.zeros((3, 2)), descriptors / 1e21, (10, 10))) == 3


def test_sides_of_an_image_may_be_a_list_or_an_array(features):
    one = features[0]

    def of_size(size):
        return mb.Features.from_arrays(one.keypoints, one.descriptors, size)

    for size in [[320, 240], np.array([320, 240]), np.array([320, 240], np.uint16), (np.int32(320), 240)]:
        assert of_size(size).image_size == (320, 240)
    for wrong, this in [
        ((320.0, 240.0), "a tuple of 2 values"),
        (one.to_dict()["image_size"], r"an array of float32 with shape \[2\]"),
        ((320,), "a tuple of 1 value"),
        (320, "a value of type int"),
        (None, "a value of type NoneType"),
    ]:
        with pytest.raises(TypeError, match=rf"^image_size is \(width, height\), two whole numbers; this is {this}"):
            of_size(wrong)
    with pytest.raises(ValueError, match="negative"):
        of_size([-1, 5])


def test_angles_are_radians_and_not_opencvs_degrees():
    def made(angles):
        arrays = np.zeros((len(angles), 2)), np.zeros((len(angles), 8), np.float32)
        return mb.Features.from_arrays(*arrays, (10, 10), angles=angles)

    degrees = np.array([-1, 0, 90, 360], np.float32)  # -1: none
    with pytest.raises(ValueError, match="`angles`: radians .* row 2 is 90. cv2 has degrees, .*; give ") as caught:
        made(degrees)
    radians = eval(str(caught.value).split("; give ", 1)[1], {"angles": degrees, "numpy": np})
    assert np.array_equal(made(radians).angles, radians, equal_nan=True) and np.isnan(radians[0])
    with pytest.raises(ValueError, match="`angles`: every row is -1"):
        made([-1, -1])
    assert made([-1]).angles.tolist() == [-1]


def test_octaves_are_levels_and_not_opencvs_packed_numbers():
    def made(octaves):
        return mb.Features.from_arrays(np.zeros((3, 2)), np.zeros((3, 8), np.float32), (10, 10), octaves=octaves)

    assert made([-32768, 0, 32767]).octaves.tolist() == [-32768, 0, 32767]
    for outside in (-32769, 32768):
        with pytest.raises(ValueError, match=f"`octaves` are from -32768 to 32767; row 1 is {outside}"):
            made([0, outside, 0])
    packed = np.array([0x00A103FF, 0x007C0200, 0x00110101])  # octaves -1, 0 and 1, with their layers and scales
    with pytest.raises(ValueError, match="cv2's SIFT packs") as caught:
        made(packed)
    told = str(caught.value).split(" by ", 1)[1]
    assert made(eval(told, {"octaves": packed, "numpy": np})).octaves.tolist() == [-1, 0, 1]


def test_sizes_below_0_are_refused_by_row():
    with pytest.raises(ValueError, match="`sizes` are diameters, not below 0; row 2 is -1.5"):
        mb.Features.from_arrays(np.zeros((3, 2)), np.zeros((3, 8), np.float32), (10, 10), sizes=[1, 0, -1.5])


@pytest.mark.parametrize("size", [(0, 0), (0, 10), (10, 0)])
def test_an_image_without_pixels_has_no_keypoints(size):
    with pytest.raises(ValueError, match=f"image_size: {size[0]}x{size[1]}, .* give width and height"):
        mb.Features.from_arrays(np.zeros((3, 2)), np.zeros((3, 8), np.float32), size)
    assert len(mb.Features.from_arrays(np.zeros((0, 2)), np.zeros((0, 8), np.float32), size)) == 0


def test_one_line_switches_from_opencv(images):
    keypoints, descriptors = mb.SIFT_create().detectAndCompute(images[0], None)
    found = mb.SIFT().extract(images[0])
    assert [key.pt for key in keypoints] == [tuple(at) for at in found.keypoints.tolist()]
    assert np.array_equal(descriptors, found.descriptors)
    assert keypoints[0].angle == pytest.approx(np.rad2deg(found.angles[0]), abs=1e-3)
    mask = np.zeros_like(images[0])
    mask[:, :160] = 255
    left, _ = mb.SIFT_create().detectAndCompute(images[0], mask)
    assert 0 < len(left) < len(keypoints) and all(key.pt[0] < 160 for key in left)
    nothing, none = mb.ORB_create().detectAndCompute(np.zeros_like(mask), None)
    assert len(nothing) == 0 and none is None
    with pytest.raises(ValueError, match="mask must be uint8"):
        mb.ORB_create().detectAndCompute(images[0], mask[:5])
    for create in (mb.ORB_create, mb.BRISK_create, mb.KAZE_create, mb.AKAZE_create, mb.SURF_create):
        assert len(create().detectAndCompute(images[0], None)[0]) > 0
    with pytest.raises(TypeError, match="scoreType"):
        mb.ORB_create(scoreType=1)


def test_an_argument_that_stands_elsewhere_in_opencv_is_given_by_name():
    """cv2's fourth argument of ORB is edgeThreshold; the first ones of AKAZE and KAZE are the kind of descriptor."""
    for create, values in [(mb.ORB_create, (1000, 1.2, 8, 31)), (mb.AKAZE_create, (5,)), (mb.KAZE_create, (True,))]:
        with pytest.raises(TypeError, match="positional argument"):
            create(*values)
    assert mb.ORB_create(1000, 1.2, 8, fastThreshold=31).extractor.params["fast_threshold"] == 31
    for create in (mb.AKAZE_create, mb.KAZE_create):
        assert create(threshold=0.002).extractor.params["threshold"] == 0.002


def test_limits_of_the_environment_hold_from_the_import_on():
    script = "import matchbench as mb, numpy as np; mb.ORB().extract(np.zeros((30, 40), np.uint8))"

    def said(most):
        words, environment = [sys.executable, "-c", script], {**os.environ, "MATCHBENCH_MAX_PIXELS": most}
        return subprocess.run(words, env=environment, timeout=120, capture_output=True, text=True).stderr

    assert said("1200") == ""
    assert "an image of 40x30 pixels, more than the limit of 1199 in all" in said("1199")
    assert "MATCHBENCH_MAX_PIXELS is `many`, but must be a whole number" in said("many")

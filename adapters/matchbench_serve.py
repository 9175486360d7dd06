"""Makes a matcher of matchbench from one or two Python functions. It handles the protocol, the images and their sizes.

There are three kinds: a matcher of pairs; one that first extracts something from each image, once per image; and one that
only describes images, while matchbench compares the descriptors.

    serve(match=f)               f(a, b, params)          -> points_a, points_b[, certainty]
    serve(extract=e, match=m)    e(image, params)         -> anything; its points in "keypoints"
                                 m(of_a, of_b, params)    -> points_a, points_b[, certainty]
    serve(describe=d)            d(image, params)         -> keypoints, descriptors[, {"scales": ..}]
                                                             for a manifest of kind = "features"

`prepare(params)`, if there is one, loads whatever takes long, before the first pair is timed. `a`, `b` and `image` are
`Image` objects. `image.gray(n)` and `image.rgb(n)` return its pixels, at most n wide and high; with `size=(width, height)`
they are of exactly that size. Points are n x 2 (x, y) in these pixels, with the centre of the first pixel at 0; `serve`
converts them to the original image. Certainty is from 0 to 1, higher is better; None is as if it were absent. Whatever a
function prints goes to the log. If it raises an exception, this pair failed, with the exception as the reason. `params` are
the values of the function `defaults`, changed by the manifest; unknown names are refused.

It needs numpy, and cv2 or PIL to read images. The documentation of matchbench describes the protocol.
"""

import hashlib
import json
import os
import queue
import sys
import threading
import time
import traceback
from collections import OrderedDict

import numpy as np

PROTOCOL = 1


class Image:
    """An image file, and the pixels that a matcher asked for last."""

    def __init__(self, path, size):
        self.path, self.size, self.scale, self.is_exact = path, tuple(size), (1.0, 1.0), False

    def gray(self, max_size=None, size=None):
        """Grey pixels, uint8, at most `max_size` wide and high, or of exactly `size`, which is width and height."""
        return self._resized(_read(self.path, True), max_size, size)

    def rgb(self, max_size=None, size=None):
        """Red, green and blue pixels, uint8, at most `max_size` wide and high, or of exactly `size`, width and height."""
        return self._resized(_read(self.path, False), max_size, size)

    def original(self, points):
        """Converts points in the pixels that were asked for last to the original image."""
        return (_n_by_2(points) + 0.5) * self.scale - 0.5

    def _resized(self, pixels, max_size, size):
        height, width = pixels.shape[:2]
        if (width, height) != self.size:
            raise ValueError(f"{self.path} is read as {width}x{height}, not {self.size}")
        if max_size and size:
            raise ValueError("`max_size` and `size` say two things of the same image; leave one out")
        factor = min(1.0, max_size / max(self.size)) if max_size else 1.0
        new = [max(1, round(length * factor)) for length in (size or self.size)]
        self.scale, self.is_exact = (width / new[0], height / new[1]), bool(size)
        if size:
            between = _between(_between(pixels.astype(np.int32), new[1], 0), new[0], 1)
            return ((between + (1 << 15)) >> 16).astype(np.uint8)
        if factor == 1.0:
            return pixels
        shrunk = _areas(_areas(pixels.astype(np.float32), new[1], 0), new[0], 1)
        return np.clip(np.rint(shrunk), 0, 255).astype(np.uint8)


def serve(match=None, extract=None, describe=None, prepare=None, name=None, version="", defaults=None,
          keep=64):
    """Answers requests until matchbench says goodbye or ends, then exits. The last `keep` images are kept in memory."""
    lines, answers = _take_standard_streams()
    requests = queue.Queue()
    threading.Thread(target=_read_requests, args=(lines, requests), daemon=True).start()
    say = lambda **answer: print(json.dumps(answer), file=answers, flush=True)
    hello = requests.get()
    if hello.get("protocol") != PROTOCOL:
        return say(type="refused", reason=f"protocol {hello.get('protocol')} is not {PROTOCOL}")
    params, script = dict(defaults or {}), os.path.abspath(sys.argv[0])
    if unknown := set(hello["params"]) - set(params):
        return say(type="refused", reason=f"unknown: {sorted(unknown)}; there are {sorted(params)}")
    params.update(hello["params"])
    try:
        prepare and prepare(params)
    except Exception as error:
        traceback.print_exc()
        return say(type="refused", reason=f"{type(error).__name__}: {error}")
    known, device = OrderedDict(), params.get("device", "cpu")

    def timed(stage, seconds, function, *arguments):
        start = time.perf_counter()
        result = function(*arguments)
        seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
        return result

    def features(path, size, seconds, extracted):
        if path not in known:
            image = Image(path, size)
            extracted.append(path)
            known[path] = image, timed("extract", seconds, extract, image, params)
        known.move_to_end(path)
        found = known[path]
        while len(known) > keep:
            known.popitem(last=False)
        return found

    def matches(request, seconds):
        sides, extracted = [(request["a"], request["size_a"]), (request["b"], request["size_b"])], []
        if extract:
            (a, of_a), (b, of_b) = (features(*side, seconds, extracted) for side in sides)
        else:
            of_a, of_b = a, b = [Image(*side) for side in sides]
        points_a, points_b, *certainty = timed("match", seconds, match, of_a, of_b, params)
        points_a, points_b = a.original(points_a), b.original(points_b)
        certainty = _certainty(certainty[0] if certainty else None, len(points_a))
        rows = np.column_stack([points_a, points_b, 1.0 - certainty])
        rows.astype("<f4").tofile(request["out"])
        counts = [_count(of["keypoints"]) for of in (of_a, of_b)] if extract else None
        found = {"features": counts, "extracted": len(extracted)} if extract else {}
        return dict(type="matched", pair=request["pair"], count=len(rows), **found)

    def described(request, seconds):
        image = Image(request["image"], request["size"])
        points, descriptors, *more = timed("extract", seconds, describe, image, params)
        more = {key: np.asarray(value, np.float32) for key, value in (more[0] if more else {}).items()}
        across, down = image.scale
        if "scales" in more:
            more["scales"] = more["scales"] * np.float32(np.sqrt(across * down) if image.is_exact else across)
        angles = more.get("angles")
        # An exact size turns directions. What are no radians is not turned, so that it is refused as what it is.
        if angles is not None and image.is_exact and np.nanmax(np.abs(angles), initial=0) < 6.3 and not (angles == -1).all():
            more["angles"] = np.arctan2(np.float32(down) * np.sin(angles), np.float32(across) * np.cos(angles))
        points = image.original(points).astype("<f4")
        if len(points) == 0:  # OpenCV has None instead of descriptors; any length will do
            descriptors = np.zeros((0, 1), np.uint8)
        with open(request["out"], "wb") as out:
            np.savez(out, keypoints=points, descriptors=descriptors, **more)
        return dict(type="described", image=request["image"], count=len(points))

    say(type="ready", protocol=PROTOCOL, name=name or os.path.basename(script), pixel_center=0,
        version=f"{version}+{_digest(script)}")
    while (request := requests.get())["type"] != "bye":
        about = {key: request[key] for key in ("pair", "image") if key in request}
        try:
            seconds = {}
            answer = (described if request["type"] == "describe" else matches)(request, seconds)
            say(**answer, seconds=seconds, device=str(device))
        except Exception as error:  # an exception of the matcher fails this pair and no other
            traceback.print_exc()
            say(type="failed", reason=f"{type(error).__name__}: {error}", **about)
    sys.stderr.flush()
    os._exit(0)  # libraries can take longer to clean up than matchbench waits


def _take_standard_streams():
    """Reserves standard input for requests and standard output for answers: whatever else reads finds nothing, and what
    it prints goes to standard error. Programs that a matcher starts inherit this."""
    lines, answers = os.fdopen(os.dup(0), encoding="utf-8"), os.fdopen(os.dup(1), "w")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return lines, answers


def _read_requests(lines, requests):
    """Reads requests. If matchbench ends, this process exits, also in the middle of a pair."""
    for line in lines:
        request = json.loads(line)
        requests.put(request)
        if request["type"] == "bye":
            return
    os._exit(0)


def _digest(script):
    """A hash of the script in eight characters; a script that was changed is another version."""
    with open(script, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()[:8]


def _read(path, gray):
    """The pixels as they are stored, without a turn by EXIF, since the cameras belong to the stored pixels."""
    try:
        import cv2
    except ImportError:
        import PIL.Image
        image = PIL.Image.open(path)
        if image.mode.startswith("I;16") or (image.mode == "I" and image.format in ("PNG", "PPM")):
            # The upper 8, as cv2 and matchbench read them. PIL would cut values off at 255.
            image = PIL.Image.fromarray((np.asarray(image) >> 8).astype(np.uint8))
        elif image.mode in ("I", "F"):
            raise ValueError(f"{path} has pixels of more than 16 bits; convert it to a png of 8 bits")
        return np.asarray(image.convert("L" if gray else "RGB"))
    mode = cv2.IMREAD_GRAYSCALE if gray else cv2.IMREAD_COLOR
    pixels = cv2.imread(path, mode | cv2.IMREAD_IGNORE_ORIENTATION)
    if pixels is None:
        raise ValueError(f"{path} cannot be read")
    return pixels if gray else np.ascontiguousarray(pixels[:, :, ::-1])


def _n_by_2(points):
    """The points as an array n x 2. Other arrays would be cut into other points. An empty one of any shape has no points."""
    points = np.asarray(points, np.float64)
    if points.size == 0:
        return np.zeros((0, 2))
    if _has_a_1_more(points.shape):
        points = points.reshape(-1, points.shape[2])
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points: an array of shape {_shape(points)}; give n x 2 (x, y)")
    return points


def _count(keypoints):
    """How many keypoints there are."""
    shape = np.shape(keypoints)
    return int(np.prod(shape[:2])) if _has_a_1_more(shape) else len(keypoints)


def _has_a_1_more(shape):
    """Whether a list of points has the 1 of cv2's n x 1 x 2, or of a batch of one, which says nothing."""
    return len(shape) == 3 and 1 in shape[:2]


def _shape(array):
    """The shape of an array in words."""
    return " x ".join(map(str, array.shape)) or "a single number"


def _certainty(given, count):
    """The certainty of each match, from 0 to 1. What lies outside by more than rounding is a score of another kind, of which
    all would be equal if it were cut off."""
    if given is None:
        return np.ones(count)
    certainty = np.asarray(given, np.float64)
    if certainty.size != count or certainty.ndim == 0:
        raise ValueError(f"certainty: an array of shape {_shape(certainty)} for {count} matches; give one for each")
    certainty = certainty.ravel()
    outside = np.flatnonzero(~((certainty >= -1e-3) & (certainty <= 1 + 1e-3)))  # NaN too
    if len(outside):
        row = outside[0]
        raise ValueError(f"certainty: row {row} is {certainty[row]:g}; give values from 0 to 1, 1 is certain, or None")
    return np.clip(certainty, 0.0, 1.0)


def _between(pixels, count, axis):
    """`count` values between `pixels` along `axis`, in 256ths: bilinear without smoothing, as OpenCV's INTER_LINEAR_EXACT and
    matchbench's own matchers resample images to an exact size."""
    length = pixels.shape[axis]
    at = np.clip((np.arange(count) + 0.5) * (1.0 / (count / length)) - 0.5, 0.0, length - 1.0)
    first = at.astype(np.int32)
    weight = np.rint((at - first) * 256).astype(np.int32).reshape([-1 if i == axis else 1 for i in range(pixels.ndim)])
    return (256 - weight) * pixels.take(first, axis) + weight * pixels.take(np.minimum(first + 1, length - 1), axis)


def _areas(pixels, count, axis):
    """`count` means of equal areas along `axis`, as OpenCV's INTER_AREA reduces images."""
    length = pixels.shape[axis]
    sums = np.concatenate([np.zeros_like(pixels.take([0], axis), np.float64),
                           pixels.cumsum(axis, dtype=np.float64)], axis)
    edges = np.arange(count + 1) * (length / count)
    whole = np.minimum(edges.astype(int), length - 1)
    part = (edges - whole).reshape([-1 if i == axis else 1 for i in range(pixels.ndim)])
    below = sums.take(whole, axis)
    cut = below + part * (sums.take(whole + 1, axis) - below)
    return np.diff(cut, axis=axis) * (count / length)

"""Whole matchers by name: two images in, matched points out."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Camera, Features, Matches
from ._native import Matcher as NativeMatcher
from ._params import seed_of, text, to_json


class Matcher:
    """A matcher, as the command line has it; see `matcher`."""

    def __init__(self, id: str, **params: Any) -> None:
        self._native = NativeMatcher(text("id", id, 'a name, as in "sift"'), to_json(params))

    @property
    def id(self) -> str:
        """Its name in commands, records and tables."""
        return self._native.id

    @property
    def native(self) -> NativeMatcher:
        """The compiled object."""
        return self._native

    @property
    def params(self) -> dict[str, Any]:
        """Every parameter, including those at their defaults; the `max_size` or `size` of the extractor and `refine`
        only if they were given."""
        return json.loads(self._native.params)

    def extract(self, image: NDArray[np.uint8]) -> Features:
        """The features of an image."""
        return self._native.extract(image)

    def match(
        self,
        image_a: NDArray[np.uint8],
        image_b: NDArray[np.uint8],
        camera_a: Camera | None = None,
        camera_b: Camera | None = None,
        *,
        seed: int = 0,
    ) -> Matches:
        """Matched points of two images. Only RepMatch uses the cameras."""
        return self._native.match_images(image_a, image_b, camera_a, camera_b, seed_of(seed))

    def __repr__(self) -> str:
        return f"matcher({self.id!r}, **{self.params})"


def matcher(id: str, **params: Any) -> Matcher:
    """The matcher with this `id` (`matchbench list matchers` lists all). Parameters that are not in `params` keep their
    defaults. The parameters of a part are a dict: `matcher("sift", ratio=0.7, extractor={"sigma": 1.2})`. With
    `refine=True` the points of `match` are moved to where the pixels about them agree best."""
    return Matcher(id, **params)

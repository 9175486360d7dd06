"""The matches that a run of matchbench has stored."""

import struct

import numpy as np


def stored(path):
    """For each pair in a file of matches (see records/matches.rs): (a, b) and an array. Its columns are x and y in a and in
    b, the ambiguity, and, if keypoints have an orientation, their turn in radians and, if they have a size too, how far
    they grew (a logarithm)."""
    data = path.read_bytes()
    at = 8
    while at + 28 <= len(data):
        a, b, repetition, _, _, _, count = struct.unpack_from("<7I", data, at)
        at += 28
        if count != 0xFFFFFFFF:
            turned, grown, count = count >> 31, count >> 30 & 1, count & 0x3FFFFFFF
            if at + (20 + 4 * (turned + grown)) * count + 8 > len(data):
                return  # an incomplete entry of a run that was killed
            matches = np.frombuffer(data, "<f4", 5 * count, at).reshape(-1, 5).astype(float)
            at += 20 * count
            for _ in range(turned + grown):
                if turned:
                    matches = np.column_stack([matches, np.frombuffer(data, "<f4", count, at).astype(float)])
                at += 4 * count
            if repetition == 0:
                yield (a, b), matches
        at += 8

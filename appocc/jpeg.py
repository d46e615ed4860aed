"""Whether a JPEG is whole: decoders fill what is missing of one with grey, and say so at most on stderr."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from appocc.checks import ByteArray

_BEGIN, _END, _SCAN = b"\xff\xd8", b"\xff\xd9", b"\xff\xda"
_GREY = 128
# Changes what a decoder makes of blocks that it still looks for at the end mark; without a mark in it.
_FILLING = bytes(range(1, 100))


def is_jpeg(data: bytes) -> bool:
    """Whether a file's bytes begin as a JPEG."""
    return data.startswith(_BEGIN)


def end_of(data: bytes) -> int:
    """Place of the last end mark of a JPEG, -1 where it has none; anything may follow it.

    A picture in its header, such as a thumbnail, has an end mark, too.
    """
    at = len(_BEGIN)
    while data[at : at + 1] == b"\xff" and data[at : at + 2] != _SCAN:
        at += 2 + max(int.from_bytes(data[at + 2 : at + 4], "big"), 2)
    return data.rfind(_END, at)


def is_cut(data: bytes, decoded: ByteArray) -> bool:
    """Whether the last blocks of a JPEG are missing, though it has an end mark.

    Only a picture with a grey corner, wherever the camera's orientation puts it, is looked at closely. In one with
    several scans that is cut between them nothing is seen to be missing.

    Args:
        data: bytes of the file.
        decoded: (H, W, 3) uint8 picture.
    """
    if not (decoded[:: max(len(decoded) - 1, 1), :: max(decoded.shape[1] - 1, 1)] == _GREY).all(axis=2).any():
        return False
    end = end_of(data)
    try:
        return not np.array_equal(_pixels(data), _pixels(data[:end] + _FILLING + data[end:]))
    except (OSError, SyntaxError, Image.DecompressionBombError):  # a kind of JPEG that Pillow does not read
        return False


def _pixels(data: bytes) -> ByteArray:
    with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
        return np.asarray(picture, dtype=np.uint8)

"""Detection of truncated JPEGs: decoders fill missing parts with grey and at most warn on stderr."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from appocc.checks import ByteArray

_BEGIN, _END, _SCAN = b"\xff\xd8", b"\xff\xd9", b"\xff\xda"
_GREY = 128
# Bytes without a marker that change blocks which a decoder still expects at the end marker.
_FILLING = bytes(range(1, 100))


def is_jpeg(data: bytes) -> bool:
    """Return whether bytes begin as a JPEG."""
    return data.startswith(_BEGIN)


def end_of(data: bytes) -> int:
    """Return the position of the last end marker of a JPEG, -1 if there is none; other data may follow it.

    Images in the header, such as thumbnails, have their own end marker and are skipped.
    """
    at = len(_BEGIN)
    while data[at : at + 1] == b"\xff" and data[at : at + 2] != _SCAN:
        at += 2 + max(int.from_bytes(data[at + 2 : at + 4], "big"), 2)
    return data.rfind(_END, at)


def is_cut(data: bytes, decoded: ByteArray) -> bool:
    """Return whether the last blocks of a JPEG are missing although it has an end marker.

    Only images with a grey corner are checked closely; any corner, because of the camera's orientation. A progressive
    JPEG that is truncated between two scans is not detected.

    Args:
        data: bytes of the file.
        decoded: (H, W, 3) uint8 image.
    """
    if not (decoded[:: max(len(decoded) - 1, 1), :: max(decoded.shape[1] - 1, 1)] == _GREY).all(axis=2).any():
        return False
    end = end_of(data)
    try:
        return not np.array_equal(_pixels(data), _pixels(data[:end] + _FILLING + data[end:]))
    except (OSError, SyntaxError, Image.DecompressionBombError):  # a JPEG variant that Pillow does not support
        return False


def _pixels(data: bytes) -> ByteArray:
    with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
        return np.asarray(picture, dtype=np.uint8)

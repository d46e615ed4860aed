"""Pictures and points of ROS messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.importers.ros.bag import COMPRESSED, POINTS, decoded
from appocc.jpeg import is_jpeg

# Channels, and what makes BGR of them.
_BGR_FROM = {
    "bgr8": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, cv2.COLOR_GRAY2BGR),
    "bayer_rggb8": (1, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGRBG2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUYV),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUYV),
}
ENCODINGS = tuple(_BGR_FROM)
_PNG = b"\x89PNG"
# sensor_msgs/PointField.datatype
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_COLUMNS = ("x", "y", "z", "intensity", "ring")


def refused(message: Any, kind: str) -> str:
    """Return why the pictures of a topic cannot be used, given its first message; '' if they can."""
    if kind == COMPRESSED:
        data = message.data.tobytes()
        known = is_jpeg(data) or data.startswith(_PNG)
        depth = "compressedDepth" in message.format or message.format.startswith(("16UC1", "32FC1"))
        return "" if known and not depth else f"{message.format[:40] or 'unknown'}: expected JPEG or PNG"
    known = message.encoding.lower() in _BGR_FROM
    return "" if known else f"{message.encoding[:40] or 'unknown'}: expected {', '.join(ENCODINGS)}"


def picture(where: str, data: bytes, kind: str) -> bytes:
    """Return the JPEG or PNG file of a serialized Image or CompressedImage; an Image becomes a PNG.

    Raises:
        DataError: if it is damaged, or has an encoding that cannot be read.
    """
    message = decoded(where, data, kind)
    return bytes(message.data.tobytes()) if kind == COMPRESSED else _png(where, message)


def _png(where: str, message: Any) -> bytes:
    if message.encoding.lower() not in _BGR_FROM:
        raise DataError(f"{where}: expected {', '.join(ENCODINGS)}, got the encoding '{message.encoding[:40]}'")
    channels, code = _BGR_FROM[message.encoding.lower()]
    height, width, step = message.height, message.width, message.step
    if not (height > 0 and 0 < width * channels <= step and height * step <= len(message.data)):
        raise DataError(
            f"{where}: expected {height} rows of {step} bytes with {width} pixels of {channels} bytes, "
            f"got {len(message.data)} bytes"
        )
    rows = message.data[: height * step].reshape(height, step)[:, : width * channels]
    pixels = np.ascontiguousarray(rows.reshape(height, width, channels) if channels > 1 else rows)
    try:
        bgr = pixels if code is None else cv2.cvtColor(pixels, code)
        done, coded = cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    except cv2.error as error:
        raise DataError(f"{where}: {message.encoding} of {width}x{height} pixels cannot be converted") from error
    if not done:
        raise DataError(f"{where}: a picture of {width}x{height} pixels cannot be written")
    return bytes(coded.tobytes())


def points(where: str, data: bytes) -> FloatArray:
    """Return the points (N, 5) of a serialized PointCloud2: x, y, z, intensity 0..255 (0 if unknown), ring (-1).

    Points that are not finite, as organised clouds have where nothing returns, are left out. Intensities are taken
    as they are, up to 255.

    Raises:
        DataError: if it is damaged, or has no x, y and z.
    """
    message = decoded(where, data, POINTS)
    known = {each.name: each for each in message.fields if each.datatype in _NUMBERS}
    if not {"x", "y", "z"} <= set(known):
        raise DataError(f"{where}: expected the fields x, y and z, got {', '.join(known) or 'none'}")
    try:
        return _columns(_cloud(message, [known[name] for name in _COLUMNS if name in known]))
    except ValueError as error:
        raise DataError(
            f"{where}: expected {message.height} rows of {message.width} points of {message.point_step} bytes, "
            f"got {len(message.data)} bytes ({error})"
        ) from error


def _cloud(message: Any, fields: Sequence[Any]) -> Any:
    """Return the points (N,) as records of some fields.

    Raises:
        ValueError: if the message has fewer bytes than its fields need.
    """
    order, step = ">" if message.is_bigendian else "<", message.point_step
    kind = np.dtype(
        {
            "names": [each.name for each in fields],
            "formats": [order + _NUMBERS[each.datatype] for each in fields],
            "offsets": [each.offset for each in fields],
            "itemsize": step,
        }
    )
    rows = message.data[: message.row_step * message.height].reshape(message.height, message.row_step)
    return (
        np.ascontiguousarray(rows[:, : message.width * step]).reshape(message.height * message.width, step).view(kind)
    )


def _columns(cloud: Any) -> FloatArray:
    table = np.full((len(cloud), len(_COLUMNS)), -1.0)
    table[:, 3] = 0.0
    for column, name in enumerate(_COLUMNS):
        if name in cloud.dtype.names:
            table[:, column] = cloud[name][:, 0]
    table = table[np.isfinite(table).all(axis=1)]
    table[:, 3] = np.clip(table[:, 3], 0, 255)
    return np.asarray(table)

"""Pictures for the page: camera images at the width of a tile, and maps as sheets of exact values."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.files import open_picture, read_file
from appocc.jpeg import is_jpeg
from appocc.visualization.canvas import to_image_axes

# Widths of camera images that the page may ask for.
WIDTHS_PX = (320, 480, 640, 960, 1920)
_QUALITY, _COMPRESSION = 85, 3
# Limits of an image before it is decoded.
_MOST_PIXELS = 200_000_000
_REDUCED = {2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4, 8: cv2.IMREAD_REDUCED_COLOR_8}


def camera_jpeg(path: Path, width_px: int) -> bytes:
    """Return a camera image as JPEG, at most `width_px` wide; a small JPEG is returned as it is.

    Raises:
        DataError: if it is missing or not an image.
    """
    try:
        with open_picture(path) as picture:
            width, height = picture.size
    except (OSError, SyntaxError, ValueError) as error:
        raise DataError(f"{path.name}: not a readable image") from error
    if width * height > _MOST_PIXELS:
        raise DataError(f"{path.name}: expected at most {_MOST_PIXELS} pixels, got {width}x{height}")
    data = read_file(path)
    if is_jpeg(data) and width <= width_px:
        return data
    # JPEG is decoded at a half, a quarter or an eighth of its size in a fraction of the time.
    factor = max((factor for factor in _REDUCED if width >= factor * width_px), default=1)
    flag = _REDUCED.get(factor, cv2.IMREAD_COLOR)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flag)
    if image is None:
        raise DataError(f"{path.name}: not a readable image")
    scale = width_px / image.shape[1]
    if scale < 1:
        size = (width_px, max(round(image.shape[0] * scale), 1))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return _encoded(".jpg", np.asarray(image, np.uint8), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])


def read_picture(path: Path) -> bytes:
    """Return a picture as it is in its file.

    Raises:
        DataError: if it is missing or not an image.
    """
    try:
        with open_picture(path) as picture:
            picture.verify()
    except (OSError, SyntaxError, ValueError) as error:
        raise DataError(f"{path.name}: not a readable image") from error
    return read_file(path)


def map_sheet(bev: BEVMap) -> bytes:
    """Return a map as one PNG of three pictures (X, Y) below each other, forward up: exact values for the page.

    The first has the colours. The second has the probabilities of road, vehicle and lane as red, green and blue,
    0..255. The third has as bits of red which classes are known, as bits of green which are on, and as blue whether
    the colour is known.
    """
    bits = np.array([1, 2, 4], np.uint8)[:, None, None]
    known = (bev.occupancy_valid * bits).sum(axis=0)
    on = (bev.on * bits).sum(axis=0)
    colours = np.moveaxis(bev.appearance, 0, -1)
    chances = np.round(255 * np.moveaxis(bev.occupancy, 0, -1))
    flags = np.stack([known, on, 255 * bev.appearance_valid], axis=-1)
    sheet = np.concatenate([to_image_axes(part.astype(np.uint8)) for part in (colours, chances, flags)])
    return _encoded(".png", np.ascontiguousarray(sheet[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, _COMPRESSION])


def _encoded(ending: str, bgr: ByteArray, settings: list[int]) -> bytes:
    done, data = cv2.imencode(ending, bgr, settings)
    if not done:
        raise DataError(f"expected an image that can be encoded as {ending}, got shape {bgr.shape}")
    return bytes(data.tobytes())

"""Validated images: camera pictures, and masks as large as a map."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.files.reading import open_plain, read_file
from appocc.files.remote_path import RemotePath, path_of
from appocc.files.writing import write_bytes
from appocc.jpeg import end_of, is_cut, is_jpeg
from appocc.typing import PathLike

# nuScenes' largest mask has 1.2 billion pixels, more than Pillow's default limit.
_MOST_PIXELS = 4_000_000_000
# A small file can decode to an image that exhausts the memory; cameras have up to 50 million pixels.
_MOST_CAMERA_PIXELS = 200_000_000
# Supported formats. Every further one is another parser for untrusted bytes, and EPS starts a program.
_FORMATS = ("JPEG", "PNG")


def read_image(path: PathLike, size_px: tuple[int, int] | None = None) -> ByteArray:
    """Read an image file as (H, W, 3) uint8 RGB; `size_px` is the expected (width, height).

    Raises:
        DataError: if it is missing, truncated or not an image, or has another size.
    """
    return decoded_image(path, read_file(path), size_px)


def read_images(paths: Sequence[Path]) -> Iterator[ByteArray | DataError]:
    """Yield several images, as `read_image`, or for one that cannot be read the error; remote ones are read at once.

    Raises:
        StoreError: if the store of a remote image does not answer or refuses.
    """
    if not any(isinstance(path, RemotePath) for path in paths):
        yield from map(_image_or_error, paths)
        return
    with ThreadPoolExecutor(len(paths)) as pool:
        yield from pool.map(_image_or_error, paths)


def _image_or_error(path: Path) -> ByteArray | DataError:
    try:
        return read_image(path)
    except DataError as error:
        return error


def decoded_image(path: PathLike, data: bytes, size_px: tuple[int, int] | None = None) -> ByteArray:
    """Decode the bytes of an image file as `read_image`; `path` names it in messages.

    Raises:
        DataError: if it is truncated or not an image, or has another size.
    """
    _check_end(path, data)
    decoded = _decoded(data, cv2.IMREAD_COLOR_RGB)
    if decoded is None:
        raise DataError(f"{path}: not a readable image ({len(data)} bytes), expected JPEG or PNG")
    image: ByteArray = np.asarray(decoded, dtype=np.uint8)
    if is_jpeg(data) and is_cut(data, image):
        raise DataError(f"{path}: the image is truncated (its end mark comes too early)")
    _check_size(path, image, size_px)
    return image


def decoded_labels(path: PathLike, data: bytes, size_px: tuple[int, int]) -> NDArray[np.uint16]:
    """Decode the bytes of a grey PNG of 16 bits as (H, W) uint16 labels; `path` names it in messages.

    Raises:
        DataError: if it is truncated, damaged or another image, or has another size (width, height).
    """
    decoded = _decoded(data, cv2.IMREAD_UNCHANGED)
    if decoded is None:
        raise DataError(f"{path}: not a readable image ({len(data)} bytes), expected PNG")
    if decoded.dtype != np.uint16 or decoded.ndim != 2:
        raise DataError(f"{path}: expected a grey image of 16 bits, got {decoded.dtype} of shape {decoded.shape}")
    _check_size(path, decoded, size_px)
    return decoded


def _check_size(path: PathLike, image: NDArray[Any], size_px: tuple[int, int] | None) -> None:
    height, width = image.shape[:2]
    if size_px is not None and size_px != (width, height):
        expected = f"{size_px[0]}x{size_px[1]}"
        raise DataError(f"{path}: expected {expected} pixels, as its table says, got {width}x{height}")


def _decoded(data: bytes, flags: int) -> NDArray[Any] | None:
    """Return the pixels of an image in a supported format as OpenCV's `flags` ask; None if it is damaged."""
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags) if _is_picture(data) else None
    except cv2.error:
        return None


def read_picture_bytes(path: PathLike) -> bytes:
    """Read the bytes of an image file, which begin and end as a JPEG or begin as a PNG; they are not decoded.

    Raises:
        DataError: if it is missing, truncated or not an image.
    """
    data = read_file(path)
    _check_end(path, data)
    if not _is_picture(data):
        raise DataError(f"{path}: not a readable image ({len(data)} bytes), expected JPEG or PNG")
    return data


def _check_end(path: PathLike, data: bytes) -> None:
    if is_jpeg(data) and end_of(data) < 0:
        raise DataError(f"{path}: the image is truncated ({len(data)} bytes)")


def _is_picture(data: bytes) -> bool:
    """Return whether bytes begin as an image in a supported format, no larger than a camera's."""
    try:
        with _pillow(io.BytesIO(data)) as picture:
            return picture.width * picture.height <= _MOST_CAMERA_PIXELS
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return False


@contextmanager
def open_picture(path: PathLike) -> Iterator[Image.Image]:
    """Open a JPEG or PNG image, which may be as large as a map, to read its size or a part.

    A remote one is read whole.

    Raises:
        DataError: as `open_plain`; reading damaged pixels raises an error of Pillow.
    """
    path = path_of(path)
    opened = nullcontext(io.BytesIO(read_file(path))) if isinstance(path, RemotePath) else open_plain(path)
    with opened as file, _pillow(file) as picture:
        yield picture


def _pillow(file: BinaryIO) -> Image.Image:
    """Open an image in a supported format; pixels are read on demand."""
    Image.MAX_IMAGE_PIXELS = _MOST_PIXELS
    return Image.open(file, formats=_FORMATS)


def write_image(path: PathLike, rgb: ByteArray) -> None:
    """Write an (H, W, 3) RGB or (H, W) grey uint8 image; the ending of the path is the format.

    Raises:
        DataError: if the ending is unknown, the image is empty or too large for the format, or the file cannot be
            written.
    """
    path = path_of(path)
    try:
        picture = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR) if rgb.ndim == 3 else rgb
        done, data = cv2.imencode(path.suffix or ".png", picture)
    except cv2.error:
        done = False
    if not done:
        raise DataError(f"{path}: an image of shape {rgb.shape} cannot be written as '{path.suffix}'")
    write_bytes(path, data.tobytes())

"""Files: paths below a root, bounded reads, atomic writes, validated images."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.lib.npyio import NpzFile
from PIL import Image

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.jpeg import end_of, is_cut, is_jpeg
from appocc.temporary import made_folder, partial_file
from appocc.typing import PathLike

# Limits far above any real image, sweep, map or town; a file of results may hold a whole dataset.
MOST_BYTES, MOST_TEXT_BYTES = 1 << 28, 1 << 31
# Limit of the unpacked size of compressed files.
_MOST_UNPACKED = 1 << 30
# nuScenes' largest mask has 1.2 billion pixels, more than Pillow's default limit.
_MOST_PIXELS = 4_000_000_000
# A small file can decode to an image that exhausts the memory; cameras have up to 50 million pixels.
_MOST_CAMERA_PIXELS = 200_000_000
# Supported formats. Every further one is another parser for untrusted bytes, and EPS starts a program.
_FORMATS = ("JPEG", "PNG")


def inside(root: Path, name: str) -> Path:
    """Return the path of a file below `root` that a table names.

    Only the name is checked: folders below the root may be links to other disks.

    Raises:
        DataError: if the name is empty or absolute, or has a part '..'.
    """
    if not stays_inside(name):
        raise DataError(f"{root}: the file name '{name}' leads out of this folder")
    return root / name


def stays_inside(name: str) -> bool:
    """Return whether a file name, joined to a folder, is a path below this folder."""
    parts = name.replace("\\", "/").split("/")
    anchored = not parts[0] or os.path.splitdrive(name)[0]
    return not anchored and bool(name.strip("./\\")) and ".." not in parts and "\0" not in name


def plain_name(root: Path, name: str) -> str:
    """Check a name from a table of `root` that becomes the name of a file or folder, and return it.

    Raises:
        DataError: if it is empty or has path separators.
    """
    if name in ("", ".", "..") or any(character in name for character in "/\\\0"):
        raise DataError(f"{root}: expected a name for a file, got '{name}', which is none or leads elsewhere")
    return name


@contextmanager
def whole_file(path: PathLike) -> Iterator[Path]:
    """Write a file atomically: a temporary path, renamed to `path` if the block succeeds, otherwise removed.

    New parent folders are removed too if the block fails.

    Raises:
        DataError: if the folder cannot be written.
    """
    path = Path(path)
    try:
        # Do not replace a device or a pipe.
        if path.exists() and not path.is_file():
            raise DataError(f"{path}: cannot be written (not a plain file)")
        with made_folder(path.parent), partial_file(path) as temporary:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_bytes(path: PathLike, data: bytes) -> None:
    """Write a file atomically.

    Raises:
        DataError: if it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: PathLike, value: Any, indent: int | None = 1) -> None:
    """Write JSON atomically.

    Raises:
        DataError: if it cannot be written.
    """
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())


@contextmanager
def open_plain(path: PathLike, most_bytes: int | None = None) -> Iterator[BinaryIO]:
    """Open a plain file for reading; pipes and devices are refused because reads may block.

    Raises:
        DataError: if it is missing, cannot be read, is not a plain file, or is larger than `most_bytes`.
    """
    try:
        opened = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - closed below, outside of this try
    except (OSError, ValueError) as error:  # a name with a null in it is a ValueError
        raise DataError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    with opened as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise DataError(f"{path}: expected a plain file, got a pipe or a device")
        if most_bytes is not None and state.st_size > most_bytes:
            raise DataError(f"{path}: expected at most {most_bytes} bytes, got {state.st_size}")
        yield file


def _without_waiting(name: str, flags: int) -> int:
    """Open a file without blocking: opening a pipe otherwise waits for a writer."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


def read_file(path: PathLike, most_bytes: int = MOST_BYTES) -> bytes:
    """Read the bytes of a plain file.

    Raises:
        DataError: as `open_plain`.
    """
    with open_plain(path, most_bytes) as file:
        try:
            # Only the size at opening: a file may grow as fast as it is read.
            return file.read(os.fstat(file.fileno()).st_size)
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def read_text(path: PathLike, most_bytes: int = MOST_BYTES) -> str:
    """Read the UTF-8 text of a plain file.

    Raises:
        DataError: as `open_plain`, or if it is not text.
    """
    try:
        return read_file(path, most_bytes).decode()
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: cannot be read as text ({error})") from error


def digest_of(path: PathLike) -> str:
    """Compute the SHA-256 of a plain file.

    Raises:
        DataError: as `open_plain`.
    """
    with open_plain(path) as file:
        digest = hashlib.sha256()
        while piece := file.read(1 << 20):
            digest.update(piece)
        return digest.hexdigest()


def unzipped(path: PathLike) -> bytes:
    """Read the bytes of a file, unpacked if its name ends in .gz.

    Raises:
        DataError: as `open_plain`, or if it is damaged or too large when unpacked.
    """
    path = Path(path)
    data = read_file(path)
    if path.suffix != ".gz":
        return data
    try:
        with gzip.open(io.BytesIO(data)) as file:
            text = file.read(_MOST_UNPACKED + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path}: cannot be unpacked ({error})") from error
    if len(text) > _MOST_UNPACKED:
        raise DataError(f"{path}: expected at most {_MOST_UNPACKED} bytes when unpacked, got more")
    return text


def read_json(path: PathLike) -> Any:
    """Read a JSON file.

    Raises:
        DataError: if it is missing or not JSON.
    """
    data = read_file(path, MOST_TEXT_BYTES)
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no valid JSON ({error})") from error


def zip_arrays(data: bytes) -> NpzFile:
    """Open the arrays of an .npz file by name, without unpickling.

    Raises:
        ValueError: if it is not an .npz file or too large when unpacked. Reading a damaged array raises nearly any
            error of zipfile, zlib and numpy.
    """
    handle = io.BytesIO(data)
    if not zipfile.is_zipfile(handle):
        raise ValueError("no .npz archive, or truncated")
    with zipfile.ZipFile(handle) as archive:
        unpacked = sum(part.file_size for part in archive.infolist())
    if unpacked > _MOST_UNPACKED:
        raise ValueError(f"expected at most {_MOST_UNPACKED} bytes when unpacked, got {unpacked}")
    handle.seek(0)
    arrays: NpzFile = np.load(handle, allow_pickle=False)
    return arrays


def read_image(path: PathLike, size_px: tuple[int, int] | None = None) -> ByteArray:
    """Read an image file as (H, W, 3) uint8 RGB; `size_px` is the expected (width, height).

    Raises:
        DataError: if it is missing, truncated or not an image, or has another size.
    """
    return decoded_image(path, read_file(path), size_px)


def decoded_image(path: PathLike, data: bytes, size_px: tuple[int, int] | None = None) -> ByteArray:
    """Decode the bytes of an image file as `read_image`; `path` names it in messages.

    Raises:
        DataError: if it is truncated or not an image, or has another size.
    """
    _check_end(path, data)
    try:
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB) if _is_picture(data) else None
    except cv2.error:
        decoded = None
    if decoded is None:
        raise DataError(f"{path}: not a readable image ({len(data)} bytes), expected JPEG or PNG")
    image: ByteArray = np.asarray(decoded, dtype=np.uint8)
    if is_jpeg(data) and is_cut(data, image):
        raise DataError(f"{path}: the image is truncated (its end mark comes too early)")
    height, width = image.shape[:2]
    if size_px is not None and size_px != (width, height):
        expected = f"{size_px[0]}x{size_px[1]}"
        raise DataError(f"{path}: expected {expected} pixels, as its table says, got {width}x{height}")
    return image


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

    Raises:
        DataError: as `open_plain`; reading damaged pixels raises an error of Pillow.
    """
    with open_plain(path) as file, _pillow(file) as picture:
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
    path = Path(path)
    try:
        picture = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR) if rgb.ndim == 3 else rgb
        done, data = cv2.imencode(path.suffix or ".png", picture)
    except cv2.error:
        done = False
    if not done:
        raise DataError(f"{path}: an image of shape {rgb.shape} cannot be written as '{path.suffix}'")
    write_bytes(path, data.tobytes())

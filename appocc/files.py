"""Files: paths that stay below their root, reads that end, writes that are whole or not at all, checked images."""

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

# Far above any real file: a camera's picture, a sweep, a map, a town. A file of results may hold a whole dataset.
MOST_BYTES, MOST_TEXT_BYTES = 1 << 28, 1 << 31
# What compressed files may hold.
_MOST_UNPACKED = 1 << 30
# nuScenes' largest mask has 1.2 billion pixels; Pillow's own limit guards against far smaller pictures.
_MOST_PIXELS = 4_000_000_000
# A few bytes can claim to be a picture that fills the memory; cameras have up to 50 million pixels.
_MOST_CAMERA_PIXELS = 200_000_000
# Formats that are read. Each of the others is one more parser for a stranger's bytes, and EPS starts a program.
_FORMATS = ("JPEG", "PNG")


def inside(root: Path, name: str) -> Path:
    """Path of a file that a table names, below `root`.

    Only the name is judged: folders below the root may be links to other disks, as datasets often lie.

    Raises:
        DataError: if the name is empty or absolute, or has a part '..'.
    """
    if not stays_inside(name):
        raise DataError(f"{root}: the file name '{name}' leads out of this folder")
    return root / name


def stays_inside(name: str) -> bool:
    """Whether a file name can only mean a place below the folder it is joined to."""
    parts = name.replace("\\", "/").split("/")
    anchored = not parts[0] or os.path.splitdrive(name)[0]
    return not anchored and bool(name.strip("./\\")) and ".." not in parts and "\0" not in name


def plain_name(root: Path, name: str) -> str:
    """A name from a table of `root` that is to become the name of a file or folder, as it is.

    Raises:
        DataError: if it is empty, or has parts that lead elsewhere.
    """
    if name in ("", ".", "..") or any(character in name for character in "/\\\0"):
        raise DataError(f"{root}: expected a name for a file, got '{name}', which is none or leads elsewhere")
    return name


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it when the block ends well and removed when it does not.

    Folders that are made for it go with it.

    Raises:
        DataError: if the folder cannot be written.
    """
    try:
        # Else a device or a pipe would be replaced by a file of its name.
        if path.exists() and not path.is_file():
            raise DataError(f"{path}: cannot be written (it is no plain file)")
        with made_folder(path.parent), partial_file(path) as temporary:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all.

    Raises:
        DataError: if it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def write_json(path: Path, value: Any, indent: int | None = 1) -> None:
    """Write JSON whole or not at all.

    Raises:
        DataError: if it cannot be written.
    """
    write_bytes(path, (json.dumps(value, indent=indent) + "\n").encode())


@contextmanager
def open_plain(path: Path, most_bytes: int | None = None) -> Iterator[BinaryIO]:
    """A plain file, open to read; reading a pipe or a device might never end.

    Raises:
        DataError: if it is missing, cannot be read, is no plain file, or is larger than `most_bytes`.
    """
    try:
        opened = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - closed below, where an error is not of opening
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
    """Open a file; a pipe at once too, which otherwise waits for a writer."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


def read_file(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The bytes of a plain file.

    Raises:
        DataError: as `open_plain`.
    """
    with open_plain(path, most_bytes) as file:
        try:
            # No more than was there when it was opened: a file may grow as fast as it is read.
            return file.read(os.fstat(file.fileno()).st_size)
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def read_text(path: Path, most_bytes: int = MOST_BYTES) -> str:
    """The text of a plain file in UTF-8.

    Raises:
        DataError: as `open_plain`, or if it is no text.
    """
    try:
        return read_file(path, most_bytes).decode()
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: cannot be read as text ({error})") from error


def digest_of(path: Path) -> str:
    """SHA-256 of a plain file.

    Raises:
        DataError: as `open_plain`.
    """
    with open_plain(path) as file:
        digest = hashlib.sha256()
        while piece := file.read(1 << 20):
            digest.update(piece)
        return digest.hexdigest()


def unzipped(path: Path) -> bytes:
    """The bytes of a file, unpacked if its name ends in .gz.

    Raises:
        DataError: as `open_plain`, or if it is damaged or holds far too much.
    """
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


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        DataError: if it is missing or no JSON.
    """
    data = read_file(path, MOST_TEXT_BYTES)
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no valid JSON ({error})") from error


def zip_arrays(data: bytes) -> NpzFile:
    """The arrays of an .npz file by name; nothing is unpickled.

    Raises:
        ValueError: if it is none, or holds far too much; what is damaged inside surfaces as nearly any error of
            zipfile, zlib and numpy.
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


def read_image(path: Path, size_px: tuple[int, int] | None = None) -> ByteArray:
    """An image file as (H, W, 3) uint8 RGB; `size_px` is the (width, height) it must have.

    Raises:
        DataError: if it is missing, truncated or no image, or has another size.
    """
    data = read_file(path)
    if is_jpeg(data) and end_of(data) < 0:
        raise DataError(f"{path}: the image is truncated ({len(data)} bytes)")
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


def _is_picture(data: bytes) -> bool:
    """Whether bytes begin as a picture of a format that is read, no larger than a camera takes."""
    try:
        with _pillow(io.BytesIO(data)) as picture:
            return picture.width * picture.height <= _MOST_CAMERA_PIXELS
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return False


@contextmanager
def open_picture(path: Path) -> Iterator[Image.Image]:
    """A JPEG or PNG picture of which only the size or a part is wanted; it may be as large as a map.

    Raises:
        DataError: as `open_plain`; what is damaged inside surfaces as an error of Pillow.
    """
    with open_plain(path) as file, _pillow(file) as picture:
        yield picture


def _pillow(file: BinaryIO) -> Image.Image:
    """A picture of a format that is read; its pixels are read when they are asked for."""
    Image.MAX_IMAGE_PIXELS = _MOST_PIXELS
    return Image.open(file, formats=_FORMATS)


def write_image(path: Path, rgb: ByteArray) -> None:
    """Write an (H, W, 3) RGB or (H, W) grey uint8 picture; the ending of the path says the format.

    Raises:
        DataError: if the ending is unknown, the picture too large for it or empty, or the file cannot be written.
    """
    try:
        picture = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR) if rgb.ndim == 3 else rgb
        done, data = cv2.imencode(path.suffix or ".png", picture)
    except cv2.error:
        done = False
    if not done:
        raise DataError(f"{path}: a picture of shape {rgb.shape} cannot be written as '{path.suffix}'")
    write_bytes(path, data.tobytes())

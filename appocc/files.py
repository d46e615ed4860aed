"""Files: paths that stay below their root, writes that are whole or not at all, images that are checked."""

from __future__ import annotations

import json
import os
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.lib.npyio import NpzFile
from PIL import Image

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.jpeg import end_of, is_cut, is_jpeg

# nuScenes' largest mask has 1.2 billion pixels; Pillow's own limit guards against far smaller pictures.
_MOST_PIXELS = 4_000_000_000


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
    with ExitStack() as undo:
        try:
            # Else a device or a pipe would be replaced by a file of its name.
            if path.exists() and not path.is_file():
                raise DataError(f"{path}: cannot be written (it is no plain file)")
            for folder in [folder for folder in reversed(path.parents) if not folder.exists()]:
                folder.mkdir(exist_ok=True)
                undo.callback(_remove_empty, folder)
            handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        except OSError as error:
            raise DataError(f"{path}: cannot be written ({error.strerror})") from error
        os.close(handle)
        temporary = Path(name)
        undo.callback(temporary.unlink, missing_ok=True)
        try:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
        except OSError as error:
            raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error
        undo.pop_all()


def _remove_empty(folder: Path) -> None:
    """Remove a folder unless something lies in it by now."""
    with suppress(OSError):
        folder.rmdir()


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


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        DataError: if it is missing or no JSON.
    """
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: no valid JSON ({error})") from error


def zip_arrays(handle: BinaryIO) -> NpzFile:
    """The arrays of an open .npz file by name; nothing is unpickled.

    Raises:
        ValueError: if it is none; what is damaged inside surfaces as nearly any error of zipfile, zlib and numpy.
    """
    if not zipfile.is_zipfile(handle):
        raise ValueError("no .npz archive, or truncated")
    handle.seek(0)
    archive: NpzFile = np.load(handle, allow_pickle=False)
    return archive


def read_image(path: Path, size_px: tuple[int, int] | None = None) -> ByteArray:
    """An image file as (H, W, 3) uint8 RGB; `size_px` is the (width, height) it must have.

    Raises:
        DataError: if it is missing, truncated or no image, or has another size.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    if is_jpeg(data) and end_of(data) < 0:
        raise DataError(f"{path}: the image is truncated ({len(data)} bytes)")
    try:
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB) if data else None
    except cv2.error:  # a few bytes that claim to be a huge picture
        decoded = None
    if decoded is None:
        raise DataError(f"{path}: not a readable image ({len(data)} bytes)")
    image: ByteArray = np.asarray(decoded, dtype=np.uint8)
    if is_jpeg(data) and is_cut(data, image):
        raise DataError(f"{path}: the image is truncated (its end mark comes too early)")
    height, width = image.shape[:2]
    if size_px is not None and size_px != (width, height):
        expected = f"{size_px[0]}x{size_px[1]}"
        raise DataError(f"{path}: expected {expected} pixels, as its table says, got {width}x{height}")
    return image


def open_picture(path: Path) -> Image.Image:
    """A picture of which only the size or a part is wanted; it may be as large as a map."""
    Image.MAX_IMAGE_PIXELS = _MOST_PIXELS
    return Image.open(path)


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

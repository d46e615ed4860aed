"""Checking the files that the tables name: whether they are there, whole, and what the tables say they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from appocc.errors import DataError
from appocc.files import open_picture, read_image, stays_inside
from appocc.jpeg import end_of
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.lidar import read_lidar
from appocc.nuscenes.problem import Problem
from appocc.nuscenes.schema import LABEL_TABLES
from appocc.nuscenes.table import Table

_BATCH = 256
_POINT_BYTES, _FIRST_POINTS = 20, 100
_ENDS = {"JPEG": b"\xff\xd9", "PNG": b"IEND"}


def check_files(dataset: Dataset, images: bool, advance: Callable[[int], None]) -> Iterator[Problem]:
    """Findings about sensor files, masks and label files; `images` reads images and LiDAR files whole.

    `advance` is called with the number of sensor files done.
    """
    yield from _sensor_files(dataset, images, advance)
    yield from _masks(dataset)
    yield from _labels(dataset)


def _problem(table: Table, row: int, kind: str, reason: str) -> Problem:
    return Problem(table.name, table.text("token", row), kind, reason)


def _leads_out(table: Table, row: int, name: str) -> Problem:
    return _problem(table, row, "name leads out", f"the file name '{name}' leads out of the root")


# Sensor files -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Job:
    """A sensor file to look at; the size (width, height) is what the table says, 0 where it says nothing."""

    row: int
    path: Path
    modality: str
    size_px: tuple[int, int]


def _sensor_files(dataset: Dataset, images: bool, advance: Callable[[int], None]) -> Iterator[Problem]:
    """Folder by folder, since one listing is far quicker than asking for each of many files."""
    table = dataset.tables["sample_data"]
    folders: dict[str, list[int]] = {}
    for row, raw in enumerate(table.array("filename").tolist()):
        name = raw.decode()
        if stays_inside(name):
            folders.setdefault(name.rpartition("/")[0], []).append(row)
        else:
            yield _leads_out(table, row, name)
            advance(1)
    look = _look_closely if images else _glance
    with ThreadPoolExecutor() as pool:
        for folder, rows in folders.items():
            names = _listing(dataset.root / folder)
            there = [row for row in rows if table.text("filename", row).rpartition("/")[2] in names]
            yield from _missing(table, folder, sorted(set(rows) - set(there)), folder_is_there=bool(names))
            advance(len(rows) - len(there))
            for at in range(0, len(there), _BATCH):
                jobs = [_job(dataset, row) for row in there[at : at + _BATCH]]
                for job, finding in zip(jobs, pool.map(look, jobs), strict=True):
                    if finding:
                        yield _problem(table, job.row, *finding)
                advance(len(jobs))


def _listing(folder: Path) -> set[str]:
    """Names of the files in a folder; none where it is missing."""
    try:
        with os.scandir(folder) as entries:  # says without asking the disk again what is a file
            return {entry.name for entry in entries if _is_file(entry)}
    except OSError:
        return set()


def _is_file(place: Path | os.DirEntry[str]) -> bool:
    """Whether a file is there and can be reached: a name may be too long, a link lead to itself."""
    try:
        return place.is_file()
    except OSError:
        return False


def _missing(table: Table, folder: str, rows: list[int], folder_is_there: bool) -> Iterator[Problem]:
    """Each missing file; sweeps of a folder that was not downloaded at all are one note."""
    keys = table.array("is_key_frame")
    if not folder_is_there and rows and not keys[rows].any():
        reason = f"none of the {len(rows)} sweeps in {folder} is there"
        yield Problem(table.name, table.text("token", rows[0]), "missing sweeps", reason, "note")
        return
    for row in rows:
        yield _problem(table, row, "missing file", f"no file {table.text('filename', row)}")


def _job(dataset: Dataset, row: int) -> _Job:
    table, channel = dataset.tables["sample_data"], dataset.tables.data_channel[row]
    modality = dataset.tables["sensor"]["modality"][channel] if channel >= 0 else ""
    size = int(table["width"][row]), int(table["height"][row])
    return _Job(row, dataset.root / table.text("filename", row), modality, size)


def _glance(job: _Job) -> tuple[str, str] | None:
    """Kind and reason of what is wrong with a file, from its size, beginning and end."""
    try:
        if job.modality == "camera":
            return _wrong_size(job, *_size_of(job.path))
        return _glance_at_lidar(job.path) if _is_lidar(job) else None
    except (DataError, OSError) as error:
        return f"unreadable {job.modality} file", str(error)


def _look_closely(job: _Job) -> tuple[str, str] | None:
    """The same from the whole file."""
    try:
        if job.modality == "camera":
            height, width = read_image(job.path).shape[:2]
            return _wrong_size(job, width, height)
        if not _is_lidar(job):
            return None
        bad = int((~np.isfinite(read_lidar(job.path)).all(axis=1)).sum())
        return ("bad LiDAR points", f"{bad} points of {job.path} are not finite") if bad else _wrong_length(job.path)
    except DataError as error:
        return f"unreadable {job.modality} file", str(error)


def _is_lidar(job: _Job) -> bool:
    return job.modality == "lidar" and job.path.suffix == ".bin"


def _wrong_size(job: _Job, width: int, height: int) -> tuple[str, str] | None:
    if job.size_px in ((0, 0), (width, height)):
        return None
    stated = f"{job.size_px[0]}x{job.size_px[1]}"
    return "wrong image size", f"{job.path} is {width}x{height}, the table says {stated}"


def _glance_at_lidar(path: Path) -> tuple[str, str] | None:
    """Only where the first points are not finite are the others looked at, too.

    Raises:
        DataError: if none is finite.
    """
    wrong = _wrong_length(path)
    if not wrong:
        with path.open("rb") as handle:
            first = np.frombuffer(handle.read(_FIRST_POINTS * _POINT_BYTES), np.float32)
        if not np.isfinite(first).all():
            read_lidar(path)
    return wrong


def _wrong_length(path: Path) -> tuple[str, str] | None:
    size = path.stat().st_size
    if size and size % _POINT_BYTES == 0:
        return None
    return "unreadable lidar file", f"{path}: expected rows of 5 float32 (20 bytes), got {size} bytes: truncated?"


def _size_of(path: Path) -> tuple[int, int]:
    """Width and height that an image file states.

    Raises:
        DataError: if it is no image or its end is missing.
    """
    try:
        with open_picture(path) as picture:
            size, form = picture.size, picture.format or ""
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise DataError(f"{path}: not a readable image ({error})") from error
    if form in _ENDS and _ENDS[form] not in _tail(path) and not _has_end(path, form):
        raise DataError(f"{path}: the image is truncated ({path.stat().st_size} bytes)")
    return size


def _has_end(path: Path, form: str) -> bool:
    """Whether a picture has its end mark before bytes that do not belong to it."""
    data = path.read_bytes()
    return end_of(data) >= 0 if form == "JPEG" else _ENDS[form] in data


def _tail(path: Path) -> bytes:
    with path.open("rb") as handle:
        handle.seek(max(path.stat().st_size - 64, 0))
        return handle.read()


# Masks and labels -------------------------------------------------------------------------------------------------


def _masks(dataset: Dataset) -> Iterator[Problem]:
    """Masks are far too large to be decoded here: only their beginnings and ends are looked at."""
    table = dataset.tables["map"]
    for row, name in enumerate(table["filename"]):
        path = dataset.root / name
        if not stays_inside(name):
            yield _leads_out(table, row, name)
        elif not _is_file(path):
            yield _problem(table, row, "missing file", f"no file {name}")
        elif path.suffix == ".png" and not _is_whole_png(path):
            yield _problem(table, row, "unreadable mask", f"{path}: no PNG picture, or truncated")


def _is_whole_png(path: Path) -> bool:
    with path.open("rb") as handle:
        return handle.read(8) == b"\x89PNG\r\n\x1a\n" and _ENDS["PNG"] in _tail(path)


def _labels(dataset: Dataset) -> Iterator[Problem]:
    """Label files: one byte for each point of their LiDAR file."""
    for table in LABEL_TABLES:
        yield from _label_files(dataset, dataset.tables[table])


def _label_files(dataset: Dataset, table: Table) -> Iterator[Problem]:
    data = dataset.tables["sample_data"]
    files = data.rows_of(table.array("sample_data_token"))
    for row, raw in enumerate(table.array("filename").tolist()):
        name = raw.decode()
        if not stays_inside(name):
            yield _leads_out(table, row, name)
        elif not _is_file(dataset.root / name):
            yield _problem(table, row, "missing file", f"no file {name}")
        elif files[row] >= 0:
            yield from _wrong_labels(dataset.root, table, row, name, data.text("filename", int(files[row])))


def _wrong_labels(root: Path, table: Table, row: int, name: str, lidar_name: str) -> Iterator[Problem]:
    lidar = root / lidar_name
    if not stays_inside(lidar_name) or not _is_file(lidar):
        return
    labels, points = (root / name).stat().st_size, lidar.stat().st_size // _POINT_BYTES
    if labels != points:
        reason = f"{name} has {labels} labels, {lidar_name} has {points} points"
        yield _problem(table, row, "wrong number of labels", reason)

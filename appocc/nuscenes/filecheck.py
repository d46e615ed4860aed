"""Validation of the files of a dataset: missing, truncated or inconsistent with the tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from appocc.errors import DataError
from appocc.files import RemotePath, open_picture, read_file, read_image, stays_inside
from appocc.files.questions import ends_of, files_there, is_file, states_of
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
    """Yield the problems of sensor files, masks and label files; `images` reads images and LiDAR files completely.

    `advance` is the progress callback with the number of sensor files.
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
    """A sensor file to check; `size_px` (width, height) from the table, 0 where unknown."""

    row: int
    path: Path
    modality: str
    size_px: tuple[int, int]


def _sensor_files(dataset: Dataset, images: bool, advance: Callable[[int], None]) -> Iterator[Problem]:
    """Yield the problems of sensor files, folder by folder: one listing is much faster than many single queries."""
    table = dataset.tables["sample_data"]
    check = _check_content if images else _check_nothing if isinstance(dataset.root, RemotePath) else _check_ends
    folders: dict[str, list[int]] = {}
    for row, raw in enumerate(table.array("filename").tolist()):
        name = raw.decode()
        if stays_inside(name):
            folders.setdefault(name.rpartition("/")[0], []).append(row)
        else:
            yield _leads_out(table, row, name)
            advance(1)
    with ThreadPoolExecutor() as pool:
        for folder, rows in folders.items():
            stated = [table.text("filename", row).rpartition("/")[2] for row in rows]
            names = files_there(dataset.root / folder, stated)
            present = [row for row, name in zip(rows, stated, strict=True) if name in names]
            yield from _missing(table, folder, sorted(set(rows) - set(present)), folder_is_there=bool(names))
            advance(len(rows) - len(present))
            for at in range(0, len(present), _BATCH):
                jobs = [_job(dataset, row) for row in present[at : at + _BATCH]]
                for job, finding in zip(jobs, pool.map(check, jobs), strict=True):
                    if finding:
                        yield _problem(table, job.row, *finding)
                advance(len(jobs))


def _missing(table: Table, folder: str, rows: list[int], folder_is_there: bool) -> Iterator[Problem]:
    """Yield each missing file; all sweeps of a folder that was not downloaded are one note."""
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


def _check_nothing(job: _Job) -> tuple[str, str] | None:
    """Find no problem in a file that is there: in a store, the ends of a file cost as much as all of it."""
    return None


def _check_ends(job: _Job) -> tuple[str, str] | None:
    """Return kind and reason of a problem of a file, from its size, first and last bytes."""
    try:
        if job.modality == "camera":
            return _wrong_size(job, *_size_of(job.path))
        return _check_lidar_ends(job.path) if _is_lidar(job) else None
    except (DataError, OSError) as error:
        return f"unreadable {job.modality} file", str(error)


def _check_content(job: _Job) -> tuple[str, str] | None:
    """Return kind and reason of a problem of a file, from its whole content."""
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


def _check_lidar_ends(path: Path) -> tuple[str, str] | None:
    """Check the length and the first points of a LiDAR file; check all points if the first ones are not finite.

    Raises:
        DataError: if no point is finite.
    """
    wrong = _wrong_length(path)
    if not wrong:
        first, _ = ends_of(path, _FIRST_POINTS * _POINT_BYTES, 0)
        if not np.isfinite(np.frombuffer(first, np.float32)).all():
            read_lidar(path)
    return wrong


def _wrong_length(path: Path) -> tuple[str, str] | None:
    size = path.stat().st_size
    if size and size % _POINT_BYTES == 0:
        return None
    return "unreadable lidar file", f"{path}: expected rows of 5 float32 (20 bytes), got {size} bytes: truncated?"


def _size_of(path: Path) -> tuple[int, int]:
    """Return width and height from the header of an image file.

    Raises:
        DataError: if it is not an image or is truncated.
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
    """Whether an image has its end marker, with trailing bytes allowed."""
    data = read_file(path)
    return end_of(data) >= 0 if form == "JPEG" else _ENDS[form] in data


def _tail(path: Path) -> bytes:
    return ends_of(path, 0, 64)[1]


# Masks and labels -------------------------------------------------------------------------------------------------


def _masks(dataset: Dataset) -> Iterator[Problem]:
    """Yield the problems of map masks; only first and last bytes are checked, since masks are slow to decode."""
    table = dataset.tables["map"]
    for row, name in enumerate(table["filename"]):
        path = dataset.root / name
        if not stays_inside(name):
            yield _leads_out(table, row, name)
        elif not is_file(path):
            yield _problem(table, row, "missing file", f"no file {name}")
        elif path.suffix == ".png" and not _is_whole_png(path):
            yield _problem(table, row, "unreadable mask", f"{path}: no PNG image, or truncated")


def _is_whole_png(path: Path) -> bool:
    first, last = ends_of(path, 8, 64)
    return first == b"\x89PNG\r\n\x1a\n" and _ENDS["PNG"] in last


def _labels(dataset: Dataset) -> Iterator[Problem]:
    """Yield the problems of label files, which have one byte per point of their LiDAR file."""
    for table in LABEL_TABLES:
        yield from _label_files(dataset, dataset.tables[table])


def _label_files(dataset: Dataset, table: Table) -> Iterator[Problem]:
    data = dataset.tables["sample_data"]
    files = data.rows_of(table.array("sample_data_token"))
    names = [raw.decode() for raw in table.array("filename").tolist()]
    sweeps = [data.text("filename", int(file)) if file >= 0 else "" for file in files]
    for at in range(0, len(names), _BATCH):
        batch = slice(at, at + _BATCH)
        sizes = zip(_sizes(dataset.root, names[batch]), _sizes(dataset.root, sweeps[batch]), strict=True)
        for row, (labels, bytes_) in enumerate(sizes, start=at):
            if not stays_inside(names[row]):
                yield _leads_out(table, row, names[row])
            elif labels is None:
                yield _problem(table, row, "missing file", f"no file {names[row]}")
            elif bytes_ is not None and labels != bytes_ // _POINT_BYTES:
                reason = f"{names[row]} has {labels} labels, {sweeps[row]} has {bytes_ // _POINT_BYTES} points"
                yield _problem(table, row, "wrong number of labels", reason)


def _sizes(root: Path, names: list[str]) -> list[int | None]:
    """Return the sizes of files; None for one that is missing or leads out of the root."""
    known = {name: root / name for name in names if stays_inside(name)}
    states = dict(zip(known, states_of(list(known.values())), strict=True))
    return [None if (state := states.get(name)) is None else state[0] for name in names]

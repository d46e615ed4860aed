"""Provenance of results: digests of their inputs, so that a later run finds stale results.

A file enters by its size and time, a table by its values; absolute paths do not. The record is a separate file: the
results themselves are the same bytes wherever the dataset is stored.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appocc.files import inside
from appocc.files.journal import append_line, read_lines, write_lines
from appocc.files.questions import State, state_of, states_of
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.label_zones import no_label_zones
from appocc.nuscenes.records import Sample, SampleData, Scene
from appocc.nuscenes.schema import LABEL_TABLES

# Digest of each part: pictures, calibration, ...
Parts = Mapping[str, str]
_RECORD = "inputs.jsonl"
_UNKNOWN = "what they were made from is not recorded"


def digest(values: Iterable[object]) -> str:
    """Digest of numbers, texts, lists and arrays."""
    hashed = hashlib.sha256()
    for value in values:
        plain = value.tolist() if isinstance(value, np.ndarray) else value
        hashed.update(f"{plain!r}\n".encode())
    return hashed.hexdigest()[:16]


class Record:
    """Inputs of each result in a folder: one line a result, the last one is valid."""

    def __init__(self, folder: Path) -> None:
        """Read the record; damaged lines are skipped."""
        self._path = folder / _RECORD
        self._parts: dict[str, Parts] = {}
        for line in read_lines(self._path):
            try:
                name, parts = json.loads(line)
                self._parts[str(name)] = dict(parts)
            except (ValueError, TypeError, RecursionError):
                continue

    def why_stale(self, name: str, parts: Parts) -> str:
        """Reason why an existing result does not belong to these parts; '' if it does."""
        before = self._parts.get(name)
        if before is None:
            return _UNKNOWN
        changed = sorted(part for part in {*before, *parts} if before.get(part) != parts.get(part))
        return f"{' and '.join(changed)} changed" if changed else ""

    def why_remake(self, result: Path, picture: Path, parts: Parts, why_stale: Callable[[Path], str]) -> str | None:
        """Return why a result must be made: the reason why it is stale, or '' if it or its picture is missing.

        Args:
            result: file of the result; its name without the ending is its name in the record.
            picture: file of its picture.
            parts: digests of its inputs now.
            why_stale: reason why an existing result is stale apart from its inputs; '' if it is not.

        Returns:
            None if the result is up to date.
        """
        if not result.is_file():
            return ""
        reason = why_stale(result) or self.why_stale(result.stem, parts)
        return reason or (None if picture.is_file() else "")

    def tidy(self) -> None:
        """Write one line for each result, in order; called when a run has ended.

        Raises:
            DataError: if it cannot be written.
        """
        found = Record(self._path.parent)._parts
        lines = "".join(_line(name, found[name]) for name in sorted(found)).encode()
        if found:
            write_lines(self._path, lines)


def add_record(folder: Path, name: str, parts: Parts) -> None:
    """Record the inputs of a written result; several processes may append concurrently.

    Raises:
        DataError: if it cannot be written.
    """
    append_line(folder / _RECORD, name, _line(name, parts).rstrip("\n"))


def _line(name: str, parts: Parts) -> str:
    return json.dumps([name, dict(sorted(parts.items()))]) + "\n"


# Of datasets ------------------------------------------------------------------------------------------------------


def sample_parts(dataset: Dataset, sample: Sample, level: bool) -> dict[str, str]:
    """Inputs of the prediction of a sample; with `level`, the LiDAR sweep is one."""
    data = list(dataset.data(sample).values())
    pictures = [each for each in data if each.modality == "camera"]
    sweeps = [each for each in data if each.channel == LIDAR]
    found = {"pictures": _files(dataset, pictures), "calibration": _mounting(dataset, data, [sample])}
    return {**found, "sweep": _files(dataset, sweeps)} if level and sweeps else found


def scene_parts(dataset: Dataset, scene: Scene) -> dict[str, str]:
    """Inputs of the ground truth of any sample of a scene.

    Raises:
        DataError: if a table entry cannot be true.
    """
    samples, stream = dataset.samples(scene), dataset.stream(scene)
    pictures = [data for data in stream if data.modality == "camera"]
    sweeps = [data for data in stream if data.channel == LIDAR]
    labels = [path for data in sweeps for table in LABEL_TABLES if (path := dataset.label_path(data, table))]
    return {
        "pictures": _files(dataset, pictures),
        "sweeps": digest([_files(dataset, sweeps), *_named(labels)]),
        "calibration": _mounting(dataset, [*pictures, *sweeps], samples),
        "boxes": _boxes(dataset, samples),
        "maps": _maps(dataset, scene),
    }


def training_parts(dataset: Dataset, samples: Sequence[Sample], more: Iterable[Path]) -> dict[str, str]:
    """Inputs of a packed dataset; `more`: the files of maps and views."""
    data = [each for sample in samples for each in dataset.data(sample).values()]
    used = [each for each in data if each.modality == "camera" or each.channel == LIDAR]
    return {
        "sensor files": _files(dataset, used),
        "calibration": _mounting(dataset, used, samples),
        "maps": digest(_named(list(more))),
    }


def pack_parts(dataset: Dataset, samples: Sequence[Sample], maps: Sequence[Path]) -> dict[str, str]:
    """Inputs of samples that are packed for other programs: pictures, calibration, boxes, and the files of maps."""
    data = [each for sample in samples for each in dataset.data(sample).values()]
    pictures = [each for each in data if each.modality == "camera"]
    return {
        "pictures": _files(dataset, pictures),
        "calibration": _mounting(dataset, pictures, samples),
        "boxes": _boxes(dataset, samples),
        "maps": digest(_named(maps)),
    }


def _files(dataset: Dataset, data: Iterable[SampleData]) -> str:
    paths = {each.filename: dataset.path(each) for each in data}
    return digest(zip(paths, states_of(list(paths.values())), strict=True))


def _named(paths: Sequence[Path]) -> Iterable[tuple[str, State]]:
    return zip((path.name for path in paths), states_of(paths), strict=True)


def _mounting(dataset: Dataset, data: Iterable[SampleData], samples: Iterable[Sample]) -> str:
    """Cameras and sensors as mounted, the ego's poses and all times, as the tables have them."""
    sensors, poses = dataset.tables["calibrated_sensor"], dataset.tables["ego_pose"]
    values: list[Any] = [(sample.token, sample.timestamp_us) for sample in samples]
    for each in data:
        values.append((each.channel, each.timestamp_us, each.width_px, each.height_px))
        values += [sensors[name][each.calibration_row] for name in ("translation", "rotation", "camera_intrinsic")]
        values += [poses[name][each.ego_pose_row] for name in ("translation", "rotation")]
    return digest(values)


def _boxes(dataset: Dataset, samples: Iterable[Sample]) -> str:
    table, categories = dataset.tables["sample_annotation"], dataset.tables["category"]["name"]
    values: list[Any] = []
    for sample in samples:
        rows = dataset.tables.annotations_by_sample.rows(sample.token)
        values += [table.array(name)[rows] for name in ("instance_token", "translation", "size", "rotation")]
        values += [categories[row] if row >= 0 else None for row in dataset.tables.annotation_category[rows]]
        values += [outline.tolist() for outline in no_label_zones(dataset, sample)]
    return digest(values)


def _maps(dataset: Dataset, scene: Scene) -> str:
    record, location = dataset.map_record(scene), dataset.location(scene)
    names = [f"maps/expansion/{location}.json", f"maps/{location}.json"] if location else []
    names += [record.filename] if record is not None else []
    return digest([record, *((name, state_of(inside(dataset.root, name))) for name in names)])

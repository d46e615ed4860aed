"""Alignment of ground truth and tracks: frames of two files, or of a file and the annotations of a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.nuscenes import Dataset, Sample
from tracking.io.readers import FrameEntries, TrackFile, TrackFormat, read_track_file

# Categories to classes of nuScenes' tracking benchmark; other categories keep their names.
_CLASSES = {
    "vehicle.bicycle": "bicycle",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.car": "car",
    "vehicle.motorcycle": "motorcycle",
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
    "vehicle.trailer": "trailer",
    "vehicle.truck": "truck",
}
# Key frames without times are evenly spaced.
_STEP_US = 500_000


@dataclass(frozen=True, eq=False)
class AlignedFrame:
    """Ground truth and tracks of one frame.

    Attributes:
        truth: objects.
        tracks: tracks.
        scene: name of the scene; ids are unique within a scene.
        time_us: time of the frame; two frames per second in files without times.
        ego_xy_m: (2,) position of the ego in the frame of the entries; None if unknown.
    """

    truth: FrameEntries
    tracks: FrameEntries
    scene: str
    time_us: int
    ego_xy_m: FloatArray | None


@dataclass(frozen=True, eq=False)
class AlignedFiles:
    """Frames to be evaluated, scene by scene in temporal order.

    Attributes:
        format: format of the files.
        frames: frames with ground truth; in text files also those with tracks only.
        annotated: whether the ground truth is that of a dataset.
        without_truth: number of samples in the file of tracks without ground truth.
    """

    format: TrackFormat
    frames: tuple[AlignedFrame, ...]
    annotated: bool
    without_truth: int


def align_files(truth: Path, tracks: Path, version: str | None = None) -> AlignedFiles:
    """Read ground truth (a file, or the root of a dataset) and a file of tracks, and align their frames.

    Folders are pooled: a folder of text files with a folder of files of the same names as ground truth, or else, with
    a dataset, all files tracking.json in a folder, such as that of one scene.

    Raises:
        DataError: if one is damaged, the formats differ, or the tracks lack a sample or a file of the ground truth.
    """
    if tracks.is_dir():
        return _pooled(truth, tracks, version)
    given = read_track_file(tracks)
    if truth.is_dir():
        return _with_dataset(Dataset(truth, version), given)
    wanted = read_track_file(truth)
    if wanted.format is None or not wanted.frames:
        raise DataError(f"{truth}: expected objects, got an empty file")
    if given.format not in (None, wanted.format):
        raise DataError(f"{tracks}: expected {wanted.format}, as {truth} is, got {given.format}")
    if wanted.format is TrackFormat.nuscenes:
        _check_complete(given, wanted.frames)
        keys: list[str | int] = list(wanted.frames)
    else:
        keys = sorted({*wanted.frames, *given.frames})
    # KITTI files are in camera coordinates.
    ego = np.zeros(2) if wanted.format is TrackFormat.kitti else None
    frames = tuple(
        AlignedFrame(_at(wanted, key), _at(given, key), "", number * _STEP_US, ego) for number, key in enumerate(keys)
    )
    return AlignedFiles(wanted.format, frames, False, len(set(given.frames) - set(keys)))


def tracking_class(category: str) -> str:
    """Return the class of nuScenes' tracking benchmark of a category, or its own name if there is none."""
    return _CLASSES.get(category, category)


def _pooled(truth: Path, tracks: Path, version: str | None) -> AlignedFiles:
    """Align the files of two folders by name, or the files tracking.json of a folder with a dataset."""
    texts, tables = sorted(tracks.glob("*.txt")), sorted(tracks.rglob("tracking.json"))
    missing = [path.name for path in texts if not (truth / path.name).is_file()]
    if tables and len(missing) == len(texts):  # the folder of a scene has its tracks in both formats
        pairs = [(truth, path) for path in tables]
    elif missing:
        expected = f"a folder with {missing[0]}, as {tracks} is, or tracking.json there"
        raise DataError(f"{truth}: expected {expected}, got neither")
    else:
        _check_sequences(truth, tracks)
        pairs = [(truth / path.name, path) for path in texts]
    if not pairs:
        raise DataError(f"{tracks}: expected files NAME.txt or tracking.json, got none")
    parts = [align_files(*pair, version) for pair in pairs]
    formats = {part.format for part in parts}
    if len(formats) > 1:
        raise DataError(f"{tracks}: expected files of one format, got {', '.join(sorted(formats))}")
    # Frames of text files name no scene; those of a dataset do.
    frames = tuple(
        replace(frame, scene=frame.scene or path.stem)
        for part, (_, path) in zip(parts, pairs, strict=True)
        for frame in part.frames
    )
    return AlignedFiles(parts[0].format, frames, parts[0].annotated, sum(part.without_truth for part in parts))


def _check_sequences(truth: Path, tracks: Path) -> None:
    """Check that each sequence of the ground truth has a file of tracks, as KITTI's and MOTChallenge's tools do.

    Raises:
        DataError: if one has none.
    """
    missing = [path.name for path in sorted(truth.glob("*.txt")) if not (tracks / path.name).is_file()]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise DataError(f"{tracks}: expected a file, empty if nothing is tracked, for {missing[0]}{more} of {truth}")


def _at(file: TrackFile, key: str | int) -> FrameEntries:
    """Return the entries of a frame; none if the file lacks it."""
    return file.frames[key] if key in file.frames else FrameEntries.empty()


def _check_complete(tracks: TrackFile, samples: Iterable[str | int]) -> None:
    missing = [token for token in samples if token not in tracks.frames]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise DataError(
            f"{tracks.path}: expected tracks, or an empty list, for sample {missing[0]}{more}, got nothing"
        )


def _with_dataset(dataset: Dataset, tracks: TrackFile) -> AlignedFiles:
    """Align with the annotated scenes that share a sample with the file; it must have all samples of them."""
    if tracks.format is not TrackFormat.nuscenes:
        got = tracks.format or "an empty file"
        raise DataError(f"{tracks.path}: expected {TrackFormat.nuscenes}, as {dataset.root} is a dataset, got {got}")
    frames: list[AlignedFrame] = []
    for scene in dataset.scenes:
        samples = dataset.samples(scene)
        if not any(sample.token in tracks.frames for sample in samples) or not dataset.annotated(scene):
            continue
        _check_complete(tracks, [sample.token for sample in samples])
        frames += [_annotated(dataset, sample, _at(tracks, sample.token), scene.name) for sample in samples]
    if not frames:
        raise DataError(f"{tracks.path}: expected samples of an annotated scene of {dataset.root}, got none")
    return AlignedFiles(tracks.format, tuple(frames), True, len(tracks.frames) - len(frames))


def _annotated(dataset: Dataset, sample: Sample, tracks: FrameEntries, scene: str) -> AlignedFrame:
    """Return a key frame with the dataset's boxes; those without LiDAR and RADAR points are not required."""
    boxes = dataset.boxes_world(sample)
    table = dataset.tables["sample_annotation"]
    radar = table.array("num_radar_pts")[dataset.tables.annotations_by_sample.rows(sample.token)]
    n = len(boxes)
    truth = FrameEntries(
        boxes.instance,
        tuple(tracking_class(name) for name in boxes.category),
        boxes.centre_m[:, :2].copy(),
        np.full((n, 4), np.nan),
        np.full(n, np.nan),
        (boxes.lidar_points != 0) | (radar > 0),
    )
    return AlignedFrame(truth, tracks, scene, sample.timestamp_us, dataset.world_from_ego(sample)[:2, 3])

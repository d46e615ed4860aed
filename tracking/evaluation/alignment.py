"""Which truth goes with which tracks: frames of two files, or of a file and the annotations of a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.nuscenes import Dataset, Sample
from tracking.io.readers import Entries, Format, TrackFile, read_tracks

# The classes of nuScenes' tracking benchmark; other categories keep their names.
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
# Without times key frames count as evenly spaced.
_STEP_US = 500_000


@dataclass(frozen=True)
class PairedFrame:
    """Truth and tracks of one frame.

    Attributes:
        truth: objects.
        tracks: tracks.
        scene: name of the scene; ids of different scenes have nothing to do with each other.
        time_us: its time; in files without times, as if there were two frames a second.
        ego_xy_m: (2,) where the ego is, in the frame of the entries; None if nobody knows.
    """

    truth: Entries
    tracks: Entries
    scene: str
    time_us: int
    ego_xy_m: FloatArray | None


@dataclass(frozen=True)
class Pairing:
    """All frames to be judged, scene by scene in order of time.

    Attributes:
        format: of the files.
        frames: those with truth; in text also those with tracks alone.
        annotated: whether the truth is that of a dataset.
        without_truth: number of samples in the file of tracks that the truth does not have.
    """

    format: Format
    frames: tuple[PairedFrame, ...]
    annotated: bool
    without_truth: int


def pair(truth: Path, tracks: Path, version: str | None = None) -> Pairing:
    """Read truth (a file, or the root of a dataset) and a file of tracks, and bring them together.

    Raises:
        DataError: if one is damaged, they are in different formats, or tracks lack a sample of the truth.
    """
    given = read_tracks(tracks)
    if truth.is_dir():
        return _with_dataset(Dataset(truth, version), given)
    wanted = read_tracks(truth)
    if wanted.format is None or not wanted.frames:
        raise DataError(f"{truth}: expected objects, got an empty file")
    if given.format not in (None, wanted.format):
        raise DataError(f"{tracks}: expected {wanted.format}, as {truth} is, got {given.format}")
    if wanted.format is Format.nuscenes:
        _check_complete(given, wanted.frames)
        keys: list[str | int] = list(wanted.frames)
    else:
        keys = sorted({*wanted.frames, *given.frames})
    # A KITTI file is in the coordinates of its camera.
    ego = np.zeros(2) if wanted.format is Format.kitti else None
    frames = tuple(
        PairedFrame(_at(wanted, key), _at(given, key), "", number * _STEP_US, ego) for number, key in enumerate(keys)
    )
    return Pairing(wanted.format, frames, False, len(set(given.frames) - set(keys)))


def _at(file: TrackFile, key: str | int) -> Entries:
    """The entries of a frame; none if the file does not have it."""
    return file.frames[key] if key in file.frames else Entries.empty()


def _check_complete(tracks: TrackFile, samples: Iterable[str | int]) -> None:
    missing = [token for token in samples if token not in tracks.frames]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise DataError(
            f"{tracks.path}: expected tracks, or an empty list, for sample {missing[0]}{more}, got nothing"
        )


def _with_dataset(dataset: Dataset, tracks: TrackFile) -> Pairing:
    """The annotated scenes of which the file has a sample; it must have all of theirs."""
    if tracks.format is not Format.nuscenes:
        got = tracks.format or "an empty file"
        raise DataError(f"{tracks.path}: expected {Format.nuscenes}, as {dataset.root} is a dataset, got {got}")
    frames: list[PairedFrame] = []
    for scene in dataset.scenes:
        samples = dataset.samples(scene)
        if not any(sample.token in tracks.frames for sample in samples) or not dataset.annotated(scene):
            continue
        _check_complete(tracks, [sample.token for sample in samples])
        frames += [_annotated(dataset, sample, _at(tracks, sample.token), scene.name) for sample in samples]
    if not frames:
        raise DataError(f"{tracks.path}: expected samples of an annotated scene of {dataset.root}, got none")
    return Pairing(tracks.format, tuple(frames), True, len(tracks.frames) - len(frames))


def _annotated(dataset: Dataset, sample: Sample, tracks: Entries, scene: str) -> PairedFrame:
    """A key frame with the dataset's boxes; those without LiDAR and RADAR points need not be found."""
    boxes = dataset.boxes_world(sample)
    table = dataset.tables["sample_annotation"]
    radar = table.array("num_radar_pts")[dataset.tables.annotations_by_sample.rows(sample.token)]
    n = len(boxes)
    truth = Entries(
        boxes.instance,
        tuple(_CLASSES.get(name, name) for name in boxes.category),
        boxes.centre_m[:, :2].copy(),
        np.full((n, 4), np.nan),
        np.full(n, np.nan),
        (boxes.lidar_points != 0) | (radar > 0),
    )
    return PairedFrame(truth, tracks, scene, sample.timestamp_us, dataset.world_from_ego(sample)[:2, 3])

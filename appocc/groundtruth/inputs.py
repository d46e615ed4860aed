"""Inputs of the pipeline for one scene, gathered once and sent to worker processes."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import FloatArray, IntArray
from appocc.geometry import poses_between
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.label_zones import no_label_zones
from appocc.nuscenes.point_labels import PointLabels, point_labels
from appocc.nuscenes.records import Sample, SampleData, Scene

# Number of images of a channel that are tried for a point, nearest in time first.
_IMAGES_PER_CHANNEL = 3


@dataclass(frozen=True, eq=False)
class PosedImage:
    """An image with camera, pose, and the boxes at its time in the world frame."""

    path: Path
    camera: Camera
    world_from_cam: FloatArray
    boxes_world: Boxes
    timestamp_us: int


@dataclass(frozen=True, eq=False)
class SweepInput:
    """A LiDAR sweep with pose, boxes at its time, labels, and rounds of images, nearest in time first.

    Each round has one image of every camera.
    """

    path: Path
    world_from_lidar: FloatArray
    boxes_world: Boxes
    labels: PointLabels | None
    rounds: tuple[tuple[PosedImage, ...], ...]


@dataclass(frozen=True, eq=False)
class SampleInput:
    """A sample with pose, boxes, key-frame images, its LiDAR sweep if it has one, no-label zones (K, 2), world."""

    token: str
    timestamp_us: int
    world_from_ego: FloatArray
    boxes_world: Boxes
    views: tuple[PosedImage, ...]
    lidar: tuple[Path, FloatArray] | None
    no_label_zones: tuple[FloatArray, ...] = ()


@dataclass(frozen=True, eq=False)
class SceneInputs:
    """Inputs of a scene."""

    name: str
    sweeps: tuple[SweepInput, ...]
    samples: tuple[SampleInput, ...]
    annotated: bool


class _BoxesOverTime:
    """Boxes interpolated over time between samples, by instance: linear position, slerp rotation."""

    def __init__(self, samples: tuple[Sample, ...], boxes: list[Boxes]) -> None:
        self._times = np.array([sample.timestamp_us for sample in samples], dtype=np.int64)
        self._boxes = boxes
        self._place = [{name: i for i, name in enumerate(b.instance)} for b in boxes]

    def at(self, timestamp_us: int) -> Boxes:
        """Return the boxes of the sample nearest in time, moved to the given time.

        Objects annotated in one of the two neighbouring samples only are not moved.
        """
        last = len(self._times) - 1
        i = int(np.clip(np.searchsorted(self._times, timestamp_us, "right") - 1, 0, max(last - 1, 0)))
        j = min(i + 1, last)
        sample = i if abs(self._times[i] - timestamp_us) <= abs(self._times[j] - timestamp_us) else j
        base = self._boxes[sample]
        if i == j or timestamp_us == self._times[sample] or not len(base):
            return base
        a, b = (np.array([self._place[k].get(name, -1) for name in base.instance]) for k in (i, j))
        both = (a >= 0) & (b >= 0)
        centre, rotation = base.centre_m.copy(), base.rotation.copy()
        if both.any():
            step_us = max(int(self._times[j] - self._times[i]), 1)
            share = float(np.clip((timestamp_us - self._times[i]) / step_us, -1.0, 2.0))
            poses = poses_between(_poses(self._boxes[i], a[both]), _poses(self._boxes[j], b[both]), share)
            centre[both], rotation[both] = poses[:, :3, 3], poses[:, :3, :3]
        return replace(base, centre_m=centre, rotation=rotation)


def _poses(boxes: Boxes, index: IntArray) -> FloatArray:
    """Return the (N, 4, 4) world-from-box poses of some boxes."""
    poses = np.tile(np.eye(4), (len(index), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = boxes.rotation[index], boxes.centre_m[index]
    return poses


def gather_inputs(dataset: Dataset, scene: Scene) -> SceneInputs:
    """Gather the inputs of a scene; sensor files are not read.

    Raises:
        DataError: if a table entry is invalid.
    """
    samples = dataset.samples(scene)
    boxes = [dataset.boxes_world(sample) for sample in samples]
    over_time = _BoxesOverTime(samples, boxes)
    stream = dataset.stream(scene)
    lead_us = _camera_lead_us(dataset, samples)
    views: dict[str, list[PosedImage]] = defaultdict(list)
    for data in stream:
        if data.modality == "camera":
            boxes_then = over_time.at(data.timestamp_us + lead_us.get(data.channel, 0))
            views[data.channel].append(_posed_image(dataset, data, boxes_then))
    sweeps = tuple(_sweep(dataset, data, over_time, views) for data in stream if data.channel == LIDAR)
    inputs = tuple(_sample(dataset, *pair) for pair in zip(samples, boxes, strict=True))
    return SceneInputs(scene.name, sweeps, inputs, dataset.annotated(scene))


def _camera_lead_us(dataset: Dataset, samples: tuple[Sample, ...]) -> dict[str, int]:
    """Return the median time by which the image of each channel precedes its sample.

    A spinning LiDAR triggers the cameras as it passes them and is stamped at the end of the rotation. Boxes are
    annotated around its points: they match the key-frame image and not the time of the sample.
    """
    early: dict[str, list[int]] = defaultdict(list)
    for sample in samples:
        for data in dataset.data(sample).values():
            if data.modality == "camera":
                early[data.channel].append(sample.timestamp_us - data.timestamp_us)
    return {channel: round(float(np.median(own))) for channel, own in early.items()}


def _posed_image(dataset: Dataset, data: SampleData, boxes: Boxes) -> PosedImage:
    camera = dataset.camera(data)
    world_from_cam = dataset.world_from_ego_at(data) @ camera.ego_from_cam
    return PosedImage(dataset.path(data), camera, world_from_cam, boxes, data.timestamp_us)


def _sweep(
    dataset: Dataset, data: SampleData, boxes: _BoxesOverTime, views: dict[str, list[PosedImage]]
) -> SweepInput:
    nearest = {
        channel: sorted(own, key=lambda view: abs(view.timestamp_us - data.timestamp_us))[:_IMAGES_PER_CHANNEL]
        for channel, own in views.items()
    }
    rounds = tuple(
        tuple(own[k] for _, own in sorted(nearest.items()) if k < len(own)) for k in range(_IMAGES_PER_CHANNEL)
    )
    return SweepInput(
        path=dataset.path(data),
        world_from_lidar=dataset.world_from_ego_at(data) @ dataset.ego_from_sensor(data),
        boxes_world=boxes.at(data.timestamp_us),
        labels=point_labels(dataset, data),
        rounds=rounds,
    )


def _sample(dataset: Dataset, sample: Sample, boxes: Boxes) -> SampleInput:
    data = dataset.data(sample)
    cameras = [d for d in data.values() if d.modality == "camera"]
    lidar = data.get(LIDAR)
    own_lidar = None
    if lidar is not None:
        own_lidar = (dataset.path(lidar), dataset.world_from_ego_at(lidar) @ dataset.ego_from_sensor(lidar))
    return SampleInput(
        sample.token,
        sample.timestamp_us,
        dataset.world_from_ego(sample),
        boxes,
        tuple(_posed_image(dataset, d, boxes) for d in cameras),
        own_lidar,
        no_label_zones(dataset, sample),
    )

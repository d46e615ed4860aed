"""Examples for the second stage: vehicles that the shipped network predicts in simulated drives, with their truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar
from zlib import crc32

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from appocc.bevmap import load_map
from appocc.camera import Camera
from appocc.checks import ByteArray, Float32Array, FloatArray, IntArray
from appocc.geometry import inverse
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.second_stage.image_crops import ImageCrops, crop_images
from appocc.inference.second_stage.network import CropInputs
from appocc.inference.second_stage.refiner import LEAST_SCORE, crop_inputs, facing_away
from appocc.nuscenes.dataset import Dataset
from appocc.objects import KINDS, PEOPLE, BEVObjects
from appocc.training.batches.camera_style import CameraStyle, apply_style, apply_tone, draw_style
from appocc.training.batches.packed_objects import COLUMNS, KIND, RGB, XY, pack_objects

# A prediction is right if its centre is closer to that of a vehicle than this.
_GATE_M = 2.0
# Errors that are added to the boxes of the restyled versions: share with an error, along the line of sight as a
# share of the distance, across it, of the logarithm of the sizes, and the largest of the heading.
_SHARE, _ALONG, _ACROSS_M, _SIZE, _TURN_RAD = 0.5, 0.03, 0.3, 0.06, np.pi / 3
_SCENES_AT_ONCE = 4
_PLACE_SCALE = 127

T = TypeVar("T")


class Examples(NamedTuple):
    """N examples.

    Attributes:
        rgb: (N, H, W, 3) uint8 crops.
        place: (N, H, W, 3) int8, places on the box times 127.
        visible: (N, H, W) int8.
        size_px: (N, 2) size of the crops in the image.
        light: (N, 3) median sRGB colour of the images.
        centre_m: (N, 3) centres of the boxes, which face away from the ego.
        size_wlh_m: (N, 3) their sizes.
        yaw_rad: (N,) their headings.
        score: (N,) their scores.
        kind: (N,) index of their kinds.
        paint: (N, 3) their sRGB colours, NaN if unknown.
        away: (N,) 1 where the predicted heading faces away too, -1 where it is turned, 0 where it is not told.
        truth: (N, COLUMNS) rows of packed objects; NaN where there is no vehicle.
    """

    rgb: ByteArray
    place: NDArray[np.int8]
    visible: NDArray[np.int8]
    size_px: FloatArray
    light: FloatArray
    centre_m: FloatArray
    size_wlh_m: FloatArray
    yaw_rad: FloatArray
    score: FloatArray
    kind: IntArray
    paint: FloatArray
    away: FloatArray
    truth: Float32Array

    @classmethod
    def concatenated(cls, parts: Sequence[Examples]) -> Examples:
        """Return the examples of all parts."""
        return cls._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))

    def select(self, chosen: IntArray) -> Examples:
        """Return copies of some examples."""
        return Examples._make(array[chosen] for array in self)

    def inputs(self) -> CropInputs:
        """Return the network inputs."""
        boxes = BEVObjects(
            centre_m=self.centre_m,
            size_wlh_m=self.size_wlh_m,
            yaw_rad=self.yaw_rad,
            velocity_mps=np.full((len(self.score), 2), np.nan),
            kind=tuple(KINDS[kind] for kind in self.kind),
            rgb=self.paint,
            score=self.score,
        )
        place, visible = self.place / np.float64(_PLACE_SCALE), self.visible.astype(np.float64)
        owner = np.arange(len(boxes))
        return crop_inputs(boxes, self.away, ImageCrops(owner, self.rgb, place, visible, self.size_px, self.light))


class _Recorder:
    """Second stage that records its inputs and changes nothing."""

    def __call__(self, objects: BEVObjects, images: ByteArray, cameras: Iterable[Camera]) -> BEVObjects:
        self.objects, self.images, self.cameras = objects, images.transpose(0, 2, 3, 1), list(cameras)
        return objects


@dataclass(frozen=True)
class Source:
    """Where examples come from.

    Attributes:
        root: dataset.
        versions: of each vehicle; the first is as predicted, the others have another camera's style and errors.
        seed: of styles and errors.
        weights: shipped weights that predict the vehicles.
        against: source of the true maps.
        most: number of key frames of each scene, the first ones; None: all.
    """

    root: Path
    versions: int
    seed: int
    weights: str = "appocc"
    against: str = "exact"
    most: int | None = None


def read_examples(source: Source, workers: int) -> Examples:
    """Return the examples of a source, in the order of its frames, read by a number of processes."""
    return Examples.concatenated(map_scenes(source, _of_scenes, workers))


def map_scenes(source: Source, of_scenes: Callable[[Source, Sequence[str]], T], workers: int) -> list[T]:
    """Return the results of a function of a source and the names of some scenes, in the order of all its scenes."""
    scenes = [scene.name for scene in Dataset(source.root).scenes]
    jobs = [scenes[i : i + _SCENES_AT_ONCE] for i in range(0, len(scenes), _SCENES_AT_ONCE)]
    with ProcessPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        return list(pool.map(partial(of_scenes, source), jobs))


def _of_scenes(source: Source, names: Sequence[str]) -> Examples:
    recorder = _Recorder()
    predictor = load_predictor(source.weights, second_stage=recorder)
    dataset = Dataset(source.root)
    parts = []
    for scene in dataset.scenes:
        if scene.name not in names:
            continue
        predictor.reset()
        rng = np.random.default_rng([source.seed, crc32(scene.name.encode())])
        for given in dataset_inputs(dataset, [scene])[: source.most]:
            predictor(given.read().frame)
            truth = _true_vehicles(dataset, source.against, given.token)
            chosen = recorder.objects.are_vehicles & (recorder.objects.score >= LEAST_SCORE)
            objects = recorder.objects.select(chosen)
            matched = truth[_match(objects, truth)]
            parts.append(_cropped(objects, recorder.images, recorder.cameras, matched))
            for _ in range(source.versions - 1):
                style = draw_style(rng)
                painted = objects.painted(_toned(objects.rgb, style))
                images = apply_style(recorder.images, style, rng)
                toned = matched.copy()
                toned[:, RGB] = _toned(matched[:, RGB].astype(np.float64), style)
                parts.append(_cropped(_with_errors(painted, rng), images, recorder.cameras, toned))
    return Examples.concatenated(parts)


def _true_vehicles(dataset: Dataset, against: str, token: str) -> Float32Array:
    """Return the rows of the vehicles of a sample, and a last one of NaN."""
    sample = dataset.sample(token)
    boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
    rows, _ = pack_objects(boxes, load_map(dataset.root, against, token))
    vehicles = [KINDS[int(kind)] not in PEOPLE for kind in rows[:, KIND]]
    return np.vstack([rows[np.array(vehicles, np.bool_)], np.full((1, COLUMNS), np.nan, np.float32)])


def _match(objects: BEVObjects, truth: Float32Array) -> IntArray:
    """Return the row of the vehicle that each object is, the last row for none: the best scores choose first."""
    apart_m = cdist(objects.centre_m[:, :2], truth[:-1, XY])
    found = np.full(len(objects), len(truth) - 1)
    for one in np.argsort(-objects.score, kind="stable").tolist():
        if apart_m.shape[1] and apart_m[one].min() < _GATE_M:
            found[one] = apart_m[one].argmin()
            apart_m[:, found[one]] = np.inf
    return found


def _toned(rgb: FloatArray, style: CameraStyle) -> FloatArray:
    known = np.nan_to_num(rgb).round().clip(0, 255).astype(np.uint8)
    return np.where(np.isfinite(rgb), apply_tone(known, style), np.nan)


def _with_errors(objects: BEVObjects, rng: Generator) -> BEVObjects:
    """Return objects with errors of place, size and heading."""
    n, centre_m = len(objects), objects.centre_m.copy()
    off, turned = rng.random((2, n)) < _SHARE
    ahead = centre_m[:, :2]
    distance_m = np.hypot(*ahead.T)
    sight = ahead / np.maximum(distance_m, 1e-6)[:, None]
    along, across = rng.normal(0, _ALONG, n) * distance_m * off, rng.normal(0, _ACROSS_M, n) * off
    centre_m[:, :2] += along[:, None] * sight + across[:, None] * np.column_stack([-sight[:, 1], sight[:, 0]])
    return replace(
        objects,
        centre_m=centre_m,
        size_wlh_m=objects.size_wlh_m * np.exp(rng.normal(0, _SIZE, (n, 3)) * off[:, None]),
        yaw_rad=objects.yaw_rad + rng.uniform(-_TURN_RAD, _TURN_RAD, n) * turned,
    )


def _cropped(objects: BEVObjects, images: ByteArray, cameras: Sequence[Camera], truth: Float32Array) -> Examples:
    objects, away = facing_away(objects)
    crops = crop_images(objects.boxes, images, cameras)
    boxes = objects.select(crops.owner)
    return Examples(
        rgb=crops.rgb,
        place=np.rint(crops.place * _PLACE_SCALE).astype(np.int8),
        visible=crops.visible.astype(np.int8),
        size_px=crops.size_px,
        light=crops.light,
        centre_m=boxes.centre_m,
        size_wlh_m=boxes.size_wlh_m,
        yaw_rad=boxes.yaw_rad,
        score=boxes.score,
        kind=np.array([KINDS.index(kind) for kind in boxes.kind], np.int64),
        paint=boxes.rgb,
        away=away[crops.owner],
        truth=truth[crops.owner],
    )

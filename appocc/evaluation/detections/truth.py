"""Annotated boxes with the classes and attributes of nuScenes' detection benchmark, and colours from true maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.boxes import Boxes, is_vehicle
from appocc.checks import FloatArray, IntArray
from appocc.colours import Exposure, exposure_of
from appocc.evaluation.detections.box_table import BoxTable, ego_distance_m, in_rack
from appocc.evaluation.pairs import FRAMES_AT_ONCE, read_map_pair
from appocc.evaluation.vehicles import true_vehicles
from appocc.geometry import inverse
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample
from appocc.workers import Engine, in_order

# Classes of the benchmark by category; the other categories have none.
_KINDS = {
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
    "movable_object.barrier": "barrier",
    "movable_object.trafficcone": "traffic_cone",
    "vehicle.bicycle": "bicycle",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.car": "car",
    "vehicle.construction": "construction_vehicle",
    "vehicle.motorcycle": "motorcycle",
    "vehicle.trailer": "trailer",
    "vehicle.truck": "truck",
}
_RACK = "static_object.bicycle_rack"


class Truth(NamedTuple):
    """Annotations of S key frames.

    Attributes:
        boxes: all annotated boxes.
        world_from_ego: (S, 4, 4) ego poses.
        racks: S tables of bicycle racks, world frame.
        light: exposure of the true map of each key frame; empty if the colours are unknown.
    """

    boxes: BoxTable
    world_from_ego: FloatArray
    racks: tuple[Boxes, ...]
    light: tuple[Exposure, ...] = ()


def read_truth(
    dataset: Dataset,
    samples: Sequence[Sample],
    against: str | None,
    advance: Callable[[float], None],
    pool: Engine | None = None,
) -> Truth:
    """Read the annotations of at least one key frame; with the colours of vehicles if a source of true maps is given.

    Args:
        dataset: dataset of the key frames.
        samples: key frames.
        against: source of the true maps; None: no colours.
        advance: progress callback with the number of new samples.
        pool: where true maps are read; the result does not depend on it.

    Raises:
        DataError: if an annotation, a pose or a map is damaged, or a map is missing.
    """
    parts, racks = list[BoxTable](), list[Boxes]()
    poses = [dataset.world_from_ego(sample) for sample in samples]
    for number, (sample, pose) in enumerate(zip(samples, poses, strict=True)):
        boxes = dataset.boxes_world(sample)
        racks.append(boxes.select(np.array([name == _RACK for name in boxes.category], np.bool_)))
        parts.append(_annotated(dataset, sample, boxes, pose, racks[-1], number))
        if against is None:
            advance(1)
    light = []
    if against is not None:
        inputs = (
            (sample.token, dataset.boxes_world(sample).transformed(inverse(pose)))
            for sample, pose in zip(samples, poses, strict=True)
        )
        read = partial(_true_colours, root=dataset.root, against=against)
        for number, (rgb, exposure) in enumerate(in_order(pool, read, inputs, FRAMES_AT_ONCE)):
            parts[number] = replace(parts[number], rgb=rgb)
            light.append(exposure)
            advance(1)
    return Truth(BoxTable.concatenated(parts), np.stack(poses), tuple(racks), tuple(light))


def _annotated(
    dataset: Dataset, sample: Sample, boxes: Boxes, pose: FloatArray, rack: Boxes, number: int
) -> BoxTable:
    rows = dataset.tables.annotations_by_sample.rows(sample.token)
    radar = dataset.tables["sample_annotation"].array("num_radar_pts")[rows]
    kind = np.array([_KINDS.get(name, "") for name in boxes.category], np.str_)
    n = len(boxes)
    return BoxTable(
        sample=np.full(n, number, np.int64),
        centre_m=boxes.centre_m,
        size_wlh_m=boxes.size_wlh_m,
        yaw_rad=boxes.yaw_rad,
        velocity_mps=boxes.velocity_mps,
        kind=kind,
        attribute=_attributes(dataset, rows),
        score=np.ones(n),
        rgb=np.full((n, 3), np.nan),
        distance_m=ego_distance_m(boxes.centre_m, pose),
        vehicle=np.array([is_vehicle(name) for name in boxes.category], np.bool_),
        # Unknown counts of points are -1.
        left_out=((boxes.lidar_points == 0) & (radar == 0)) | in_rack(boxes.centre_m, kind, rack),
    )


def _attributes(dataset: Dataset, rows: IntArray) -> NDArray[np.str_]:
    """Return the attribute (N,) of annotations; '' where there is none, or more than one."""
    tokens = dataset.tables["sample_annotation"]["attribute_tokens"]
    table = dataset.tables["attribute"]
    names = {table.text("token", row): table["name"][row] for row in range(len(table))}
    own = [tokens[int(row)] for row in rows]
    return np.array([names.get(some[0], "") if len(some) == 1 else "" for some in own], np.str_)


def _true_colours(wanted: tuple[str, Boxes], root: Path, against: str) -> tuple[FloatArray, Exposure]:
    """Return the median colour (N, 3) of the cells of each box in the true map, and the map's exposure.

    Colours are NaN if no cell is known. `wanted` is the token of a sample with its annotated boxes in the ego frame.
    """
    token, boxes_ego = wanted
    pair = read_map_pair(root, against, against, token, ahead=False)
    vehicles = true_vehicles(pair.truth, pair.instance, boxes_ego)
    number = {name: i for i, name in enumerate(vehicles.instance)}
    rgb = np.full((len(boxes_ego), 3), np.nan)
    owner = np.where(pair.truth.appearance_valid, vehicles.owner, -1)
    present = set(np.unique(owner).tolist())
    for i, name in enumerate(boxes_ego.instance):
        if number.get(name, -1) in present - {-1}:
            rgb[i] = np.median(pair.truth.appearance[:, owner == number[name]], axis=1)
    return rgb, exposure_of(pair.truth, rgb)

"""The tiny dataset with maps made from its own boxes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from made_map import WHITE, Car, map_of
from made_objects import objects_of_boxes
from tiny_dataset import TinyDataset

from appocc.bevmap import bev_path, load_map
from appocc.geometry import inverse
from appocc.nuscenes import Dataset


def with_maps(tiny: TinyDataset, source: str = "groundtruth") -> Dataset:
    """Write the map of every sample and open the dataset."""
    dataset = Dataset(tiny.root)
    for sample in (sample for scene in dataset.scenes for sample in dataset.samples(scene)):
        boxes = dataset.boxes_world(sample).vehicles().transformed(inverse(dataset.world_from_ego(sample)))
        cars = [
            Car(float(x), float(y), float(yaw), WHITE, float(length), float(width))
            for (x, y, _), yaw, (width, length, _) in zip(
                boxes.centre_m, boxes.yaw_rad, boxes.size_wlh_m, strict=True
            )
        ]
        bev = replace(map_of(cars), meta={"sources": {"vehicle": "cuboids"}} if source == "groundtruth" else {})
        bev.save(bev_path(tiny.root, source, sample.token))
    return dataset


def with_objects(dataset: Dataset) -> None:
    """Write maps of source `model`: those of `groundtruth` with the annotated boxes as objects."""
    for sample in (sample for scene in dataset.scenes for sample in dataset.samples(scene)):
        boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
        objects = objects_of_boxes(boxes, np.tile(np.array(WHITE, np.float64), (len(boxes), 1)))
        bev = load_map(dataset.root, "groundtruth", sample.token)
        replace(bev, objects=objects).save(bev_path(dataset.root, "model", sample.token))


def add_second_scene(tiny: TinyDataset) -> None:
    """Add a copy of the scene, of other tokens, with the same files."""
    tables = ("scene", "sample", "sample_data", "ego_pose", "instance", "sample_annotation")
    own = {row["token"] for name in tables for row in tiny.tables[name]}

    def renamed(value: Any) -> Any:
        return value[:-1] + "2" if value in own else value

    for name in tables:
        copies = [
            {key: renamed(value) if isinstance(value, str) else value for key, value in row.items()}
            for row in tiny.tables[name]
        ]
        tiny.tables[name] += copies
    tiny.tables["scene"][1]["name"] = "scene-second"
    tiny.write()

"""The tiny dataset with maps made from its own boxes."""

from __future__ import annotations

from dataclasses import replace

from made_map import WHITE, Car, map_of
from tiny_dataset import TinyDataset

from appocc.bevmap import bev_path
from appocc.geometry import inverse
from appocc.nuscenes import Dataset


def with_maps(tiny: TinyDataset, source: str = "groundtruth") -> Dataset:
    """Write the map of every sample and open the dataset."""
    dataset = Dataset(tiny.root)
    for sample in dataset.samples(dataset.scenes[0]):
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

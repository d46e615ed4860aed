"""Uses of a dataset: the layers of ground truth that it allows, and the directions in which no camera looks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from appocc.camera import CameraRig
from appocc.errors import AppoccError
from appocc.nuscenes import Dataset

# Directions and their yaw; a camera looks there if it sees a place so far away and high.
_DIRECTIONS = {"ahead": 0, "left": 90, "behind": 180, "right": -90}
_PLACE_M = (20.0, 1.0)


def uses_of(dataset: Dataset, masks: int, vector_maps: int) -> tuple[str, ...]:
    """Return lines for people: the layers that `appocc groundtruth` makes, their sources, and blind directions.

    Raises:
        DataError: if a table is damaged.
    """
    tables = dataset.tables
    modality = {tables["sensor"]["modality"][row] for row in set(tables.data_channel.tolist()) if row >= 0}
    fine, coarse = len(tables["pointlabels"]) > 0, len(tables["lidarseg"]) > 0
    seen = {"lidar", "camera"} <= modality
    layers = {
        "road": ("vector map" * bool(vector_maps) or "mask" * bool(masks) or "point labels" * (fine or coarse)),
        "lane markings": ("vector map" * bool(vector_maps) or "point labels" * fine),
        "vehicles": "boxes" * bool(len(tables["sample_annotation"])),
        "colours": "cameras and LiDAR" * seen,
    }
    needs = {"road": "a map or labelled points", "lane markings": "a vector map or labelled points"}
    needs |= {"vehicles": "boxes", "colours": "cameras and LiDAR"}
    can = ", ".join(f"{layer} ({source})" for layer, source in layers.items() if source)
    cannot = ", ".join(f"{layer} (needs {needs[layer]})" for layer, source in layers.items() if not source)
    blind = ", ".join(_blind(_rig(dataset)))
    lines = (f"ground truth: {can or 'none'}", cannot and f"  not: {cannot}", blind and f"no camera looks: {blind}")
    return tuple(filter(None, lines))


def _rig(dataset: Dataset) -> CameraRig | None:
    """Return the cameras of the first key frame; None if there is none, or its calibration is damaged."""
    try:
        samples = dataset.samples(dataset.scenes[0]) if dataset.scenes else ()
        return dataset.frame(samples[0], images=False).rig if samples else None
    except AppoccError:
        return None  # the findings say what is wrong


def _blind(rig: CameraRig | None) -> Iterator[str]:
    for name, yaw in _DIRECTIONS.items() if rig is not None and len(rig) else ():
        distance, height = _PLACE_M
        place = np.array([[distance * np.cos(np.radians(yaw)), distance * np.sin(np.radians(yaw)), height]])
        if not any(camera.sees(*camera.project_ego(place)).any() for camera in rig or ()):
            yield name

"""Evaluation of single vehicles: cell recall and colour error of each true vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import BoolArray, ByteArray, IntArray
from appocc.evaluation.cells import colour_error
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample
from appocc.rasterise import vehicle_owner

# A vehicle is detected if the map has at least this share of its cells.
DETECTED_SHARE = 0.5


class TrueVehicles(NamedTuple):
    """Vehicle of each cell.

    Attributes:
        owner: (X, Y) index of the vehicle, -1 for none.
        instance: instance token of each vehicle; empty if unknown.
    """

    owner: IntArray
    instance: Sequence[str]


class VehicleScore(NamedTuple):
    """Score of one vehicle in one sample.

    Attributes:
        distance_m: distance of the mean of its cells from the ego origin.
        visibility: visibility level of its annotation; empty if unknown.
        cell_recall: share of its cells that are vehicle in the map.
        colour_l1: mean colour error of its cells, 0..255; NaN if no cell has known colours in both maps.
        delta_e: CIEDE2000 between its mean colours in both maps; NaN as above.
    """

    distance_m: float
    visibility: str
    cell_recall: float
    colour_l1: float
    delta_e: float

    @property
    def detected(self) -> bool:
        """Whether the map has enough of its cells."""
        return self.cell_recall >= DETECTED_SHARE


def true_vehicles(truth: BEVMap, instance: IntArray | None, boxes_ego: Boxes | None) -> TrueVehicles:
    """Separate the vehicles of a true map by simulated instances, else annotated boxes, else connected components.

    Args:
        truth: true map.
        instance: (X, Y) index into `instances` of the map's meta, -1 for none; None if the file has no such array.
        boxes_ego: annotated boxes; None if the scene has no annotations.
    """
    on = (truth.occupancy[VEHICLE] >= 0.5) & truth.occupancy_valid[VEHICLE]
    if instance is not None:
        return TrueVehicles(np.where(on, instance, -1), tuple(truth.meta.get("instances", ())))
    if boxes_ego is not None:
        vehicles = boxes_ego.vehicles()
        return TrueVehicles(np.where(on, vehicle_owner(truth.grid, vehicles), -1), vehicles.instance)
    labels, _ = ndimage.label(on)
    return TrueVehicles(labels.astype(np.int64) - 1, ())


def score_vehicles(
    predicted: BEVMap,
    truth: BEVMap,
    vehicles: TrueVehicles,
    within: BoolArray,
    threshold: float,
    visibility: Mapping[str, str],
) -> list[VehicleScore]:
    """Score every vehicle by its true cells; none if the map has no valid vehicle cell.

    Args:
        predicted: evaluated map.
        truth: true map on the same grid.
        vehicles: true vehicles.
        within: (X, Y) cells to evaluate.
        threshold: lowest probability of a vehicle cell.
        visibility: visibility level by instance token.
    """
    found = predicted.occupancy[VEHICLE] >= threshold
    known = predicted.appearance_valid & truth.appearance_valid
    error, centres = colour_error(predicted, truth), truth.grid.centres()
    owner = np.where(within & predicted.occupancy_valid[VEHICLE].any(), vehicles.owner, -1)
    scores = []
    for number in np.unique(owner[owner >= 0]).tolist():
        cells = owner == number
        coloured = cells & known
        name = vehicles.instance[number] if number < len(vehicles.instance) else ""
        scores.append(
            VehicleScore(
                distance_m=float(np.linalg.norm(centres[cells].mean(axis=0))),
                visibility=visibility.get(name, ""),
                cell_recall=float(found[cells].mean()),
                colour_l1=float(error[coloured].mean()) if coloured.any() else float("nan"),
                delta_e=delta_e(predicted.appearance[:, coloured], truth.appearance[:, coloured]),
            )
        )
    return scores


def delta_e(predicted: ByteArray, true: ByteArray) -> float:
    """Return CIEDE2000 between the mean sRGB colours 0..255 of two sets of cells (3, C); NaN for no cells."""
    if not predicted.shape[1]:
        return float("nan")
    from skimage.color import deltaE_ciede2000, rgb2lab

    means = np.stack([colours.mean(axis=1) for colours in (predicted, true)])
    lab = rgb2lab(means[None] / 255)[0]
    return float(deltaE_ciede2000(lab[0], lab[1]))


def visibility_levels(dataset: Dataset, sample: Sample) -> dict[str, str]:
    """Return the visibility level, such as v80-100, by instance token; instances without a level are absent."""
    rows = dataset.tables.annotations_by_sample.rows(sample.token)
    annotations, levels = dataset.tables["sample_annotation"], dataset.tables["visibility"]
    found = levels.rows_of(annotations.array("visibility_token")[rows])
    pairs = zip(rows.tolist(), found.tolist(), strict=True)
    return {annotations.text("instance_token", i): levels.text("level", row) for i, row in pairs if row >= 0}

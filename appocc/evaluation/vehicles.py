"""Vehicles of one map against the truth: how much of each was found, and how far off its colour is."""

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

# A vehicle is detected when the map has at least this share of its cells.
DETECTED_SHARE = 0.5


class TrueVehicles(NamedTuple):
    """Which vehicle each cell belongs to.

    Attributes:
        owner: (X, Y) number of the vehicle, -1 where there is none.
        instance: instance token of each number; empty where that is not known.
    """

    owner: IntArray
    instance: Sequence[str]


class VehicleScore(NamedTuple):
    """One vehicle of one sample.

    Attributes:
        distance_m: of the mean of its cells from the ego's origin.
        visibility: level of its annotation; empty where there is none.
        found: share of its cells that the map has.
        l1: mean colour error of its cells, 0..255; NaN where no colour is known in both maps.
        delta_e: CIEDE2000 between its mean colours in both maps; NaN as above.
    """

    distance_m: float
    visibility: str
    found: float
    l1: float
    delta_e: float

    @property
    def detected(self) -> bool:
        """Whether enough of it was found."""
        return self.found >= DETECTED_SHARE


def true_vehicles(truth: BEVMap, instance: IntArray | None, boxes_ego: Boxes | None) -> TrueVehicles:
    """The vehicles of a true map: the simulator's own instances, else annotated boxes, else connected cells.

    Args:
        truth: the true map.
        instance: (X, Y) index into `instances` of its meta, -1 for none; None where the file has no such array.
        boxes_ego: annotated boxes; None where the scene has none.
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
    made: BEVMap,
    truth: BEVMap,
    vehicles: TrueVehicles,
    within: BoolArray,
    threshold: float,
    visibility: Mapping[str, str],
) -> list[VehicleScore]:
    """Judge every vehicle by its true cells `within` (X, Y) what is looked at; none if the map knows no vehicle cell.

    Args:
        made: the map that is judged.
        truth: the map it should be, on the same grid.
        vehicles: whose each cell is.
        within: (X, Y) cells that are looked at.
        threshold: least probability of a vehicle cell.
        visibility: level by instance token.
    """
    found = made.occupancy[VEHICLE] >= threshold
    known = made.appearance_valid & truth.appearance_valid
    error, centres = colour_error(made, truth), truth.grid.centres()
    owner = np.where(within & made.occupancy_valid[VEHICLE].any(), vehicles.owner, -1)
    scores = []
    for number in np.unique(owner[owner >= 0]).tolist():
        cells = owner == number
        coloured = cells & known
        name = vehicles.instance[number] if number < len(vehicles.instance) else ""
        scores.append(
            VehicleScore(
                float(np.linalg.norm(centres[cells].mean(axis=0))),
                visibility.get(name, ""),
                float(found[cells].mean()),
                float(error[coloured].mean()) if coloured.any() else float("nan"),
                delta_e(made.appearance[:, coloured], truth.appearance[:, coloured]),
            )
        )
    return scores


def delta_e(made: ByteArray, true: ByteArray) -> float:
    """CIEDE2000 between the mean sRGB colours of two sets of cells (3, C), 0..255; NaN of none."""
    if not made.shape[1]:
        return float("nan")
    from skimage.color import deltaE_ciede2000, rgb2lab

    means = np.stack([colours.mean(axis=1) for colours in (made, true)])
    lab = rgb2lab(means[None] / 255)[0]
    return float(deltaE_ciede2000(lab[0], lab[1]))


def visibility_levels(dataset: Dataset, sample: Sample) -> dict[str, str]:
    """Level of visibility, such as v80-100, of each annotated instance of a sample; those without one are absent."""
    rows = dataset.tables.annotations_by_sample.rows(sample.token)
    annotations, levels = dataset.tables["sample_annotation"], dataset.tables["visibility"]
    found = levels.rows_of(annotations.array("visibility_token")[rows])
    pairs = zip(rows.tolist(), found.tolist(), strict=True)
    return {annotations.text("instance_token", i): levels.text("level", row) for i, row in pairs if row >= 0}

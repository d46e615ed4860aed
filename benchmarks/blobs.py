"""Accuracy and speed of vehicle instance extraction, on exact and predicted maps of a simulated dataset.

Run: python -m benchmarks.blobs ROOT [--bev SOURCE] [--frames N] [--whole]
ROOT contains bev/exact with the simulator's own instances. N frames, spread over all scenes, are evaluated (default:
all). With --whole, blobs of several vehicles are not split.

Columns, over vehicles and blobs whose centre (mean of their cells) is within 20 m and 40 m of the ego:
- vehicles: true ones that cover at least LEAST_M2 of the grid; blobs: those found;
- missed, false: unmatched vehicles and blobs; the matching is one-to-one, with the most pairs whose centres are
  within NEAR_M of each other and among those the least distance; F1 is the harmonic mean of the two matched shares;
- merged: blobs that contain most of the cells of each of two or more vehicles;
- split: vehicles with two or more blobs whose true cells are mostly theirs (and a third of all cells of the blob);
- place, size: median distance of the centres of pairs, and median of the mean error of length and width, metres;
- dE mean, dE lab: median CIEDE2000 of pairs between the blob's colour and the mean over the vehicle's true cells, and
  between the robust colours of both.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist
from skimage.color import deltaE_ciede2000

from appocc.bevmap import BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.colours import lab_from_rgb
from appocc.evaluation.pairs import read_map_pair
from appocc.evaluation.vehicles import true_vehicles
from appocc.grid import BEVGrid
from appocc.nuscenes.dataset import Dataset
from tracking.instances.instances import InstanceConfig, Instances, find_instances, label_instances, measure_instances

LEAST_M2 = 0.4
NEAR_M = 2.0
RANGES_M = (20.0, 40.0)


class Frame(NamedTuple):
    """A map and the true vehicle of each cell.

    Attributes:
        bev: the evaluated map.
        truth: the exact one.
        owner: (X, Y) number 1..V of the true vehicle, 0 for none.
        vehicles: V true vehicles in the form of blobs.
    """

    bev: BEVMap
    truth: BEVMap
    owner: IntArray
    vehicles: Instances


@dataclass
class Sums:
    """Counts and errors within a distance."""

    vehicles: int = 0
    blobs: int = 0
    pairs: int = 0
    merged: int = 0
    split: int = 0

    def __post_init__(self) -> None:
        """Start empty lists of errors of pairs: place, size, colour, robust colour."""
        self.errors: list[FloatArray] = []

    def row(self) -> list[str]:
        """Return the figures in the order of HEAD."""
        counts = [self.vehicles, self.blobs, self.vehicles - self.pairs, self.blobs - self.pairs]
        f1 = 2 * self.pairs / max(self.vehicles + self.blobs, 1)
        errors = np.concatenate([np.full((1, 4), np.nan), *self.errors])
        middle = [
            f"{np.median(known) if len(known := column[np.isfinite(column)]) else np.nan:.2f}" for column in errors.T
        ]
        return [*map(str, counts), f"{100 * f1:.1f}", str(self.merged), str(self.split), *middle]


HEAD = ("vehicles", "blobs", "missed", "false", "F1 %", "merged", "split", "place", "size", "dE mean", "dE lab")


def frames_of(dataset: Dataset, source: str, number: int | None) -> list[Frame]:
    """Yield maps of a source with their truth, evenly spread over all key frames."""
    tokens = [sample.token for scene in dataset.scenes for sample in dataset.samples(scene)]
    chosen = tokens if number is None else [tokens[i] for i in np.linspace(0, len(tokens) - 1, number).astype(int)]
    frames = []
    for token in chosen:
        pair = read_map_pair(dataset.root, source, "exact", token, ahead=False)
        owner = true_vehicles(pair.truth, pair.instance, None).owner + 1
        areas_m2 = np.bincount(owner.ravel()) * pair.truth.grid.cell_m**2
        large = np.flatnonzero(areas_m2 >= LEAST_M2)
        number_of = np.zeros(len(areas_m2), np.int64)
        number_of[large[large > 0]] = 1 + np.arange(int((large > 0).sum()))
        owner = number_of[owner]
        vehicles = measure_instances(pair.truth, owner, int(owner.max()))
        frames.append(Frame(pair.predicted, pair.truth, owner, vehicles))
    return frames


def count(frame: Frame, config: InstanceConfig, sums: dict[float, Sums]) -> None:
    """Add the counts of a frame to the sums by distance."""
    labels, number = label_instances(frame.bev, config)
    blobs, vehicles = measure_instances(frame.bev, labels, number), frame.vehicles
    shared = np.zeros((number + 1, len(vehicles) + 1), np.int64)
    np.add.at(shared, (labels.ravel(), frame.owner.ravel()), 1)
    whole, parts = shared[:, 1:].sum(axis=0), shared[1:, 1:]
    holds = (2 * parts > whole).sum(axis=1)
    main = parts.argmax(axis=1) if len(vehicles) else np.zeros(number, np.int64)
    of_one = np.zeros(number, np.bool_)
    if number and len(vehicles):
        most = parts[np.arange(number), main]
        of_one = (2 * most > parts.sum(axis=1)) & (3 * most >= shared[1:].sum(axis=1))
    pieces = np.bincount(main[of_one], minlength=len(vehicles))
    rows, columns = pairs_of(blobs.centroid_m, vehicles.centroid_m)
    errors = errors_of(blobs.select(rows), vehicles.select(columns))
    for range_m, total in sums.items():
        near_blob, near_vehicle = (np.hypot(*some.centroid_m.T) <= range_m for some in (blobs, vehicles))
        # A pair counts at the distance of its vehicle, so that no pair is divided by the limit.
        inside = near_vehicle[columns]
        total.vehicles += int(near_vehicle.sum())
        total.pairs += int(inside.sum())
        near_blob[rows] = inside
        total.blobs += int(near_blob.sum())
        total.merged += int((holds[near_blob] >= 2).sum())
        total.split += int((pieces[near_vehicle] >= 2).sum())
        total.errors.append(errors[inside])


def pairs_of(places_m: FloatArray, true_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the matched rows of places (N, 2) and true places (M, 2)."""
    apart_m = cdist(places_m, true_m)
    rows, columns = linear_sum_assignment(np.where(apart_m <= NEAR_M, apart_m, 1e4))
    kept = apart_m[rows, columns] <= NEAR_M
    return rows[kept], columns[kept]


def errors_of(blobs: Instances, vehicles: Instances) -> FloatArray:
    """Return errors (N, 4) of matched blobs: place, size (m), colour, robust colour (CIEDE2000)."""
    place = np.hypot(*(blobs.centroid_m - vehicles.centroid_m).T)
    size = (np.abs(blobs.length_m - vehicles.length_m) + np.abs(blobs.width_m - vehicles.width_m)) / 2
    means = deltaE_ciede2000(lab_from_rgb(blobs.rgb), lab_from_rgb(vehicles.rgb))
    return np.stack([place, size, means, deltaE_ciede2000(blobs.lab, vehicles.lab)], axis=1)


def milliseconds(rounds: int = 200) -> tuple[float, float]:
    """Return least and median time of `find_instances` on a map of 200 x 200 cells with 50 separate vehicles."""
    bev = made_map(BEVGrid.surround())
    seconds = []
    for _ in range(rounds):
        # A fresh map: what it computes once (`on`) is part of the work.
        fresh = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, bev.appearance, bev.appearance_valid)
        start = time.perf_counter()
        found = find_instances(fresh)
        seconds.append(time.perf_counter() - start)
    if len(found) != 50:
        raise SystemExit(f"expected 50 blobs, got {len(found)}")
    return 1e3 * min(seconds), 1e3 * float(np.median(seconds))


def made_map(grid: BEVGrid) -> BEVMap:
    """Return a map with five rows of ten noisy cars, 4.4 x 2 m, 7 m apart, each rotated by a further 0.1 rad."""
    dice = np.random.default_rng(1)
    on = np.zeros(grid.shape, np.bool_)
    xy = grid.centres()
    for k in range(50):
        dx, dy = xy[..., 0] - (-36 + 16 * (k // 10)), xy[..., 1] - (-31.5 + 7 * (k % 10))
        cos, sin = np.cos(0.1 * k), np.sin(0.1 * k)
        on |= (np.abs(dx * cos + dy * sin) <= 2.2) & (np.abs(dy * cos - dx * sin) <= 1.0)
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[1][on] = 0.9
    appearance = dice.integers(0, 256, (3, *grid.shape)).astype(np.uint8)
    known: BoolArray = np.ones((3, *grid.shape), np.bool_)
    return BEVMap(grid, occupancy, known, appearance, known[0].copy())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="predicted")
    parser.add_argument("--frames", type=int)
    parser.add_argument("--whole", action="store_true")
    arguments = parser.parse_args()
    dataset, config = Dataset(arguments.root), InstanceConfig(split=not arguments.whole)
    print(" ".join(f"{name:>10}" for name in ("maps", "within", *HEAD)))
    for source in ("exact", arguments.bev):
        sums = {range_m: Sums() for range_m in RANGES_M}
        for frame in frames_of(dataset, source, arguments.frames):
            count(frame, config, sums)
        for range_m, total in sums.items():
            print(" ".join(f"{text:>10}" for text in (source, f"{range_m:.0f} m", *total.row())))
    least, median = milliseconds()
    print(f"find_instances, 200 x 200 cells, 50 vehicles: {least:.2f} ms at least, {median:.2f} ms in the median")


if __name__ == "__main__":
    main()

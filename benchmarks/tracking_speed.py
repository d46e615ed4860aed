"""Time of the tracker by number of vehicles, compared with a loop of single filters; memory over time.

    OMP_NUM_THREADS=1 python -m benchmarks.tracking_speed [--frames 60] [--repeats 5]
    OMP_NUM_THREADS=1 python -m benchmarks.tracking_speed --memory [--frames 100000]

Synthetic traffic at 10 Hz: vehicles on lanes 4 m apart, each lane with its own speed, on a square of 128 m2 per
vehicle, so that 50 fill the grid of 80 x 80 m. A vehicle that leaves the square is replaced by a new one. In each
frame 5 % of the vehicles are missed, and 5 % of false detections are added; colours are known. The first ten frames
do not count.

- tracks: number of current tracks, including those of false detections and of vehicles that left.
- ms, frames/s, us/vehicle: CPU time of `Tracker.update` alone; median over the frames of a repeat, then over repeats.
- plain: the same for a baseline: one filterpy `KalmanFilter` of constant velocity per track, assignment by the least
  sum of distances, a gate of 2 m, without colours, headings and sizes.
- with maps: `Detections.from_bev` and `Tracker(MAPS).update` together, on maps of 200 x 200 cells with 50 vehicles.

With --memory, one tracker follows 50 vehicles that enter and leave; ten times per run, the resident memory of the
process (Linux) and the number of tracks so far are printed.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from filterpy.kalman import KalmanFilter
from rich.console import Console
from rich.table import Table
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import apply
from appocc.grid import BEVGrid
from tracking.detections import Detections
from tracking.field_of_view import GridView
from tracking.presets import MAPS
from tracking.tracker import Tracker

COUNTS = (10, 50, 100, 200, 500)
AREA_M2, LANE_M, STEP_US = 128.0, 4.0, 100_000
MISSED, FALSE = 0.05, 0.05
WARM_UP = 10
GATE_M, MOST_UNSEEN = 2.0, 12


class Moment(NamedTuple):
    """One frame of synthetic traffic.

    Attributes:
        timestamp_us: time of the frame.
        detections: (M,) detections; the ego is at the origin.
        truth: (M,) vehicle numbers of the detections, -1 for false ones.
    """

    timestamp_us: int
    detections: Detections
    truth: IntArray


class Traffic:
    """N vehicles on the lanes of a square around the origin.

    Attributes:
        xy_m: (N, 2) positions.
        yaw_rad: (N,) headings.
        size_m: (N, 3) width, length, height.
        rgb: (N, 3) sRGB 0..255.
        number: (N,) vehicle numbers; an entering vehicle gets a new one.
    """

    def __init__(self, count: int, seed: int = 0) -> None:
        """Place the vehicles, equally spaced within a lane."""
        self._dice = np.random.default_rng(seed)
        self._half_m = float(np.sqrt(count * AREA_M2)) / 2
        lanes = round(2 * self._half_m / LANE_M)
        lane, place = np.arange(count) % lanes, np.arange(count) // lanes
        apart_m = 2 * self._half_m * lanes / count
        x = (place * apart_m + self._dice.uniform(0, apart_m / 2, lanes)[lane]) % (2 * self._half_m) - self._half_m
        self.xy_m = np.stack([x, (lane + 0.5) * 2 * self._half_m / lanes - self._half_m], axis=1)
        self.yaw_rad = np.where(lane % 2, 0.0, np.pi)
        self._speed_mps = self._dice.uniform(0, 15, lanes)[lane] * np.cos(self.yaw_rad)
        self.number = np.arange(count)
        self.size_m, self.rgb, self._lab = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
        self._paint(self.number)
        half_m = self._half_m
        self._view = GridView(BEVGrid(-half_m, half_m, -half_m, half_m, half_m / 100))
        self._time_us = 0

    def _paint(self, who: IntArray) -> None:
        """Assign sizes and colours to some vehicles."""
        self.size_m[who] = self._dice.uniform([1.7, 3.8, 1.4], [2.0, 4.8, 1.8], (len(who), 3))
        self.rgb[who] = self._dice.uniform(0, 255, (len(who), 3))
        self._lab[who] = self._dice.uniform([20, -60, -60], [90, 60, 60], (len(who), 3))

    def drive(self) -> None:
        """Advance the traffic by a tenth of a second."""
        self._time_us += STEP_US
        self.xy_m[:, 0] += self._speed_mps * STEP_US * 1e-6
        gone = np.flatnonzero(np.abs(self.xy_m[:, 0]) > self._half_m)
        self.xy_m[gone, 0] -= np.sign(self._speed_mps[gone]) * 2 * self._half_m
        self.number[gone] = self.number.max() + 1 + np.arange(len(gone))
        self._paint(gone)

    def moments(self) -> Iterator[Moment]:
        """Yield the frames, without end."""
        while True:
            self.drive()
            yield self._seen()

    def _seen(self) -> Moment:
        dice, n = self._dice, len(self.number)
        who = np.flatnonzero(dice.random(n) >= MISSED)
        seen, false = len(who), int(dice.binomial(n, FALSE))
        nowhere = dice.uniform(-self._half_m, self._half_m, (false, 2))
        xy_m = np.concatenate([self.xy_m[who] + dice.normal(0, 0.15, (seen, 2)), nowhere])
        yaw_rad = np.concatenate([self.yaw_rad[who] + dice.normal(0, 0.05, seen), dice.uniform(-np.pi, np.pi, false)])
        size_m = np.concatenate([self.size_m[who], dice.uniform([1.5, 3, 1.3], [2.5, 6, 2], (false, 3))])
        lab = np.concatenate([self._lab[who] + dice.normal(0, 3, (seen, 3)), dice.uniform(-60, 60, (false, 3))])
        detections = Detections(
            ground_m=np.pad(xy_m, ((0, 0), (0, 1))),
            yaw_rad=yaw_rad,
            heading_known=np.ones(len(yaw_rad), np.bool_),
            size_m=size_m,
            log_odds=np.concatenate([dice.normal(2.5, 1.0, seen), dice.normal(-1.0, 1.0, false)]),
            kind=("vehicle",) * len(yaw_rad),
            rgb=np.concatenate([self.rgb[who], dice.uniform(0, 255, (false, 3))]),
            lab=lab,
            velocity_mps=np.full((len(yaw_rad), 2), np.nan),
            truncated=np.zeros(len(yaw_rad), np.bool_),
            view=self._view,
        )
        return Moment(self._time_us, detections, np.concatenate([self.number[who], np.full(false, -1)]))

    def drawn(self, grid: BEVGrid) -> BEVMap:
        """Return the map of the vehicles."""
        occupancy = np.zeros((3, *grid.shape), np.float32)
        appearance = np.full((3, *grid.shape), 90, np.uint8)
        centres = grid.centres()
        for xy_m, yaw_rad, (width, length, _), rgb in zip(
            self.xy_m, self.yaw_rad, self.size_m, self.rgb, strict=True
        ):
            dx, dy = np.moveaxis(centres - xy_m, -1, 0)
            cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
            inside = (np.abs(dx * cos + dy * sin) <= length / 2) & (np.abs(dy * cos - dx * sin) <= width / 2)
            occupancy[VEHICLE][inside] = 0.9
            appearance[:, inside] = rgb[:, None]
        known: BoolArray = np.ones((3, *grid.shape), np.bool_)
        return BEVMap(grid, occupancy, known, appearance, known[0].copy())


# The plain loop ---------------------------------------------------------------------------------------------------


@dataclass
class _Single:
    """One track of the plain loop."""

    id: int
    filter: KalmanFilter
    unseen: int = 0


class PlainLoop:
    """The baseline: a textbook tracker."""

    def __init__(self) -> None:
        """Start without tracks."""
        self.alive: list[_Single] = []
        self._born = 0

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> list[_Single]:
        """Update the tracks a tenth of a second after the last frame; return the matched ones."""
        places = apply(world_from_ego, detections.ground_m)[:, :2]
        for single in self.alive:
            single.filter.predict()
            single.unseen += 1
        free = set(range(len(places)))
        if self.alive and len(places):
            distance = cdist([single.filter.x[:2, 0] for single in self.alive], places)
            rows, columns = linear_sum_assignment(distance)
            for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
                if distance[row, column] <= GATE_M:
                    self.alive[row].filter.update(places[column])
                    self.alive[row].unseen = 0
                    free.discard(column)
        for column in sorted(free):
            self._born += 1
            self.alive.append(_Single(self._born, _filter(places[column])))
        self.alive = [single for single in self.alive if single.unseen <= MOST_UNSEEN]
        return [single for single in self.alive if single.unseen == 0]


def _filter(place_m: FloatArray) -> KalmanFilter:
    """Return a constant-velocity filter for 10 Hz."""
    single, step = KalmanFilter(dim_x=4, dim_z=2), STEP_US * 1e-6
    single.x[:2, 0] = place_m
    single.F = np.eye(4) + step * np.eye(4, k=2)
    single.H = np.eye(2, 4)
    single.P = np.diag([0.1, 0.1, 64.0, 64.0])
    single.R = 0.1 * np.eye(2)
    single.Q = np.kron([[step**3 / 3, step**2 / 2], [step**2 / 2, step]], 4.0 * np.eye(2))
    return single


# Measuring --------------------------------------------------------------------------------------------------------


def seconds_of(work: Sequence[Callable[[], object]]) -> float:
    """Return the median CPU time of the calls after the warm-up, run in sequence."""
    seconds = []
    for each in work:
        start = time.process_time()
        each()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds[WARM_UP:]))


def seconds_of_frames(tracker: Tracker | PlainLoop, moments: Sequence[Moment]) -> float:
    """Return the median time per frame of detections."""
    return seconds_of([lambda m=m: tracker.update(m.detections, m.timestamp_us, np.eye(4)) for m in moments])  # type: ignore[misc]


def seconds_of_maps(frames: int) -> float:
    """Return the median time per frame of maps with 50 vehicles."""
    traffic, tracker, grid = Traffic(50), Tracker(MAPS), BEVGrid.surround()
    maps = []
    for _ in range(frames):
        traffic.drive()
        maps.append(traffic.drawn(grid))
    return seconds_of(
        [
            lambda i=i, bev=bev: tracker.update(Detections.from_bev(bev), i * STEP_US, np.eye(4))  # type: ignore[misc]
            for i, bev in enumerate(maps)
        ]
    )


def speed_table(frames: int, repeats: int) -> Table:
    """Measure all times; the trackers take turns, so that other load on the machine affects both."""
    table = Table("vehicles", "tracks", "ms", "frames/s", "us/vehicle", "plain ms", "plain frames/s", "times faster")
    for count in COUNTS:
        moments = list(islice(Traffic(count).moments(), frames))
        own, plain, alive = [], [], 0
        for _ in range(repeats):
            tracker = Tracker()
            own.append(seconds_of_frames(tracker, moments))
            plain.append(seconds_of_frames(PlainLoop(), moments))
            alive = len(tracker._table)
        ours, theirs = float(np.median(own)), float(np.median(plain))
        table.add_row(str(count), str(alive), *_figures(ours, count), *_figures(theirs)[:2], f"{theirs / ours:.1f}")
    with_maps = float(np.median([seconds_of_maps(frames) for _ in range(repeats)]))
    table.add_row("50 with maps", "", *_figures(with_maps, 50))
    return table


def _figures(seconds: float, count: int = 1) -> tuple[str, str, str]:
    """Format milliseconds per frame, frames per second, and microseconds per vehicle."""
    return f"{1e3 * seconds:.2f}", f"{1 / seconds:.0f}", f"{1e6 * seconds / count:.1f}"


def memory_table(frames: int) -> Table:
    """Measure the memory of one tracker over time."""
    table = Table("frame", "resident MB", "tracks alive", "tracks so far", "vehicles so far")
    tracker, so_far, vehicles = Tracker(), 0, 0
    for number, moment in enumerate(islice(Traffic(50).moments(), frames), start=1):
        tracks = tracker.update(moment.detections, moment.timestamp_us, np.eye(4))
        so_far, vehicles = max([so_far, *tracks.id.tolist()]), max(vehicles, int(moment.truth.max()) + 1)
        if number == 1 or number % max(frames // 10, 1) == 0:
            table.add_row(str(number), f"{resident_mb():.2f}", str(len(tracker._table)), str(so_far), str(vehicles))
    return table


def resident_mb() -> float:
    """Return the resident memory of this process in MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--memory", action="store_true", help="memory over time instead of speed")
    parser.add_argument("--frames", type=int, help="number of frames: 60, or 100000 with --memory")
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    made = memory_table(asked.frames or 100_000) if asked.memory else speed_table(asked.frames or 60, asked.repeats)
    Console(width=110).print(made)


if __name__ == "__main__":
    main()

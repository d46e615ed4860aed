"""Tracking of one car in bends: errors of tracks against those of their detections and of a plain Kalman filter.

    OMP_NUM_THREADS=1 python -m benchmarks.manoeuvres [--seeds 10] [--json]

A car drives on a circle for 40 s. Its detections have errors of 0.1 m along each axis and of 1.7 degrees in heading.
The figures are root mean squares over the last 30 s and all seeds. The plain filter is that of `benchmarks.kitti`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.checks import FloatArray
from appocc.geometry import wrap_angle
from benchmarks.kitti import PlainFilter
from tracking import Detections, Tracker

_SECONDS, _FROM_S = 40, 10
_PLACE_STD_M, _HEADING_STD_RAD = 0.1, 0.03
# Radius, metres; speed, m/s; frames per second.
CASES = ((8.0, 4.8, 10), (8.0, 4.8, 5), (8.0, 4.8, 2), (30.0, 9.0, 10), (30.0, 9.0, 2), (1e4, 10.0, 10))


class Errors(NamedTuple):
    """Root mean squares of a tracker's errors: place, metres; velocity, m/s; heading, degrees."""

    place_m: float
    velocity_mps: float
    heading_deg: float


def errors(tracker: Tracker | PlainFilter, radius_m: float, speed_mps: float, hz: int, seed: int) -> FloatArray:
    """Return the errors (T, 4) of a tracker after the first 10 s, of place, velocity, heading and detections."""
    rng, rows = np.random.default_rng(seed), []
    for i in range(_SECONDS * hz):
        angle = speed_mps / radius_m * i / hz
        ahead = np.array([-np.sin(angle), np.cos(angle)])
        place, yaw = radius_m * np.array([np.cos(angle) - 1, np.sin(angle)]), angle + np.pi / 2
        noise = rng.normal(0, _PLACE_STD_M, 2)
        boxes = [place + noise], [wrap_angle(yaw + rng.normal(0, _HEADING_STD_RAD))]
        found = Detections.from_boxes(*boxes, size_m=[[1.8, 4.5, 1.5]], log_odds=[3.0], kind="car")
        (track,) = tracker.update(found, round(i * 1e6 / hz), np.eye(4))
        off = track.position_world_m[:2] - place, track.velocity_world_mps - speed_mps * ahead
        rows.append([*(np.hypot(*each) for each in off), wrap_angle(track.yaw_world_rad - yaw), np.hypot(*noise)])
    return np.array(rows[_FROM_S * hz :])


def measure(seeds: int) -> dict[str, dict[str, Errors]]:
    """Return case -> tracker -> errors; the errors of the detections have no velocity."""
    found: dict[str, dict[str, Errors]] = {}
    for radius_m, speed_mps, hz in CASES:
        own, plain = (
            np.concatenate([errors(make(), radius_m, speed_mps, hz, seed) for seed in range(seeds)])
            for make in (Tracker, PlainFilter)
        )
        rms = [np.sqrt((each**2).mean(axis=0)) for each in (own, plain)]
        found[f"{radius_m:g} m, {speed_mps:g} m/s, {hz} Hz"] = {
            "appocc": Errors(rms[0][0], rms[0][1], float(np.degrees(rms[0][2]))),
            "plain filter": Errors(rms[1][0], rms[1][1], float(np.degrees(rms[1][2]))),
            "detections": Errors(rms[0][3], np.nan, float(np.degrees(rms[1][2]))),
        }
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    found = measure(options.seeds)
    if options.json:
        values = {case: {name: each._asdict() for name, each in rows.items()} for case, rows in found.items()}
        print(json.dumps(values).replace("NaN", "null"))
        return
    table = Table("circle", "what", "place m", "velocity m/s", "heading deg")
    for case, rows in found.items():
        for name, one in rows.items():
            velocity = "-" if np.isnan(one.velocity_mps) else f"{one.velocity_mps:.2f}"
            table.add_row(case, name, f"{one.place_m:.2f}", velocity, f"{one.heading_deg:.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()

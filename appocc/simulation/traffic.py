"""Recorded traffic of a town at a fixed rate; any vehicle in it can be the ego."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from appocc.checks import ByteArray, Float32Array, FloatArray, IntArray, check_dtype, check_shape, frozen
from appocc.errors import ShapeError

KINDS = ("car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian")


class Light(IntFlag):
    """Lights and parking state of an actor."""

    BRAKE = 1
    LEFT = 2
    RIGHT = 4
    PARKED = 8  # no lamps, unoccupied


@dataclass(frozen=True)
class Actor:
    """A moving or parked road user; the properties that do not change over time.

    Attributes:
        name: unique in its log.
        kind: one of `KINDS`.
        body: shape: sedan, hatchback, estate, suv, pickup, minivan, van, box_truck, bus, motorcycle, bicycle, adult,
            child.
        size_lwh_m: length, width, height, without mirrors.
    """

    name: str
    kind: str
    body: str
    size_lwh_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class TrafficState:
    """State of all N actors present at a time, in the order of the log.

    Attributes:
        index: (N,) positions in `TrafficLog.actors`.
        xy_m: (N, 2) centre of the box on the ground, town frame.
        yaw_rad: (N,) heading.
        velocity_mps: (N, 2) of the centre, town frame.
        lights: (N,) `Light` bits.
        signals: (S,) letters of the traffic lights' links as ASCII: r, y, g, G (SUMO's), in the order of
            `signal_links`.
    """

    index: IntArray
    xy_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    lights: ByteArray
    signals: ByteArray


@dataclass(frozen=True, eq=False, kw_only=True)
class TrafficLog:
    """Recorded traffic: T steps of A actors.

    Attributes:
        step_s: time between two steps.
        actors: static properties of the actors.
        xy_m: (T, A, 2) float32 centre of the box on the ground, town frame; NaN while absent.
        yaw_rad: (T, A) float32 heading; NaN while absent.
        lights: (T, A) uint8 `Light` bits.
        signal_links: names `light/link` of the traffic lights' links.
        signals: (T, S) uint8 letters, see `TrafficState.signals`.
    """

    step_s: float
    actors: tuple[Actor, ...]
    xy_m: Float32Array
    yaw_rad: Float32Array
    lights: ByteArray
    signal_links: tuple[str, ...]
    signals: ByteArray

    def __post_init__(self) -> None:
        """Check shapes and types.

        Raises:
            ShapeError: if one does not fit.
        """
        steps, count = len(self.xy_m), len(self.actors)
        expected: tuple[tuple[str, NDArray[np.generic], tuple[int, ...], type[np.generic]], ...] = (
            ("xy_m", self.xy_m, (steps, count, 2), np.float32),
            ("yaw_rad", self.yaw_rad, (steps, count), np.float32),
            ("lights", self.lights, (steps, count), np.uint8),
            ("signals", self.signals, (steps, len(self.signal_links)), np.uint8),
        )
        for name, array, shape, dtype in expected:
            check_shape(name, array, shape)
            check_dtype(name, array, dtype)
            frozen(array)
        if steps < 2 or self.step_s <= 0:
            raise ShapeError(f"traffic: expected two steps or more, got {steps} of {self.step_s} s")

    @property
    def duration_s(self) -> float:
        """Time from the first to the last step."""
        return (len(self.xy_m) - 1) * self.step_s

    def state_at(self, time_s: float) -> TrafficState:
        """Return the traffic state at a time; positions are interpolated linearly, headings along the shorter arc.

        Raises:
            ShapeError: if the time is outside the log.
        """
        if not 0 <= time_s <= self.duration_s + 1e-6:
            raise ShapeError(f"traffic: expected a time within 0..{self.duration_s:g} s, got {time_s:g}")
        before = min(int(time_s / self.step_s + 1e-9), len(self.xy_m) - 2)
        share = time_s / self.step_s - before
        first, second = self.xy_m[before].astype(np.float64), self.xy_m[before + 1].astype(np.float64)
        index = np.flatnonzero(np.isfinite(first[:, 0]) & np.isfinite(second[:, 0]))
        step, yaw = (second - first)[index], self.yaw_rad[before : before + 2, index].astype(np.float64)
        turn = np.mod(yaw[1] - yaw[0] + np.pi, 2 * np.pi) - np.pi
        return TrafficState(
            index,
            first[index] + share * step,
            yaw[0] + share * turn,
            step / self.step_s,
            self.lights[before, index],
            self.signals[before],
        )

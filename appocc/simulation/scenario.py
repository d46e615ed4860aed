"""Scenarios: town, ego vehicle, start time and weather of a scene, drawn by seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray
from appocc.errors import DataError
from appocc.nuscenes.simulated import simulated_description
from appocc.simulation.traffic import Actor, TrafficLog

# Sampling weights of the weathers, by name in `WEATHERS`.
WEATHER_SHARES = {"clear": 0.3, "overcast": 0.22, "low_sun": 0.16, "wet": 0.12, "dusk": 0.1, "night": 0.1}
# Only cars and vans are drawn as the ego: camera poses assume a car.
_EGO_KINDS = ("car", "van")
_STANDING_MPS, _MOST_STANDING = 0.5, 0.2


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A scene to be recorded.

    Attributes:
        name: name of the scene, such as scene-0003.
        number: position in the dataset.
        town: name of the town.
        ego: index of the ego in the town's traffic log.
        start_s: time of the first frame in the log.
        weather: name of the weather.
        seed: random seed of paints, noise and weather variation; combined with `number`.
    """

    name: str
    number: int
    town: str
    ego: int
    start_s: float
    weather: str
    seed: int

    @property
    def random_seed(self) -> tuple[int, int]:
        """Random seed of this scene."""
        return (self.seed, self.number)


def draw_scenario(
    number: int, town: str, log: TrafficLog, seconds: float, weathers: Sequence[str], seed: int, hz: float = 2.0
) -> Scenario:
    """Draw scene `number` of a dataset: an ego that is present for `seconds` and moves in most frames.

    The ego is stationary in at most a fifth of the frames; if no vehicle moves that much, in some, but not in all.

    Raises:
        DataError: if no car is present in the town's traffic for that long.
    """
    random = np.random.default_rng([seed, number, 0])
    starts = _possible_starts(log, seconds, hz)
    if not starts.any():
        raise DataError(f"{town}: no vehicle drives for {seconds:g} s in its traffic of {log.duration_s:g} s")
    ego = int(random.choice(np.flatnonzero(starts.any(axis=0))))
    start = int(random.choice(np.flatnonzero(starts[:, ego])))
    shares = np.array([WEATHER_SHARES[name] for name in weathers])
    weather = str(random.choice(np.array(weathers), p=shares / shares.sum()))
    return Scenario(
        name=f"scene-{number:04d}",
        number=number,
        town=town,
        ego=ego,
        start_s=start * log.step_s,
        weather=weather,
        seed=seed,
    )


def describe_scenario(scenario: Scenario, ego: Actor) -> str:
    """Return the description for the table of scenes; `weather_of` parses it."""
    return simulated_description(scenario.town, scenario.weather, ego.name, ego.body)


def _possible_starts(log: TrafficLog, seconds: float, hz: float) -> BoolArray:
    """Return (T, A) at which steps a scene may start with which ego; if no ego moves enough, all that are present."""
    steps = int(np.ceil(seconds / log.step_s - 1e-9)) + 1
    there = np.isfinite(log.xy_m[..., 0])
    if steps > len(there):
        return np.zeros_like(there)
    speed = np.linalg.norm(np.diff(log.xy_m, axis=0, append=np.nan), axis=2) / log.step_s
    standing = np.nan_to_num(speed, nan=0.0) < _STANDING_MPS
    able = np.array([actor.kind in _EGO_KINDS for actor in log.actors], dtype=np.bool_)
    present = _window_counts(there, steps) == steps
    possible = np.zeros_like(there)
    possible[: len(present)] = present & able & (_window_counts(there & ~standing, steps) > 0)
    driving = possible.copy()
    # A frame has the speed of the traffic step it falls into.
    frames = (np.arange(round(seconds * hz) + 1) / hz / log.step_s + 1e-9).astype(np.int64)
    stood = np.zeros(present.shape, np.int32)
    for step in np.minimum(frames, steps - 1):
        stood += standing[step : step + len(present)]
    driving[: len(present)] &= stood <= _MOST_STANDING * len(frames)
    return driving if driving.any() else possible


def _window_counts(flags: BoolArray, steps: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return (T - steps + 1, A) the number of set flags in each window of `steps`."""
    total = np.cumsum(np.concatenate([np.zeros((1, flags.shape[1]), np.int64), flags]), axis=0)
    return np.asarray(total[steps:] - total[:-steps])

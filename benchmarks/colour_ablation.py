"""Ablation of the tracker's colour likelihood: identity switches with and without it, all else equal.

    python -m benchmarks.colour_ablation [--scenes 60]
    python -m benchmarks.colour_ablation --wrong-orders 6 [--scenes 24] [--first 0]
    python -m benchmarks.colour_ablation --root ROOT [--bev SOURCE]

Without --root: synthetic traffic at dense crossings (`benchmarks.encounters`), 20 s at 2 Hz per scene; each frame is
a map of 200 x 200 cells without the vehicles of the lowest visibility. With --root: all scenes of a simulated
dataset, from its exact maps or those of a source, also without the vehicles of the lowest visibility.

- exact: unchanged maps. noisy: one vehicle in ten is missed; places, headings and sizes are noisy; 1.5 false vehicles
  per map; probabilities vary; the light of the scene changes from map to map; every fifth vehicle is in shadow;
  colours are grainy. wrong: exact, but each vehicle has the colour of another one, a different one in each frame.
  exact, noise: exact, with Gaussian noise in L*, a* and b* of each sighting. Exact colours are an upper bound: each
  vehicle has the same colour at every sighting.
  With --wrong-orders, only wrong colours, in several random orders.
- with, without: `Tracker(MAPS)`, and the same tracker without its colour term; both get the same blobs.
- Ground truth: visible vehicles within 40 m of the ego; the gate is 2 m; a switch counts after a gap of any length.
- fewer: reduction of switches by colour, in percent, with its 95 % bootstrap interval over scenes; p: probability of
  such a reduction by chance, by flipping the signs of the scenes' differences (one-sided).
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.evaluation.pairs import read_map_pair
from appocc.evaluation.vehicles import true_vehicles, visibility_levels
from appocc.geometry import apply, footprints, inverse, yaw_of
from appocc.grid import BEVGrid
from appocc.nuscenes import Dataset
from appocc.rasterise import VEHICLE_SHARE, polygon_owner
from benchmarks.encounters import Sight, encounters
from tracking.detections import Detections
from tracking.evaluation.clear_id_hota import Metrics, evaluate
from tracking.evaluation.frames import EvaluationFrame
from tracking.instances.instances import find_instances
from tracking.presets import MAPS
from tracking.tracker import Tracker, TrackerConfig

RANGE_M, LEAST_M2, HIDDEN = 40.0, 0.4, "v0-40"
GRID, GREY = BEVGrid.surround(), 90.0
DRAWS = 10_000
# Standard deviations of lightness and the two colour axes between sightings.
LAB_NOISE = ((3, 2, 2), (6, 4, 4), (15, 8, 8))


class Step(NamedTuple):
    """One frame for the tracker, with its truth: V vehicles, their numbers, places (V, 2), and which count."""

    timestamp_us: int
    world_from_ego: FloatArray
    detections: Detections
    number: IntArray
    xy_m: FloatArray
    demanded: BoolArray


Scene = list[Step]


# Synthetic scenes -------------------------------------------------------------------------------------------------


def made_scene(seed: int, noisy: bool) -> Scene:
    """Return a scene of synthetic traffic, with exact or noisy maps."""
    random = np.random.default_rng([seed, 9])
    steps = []
    for sight in encounters(seed):
        shown = _disturbed(sight, random) if noisy else _Shown.of(sight)
        places = apply(inverse(sight.world_from_ego), np.pad(sight.xy_m, ((0, 0), (0, 1))))[:, :2]
        inside = GRID.contains(GRID.cell_of(places)) & (np.hypot(*places.T) <= RANGE_M)
        grain = random.normal(0, 12, (3, *GRID.shape)) if noisy else np.zeros((3, *GRID.shape))
        found = Detections.from_instances(find_instances(_map_of(shown, sight.world_from_ego, grain)))
        step = Step(
            sight.timestamp_us, sight.world_from_ego, found, sight.number, sight.xy_m.copy(), sight.seen & inside
        )
        steps.append(step)
    return steps


class _Shown(NamedTuple):
    """Content of a map: N boxes in the world frame, probabilities (N,) and colours (N, 3)."""

    xy_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    probability: FloatArray
    rgb: FloatArray

    @classmethod
    def of(cls, sight: Sight) -> _Shown:
        """Return the visible vehicles without noise."""
        seen = sight.seen
        return cls(sight.xy_m[seen], sight.yaw_rad[seen], sight.size_m[seen], np.ones(seen.sum()), sight.rgb[seen])


def _disturbed(sight: Sight, random: np.random.Generator) -> _Shown:
    """Return the visible vehicles with noise, and some false ones, similar to a network's prediction."""
    true = _Shown.of(sight)
    kept = np.flatnonzero(random.random(len(true.xy_m)) >= 0.1)
    xy_m, yaw_rad, size_m, _, rgb = (each[kept] for each in true)
    n, false = len(kept), int(random.poisson(1.5))
    elsewhere = apply(sight.world_from_ego, np.pad(random.uniform(-38, 38, (false, 2)), ((0, 0), (0, 1))))[:, :2]
    light = np.exp(random.normal(0, 0.12)) * np.where(random.random(n) < 0.2, 0.55, 1.0)
    return _Shown(
        np.vstack([xy_m + random.normal(0, 0.25, (n, 2)), elsewhere]),
        np.append(yaw_rad + random.normal(0, 0.05, n), random.uniform(-np.pi, np.pi, false)),
        np.vstack([size_m * np.exp(random.normal(0, 0.06, (n, 3))), np.tile([1.8, 4.5, 1.5], (false, 1))]),
        np.append(random.uniform(0.6, 1.0, n), random.uniform(0.5, 0.75, false)),
        np.vstack(
            [
                255 * np.minimum((rgb / 255) ** 2.2 * light[:, None], 1) ** (1 / 2.2),
                random.uniform(0, 255, (false, 3)),
            ]
        ),
    )


def _map_of(shown: _Shown, world_from_ego: FloatArray, grain: FloatArray) -> BEVMap:
    """Return the map of boxes; `grain` (3, X, Y) is added to its colours."""
    ego_from_world = inverse(world_from_ego)
    centre = apply(ego_from_world, np.pad(shown.xy_m, ((0, 0), (0, 1))))[:, :2]
    yaw = shown.yaw_rad + float(yaw_of(ego_from_world))
    near = np.abs(centre).max(axis=1) < 50.0
    corners = footprints(centre[near], yaw[near], shown.size_m[near][:, [1, 0]])
    owner = polygon_owner(GRID, corners, VEHICLE_SHARE)
    on = owner >= 0
    occupancy, appearance = np.zeros((3, *GRID.shape), np.float32), GREY + grain
    occupancy[VEHICLE][on] = shown.probability[near][owner[on]]
    appearance[:, on] += shown.rgb[near][owner[on]].T - GREY
    known = np.ones(GRID.shape, np.bool_)
    colours = np.clip(np.rint(appearance), 0, 255).astype(np.uint8)
    return BEVMap(GRID, occupancy, np.stack([known] * 3), colours, known)


# Scenes of a dataset ----------------------------------------------------------------------------------------------


def read_scenes(root: Path, source: str) -> Iterator[Scene]:
    """Read the scenes of a simulated dataset with the maps of a source."""
    dataset = Dataset(root)
    for scene in dataset.scenes:
        steps = []
        for sample in dataset.samples(scene):
            pair = read_map_pair(dataset.root, source, "exact", sample.token, ahead=False)
            vehicles = true_vehicles(pair.truth, pair.instance, None)
            levels, pose = visibility_levels(dataset, sample), dataset.world_from_ego(sample)
            hidden = np.array([levels.get(name) == HIDDEN for name in vehicles.instance] + [False])
            area_m2 = np.bincount(vehicles.owner.ravel() + 1, minlength=len(hidden))[1:] * pair.truth.grid.cell_m**2
            there = dict(zip(vehicles.instance, (area_m2 >= LEAST_M2) & ~hidden[:-1], strict=True))
            occupancy = pair.predicted.occupancy.copy()
            occupancy[VEHICLE][(vehicles.owner >= 0) & hidden[vehicles.owner]] = 0
            boxes = dataset.boxes_world(sample).vehicles()
            xy_m = boxes.centre_m[:, :2].copy()
            shown = np.array([there.get(name, False) for name in boxes.instance], dtype=np.bool_)
            number = np.array([zlib.crc32(name.encode()) for name in boxes.instance], dtype=np.int64)
            found = Detections.from_instances(find_instances(replace(pair.predicted, occupancy=occupancy)))
            demanded = shown & (np.hypot(*(xy_m - pose[:2, 3]).T) <= RANGE_M)
            steps.append(Step(sample.timestamp_us, pose, found, number, xy_m, demanded))
        yield steps


# Trackers ---------------------------------------------------------------------------------------------------------


def without_colour(config: TrackerConfig) -> TrackerConfig:
    """Return the same configuration without the colour term."""
    return replace(config, colour_outlier_rate=1.0)


def judged(scene: Scene, config: TrackerConfig) -> Metrics:
    """Return the tracker's scores in a scene."""
    tracker, moments = Tracker(config), []
    for step in scene:
        tracks = tracker.update(step.detections, step.timestamp_us, step.world_from_ego)
        places_m = tracks.position_world_m[:, :2].copy()
        near = np.hypot(*(places_m - step.world_from_ego[:2, 3]).T) <= RANGE_M
        moments.append(EvaluationFrame(step.number, step.xy_m, step.demanded, tracks.id.copy(), places_m, near))
    return evaluate(moments)


def wrongly_coloured(scene: Scene, random: np.random.Generator) -> Scene:
    """Return the scene with the colours of each frame permuted among its vehicles."""
    steps = []
    for step in scene:
        order = random.permutation(len(step.detections))
        found = replace(step.detections, rgb=step.detections.rgb[order], lab=step.detections.lab[order])
        steps.append(step._replace(detections=found))
    return steps


def noisily_coloured(scene: Scene, lab_std: Sequence[float], random: np.random.Generator) -> Scene:
    """Return the scene with Gaussian noise of standard deviations (3,) in the CIELAB colour of each sighting."""
    return [
        step._replace(
            detections=replace(
                step.detections, lab=step.detections.lab + random.normal(0, lab_std, (len(step.detections), 3))
            )
        )
        for step in scene
    ]


# Figures ----------------------------------------------------------------------------------------------------------


class Trial(NamedTuple):
    """Scores of scenes with and without colour."""

    name: str
    with_colour: list[Metrics]
    without: list[Metrics]

    def row(self) -> list[str]:
        """Return the figures in the order of HEAD."""
        ids = np.array([[one.IDS, other.IDS] for one, other in zip(self.with_colour, self.without, strict=True)])
        random = np.random.default_rng(0)
        drawn = ids[random.integers(0, len(ids), (DRAWS, len(ids)))].sum(axis=1)
        low, high = np.percentile(_fewer(drawn), [2.5, 97.5])
        gain = ids[:, 1] - ids[:, 0]
        flipped = (random.choice([-1, 1], (DRAWS, len(ids))) * gain).sum(axis=1)
        chance = (1 + np.count_nonzero(flipped >= gain.sum())) / (1 + DRAWS)
        with_, without = ids.sum(axis=0)
        pairs = [f"{_mean(self.with_colour, name):.1f} / {_mean(self.without, name):.1f}" for name in SHARES]
        # Without switches there is nothing to reduce.
        fewer = f"{float(_fewer(ids.sum(axis=0))):.0f} ({low:.0f} to {high:.0f})" if without else "-"
        return [self.name, f"{with_} / {without}", fewer, f"{chance:.4f}", *pairs]


SHARES = ("MOTA", "IDF1", "AssA")
HEAD = ("maps", "IDS with / without", "fewer %", "p", *(f"{name} %" for name in SHARES))


def _fewer(ids: IntArray) -> FloatArray:
    """Return the reduction (...,) of switches in percent, from counts (..., 2) with and without colour."""
    with_, without = ids[..., 0], ids[..., 1]
    return np.asarray(np.where(without > 0, 100 * (1 - with_ / np.maximum(without, 1)), 0.0))


def _mean(scores: list[Metrics], name: str) -> float:
    """Return a mean share in percent; scenes are weighted by their number of vehicles."""
    weights = [each.GT for each in scores]
    return 100 * float(np.average([getattr(each, name) for each in scores], weights=weights))


def trial(name: str, scenes: Iterable[Scene], done: Callable[[], None]) -> Trial:
    """Run both trackers in all scenes."""
    result = Trial(name, [], [])
    for scene in scenes:
        result.with_colour.append(judged(scene, MAPS))
        result.without.append(judged(scene, without_colour(MAPS)))
        done()
    return result


def wrong_trials(seeds: Sequence[int], orders: int, done: Callable[[], None]) -> list[Trial]:
    """Run the trials of wrong colours in several orders."""
    exact = [made_scene(seed, noisy=False) for seed in seeds]
    return [
        trial(f"wrong, order {order}", (wrongly_coloured(scene, random) for scene in exact), done)
        for order, random in ((order, np.random.default_rng(order)) for order in range(1, orders + 1))
    ]


def switches_of(trials: Sequence[Trial]) -> str:
    """Return the switches of all trials together, with and without colour, in a line."""
    sides = [[each.with_colour for each in trials], [each.without for each in trials]]
    with_, without = (sum(one.IDS for scores in side for one in scores) / len(trials) for side in sides)
    return f"switches, mean of the orders: {with_:.0f} / {without:.0f}, {100 * (with_ / max(without, 1) - 1):+.0f} %"


def made_trials(seeds: Sequence[int], done: Callable[[], None]) -> list[Trial]:
    """Run the trials of synthetic scenes."""
    exact = [made_scene(seed, noisy=False) for seed in seeds]
    random = np.random.default_rng(1)
    return [
        trial("exact", exact, done),
        trial("noisy", (made_scene(seed, noisy=True) for seed in seeds), done),
        trial("wrong", (wrongly_coloured(scene, random) for scene in exact), done),
        *(
            trial(f"exact, noise {std}", (noisily_coloured(scene, std, random) for scene in exact), done)
            for std in LAB_NOISE
        ),
    ]


def main(words: Sequence[str] | None = None) -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--wrong-orders", type=int, default=0, help="number of random orders of wrong colours")
    parser.add_argument("--root", type=Path)
    parser.add_argument("--bev", default="exact")
    given = parser.parse_args(words)
    rounds, seeds = given.wrong_orders or 3 + len(LAB_NOISE), range(given.first, given.first + given.scenes)
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("scenes", total=None if given.root else rounds * given.scenes)
        done = partial(progress.advance, task)
        if given.root:
            trials = [trial(given.bev, read_scenes(given.root, given.bev), done)]
        elif given.wrong_orders:
            trials = wrong_trials(seeds, given.wrong_orders, done)
        else:
            trials = made_trials(seeds, done)
    table = Table(*HEAD)
    for each in trials:
        table.add_row(*each.row())
    console = Console(width=120)
    console.print(table)
    if given.wrong_orders:
        console.print(switches_of(trials), highlight=False)


if __name__ == "__main__":
    main()

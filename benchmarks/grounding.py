"""Latency of grounding: commands of all kinds on a map with many vehicles, and the start-up time of the language.

    OMP_NUM_THREADS=1 python -m benchmarks.grounding [--vehicles 50] [--repeats 5]

A synthetic crossing of 200 x 200 cells: vehicles parked at the kerbs, in the lanes and on the crossing road, with
seven bodies and five paints. Sentences are worded as in `benchmarks.grounding_truth`: every relation and action, with
vehicles of the map distinguished by paint, side, ordinals, superlatives, or not at all.

- read: parsing alone. ground: parsing, referent and goal together; to a place: only commands with a goal. set_scene:
  the work done once per map (vehicles, road). CPU milliseconds on one core; median, 95th percentile and maximum over
  all sentences and repeats.
- start: CPU milliseconds from the import of the language to the end of its first sentence in a fresh process, without
  the interpreter and numpy; median of `--repeats`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.geometry import footprints, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.rasterise import VEHICLE_SHARE, polygon_owner
from benchmarks.grounding_truth.case_generation import SUITS
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.sentences import CALLED, ORDERS, Description, command
from grounding.grounder import Grounder
from grounding.language import parse

GRID = BEVGrid.surround()
# Half the width of both roads, position of the crossing road, and lines along which vehicles are placed.
ROAD_M, CROSSING_X_M, LINES_M, STEP_M = 8.0, 20.0, (-6.5, -2.0, 2.0, 6.5), 7.0
# Distance from the ego that is kept free.
CLEAR_M = 7.0
PAINTS = {
    "red": (190, 25, 30),
    "blue": (30, 60, 170),
    "white": (240,) * 3,
    "black": (20,) * 3,
    "green": (30, 130, 50),
}
# Body: width, length, height.
BODIES = {
    **dict.fromkeys(("sedan", "hatchback", "estate"), (1.8, 4.5, 1.5)),
    **dict.fromkeys(("suv", "minivan"), (1.9, 4.6, 1.75)),
    **dict.fromkeys(("van", "pickup"), (2.0, 5.4, 2.1)),
}
START = """
import time
import numpy
begun = time.process_time()
from grounding.language import parse
parse("park behind the second silver van on the left")
print(time.process_time() - begun)
"""


class Made(NamedTuple):
    """A scene: the map, boxes in the ego frame, and body and paint of each vehicle."""

    bev: BEVMap
    boxes: Boxes
    looks: list[tuple[str, str]]


def made_scene(vehicles: int, seed: int = 0) -> Made:
    """Return a crossing with this many vehicles, as far as there is room."""
    random = np.random.default_rng(seed)
    along = np.arange(-36.0, 37.0, STEP_M)
    poses = [(x, y, 0.0 if y < 0 else np.pi) for x in along for y in LINES_M]
    poses += [(CROSSING_X_M + x, y, np.pi / 2) for y in along if abs(y) > ROAD_M + 4 for x in LINES_M]
    poses = [pose for pose in poses if np.hypot(pose[0], pose[1]) > CLEAR_M]
    x, y, yaw = np.array([poses[i] for i in random.permutation(len(poses))[:vehicles]]).reshape(-1, 3).T
    looks = [(_pick(BODIES, random), _pick(PAINTS, random)) for _ in x]
    size = np.array([BODIES[body] for body, _ in looks]).reshape(-1, 3)
    moving = np.where(np.abs(y) < min(map(abs, LINES_M)) + 1, random.uniform(2, 9, len(x)), 0.0)
    names = tuple(f"vehicle {n}" for n in range(len(x)))
    boxes = Boxes(
        centre_m=np.stack([x, y, size[:, 2] / 2], axis=-1),
        size_wlh_m=size,
        rotation=np.array([transform(quaternion_from_yaw(one), [0, 0, 0])[:3, :3] for one in yaw]).reshape(-1, 3, 3),
        category=tuple("vehicle.truck" if body == "pickup" else "vehicle.car" for body, _ in looks),
        instance=names,
        token=names,
        velocity_mps=moving[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1),
        lidar_points=np.full(len(x), 5),
    )
    return Made(_map_of(boxes, looks), boxes, looks)


def _map_of(boxes: Boxes, looks: Sequence[tuple[str, str]]) -> BEVMap:
    """Return the map of the crossing."""
    outlines = footprints(boxes.centre_m[:, :2], boxes.yaw_rad, boxes.size_wlh_m[:, [1, 0]])
    owner = polygon_owner(GRID, outlines, VEHICLE_SHARE)
    x, y = np.moveaxis(GRID.centres(), -1, 0)
    occupancy, appearance = np.zeros((3, *GRID.shape), np.float32), np.full((3, *GRID.shape), 90, np.uint8)
    occupancy[ROAD] = (np.abs(y) < ROAD_M) | (np.abs(x - CROSSING_X_M) < ROAD_M)
    occupancy[VEHICLE] = owner >= 0
    colours = np.array([PAINTS[paint] for _, paint in looks], dtype=np.uint8).reshape(-1, 3)
    appearance[:, owner >= 0] = colours[owner[owner >= 0]].T
    known = np.ones(GRID.shape, np.bool_)
    return BEVMap(GRID, occupancy, np.stack([known] * 3), appearance, known.copy())


def sentences(made: Made, each: int = 8, seed: int = 0) -> list[str]:
    """Return commands with every relation and action about vehicles ahead."""
    random = np.random.default_rng(seed)
    ahead = np.flatnonzero(made.boxes.centre_m[:, 0] > CLEAR_M).tolist() or [0]
    asked = []
    for relation, action in sorted({pair for pairs in SUITS.values() for pair in pairs}):
        for n in range(each):
            named = relation == "none" and action == "stop"
            ask = Ask(action, 12.0 if named else None, ("left", "right", None)[n % 3] if not named else None)
            count = {"none": 0, "between": 2}.get(relation, 1)
            about = [int(ahead[i]) for i in random.integers(0, len(ahead), count)]
            asked.append(command(relation, ask, [_described(made, i, n, random) for i in about], random))
    return asked


def _described(made: Made, i: int, n: int, random: np.random.Generator) -> tuple[Description, str]:
    """Return a description of a vehicle, of a random kind."""
    body, paint = made.looks[i]
    side = "left" if made.boxes.centre_m[i, 1] > 0 else "right"
    order = _pick(ORDERS, random) if n % 4 > 1 else None
    return Description(CALLED[body][0], paint if n % 2 else None, side if n % 3 else None, order=order), body


def _pick(words: Collection[str], random: np.random.Generator) -> str:
    return list(words)[int(random.integers(len(words)))]


def timed_ms(what: Callable[[], object]) -> float:
    """Return the CPU milliseconds of a call."""
    begun = time.process_time()
    what()
    return 1e3 * (time.process_time() - begun)


def start_ms(repeats: int) -> float:
    """Return the start-up milliseconds of the language in fresh processes."""
    command_line = [sys.executable, "-c", START]
    runs = [subprocess.run(command_line, capture_output=True, text=True, check=True) for _ in range(repeats)]
    return 1e3 * float(np.median([float(run.stdout) for run in runs]))


def main(words: Sequence[str] | None = None) -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args(words)
    made, grounder = made_scene(given.vehicles), Grounder()
    asked = sentences(made)
    setting = [timed_ms(partial(grounder.set_scene, made.bev, made.boxes)) for _ in range(given.repeats)]
    status = {text: grounder.ground(text).status for text in asked}  # the first round warms up
    turns = [text for _ in range(given.repeats) for text in asked]
    grounding = [timed_ms(partial(grounder.ground, text)) for text in turns]
    rows = {
        "read": [timed_ms(partial(parse, text)) for text in turns],
        "ground": grounding,
        "  to a place": [ms for ms, text in zip(grounding, turns, strict=True) if status[text] == "ok"],
        "set_scene": setting,
    }
    table = Table("CPU ms", "median", "95 %", "worst")
    for name, each in ((name, each) for name, each in rows.items() if each):
        table.add_row(name, *(f"{value:.1f}" for value in (*np.percentile(each, [50, 95]), max(each))))
    console = Console(width=100)
    console.print(table)
    counts = Counter(status[text] for text in asked).most_common()
    became = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts)
    console.print(f"{len(asked)} sentences, {len(made.boxes)} vehicles: {became}", highlight=False)
    console.print(f"start: {start_ms(given.repeats):.0f} ms", highlight=False)


if __name__ == "__main__":
    main()

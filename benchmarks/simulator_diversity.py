"""Contents of a simulated dataset: kinds of road users; distance, heading, colour, visibility of vehicles; classes.

    python -m benchmarks.simulator_diversity ROOT

Prints the tables of docs/simulator.md as Markdown. ROOT is a dataset written by `appocc simulate`.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from appocc.bevmap import CLASSES, load_map
from appocc.boxes import Boxes
from appocc.nuscenes import Dataset
from appocc.nuscenes.records import Sample
from appocc.nuscenes.writer import token_of

DISTANCES_M = (0, 10, 20, 30, 40, 60, 80)
HEADINGS = ("same way", "from the left", "oncoming", "from the right")
NEAR_M = 40.0
MOVING_MPS = 0.3
BAR = 40


@dataclass
class Counts:
    """Counts over all samples; vehicles are boxes of the class vehicle."""

    near: list[int] = field(default_factory=list)
    distance: Counter[str] = field(default_factory=Counter)
    heading: Counter[str] = field(default_factory=Counter)
    colour: Counter[str] = field(default_factory=Counter)
    visibility: Counter[str] = field(default_factory=Counter)
    category: Counter[str] = field(default_factory=Counter)
    shares: list[np.ndarray] = field(default_factory=list)
    kinds: list[Counter[str]] = field(default_factory=list)
    moving: Counter[str] = field(default_factory=Counter)
    occluded: Counter[str] = field(default_factory=Counter)


def main(root: Path) -> None:
    dataset = Dataset(root)
    paints = dataset.tables["paint"]
    tokens = [token.decode() for token in paints.array("instance_token")]
    colours = dict(zip(tokens, paints["name"], strict=True))
    levels = {"1": "0-40 %", "2": "40-60 %", "3": "60-80 %", "4": "80-100 %"}
    counts = Counts()
    for scene in dataset.scenes:
        for sample in dataset.samples(scene):
            add(counts, dataset, sample, colours, levels)
    print(f"{len(dataset.scenes)} scenes, {len(counts.near)} samples.\n")
    near = np.array(counts.near)
    groups = Counter(f"{low}-{low + 4}" for low in (near // 5 * 5).tolist())
    show(f"vehicles within {NEAR_M:.0f} m (median {np.median(near):.0f})", groups, sorted(groups, key=first_number))
    show_kinds(counts)
    show("distance of vehicles, m", counts.distance, sorted(counts.distance, key=first_number))
    show("heading of vehicles within 40 m, relative to the ego", counts.heading, HEADINGS)
    show("true colour of vehicles", counts.colour, [name for name, _ in counts.colour.most_common()])
    show("visibility of vehicles within 40 m", counts.visibility, list(levels.values()))
    show("annotations", counts.category, [name for name, _ in counts.category.most_common()])
    means = np.mean(counts.shares, axis=0)
    print("| class | share of the cells |\n|---|---|")
    for name, mean in zip(CLASSES, means, strict=True):
        print(f"| {name} | {mean:.1%} |")


def add(
    counts: Counts, dataset: Dataset, sample: Sample, colours: Mapping[str, str], levels: Mapping[str, str]
) -> None:
    """Count the contents of a sample."""
    boxes = dataset.boxes_world(sample)
    counts.category.update(boxes.category)
    vehicles = boxes.vehicles()
    pose = dataset.world_from_ego(sample)
    offset = vehicles.centre_m[:, :2] - pose[:2, 3]
    away = np.hypot(*offset.T)
    counts.near.append(int((away <= NEAR_M).sum()))
    bins = np.digitize(away, DISTANCES_M) - 1
    counts.distance.update(f"{DISTANCES_M[i]}-{DISTANCES_M[i + 1]}" for i in bins if i + 1 < len(DISTANCES_M))
    yaw = np.arctan2(vehicles.rotation[:, 1, 0], vehicles.rotation[:, 0, 0]) - np.arctan2(pose[1, 0], pose[0, 0])
    # A vehicle that heads to the right (-90 degrees) comes from the left.
    quarter = np.round(-yaw[away <= NEAR_M] / (np.pi / 2)).astype(int) % 4
    counts.heading.update(HEADINGS[i] for i in quarter)
    counts.colour.update(colours[token] for token in vehicles.instance)
    annotations = visibility_of(dataset, sample)
    far_m = np.hypot(*(boxes.centre_m[:, :2] - pose[:2, 3]).T)
    add_kinds(counts, boxes, far_m, parked_in(dataset, sample), annotations)
    counts.visibility.update(
        levels[annotations[token]] for token, far in zip(vehicles.instance, away, strict=True) if far <= NEAR_M
    )
    counts.shares.append(load_map(dataset.root, "exact", sample.token).occupancy.mean(axis=(1, 2)))


def add_kinds(
    counts: Counts, boxes: Boxes, away_m: np.ndarray, parked: Set[str], visibility: Mapping[str, str]
) -> None:
    """Count kinds of road users within range; parked vehicles are kinds of their own."""
    speed = np.nan_to_num(np.linalg.norm(boxes.velocity_mps, axis=1))
    near = Counter[str]()
    for row in np.flatnonzero(away_m <= NEAR_M):
        token = boxes.instance[row]
        kind = boxes.category[row].removeprefix("vehicle.").removeprefix("human.")
        kind += ", parked" if token in parked else ""
        near[kind] += 1
        counts.moving[kind] += bool(speed[row] > MOVING_MPS)
        counts.occluded[kind] += visibility[token] == "1"
    counts.kinds.append(near)


def visibility_of(dataset: Dataset, sample: Sample) -> dict[str, str]:
    """Return visibility tokens by instance token."""
    table = dataset.tables["sample_annotation"]
    rows = table.groups("sample_token").rows(sample.token)
    instances, tokens = table.array("instance_token"), table.array("visibility_token")
    return {instances[row].decode(): tokens[row].decode() for row in rows}


def parked_in(dataset: Dataset, sample: Sample) -> set[str]:
    """Return the instance tokens of parked vehicles."""
    table, parked = dataset.tables["sample_annotation"], token_of("attribute", "vehicle.parked")
    rows = table.groups("sample_token").rows(sample.token)
    instances, attributes = table.array("instance_token"), table["attribute_tokens"]
    return {instances[row].decode() for row in rows if parked in attributes[row]}


def show_kinds(counts: Counts) -> None:
    """Print how many road users of each kind there are near the ego."""
    total: Counter[str] = sum(counts.kinds, Counter())
    print(f"| within {NEAR_M:.0f} m | per sample | samples with any | moving | visible at most 40 % |")
    print("|---|---|---|---|---|")
    for kind, number in total.most_common():
        frames = np.mean([kind in near for near in counts.kinds])
        moving, occluded = counts.moving[kind] / number, counts.occluded[kind] / number
        print(f"| {kind} | {number / len(counts.kinds):.2f} | {frames:.0%} | {moving:.0%} | {occluded:.0%} |")
    print()


def first_number(label: str) -> int:
    return int(label.split("-")[0])


def show(title: str, counts: Mapping[str, int], order: Sequence[str]) -> None:
    """Print a table with one bar per row."""
    total = max(sum(counts.values()), 1)
    print(f"| {title} | share | |\n|---|---|---|")
    for label in order:
        share = counts.get(label, 0) / total
        print(f"| {label} | {share:.1%} | {'#' * round(share * BAR)} |")
    print()


if __name__ == "__main__":
    main(Path(sys.argv[1]))

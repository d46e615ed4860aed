"""Accuracy of colour words: on real vehicles labelled by hand, and on simulated ones in all weathers.

    python -m benchmarks.colour_words [ROOT] [--bev SOURCE]
    python -m benchmarks.colour_words --remake PANDASET NUSCENES

Prints the tables of docs/colours.md as Markdown. ROOT is a dataset of `appocc simulate`; --bev is the source of its
maps (exact or predicted). Vehicles of the lowest visibility are skipped. --remake updates the colours and the light
of the real vehicles from the maps of `appocc groundtruth` in the two datasets.

- first: share of vehicles whose word (of their paint, or of the person) is the most likely one. two: is among the two
  most likely. P: mean probability of that word.
- found: for each word that applies to some vehicles of a map and not to others, how often the best-fitting vehicle
  has it. pairs: how often it fits a vehicle with the colour better than one without. Real vehicles count as one map
  per dataset.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import load_map
from appocc.checks import FloatArray
from appocc.colours import WORDS, Exposure, exposure_of, exposures_of, fit, word_probabilities
from appocc.evaluation.vehicles import visibility_levels
from appocc.files import write_bytes
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import vehicles_near
from appocc.groundtruth.inputs import gather_inputs
from appocc.groundtruth.painting import bodywork_by_box, robust_colours
from appocc.groundtruth.pipeline import reconstruct_ground
from appocc.groundtruth.scene_jobs import SceneJobs
from appocc.nuscenes import Dataset
from appocc.nuscenes.records import Sample, Scene
from grounding.referent.scene import scene_from_boxes

NAMED = Path(__file__).parents[1] / "tests" / "grounding" / "colour_names.csv"
_CHANNELS = ("red", "green", "blue")
# Range of vehicles that a person can label, beyond the grids of the maps.
_FAR_M = 160.0
WEATHERS = ("clear", "overcast", "low sun", "wet", "dusk", "night")
HIDDEN = "v0-40"


class Named(NamedTuple):
    """A real vehicle labelled by a person: its colour in a map (3,), the light there, and the words.

    `seen`: well, or little: far away, or mostly occluded.
    """

    dataset: str
    seen: str
    rgb: FloatArray
    exposure: Exposure
    word: str
    second: str


class Group(NamedTuple):
    """N vehicles of one map: words, probabilities (N, 12) and fits (N, 12) of each word."""

    words: Sequence[str]
    probabilities: FloatArray
    fits: FloatArray


class Shares(NamedTuple):
    """The figures of one table row; NaN where nothing is counted."""

    vehicles: int
    first: float
    two: float
    probability: float
    found: float
    pairs: float


def read_named(path: Path = NAMED) -> list[Named]:
    """Read the real vehicles labelled by hand."""
    return [
        Named(
            row["dataset"],
            row["seen"],
            np.array([float(row[channel]) for channel in ("red", "green", "blue")]),
            Exposure(np.array([float(row[f"gain_{channel}"]) for channel in ("red", "green", "blue")])),
            row["word"],
            row["second"],
        )
        for row in _rows(path)
    ]


def _rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))


def remake(roots: Mapping[str, Path], path: Path = NAMED) -> None:
    """Update the colours of the hand-labelled vehicles from the maps of the datasets; the words are kept.

    Colour and light are those of the map in which the vehicle is nearest to the ego, or, for a vehicle beyond all
    grids, those that the ground truth would use.
    """
    head = [line for line in path.read_text().splitlines() if line.startswith("#")]
    rows = _rows(path)
    for name, root in roots.items():
        dataset = Dataset(root)
        for scene in dataset.scenes:
            own = [row for row in rows if (row["dataset"], row["scene"]) == (name, scene.name)]
            for row, (rgb, light) in zip(own, _shown(dataset, scene, [row["vehicle"] for row in own]), strict=True):
                row |= {channel: f"{value:.0f}" for channel, value in zip(_CHANNELS, rgb, strict=True)}
                row |= {
                    f"gain_{channel}": f"{value:.3f}" for channel, value in zip(_CHANNELS, light.gain, strict=True)
                }
    text = StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(path, ("\n".join(head) + "\n" + text.getvalue()).encode())


def _shown(dataset: Dataset, scene: Scene, vehicles: Sequence[str]) -> Iterator[tuple[FloatArray, Exposure]]:
    """Return colour (3,) and light of the given vehicles of a scene."""
    inputs = gather_inputs(dataset, scene)
    with TemporaryDirectory() as folder:
        _, gains = reconstruct_ground(inputs, SceneJobs(None, lambda _: None, 1), Path(folder))
    far = BEVGrid(-_FAR_M, _FAR_M, -_FAR_M, _FAR_M, 0.4)
    painted = robust_colours(
        inputs.samples, [bodywork_by_box(sample, vehicles_near(sample, far), gains) for sample in inputs.samples]
    )
    paint = {
        name: rgb
        for sample, own in zip(inputs.samples, painted, strict=True)
        for name, rgb, known in zip(sample.boxes_world.instance, *own, strict=True)
        if known
    }
    lit = [_lit(dataset, sample) for sample in dataset.samples(scene)]
    for vehicle in vehicles:
        near = sorted((row for row in lit if vehicle in row.distance_m), key=lambda row: row.distance_m[vehicle])
        nearest = next((row for row in near if vehicle in row.rgb), near[0])
        rgb = nearest.rgb.get(vehicle, np.asarray(paint[vehicle], np.float64))
        yield rgb, nearest.light.get(vehicle, nearest.common)


class _Lit(NamedTuple):
    """A map: distances of the objects from the ego, colours and light of those on the map, light of the whole map."""

    distance_m: dict[str, float]
    rgb: dict[str, FloatArray]
    light: dict[str, Exposure]
    common: Exposure


def _lit(dataset: Dataset, sample: Sample) -> _Lit:
    bev, pose = load_map(dataset.root, "groundtruth", sample.token), dataset.world_from_ego(sample)
    boxes = dataset.boxes_world(sample).transformed(inverse(pose))
    objects = [item for item in scene_from_boxes(bev, boxes.vehicles(), pose).objects if item.rgb is not None]
    rgb = np.array([item.rgb for item in objects]).reshape(-1, 3)
    lights = exposures_of(bev, rgb, np.array([item.footprint() for item in objects]).reshape(-1, 4, 2))
    names = [item.id for item in objects]
    distance = np.linalg.norm(boxes.centre_m[:, :2], axis=1).tolist()
    return _Lit(
        dict(zip(boxes.instance, distance, strict=True)),
        dict(zip(names, rgb, strict=True)),
        dict(zip(names, lights, strict=True)),
        exposure_of(bev, rgb),
    )


def named_groups(named: Iterable[Named]) -> dict[str, list[Group]]:
    """Return the vehicles of each dataset as one group, and the groups of all datasets together."""
    rows = list(named)
    groups = {}
    for dataset in sorted({row.dataset for row in rows}):
        own = [row for row in rows if row.dataset == dataset]
        groups[dataset] = [group_of([row.word for row in own], [row.rgb for row in own], [r.exposure for r in own])]
    return groups


def group_of(words: Sequence[str], rgb: Sequence[FloatArray], exposures: Sequence[Exposure]) -> Group:
    """Return the group of the vehicles of one map, each in its own light."""
    pairs = list(zip(rgb, exposures, strict=True))
    probabilities = np.array([word_probabilities(colour, light) for colour, light in pairs]).reshape(-1, len(WORDS))
    fits = np.array([[fit(word, colour, light) for word in WORDS] for colour, light in pairs]).reshape(-1, len(WORDS))
    return Group(words, probabilities, fits)


def either(named: Iterable[Named]) -> float:
    """Return the share of vehicles whose most likely word is one that the person would use."""
    likeliest = [(WORDS[int(word_probabilities(row.rgb, row.exposure).argmax())], row) for row in named]
    return _mean([word in (row.word, row.second) for word, row in likeliest])


def shares(groups: Iterable[Group]) -> Shares:
    """Return the figures of groups."""
    places: list[int] = []
    probability: list[float] = []
    found: list[bool] = []
    pairs: list[float] = []
    for group in groups:
        order = np.argsort(-group.probabilities, axis=1)
        for row, word in enumerate(group.words):
            places.append(int(np.flatnonzero(order[row] == WORDS.index(word))[0]))
            probability.append(float(group.probabilities[row, WORDS.index(word)]))
        for word in sorted(set(group.words)):
            has = np.array([other == word for other in group.words])
            fits = group.fits[:, WORDS.index(word)]
            if not has.all():
                found.append(bool(has[fits.argmax()]))
                pairs.append(float((fits[has][:, None] > fits[~has]).mean()))
    rank = np.array(places)
    return Shares(len(rank), _mean(rank == 0), _mean(rank < 2), _mean(probability), _mean(found), _mean(pairs))


def _mean(values: ArrayLike) -> float:
    array = np.asarray(values, np.float64)
    return float(array.mean()) if array.size else float("nan")


def simulated_groups(root: Path, source: str) -> Iterator[tuple[str, Group]]:
    """Return the vehicles of each map of a simulated dataset, by weather."""
    dataset = Dataset(root)
    paints = dataset.tables["paint"]
    paint = dict(zip((token.decode() for token in paints.array("instance_token")), paints["name"], strict=True))
    for scene in dataset.scenes:
        weather = scene.description.split(", ")[1]
        for sample in dataset.samples(scene):
            pose = dataset.world_from_ego(sample)
            bev = load_map(root, source, sample.token)
            objects = scene_from_boxes(
                bev, dataset.boxes_world(sample).vehicles().transformed(inverse(pose)), pose
            ).objects
            levels = visibility_levels(dataset, sample)
            known = [(item, item.rgb) for item in objects if item.rgb is not None]
            rgb = np.array([colour for _, colour in known]).reshape(-1, 3)
            sides = np.array([item.footprint() for item, _ in known]).reshape(-1, 4, 2)
            lights = exposures_of(bev, rgb, sides)
            seen = [i for i, (item, _) in enumerate(known) if levels.get(item.id) != HIDDEN]
            yield (
                weather,
                group_of([paint[known[i][0].id] for i in seen], [rgb[i] for i in seen], [lights[i] for i in seen]),
            )


def show(title: str, rows: dict[str, list[Group]]) -> None:
    """Print a table; its last row is over all groups."""
    print(f"| {title} | vehicles | first | two | P | found | pairs |\n|---|---|---|---|---|---|---|")
    every = [group for groups in rows.values() for group in groups]
    for label, own in {**rows, "all": every}.items():
        n, *figures = shares(own)
        print(f"| {label} | {n} | " + " | ".join(f"{figure:.2f}" for figure in figures) + " |")
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path, nargs="?", help="a simulated dataset")
    parser.add_argument("--bev", default="exact", help="source of its maps (exact)")
    parser.add_argument(
        "--remake", type=Path, nargs=2, metavar=("PANDASET", "NUSCENES"), help="two datasets with maps"
    )
    arguments = parser.parse_args()
    if arguments.remake:
        remake(dict(zip(("pandaset", "nuscenes"), arguments.remake, strict=True)))
    for seen in ("well", "little"):
        named = [row for row in read_named() if row.seen == seen]
        show(f"real vehicles seen {seen}", named_groups(named))
        print(f"The likeliest word is one of the two that a person would say: {either(named):.2f}\n")
    if arguments.root is None:
        return
    rows: dict[str, list[Group]] = {weather: [] for weather in WEATHERS}
    for weather, group in simulated_groups(arguments.root, arguments.bev):
        rows.setdefault(weather, []).append(group)
    show(f"simulated vehicles, {arguments.bev} maps", {weather: groups for weather, groups in rows.items() if groups})


if __name__ == "__main__":
    main()

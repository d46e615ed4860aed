"""How well colour words are ranked: on real vehicles named by hand, and on simulated ones in all weathers.

    python -m benchmarks.colour_words [ROOT] [--bev SOURCE]

Prints the tables of docs/colours.md as Markdown. ROOT is a folder that `appocc simulate` made; --bev names its maps
(exact, or what a network answered). Vehicles of the lowest visibility are left out.

- first: share of vehicles whose word (of the paint they were given; of the person) is the likeliest one. two: is
  among the two likeliest. P: mean probability of that word.
- found: of each word that some vehicles of a map have and others have not, how often the vehicle that it fits best
  has it. pairs: of a vehicle that has it and one that has not, how often it fits the former better. Real vehicles
  count as one map a dataset.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import load_map
from appocc.checks import FloatArray
from appocc.colours import WORDS, Exposure, exposures_of, fit, word_probabilities
from appocc.evaluation.vehicles import visibility_levels
from appocc.geometry import inverse
from appocc.nuscenes import Dataset
from grounding.scene import scene_of

NAMED = Path(__file__).parents[1] / "tests" / "grounding" / "colour_names.csv"
WEATHERS = ("clear", "overcast", "low sun", "wet", "dusk", "night")
HIDDEN = "v0-40"


class Named(NamedTuple):
    """A real vehicle that a person named: what a map shows of it (3,), in which light, and the words."""

    dataset: str
    rgb: FloatArray
    exposure: Exposure
    word: str
    second: str


class Group(NamedTuple):
    """N vehicles of one map: words, probabilities (N, 12) and how well each word fits (N, 12)."""

    words: Sequence[str]
    probabilities: FloatArray
    fits: FloatArray


class Shares(NamedTuple):
    """The figures of a row of the tables; NaN where there is nothing to count."""

    vehicles: int
    first: float
    two: float
    probability: float
    found: float
    pairs: float


def read_named(path: Path = NAMED) -> list[Named]:
    """The real vehicles that were named by hand."""
    lines = (line for line in path.read_text().splitlines() if not line.startswith("#"))
    return [
        Named(
            row["dataset"],
            np.array([float(row[channel]) for channel in ("red", "green", "blue")]),
            Exposure(np.array([float(row[f"gain_{channel}"]) for channel in ("red", "green", "blue")])),
            row["word"],
            row["second"],
        )
        for row in csv.DictReader(lines)
    ]


def named_groups(named: Iterable[Named]) -> dict[str, list[Group]]:
    """The vehicles of each dataset as one group, those of all datasets together."""
    rows = list(named)
    groups = {}
    for dataset in sorted({row.dataset for row in rows}):
        own = [row for row in rows if row.dataset == dataset]
        groups[dataset] = [group_of([row.word for row in own], [row.rgb for row in own], [r.exposure for r in own])]
    return groups


def group_of(words: Sequence[str], rgb: Sequence[FloatArray], exposures: Sequence[Exposure]) -> Group:
    """Vehicles of one map, each in its own light."""
    pairs = list(zip(rgb, exposures, strict=True))
    probabilities = np.array([word_probabilities(colour, light) for colour, light in pairs]).reshape(-1, len(WORDS))
    fits = np.array([[fit(word, colour, light) for word in WORDS] for colour, light in pairs]).reshape(-1, len(WORDS))
    return Group(words, probabilities, fits)


def either(named: Iterable[Named]) -> float:
    """Share of vehicles of which the likeliest word is one that a person would say."""
    likeliest = [(WORDS[int(word_probabilities(row.rgb, row.exposure).argmax())], row) for row in named]
    return _mean([word in (row.word, row.second) for word, row in likeliest])


def shares(groups: Iterable[Group]) -> Shares:
    """The figures of some groups."""
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
    """Weather and vehicles of each map of a simulated dataset."""
    dataset = Dataset(root)
    paints = dataset.tables["paint"]
    paint = dict(zip((token.decode() for token in paints.array("instance_token")), paints["name"], strict=True))
    for scene in dataset.scenes:
        weather = scene.description.split(", ")[1]
        for sample in dataset.samples(scene):
            pose = dataset.world_from_ego(sample)
            bev = load_map(root, source, sample.token)
            objects = scene_of(bev, dataset.boxes_world(sample).vehicles().transformed(inverse(pose)), pose).objects
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
    """A table, with all rows together at its end."""
    print(f"| {title} | vehicles | first | two | P | found | pairs |\n|---|---|---|---|---|---|---|")
    every = [group for groups in rows.values() for group in groups]
    for label, own in {**rows, "all": every}.items():
        n, *figures = shares(own)
        print(f"| {label} | {n} | " + " | ".join(f"{figure:.2f}" for figure in figures) + " |")
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path, nargs="?", help="a simulated dataset")
    parser.add_argument("--bev", default="exact", help="source of its maps")
    arguments = parser.parse_args()
    named = read_named()
    show("real vehicles", named_groups(named))
    print(f"The likeliest word is one of the two that a person would say: {either(named):.2f}\n")
    if arguments.root is None:
        return
    rows: dict[str, list[Group]] = {weather: [] for weather in WEATHERS}
    for weather, group in simulated_groups(arguments.root, arguments.bev):
        rows.setdefault(weather, []).append(group)
    show(f"simulated vehicles, {arguments.bev} maps", {weather: groups for weather, groups in rows.items() if groups})


if __name__ == "__main__":
    main()

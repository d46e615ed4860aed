"""Referent resolution of human commands on real tracks.

    python -m benchmarks.real_commands DIR [--json]

DIR contains `scene-*.npz` (tracks of annotated objects in the world frame at 10 Hz, without colours) and
`talk2car_commands.json` (sentences with scene, time and the referent's track; those without a track are skipped).
Each sentence is parsed and resolved among the tracks of its moment and of the half second before. There is no map, so
colour words are parsed but cannot be checked.

- rank: rank of the referent among all candidates, 0 if it is not one of them.
- top: the referent is the answer. among: the answer is a clarification question that includes it. missed: neither.
- what lacked, for all that are not top. language: the query has another class, or lacks a colour word of the
  sentence. colour: with its own paint on that track alone it would be the answer. scene: the rest (the words
  contradict the tracks, or do not suffice).
"""

from __future__ import annotations

import argparse
import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.checks import FloatArray
from appocc.colours import WORDS
from appocc.errors import AppoccError, DataError
from appocc.files import read_json, zip_arrays
from appocc.geometry import quaternion_from_yaw, transform
from grounding.language import parse
from grounding.query import Query
from grounding.referent.class_fit import fit_noun
from grounding.referent.resolver import resolve
from grounding.referent.scene import SceneModel, scene_from_tracks
from grounding.vocabulary import PERSON_NOUNS
from tracking.tracks import Track

OUTCOMES = ("top", "among", "missed")
BEFORE_STEPS, STEP_S, MOVES_MPS = 5, 0.1, 0.5
# Paints without a common word, to mark the referent.
PAINTS: dict[str, tuple[int, int, int]] = {
    **{"black": (20, 20, 22), "grey": (118, 118, 120), "silver": (180, 182, 184), "white": (245, 245, 245)},
    **{"red": (190, 25, 30), "orange": (240, 130, 30), "brown": (100, 60, 35), "yellow": (240, 205, 40)},
    **{"green": (30, 130, 50), "blue": (30, 60, 180), "purple": (110, 40, 140), "pink": (240, 150, 180)},
}


class Recording:
    """The tracks of a scene."""

    def __init__(self, path: Path) -> None:
        """Read a file.

        Raises:
            DataError: if it cannot be read or lacks a part.
        """
        names = [*("t", "ids", "category", "position", "heading", "velocity", "valid", "size_lwh")]
        names += ["ego_position", "ego_heading"]
        try:
            with zip_arrays(path.read_bytes()) as arrays:
                self._parts: dict[str, Any] = {name: arrays[name] for name in names}
        except (OSError, ValueError, KeyError) as error:
            raise DataError(f"{path}: expected tracks of a scene ({error})") from error

    def number_of(self, token: str) -> int:
        """Return the number of an instance, from 1.

        Raises:
            DataError: if there is none.
        """
        found = np.flatnonzero(self._parts["ids"] == token)
        if not len(found):
            raise DataError(f"track {token}: expected it among those of its scene, got none")
        return int(found[0]) + 1

    def scene_at(self, seconds: float) -> SceneModel:
        """Return the scene of the moment nearest to a time."""
        now = int(np.argmin(np.abs(self._parts["t"] - seconds)))
        before = max(now - BEFORE_STEPS, 0)
        heading, place = self._parts["ego_heading"][now], self._parts["ego_position"][now]
        world_from_ego = transform(quaternion_from_yaw(float(heading)), place)
        if before == now:
            return scene_from_tracks(None, self._tracks(now), world_from_ego)
        return scene_from_tracks(
            None, self._tracks(now), world_from_ego, self._tracks(before), STEP_S * (now - before)
        )

    def _tracks(self, moment: int) -> Iterator[Track]:
        parts = self._parts
        for i in np.flatnonzero(parts["valid"][:, moment]).tolist():
            kind = str(parts["category"][i])
            if not kind.startswith(("vehicle.", "human.")):
                continue
            length, width, height = parts["size_lwh"][i].tolist()
            ground: FloatArray = parts["position"][i, moment] - np.array([0.0, 0.0, height / 2])
            velocity = parts["velocity"][i, moment].astype(np.float64)
            moving = bool(np.hypot(*velocity) > MOVES_MPS)
            seen_before = bool(parts["valid"][i, max(moment - BEFORE_STEPS, 0)])
            yaw = float(parts["heading"][i, moment])
            unknown = np.full(3, np.nan)
            yield Track(
                id=i + 1,
                position_world_m=ground,
                velocity_world_mps=velocity,
                yaw_world_rad=yaw,
                heading_known=True,
                length_m=length,
                width_m=width,
                rgb=unknown,
                score=1.0,
                seen=True,
                height_m=height,
                kind=kind,
                moving=moving,
                velocity_known=moving or seen_before,
            )


@dataclass(frozen=True)
class Outcome:
    """The outcome of one command.

    Attributes:
        command: the sentence.
        scene: name of its scene.
        outcome: top, among or missed.
        rank: rank of the referent, 0 if it does not fit.
        asked: number of candidates that the answer leaves open.
        lacked: language, colour or scene; empty for top.
        said: the answer in one line.
    """

    command: str
    scene: str
    outcome: str
    rank: int
    asked: int
    lacked: str
    said: str


def outcome_of(query: Query, scene: SceneModel, meant: str) -> tuple[str, int, int, str]:
    """Return outcome, rank, number of open candidates, and the answer in words, given the id of the referent."""
    whole = [one.item.id for one in resolve(query, scene, limit=len(scene.table)).candidates]
    found = resolve(query, scene)
    ids = [one.item.id for one in found.candidates]
    rank = whole.index(meant) + 1 if meant in whole and found.status != "not_found" else 0
    said = found.question or (found.reasons[0] if found.reasons else found.status)
    if found.status == "ok" and ids and ids[0] == meant:
        return "top", rank, 1, said
    return "among" if found.status == "ambiguous" and meant in ids else "missed", rank, len(ids), said


def lacked_by(command: str, query: Query, scene: SceneModel, meant: str) -> str:
    """Return the reason why the referent is not the answer."""
    row = next((i for i, item in enumerate(scene.table.items) if item.id == meant), None)
    if row is None:
        return "scene"  # neither a vehicle nor a person, or out of range
    named = next(
        (word for word in re.findall("[a-z]+", command.lower().replace("gray", "grey")) if word in WORDS), ""
    )
    referent = query.referent
    if referent is None:
        return "language"
    colours = " ".join(colour or "" for colour in (referent.colour, *(part.colour for part in query.secondary)))
    # Colours of people are clothes, not paint.
    if named not in colours.split() and named and referent.noun not in PERSON_NOUNS:
        return "language"
    nouns = [(referent.noun, referent.head), *((part.noun, part.noun) for part in query.secondary)]
    if max(float(fit_noun(noun, head, scene.table)[row]) for noun, head in nouns) < 0.1:
        return "language"
    painted = _painted(scene, meant, (referent.colour or "").split()[-1:])
    return "colour" if painted and outcome_of(query, painted, meant)[0] == "top" else "scene"


def _painted(scene: SceneModel, meant: str, colour: list[str]) -> SceneModel | None:
    """Return the scene with a colour on one track and a contrasting one on all others; None without such a colour."""
    if not colour or colour[0] not in PAINTS:
        return None
    other = PAINTS["white" if colour[0] in ("black", "blue", "purple", "brown", "grey", "green") else "black"]
    rgb = {True: np.array(PAINTS[colour[0]], np.float64), False: np.array(other, np.float64)}
    return replace(scene, objects=tuple(replace(item, rgb=rgb[item.id == meant].copy()) for item in scene.objects))


def measure(folder: Path) -> list[Outcome]:
    """Return the outcome of each command.

    Raises:
        DataError: if a file cannot be read or a track is missing.
    """
    path = folder / "talk2car_commands.json"
    records = read_json(path)
    keys = {"command", "scene", "track", "t_best"}
    if not isinstance(records, list) or not all(isinstance(one, dict) for one in records):
        raise DataError(f"{path}: expected a list of records, got {type(records).__name__}")
    records = [one for one in records if one.get("track")]
    lacking = [one for one in records if not keys <= one.keys()]
    if lacking:
        raise DataError(f"{path}: expected {', '.join(sorted(keys))} in each record, got {sorted(lacking[0])}")
    recordings = {name: Recording(folder / f"{name}.npz") for name in sorted({one["scene"] for one in records})}
    outcomes = []
    for one in records:
        recording = recordings[one["scene"]]
        scene, meant = recording.scene_at(one["t_best"]), f"track {recording.number_of(one['track'])}"
        query = parse(one["command"]).query
        outcome, rank, asked, said = outcome_of(query, scene, meant)
        lacked = "" if outcome == "top" else lacked_by(one["command"], query, scene, meant)
        outcomes.append(Outcome(one["command"], one["scene"], outcome, rank, asked, lacked, said))
    return outcomes


def table(outcomes: Sequence[Outcome]) -> Table:
    """Return the outcomes as a table with totals."""
    made = Table("scene", "command", "outcome", "rank", "asked", "lacked")
    for one in outcomes:
        made.add_row(one.scene[-4:], one.command, one.outcome, str(one.rank or "-"), str(one.asked), one.lacked)
    made.add_section()
    counts = Counter(one.outcome for one in outcomes)
    lacked = Counter(one.lacked for one in outcomes if one.lacked)
    totals = ", ".join(f"{name} {counts[name]}" for name in OUTCOMES)
    made.add_row("all", f"{len(outcomes)} commands", totals, "", "", ", ".join(f"{k} {v}" for k, v in lacked.items()))
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    try:
        outcomes = measure(options.folder)
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")
    if options.json:
        counts = Counter(one.outcome for one in outcomes)
        lacked = Counter(one.lacked for one in outcomes if one.lacked)
        print(json.dumps({"counts": counts, "lacked": lacked, "commands": [vars(one) for one in outcomes]}, indent=2))
    else:
        Console(width=150).print(table(outcomes))


if __name__ == "__main__":
    main()

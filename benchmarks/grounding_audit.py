"""Audit of the places of answers that are `ok`: would a driver go there?

    python -m benchmarks.grounding_audit ROOT [--bev SOURCE] [--sentences FILE ...] [--draws 1] [--cases 1000]
                                              [--seed 0] [--faults] [--refused] [--pictures DIR [--every]]

ROOT is a simulated dataset of built-in towns. Sentences: the commands of labelled files, each asked in `--draws` key
frames at random, and `--cases` drawn ones about a vehicle of the frame, whatever is free or ahead. Nothing is left
out. The truth is the plan of the town, the exact map and the true boxes, without code of `grounding`
(`benchmarks.grounding_truth`); actions are those of the labels, and "unasked" is decided by the words.

Faults of an answer `ok`; a share is of all answers `ok`:

- behind us: the goal is more than 8 m behind us, unasked.
- wrong side: it heads against all lanes at its place, unasked. Who names a vehicle that stands there asks for that
  side: such answers are no fault, and told in a row of their own.
- beside moving: to park or stop, within 8 m of the vehicle meant, which drives faster than 2 m/s.
- score: below 0.1.
- junction: to park or wait, the centre is in a junction, or the footprint on a crossing, unasked.
- turns: it is less than 12 m away and heads more than 100 degrees from us, unasked.
- backwards: a car gets there, but with more than 10 m backwards, unasked.
- unreachable: no car gets there, with 30 m backwards.
"""

from __future__ import annotations

import argparse
import json
import re
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from appocc.bevmap import load_map
from appocc.checks import FloatArray
from appocc.errors import AppoccError
from appocc.files import write_image
from appocc.geometry import footprints, wrap_angle
from benchmarks.grounding_truth.car_moves import Reached, reached_poses
from benchmarks.grounding_truth.case_generation import SUITS
from benchmarks.grounding_truth.key_frames import Town, TrueFrame, Vehicle
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.roads import EGO
from benchmarks.grounding_truth.sentences import command, describe
from benchmarks.grounding_truth.streets import Streets
from grounding.answer import Answer
from grounding.grounder import Grounder
from grounding.visualization import draw_answer

SENTENCES = Path(__file__).parents[1] / "tests" / "grounding" / "language" / "commands.jsonl"
BEHIND_M, DRIVES_MPS, BESIDE_M, LEAST_SCORE = 8.0, 2.0, 8.0, 0.1
TURNED_RAD, WITHIN_M, BACK_M, FAR_BACK_M = np.radians(100), 12.0, 10.0, 30.0
STOPS, WAITS = ("park", "stop", "pull_over"), ("park", "pull_over", "wait")
# Words that ask for a place that is otherwise a fault.
_BACK = r"behind (us|me)|\bback(wards)?\b|revers|\brear\b|just passed|we passed"
_ROUND = r"turn\w* (\w+ ){0,3}(a)?round|u-?\s?turn|other way|spin|opposite direction|go back|head back"
_OTHER_SIDE = r"opposite|across|other side|oncoming|\bleft\b|wrong side|far side"
_JUNCTION = r"junction|intersection|crossing|crosswalk|zebra|corner|\blights?\b|roundabout|stop (sign|line)"
FAULTS = (*("behind us", "wrong side", "beside moving", "score", "junction", "turns", "backwards", "unreachable"),)
MOST_PICTURES = 60


class Question(NamedTuple):
    """A sentence to ask in a key frame, with the action that it commands."""

    token: str
    sentence: str
    action: str
    origin: str


class Audited(NamedTuple):
    """An answer and its faults."""

    question: Question
    status: str
    faults: tuple[str, ...] = ()
    beside: bool = False
    words: str = ""


class Place(NamedTuple):
    """A goal in the ego frame and the world frame, and the vehicles that it is measured from, by instance."""

    xy_m: FloatArray
    yaw_rad: float
    world_m: FloatArray
    world_yaw_rad: float
    score: float
    names: tuple[str, ...]


# Sentences --------------------------------------------------------------------------------------------------------


def labelled(files: Sequence[Path], tokens: Sequence[str], draws: int, seed: int) -> Iterator[Question]:
    """Yield the commands of labelled files, each in some frames at random."""
    for path in files:
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines()):
            row: dict[str, Any] = json.loads(line)
            if row.get("status") == "ok":
                random = np.random.default_rng([seed, number, zlib.crc32(path.name.encode())])
                for at in random.choice(len(tokens), min(draws, len(tokens)), replace=False).tolist():
                    yield Question(tokens[at], row["command"], str(row["action"]), path.stem)


def drawn(town: Town, tokens: Sequence[str], count: int, seed: int) -> Iterator[Question]:
    """Yield commands about vehicles of key frames, as many in each: any relation, whatever is free or ahead."""
    pairs = [(relation, action) for suits in SUITS.values() for relation, action in suits if relation != "between"]
    for number, token in enumerate(tokens):
        moment = town.moment(token)
        random = np.random.default_rng([seed, 1, zlib.crc32(token.encode())])
        near = [v for v in moment.vehicles if v.visible and v.on_map]
        for _ in range(count * (number + 1) // len(tokens) - count * number // len(tokens)):
            relation, action = pairs[int(random.integers(len(pairs)))]
            if relation == "none":
                ask = Ask(action, 15.0 if action == "stop" else None, "right" if action != "stop" else None)
                yield Question(token, command(relation, ask, [], random), action, "drawn")
                continue
            for i in random.permutation(len(near))[:6].tolist():
                if said := describe(moment, near[i], False, random):
                    words = command(relation, Ask(action), [(said, near[i].body)], random)
                    yield Question(token, words, action, "drawn")
                    break


# Judging ----------------------------------------------------------------------------------------------------------


class Auditor:
    """Judges the places of answers in one key frame."""

    def __init__(self, moment: TrueFrame, streets: Streets) -> None:
        """Take the truth of a key frame."""
        self._moment, self._streets = moment, streets
        self._reached: Reached | None = None

    def reached(self) -> Reached:
        """Return the poses that a car reaches; computed once."""
        if self._reached is None:
            bev = self._moment.bev
            free = self._moment.ground & ~self._moment.occupied
            # The ego stands where it stands, and a cell that its body touches is no obstacle.
            along, across = self._moment.local(np.array([EGO.centre_m, 0.0]), 0.0)
            grown = bev.grid.cell_m / 2
            free |= (np.abs(along) <= EGO.length_m / 2 + grown) & (np.abs(across) <= EGO.width_m / 2 + grown)
            low = bev.grid.centre_of(np.zeros(2, np.int64)) - bev.grid.cell_m / 2
            self._reached = reached_poses(free, bev.grid.cell_m, low, EGO, FAR_BACK_M)
        return self._reached

    def faults(self, question: Question, place: Place) -> tuple[tuple[str, ...], bool]:
        """Return the faults of a place, and whether one on the wrong side is beside a vehicle that stands there."""
        asked = {
            name: bool(re.search(words, question.sentence, re.IGNORECASE))
            for name, words in (("back", _BACK), ("round", _ROUND), ("side", _OTHER_SIDE), ("junction", _JUNCTION))
        }
        asked["side"] |= asked["round"]
        meant = [v for v in self._moment.vehicles if v.instance in place.names]
        against = self._streets.way(place.world_m, place.world_yaw_rad) < 0 and not asked["side"]
        beside = against and any(self._faces(place, v) for v in meant)
        found = [
            ("behind us", place.xy_m[0] < EGO.centre_m - BEHIND_M and not (asked["back"] or asked["round"])),
            ("wrong side", against and not beside),
            ("beside moving", question.action in STOPS and self._is_beside_moving(place, meant)),
            ("score", place.score < LEAST_SCORE),
            ("junction", question.action in WAITS and self._is_in_junction(place) and not asked["junction"]),
            ("turns", self._turns(place) and not asked["round"]),
        ]
        back_m = self.reached().least_back_m(place.xy_m, place.yaw_rad)
        found += [
            ("backwards", BACK_M < back_m < np.inf and not asked["back"]),
            ("unreachable", not np.isfinite(back_m)),
        ]
        return tuple(name for name, holds in found if holds), beside

    @staticmethod
    def _is_beside_moving(place: Place, meant: Sequence[Vehicle]) -> bool:
        own = footprints(place.xy_m, place.yaw_rad, [EGO.length_m + 2 * BESIDE_M, EGO.width_m + 2 * BESIDE_M])
        boxes = [footprints(v.xy_m, v.yaw_rad, [v.length_m, v.width_m]) for v in meant if v.speed_mps > DRIVES_MPS]
        return any(_overlap(own, box) for box in boxes)

    def _is_in_junction(self, place: Place) -> bool:
        along, across = np.meshgrid(np.linspace(-0.5, 0.5, 7) * EGO.length_m, np.linspace(-0.5, 0.5, 3) * EGO.width_m)
        cos, sin = np.cos(place.world_yaw_rad), np.sin(place.world_yaw_rad)
        points = place.world_m + np.stack([along * cos - across * sin, along * sin + across * cos], -1).reshape(-1, 2)
        inside = self._streets.is_in(self._streets.junctions, place.world_m[None])
        return inside or self._streets.is_in(self._streets.crossings, points)

    @staticmethod
    def _turns(place: Place) -> bool:
        away = float(np.hypot(*(place.xy_m - [EGO.centre_m, 0.0])))
        return away < WITHIN_M and abs(float(wrap_angle(place.yaw_rad))) > TURNED_RAD

    @staticmethod
    def _faces(place: Place, v: Vehicle) -> bool:
        return bool(np.cos(v.yaw_rad - place.yaw_rad) < 0)


def _overlap(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two rectangles, corners (4, 2), overlap: no side of either separates them."""
    for a in (one, other):
        for side in (a[1] - a[0], a[2] - a[1]):
            p, q = one @ side, other @ side
            if p.max() < q.min() or q.max() < p.min():
                return False
    return True


# Asking -----------------------------------------------------------------------------------------------------------


def place_of(answer: Answer, moment: TrueFrame) -> Place | None:
    """Return the goal of an answer; vehicles of a predicted map are matched by place. None without a goal."""
    target, referent = answer.target, answer.referent
    if target is None:
        return None
    items = [one for one in (referent.item, referent.partner) if one] if referent else []
    names = [
        v.instance
        for item in items
        for v in moment.vehicles
        if item.id == v.instance or np.hypot(*(item.centre_m - v.xy_m)) < 1.5
    ]
    return Place(target.ego_m, target.heading_ego_rad, target.world_m, target.heading_rad, target.score, tuple(names))


def audit(
    town: Town, questions: Sequence[Question], source: str, pictures: Path | None, every: bool
) -> Iterator[Audited]:
    """Ask and judge, key frame by key frame; draw the answers `ok`, those with a fault only unless `every`."""
    scenes = {s.token: scene for scene in town.dataset.scenes for s in town.dataset.samples(scene)}
    streets: dict[str, Streets] = {}
    number = 0
    for token in dict.fromkeys(question.token for question in questions):
        moment = town.moment(token)
        name = str(town.dataset.location(scenes[token]))
        auditor = Auditor(moment, streets.setdefault(name, Streets(name)) if name not in streets else streets[name])
        grounder = Grounder()
        bev = load_map(town.dataset.root, source, token)
        grounder.set_scene(bev, moment.boxes if bev.is_truth else None, moment.world_from_ego)
        for question in (one for one in questions if one.token == token):
            answer = grounder.ground(question.sentence)
            place = place_of(answer, moment)
            if answer.status != "ok" or place is None:
                yield Audited(question, answer.status, words="; ".join(answer.reasons))
                continue
            faults, beside = auditor.faults(question, place)
            if pictures and (faults or every) and number < MOST_PICTURES:
                title = "_".join(faults).replace(" ", "-") or "ok"
                write_image(pictures / f"{number:03d}_{title}.png", draw_answer(answer))
                number += 1
            yield Audited(question, "ok", faults, beside, "; ".join(answer.reasons))


# Telling ----------------------------------------------------------------------------------------------------------


def table(audited: Sequence[Audited]) -> Table:
    """Return the shares of the answers and of the faults, by the origin of the sentences."""
    made = Table("", *(origins := [*dict.fromkeys(one.question.origin for one in audited)]), "all")
    columns = [[one for one in audited if one.question.origin in (origin, "")] for origin in origins]
    columns.append(list(audited))
    made.add_row("sentences", *(str(len(rows)) for rows in columns))
    names = (
        ("answered", "ok"),
        ("asked back", "ambiguous"),
        ("refused", "not_found"),
        ("no command", "not_a_command"),
    )
    for words, status in names:
        made.add_row(f"{words} %", *(_share([one.status == status for one in rows]) for rows in columns))
    found = [[one for one in rows if one.status == "ok"] for rows in columns]
    made.add_section()
    made.add_row("answers ok", *(str(len(rows)) for rows in found))
    for fault in FAULTS:
        made.add_row(f"{fault} %", *(_share([fault in one.faults for one in rows]) for rows in found))
    made.add_row("beside a vehicle there %", *(_share([one.beside for one in rows]) for rows in found))
    made.add_row("any fault %", *(_share([bool(one.faults) for one in rows]) for rows in found))
    return made


def _share(holds: Sequence[bool]) -> str:
    return f"{100 * np.mean(holds):.1f}" if holds else "-"


def main(words: Sequence[str] | None = None) -> None:
    """Run the audit and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="exact")
    parser.add_argument("--sentences", type=Path, nargs="*", default=[SENTENCES])
    parser.add_argument("--draws", type=int, default=1)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", action="store_true", help="print every answer with a fault")
    parser.add_argument("--refused", action="store_true", help="print every sentence without a place")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of answers with a fault")
    parser.add_argument("--every", action="store_true", help="draw answers without a fault too")
    given = parser.parse_args(words)
    console = Console(width=140)
    try:
        town = Town(given.root)
        tokens = [sample.token for sample in town.samples()]
        questions = [*labelled(given.sentences, tokens, given.draws, given.seed)]
        questions += drawn(town, tokens, given.cases, given.seed)
        order = {token: n for n, token in enumerate(tokens)}
        questions.sort(key=lambda one: order[one.token])
        with Progress(console=Console(stderr=True)) as progress:
            asking = audit(town, questions, given.bev, given.pictures, given.every)
            audited = list(progress.track(asking, total=len(questions), description="asking"))
    except AppoccError as error:
        parser.exit(2, f"{error}\n")
    for one in audited:
        if (given.faults and one.faults) or (given.refused and one.status not in ("ok", "not_a_command")):
            what = ", ".join(one.faults) or one.status
            console.print(
                f"{one.question.token[:8]} {what}: {one.question.sentence}\n    {one.words}",
                highlight=False,
                markup=False,
            )
    console.print(table(audited))


if __name__ == "__main__":
    main()

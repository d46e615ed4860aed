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

A drawn sentence is doable if its vehicle suits the action (it stands to be parked at, it is none of the parked ones
to be followed, it is in a street) and some place in the relation, by the regions of `benchmarks.grounding_cases`, is
reached by a car and has none of these faults. Where people might disagree about the relation or all places are tight,
it does not count as doable. Right: the vehicle is the one meant, and the place is among those of the relation.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from appocc.bevmap import load_map
from appocc.errors import AppoccError
from appocc.files import write_image
from benchmarks.grounding_truth.faults import FAULTS, Auditor, Place
from benchmarks.grounding_truth.key_frames import Town, TrueFrame
from benchmarks.grounding_truth.questions import Question, drawn, labelled
from benchmarks.grounding_truth.streets import Streets
from grounding.answer import Answer
from grounding.grounder import Grounder
from grounding.visualization import draw_answer

SENTENCES = Path(__file__).parents[1] / "tests" / "grounding" / "language" / "commands.jsonl"
MOST_PICTURES = 60


class Audited(NamedTuple):
    """An answer and its faults.

    Attributes:
        question: the sentence.
        status: of the answer.
        doable: whether a person would find the sentence doable.
        faults: names of faults.
        beside: whether it is beside a vehicle on the wrong side.
        right: whether vehicle and place are those that would do; False if the sentence is not doable.
        words: the reasons, and the question if there is one.
    """

    question: Question
    status: str
    doable: bool
    faults: tuple[str, ...] = ()
    beside: bool = False
    right: bool = False
    words: str = ""


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
        grounder.set_street_map(town.street_map(token))
        bev = load_map(town.dataset.root, source, token)
        grounder.set_scene(bev, moment.boxes if bev.is_truth else None, moment.world_from_ego)
        for question in (one for one in questions if one.token == token):
            answer = grounder.ground(question.sentence)
            place, would_do = place_of(answer, moment), auditor.doable(question)
            words = "; ".join([*answer.reasons, answer.question])
            if answer.status != "ok" or place is None:
                yield Audited(question, answer.status, would_do is not None, words=words)
                continue
            faults, beside = auditor.faults(question, place)
            if pictures and (faults or every) and number < MOST_PICTURES:
                title = "_".join(faults).replace(" ", "-") or "ok"
                write_image(pictures / f"{number:03d}_{title}.png", draw_answer(answer))
                number += 1
            right = would_do is not None and bool(would_do.cells[tuple(bev.grid.cell_of(place.xy_m))])
            right &= question.instance in (*place.names, "")
            yield Audited(question, "ok", would_do is not None, faults, beside, right, words)


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
    doable = [[one for one in rows if one.doable] for rows in columns]
    made.add_section()
    made.add_row("doable", *(str(len(rows)) for rows in doable))
    made.add_row("answered %", *(_share([one.status == "ok" for one in rows]) for rows in doable))
    made.add_row("right of these %", *(_share([o.right for o in rows if o.status == "ok"]) for rows in doable))
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
    parser.add_argument("--refused", action="store_true", help="print every doable sentence without a place")
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
        if (given.faults and one.faults) or (given.refused and one.doable and one.status != "ok"):
            what = ", ".join(one.faults) or one.status
            console.print(
                f"{one.question.token[:8]} {what}: {one.question.sentence}\n    {one.words}",
                highlight=False,
                markup=False,
            )
    console.print(table(audited))


if __name__ == "__main__":
    main()

"""Sentence and scene -> answer: the query, the vehicle, the cell, and why; or why not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from grounding.describe import candidate_dict, phrase, target_dict
from grounding.parse import Problem, caret, read
from grounding.query import Query
from grounding.resolve import Candidate, resolve
from grounding.scene import Scene
from grounding.target import Plan, Target, plan

# Of a sentence, in the answer for people.
_SHOWN_CHARACTERS = 160


@dataclass(frozen=True)
class Answer:
    """What became of a sentence.

    Attributes:
        status: ok, ambiguous, not_found or not_a_command.
        query: what was understood.
        scene: where it was asked.
        target: the place, None unless the status is ok.
        referent: the vehicle the place is measured from, None where none is certain.
        candidates: vehicles that may be meant, best first; near misses where none fits.
        reasons: sentences that say why.
        problem: why the sentence is no command or cannot be placed, and the words it is about.
    """

    status: str
    query: Query
    scene: Scene
    target: Target | None = None
    referent: Candidate | None = None
    candidates: tuple[Candidate, ...] = ()
    reasons: tuple[str, ...] = ()
    problem: Problem | None = None

    @property
    def exit_code(self) -> int:
        """Of the command line: 0 done, 2 not a command, 3 ambiguous or not found."""
        return {"ok": 0, "not_a_command": 2}.get(self.status, 3)

    def to_dict(self) -> dict[str, Any]:
        """The answer for machines; angles in radians, lengths in metres."""
        return {
            "status": self.status,
            "query": self.query.to_dict(),
            "target": target_dict(self.target) if self.target else None,
            "referent": candidate_dict(self.referent, self.scene) if self.referent else None,
            "candidates": [candidate_dict(one, self.scene) for one in self.candidates],
            "reasons": list(self.reasons),
        }

    def text(self) -> str:
        """The answer for people, several lines."""
        asked = "".join(c if c.isprintable() else " " for c in self.query.command[:_SHOWN_CHARACTERS])
        lines = [f"{self.status.replace('_', ' ')}: {asked}"]
        if self.problem and (marks := caret(self.query.command, self.problem)):
            lines.append(marks)
        if self.target:
            x, y = self.target.ego_m
            i, j = self.target.cell
            lines.append(
                f"target: cell ({i}, {j}), ego ({x:.1f}, {y:.1f}) m, "
                f"world ({self.target.world_m[0]:.1f}, {self.target.world_m[1]:.1f}) m, "
                f"heading {self.target.heading_ego_rad:+.2f} rad to ours, score {self.target.score:.2f}"
            )
        lines += [f"- {reason}" for reason in self.reasons]
        others = [(n, one) for n, one in enumerate(self.candidates, start=1) if one is not self.referent]
        title = "others:" if self.referent else "which?" if self.status == "ambiguous" else "nearest to it:"
        lines += [title] if others else []
        lines += [f"  {number}. {phrase(one.item, self.scene)}" for number, one in others]
        return "\n".join(lines)


def ground(text: str, scene: Scene) -> Answer:
    """The place that a sentence asks for in a scene; every text gets an answer."""
    reading = read(text)
    query = reading.query
    if reading.problem:
        status = "not_found" if query.action else "not_a_command"
        return Answer(
            status, query, scene, reasons=(reading.problem.message, *reading.notes), problem=reading.problem
        )
    notes = (*reading.notes, *(f"the map holds no {one.noun.replace('_', ' ')}" for one in query.secondary))
    if query.referent is None:
        reason = "the command names no vehicle to find a place by"
        return Answer("not_found", query, scene, reasons=(reason, *notes))
    resolution = resolve(query.referent, scene)
    reasons = (*resolution.reasons, *notes)
    if resolution.status != "ok":
        return Answer(resolution.status, query, scene, candidates=resolution.candidates, reasons=reasons)
    tried = resolution.candidates[: None if not query.referent.definite else 1]
    referent, made = max(((one, plan(query, one.item, scene)) for one in tried), key=lambda pair: _worth(*pair))
    described = f"'{query.referent.phrase()}' is the {phrase(referent.item, scene)}"
    return Answer(
        "ok" if made.target else "not_found",
        query,
        scene,
        made.target,
        referent,
        resolution.candidates,
        (described, *reasons, *made.reasons),
    )


def _worth(candidate: Candidate, made: Plan) -> float:
    """How good a vehicle is together with the place beside it, where any vehicle will do."""
    return candidate.score + math.log(made.target.score) if made.target else -math.inf

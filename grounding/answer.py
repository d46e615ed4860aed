"""What became of a sentence: the query, the vehicle, the cell, and why; or why not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from appocc.polylines import length_m
from grounding.describe import candidate_dict, phrase, rounded, target_dict
from grounding.goal.planner import GoalPlan, Target
from grounding.language.parser import Problem, Reading, caret
from grounding.query import Query
from grounding.referent.resolver import Candidate
from grounding.referent.scene import Scene

# Of a sentence, in the answer for people.
_SHOWN_CHARACTERS = 160
_NO_PLAN = GoalPlan(None, ())


@dataclass(frozen=True)
class Answer:
    """What became of a sentence.

    Attributes:
        status: ok, ambiguous, not_found or not_a_command.
        reading: what was understood.
        scene: where it was asked.
        plan: the place, its route, others that would do; without a target unless the status is ok.
        referent: the vehicle the place is measured from, None where none is certain.
        candidates: vehicles that may be meant, best first; near misses where none fits.
        reasons: sentences that say why.
        question: what would decide between the candidates, '' where they are not several.
        score: logarithm of how good reading, vehicle and place are together, to compare readings by.
    """

    status: str
    reading: Reading
    scene: Scene
    plan: GoalPlan = _NO_PLAN
    referent: Candidate | None = None
    candidates: tuple[Candidate, ...] = ()
    reasons: tuple[str, ...] = ()
    question: str = ""
    score: float = 0.0

    @property
    def query(self) -> Query:
        """What was understood."""
        return self.reading.query

    @property
    def problem(self) -> Problem | None:
        """Why the sentence is no command, and the words that this is about."""
        return self.reading.problem

    @property
    def target(self) -> Target | None:
        """The place, None unless the status is ok."""
        return self.plan.target

    @property
    def exit_code(self) -> int:
        """Of the command line: 0 done, 2 not a command, 3 ambiguous or not found."""
        return {"ok": 0, "not_a_command": 2}.get(self.status, 3)

    def to_dict(self) -> dict[str, Any]:
        """The answer for machines; angles in radians, lengths in metres."""
        plan = self.plan
        return {
            "status": self.status,
            "query": self.query.to_dict(),
            "target": target_dict(plan.target) if plan.target else None,
            "route": None if plan.route is None else [rounded(point) for point in plan.route],
            "runners_up": [target_dict(one) for one in plan.runners_up],
            "nearest": target_dict(plan.nearest) if plan.nearest else None,
            "referent": candidate_dict(self.referent, self.scene) if self.referent else None,
            "candidates": [candidate_dict(one, self.scene) for one in self.candidates],
            "question": self.question or None,
            "reasons": list(self.reasons),
        }

    def text(self) -> str:
        """The answer for people, several lines."""
        asked = "".join(c if c.isprintable() else " " for c in self.query.command[:_SHOWN_CHARACTERS])
        lines = [f"{self.status.replace('_', ' ')}: {asked}"]
        if self.problem and (marks := caret(self.query.command, self.problem)):
            lines.append(marks)
        if self.target:
            lines.append(f"target: {_place(self.target)}, score {self.target.score:.2f}")
            lines.append(f"way: {length_m(self.plan.route):.0f} m") if self.plan.route is not None else None
        lines += [f"- {reason}" for reason in self.reasons]
        if self.plan.nearest:
            lines.append(f"nearest place that would do: {_place(self.plan.nearest)}")
        others = [(n, one) for n, one in enumerate(self.candidates, start=1) if one is not self.referent]
        title = "others:" if self.referent else "which?" if self.status == "ambiguous" else "nearest to it:"
        lines += [title] if others else []
        lines += [f"  {number}. {phrase(one.item, self.scene)}" for number, one in others]
        return "\n".join([*lines, *([self.question] if self.question else [])])


def _place(target: Target) -> str:
    (i, j), (x, y) = target.cell, target.ego_m
    return (
        f"cell ({i}, {j}), ego ({x:.1f}, {y:.1f}) m, world ({target.world_m[0]:.1f}, {target.world_m[1]:.1f}) m, "
        f"heading {target.heading_ego_rad:+.2f} rad to ours"
    )

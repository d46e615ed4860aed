"""The answer to a command: query, referent and goal pose with reasons, or why there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

from appocc.errors import AppoccError
from appocc.polylines import length_m
from grounding.describe import (
    candidate_to_dict,
    describe_candidate,
    describe_step,
    round_to_mm,
    target_to_dict,
    with_article,
)
from grounding.goal.planner import GoalPlan, Target
from grounding.language import ParseProblem, Reading, underline
from grounding.query import Query
from grounding.referent.resolver import Candidate, ResolutionStatus
from grounding.referent.scene import SceneModel
from grounding.vocabulary import Pace

_Option = TypeVar("_Option")
AnswerStatus = ResolutionStatus | Literal["not_a_command"]

# Longest part of a command that the text of an answer repeats.
_MAX_CHARACTERS = 160
_MAX_SHOWN = 60
_NO_PLAN = GoalPlan(None, ())


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Answer:
    """The answer to a command.

    Attributes:
        status: whether there is a goal, and why not.
        reading: parsed command.
        scene: scene of the command.
        plan: goal, route and alternatives; without a goal unless the status is "ok".
        referent: vehicle that the goal is measured from; None if the command names none or it is not certain.
        candidates: vehicles that the command may mean, best first; near misses if none fits.
        reasons: sentences that explain the answer.
        question: clarification question if the status is "ambiguous", else ''.
        score: log score of reading, referent and goal, comparable between readings.
        steps: answers to the steps of the command in order, each planned from where the one before ends.
        dropped: content words of the command that the reading does not use.
        confidence: estimated probability that referent and goal are what is meant, 0..1.
        alternatives: answers to different readings, if the question asks for the reading and not for a vehicle.
        chooser: makes the answer with another candidate; None if there is nothing to choose.
    """

    status: AnswerStatus
    reading: Reading
    scene: SceneModel
    plan: GoalPlan = _NO_PLAN
    referent: Candidate | None = None
    candidates: tuple[Candidate, ...] = ()
    reasons: tuple[str, ...] = ()
    question: str = ""
    score: float = 0.0
    steps: tuple[Answer, ...] = ()
    dropped: tuple[str, ...] = ()
    confidence: float = 0.0
    alternatives: tuple[Answer, ...] = ()
    chooser: Callable[[int], Answer] | None = field(default=None, repr=False)

    @property
    def query(self) -> Query:
        """The typed query of the command."""
        return self.reading.query

    @property
    def problem(self) -> ParseProblem | None:
        """Why the sentence is not a command, with the span of the words; None if it is one."""
        return self.reading.problem

    @property
    def target(self) -> Target | None:
        """The goal pose; None unless the status is "ok", and for a command without a place."""
        return self.plan.target

    @property
    def pace(self) -> Pace | None:
        """What the command asks for instead of a place: slower, faster, standing; None if it asks for a place."""
        return self.plan.pace

    @property
    def exit_code(self) -> int:
        """Exit code of the command line: 0 found, 2 not a command, 3 ambiguous or not found."""
        return {"ok": 0, "not_a_command": 2}.get(self.status, 3)

    @property
    def awaits(self) -> str | None:
        """The event that ends or starts the action, such as "leave"; None without one."""
        return self.query.trigger

    def choose(self, number: int) -> Answer:
        """Return the answer with a candidate as the referent, by its number from 1.

        Raises:
            AppoccError: if there is no such candidate.
        """
        if self.chooser is None:
            raise AppoccError(f"expected an answer with candidates to choose from, got '{self.status}' without")
        return self.chooser(number)

    def __repr__(self) -> str:
        """Return status, command, referent and place in one line."""
        command = self.query.command
        shown = command if len(command) <= _MAX_SHOWN else command[:_MAX_SHOWN] + "..."
        parts = [f"status={self.status!r}", f"command={shown!r}"]
        if self.referent is not None:
            parts.append(f"referent={self.referent.item.id!r}")
        if self.target is not None:
            parts.append("target=({:.1f}, {:.1f}) m".format(*self.target.ego_m))
        if self.pace is not None:
            parts.append(f"pace={self.pace!r}")
        if self.candidates:
            parts.append(f"candidates={len(self.candidates)}")
        return f"Answer({', '.join(parts)})"

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as JSON values; angles in radians, lengths in metres."""
        plan = self.plan
        return {
            "status": self.status,
            "query": self.query.to_dict(),
            "target": target_to_dict(plan.target) if plan.target else None,
            "pace": plan.pace,
            "refused": plan.refused,
            "route": None if plan.route is None else [round_to_mm(point) for point in plan.route],
            "runners_up": [target_to_dict(one) for one in plan.runners_up],
            "nearest": target_to_dict(plan.nearest) if plan.nearest else None,
            "referent": candidate_to_dict(self.referent, self.scene) if self.referent else None,
            "candidates": [candidate_to_dict(one, self.scene) for one in self.candidates],
            "question": self.question or None,
            "reasons": list(self.reasons),
            "steps": [step._step_to_dict() for step in self.steps],
            "dropped": list(self.dropped),
            "confidence": round(self.confidence, 3),
        }

    def _step_to_dict(self) -> dict[str, Any]:
        """Return a step of a plan as JSON values."""
        return {
            "action": self.query.action,
            "relation": self.query.relation,
            "awaits": self.awaits,
            "status": self.status,
            "referent": None if self.referent is None else self.referent.item.id,
            "target": target_to_dict(self.target) if self.target else None,
            "pace": self.pace,
            "later": self.plan.later,
            "route": None if self.plan.route is None else [round_to_mm(point) for point in self.plan.route],
        }

    def step_text(self) -> str:
        """Return a step of a plan in one line."""
        done = f" until: {self.awaits}" if self.awaits else ""
        place: str = self.pace or ("later" if self.plan.later else self.status)
        if self.target:
            place = f"({self.target.ego_m[0]:.1f}, {self.target.ego_m[1]:.1f}) m"
        return f"{describe_step(self.query, self.referent, self.scene)}{done}: {place.replace('_', ' ')}"

    def text(self) -> str:
        """Return the answer as lines of English."""
        command = "".join(c if c.isprintable() else " " for c in self.query.command[:_MAX_CHARACTERS])
        status = "refused" if self.plan.refused else self.status.replace("_", " ")
        lines = [f"{status}: {command}"]
        if self.problem and (marks := underline(self.query.command, self.problem)):
            lines.append(marks)
        if self.target:
            lines.append(f"target: {_describe_pose(self.target)}, score {self.target.score:.2f}")
            lines += [f"way: {length_m(self.plan.route):.0f} m"] if self.plan.route is not None else []
        lines += [f"pace: {self.pace}"] if self.pace else []
        if len(self.steps) > 1:
            lines += [f"step {number}: {step.step_text()}" for number, step in enumerate(self.steps, start=1)]
        lines += [f"- {reason}" for reason in self.reasons]
        if self.plan.nearest:
            lines.append(f"nearest place that would do: {_describe_pose(self.plan.nearest)}")
        others = [(n, one) for n, one in enumerate(self.candidates, start=1) if one is not self.referent]
        title = "others:" if self.referent else "which?" if self.status == "ambiguous" else "nearest to it:"
        lines += [title] if others else []
        lines += [f"  {number}. {describe_candidate(one, self.scene)}" for number, one in others]
        return "\n".join([*lines, *([self.question] if self.question else [])])


def pick(options: Sequence[_Option], number: int, name: str) -> _Option:
    """Return an option of an answer by its number, from 1; `name` is what the options are.

    Raises:
        AppoccError: if there is no such option.
    """
    if not 1 <= number <= len(options):
        raise AppoccError(f"expected the number of {with_article(name)}, 1 to {len(options)}, got {number}")
    return options[number - 1]


def _describe_pose(target: Target) -> str:
    (i, j), (x, y) = target.cell, target.ego_m
    return (
        f"cell ({i}, {j}), ego ({x:.1f}, {y:.1f}) m, world ({target.world_m[0]:.1f}, {target.world_m[1]:.1f}) m, "
        f"heading {target.heading_ego_rad:+.2f} rad to ours"
    )

"""Dialogue state: plan, goal, referents and open question of a conversation."""

from __future__ import annotations

from dataclasses import dataclass, replace

from grounding.answer import Answer
from grounding.language.questions import Question
from grounding.query import Referent
from grounding.referent.resolver import Candidate
from grounding.requests import Request

# Plans that a conversation can go back to.
_MAX_EARLIER = 8
# Vehicles that are remembered for "the other one".
_MAX_SPOKEN = 4


@dataclass(frozen=True)
class Told:
    """A question that was answered.

    Attributes:
        question: the question, with what an earlier one added.
        ids: ids of what the answer told, best first.
        turn: number of its turn.
        before: id of the best thing that the answer before told; empty without one.
    """

    question: Question
    ids: tuple[str, ...]
    turn: int
    before: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Memory:
    """Dialogue state.

    Attributes:
        plan: steps in force, in order; empty without a goal.
        goal: answer whose goal is in force; None without one.
        asked: steps of the last command, in force or not.
        at: index in `asked` of the step of the last question or answer.
        focus: last referent, and its description.
        topic: description of vehicles that were counted; None if a referent came after.
        question: answer whose question is open; None without one.
        offered: candidates of the last question.
        spoken: vehicles that answers were about, the last one first.
        rejected: ids of the candidates that were refused since the last command.
        earlier: plans that were in force before and had other steps, the last one first.
        counts_stops: whether the passenger counts the stops: "first stop ...", "two drops".
    """

    plan: tuple[Request, ...] = ()
    goal: Answer | None = None
    asked: tuple[Request, ...] = ()
    at: int = 0
    focus: tuple[Candidate, Referent] | None = None
    topic: Referent | None = None
    question: Answer | None = None
    offered: tuple[Candidate, ...] = ()
    spoken: tuple[Candidate, ...] = ()
    rejected: frozenset[str] = frozenset()
    earlier: tuple[tuple[Request, ...], ...] = ()
    counts_stops: bool = False

    def with_earlier(self) -> Memory:
        """Return the memory with the plan in force among the earlier ones."""
        return replace(self, earlier=(self.plan, *self.earlier)[:_MAX_EARLIER]) if self.plan else self

    def with_spoken(self, vehicle: Candidate | None) -> Memory:
        """Return the memory after an answer about a vehicle."""
        if vehicle is None:
            return self
        before = (one for one in self.spoken if one.item.id != vehicle.item.id)
        return replace(self, spoken=(vehicle, *before)[:_MAX_SPOKEN])

    @property
    def request(self) -> Request | None:
        """The step that the last question or answer is about; None before the first command."""
        return self.asked[self.at] if self.asked else None

    @property
    def lists(self) -> bool:
        """Whether the open question lists vehicles, or readings, of which one is chosen by its number."""
        asked = self.question
        return asked is not None and bool(asked.question) and len(asked.alternatives or asked.candidates) > 1

    @property
    def steps(self) -> tuple[Request, ...]:
        """The steps that were spoken of: those in force, and after or before them those of the open question."""
        queries = [replace(step.query, command="") for step in self.asked]
        in_force = [replace(step.query, command="") for step in self.plan]
        adds = all(one in queries for one in in_force) if self.question else queries[: len(in_force)] == in_force
        return self.asked if adds else self.plan

    def with_request(self, request: Request) -> tuple[Request, ...]:
        """Return the steps that were asked for last with another one in its place."""
        return (*self.asked[: self.at], request, *self.asked[self.at + 1 :])

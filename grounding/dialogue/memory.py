"""What a conversation remembers."""

from __future__ import annotations

from dataclasses import dataclass

from grounding.answer import Answer
from grounding.answering import Request
from grounding.query import Referent
from grounding.referent.resolver import Candidate


@dataclass(frozen=True, kw_only=True)
class Memory:
    """What a conversation remembers.

    Attributes:
        plan: steps in force, in order; empty without a goal.
        goal: answer whose goal is in force; None without one.
        request: last step that was asked for, in force or not.
        focus: last referent, and its description.
        question: answer whose question is open; None without one.
        offered: candidates of the last question.
        rejected: ids of the candidates that were refused since the last command.
    """

    plan: tuple[Request, ...] = ()
    goal: Answer | None = None
    request: Request | None = None
    focus: tuple[Candidate, Referent] | None = None
    question: Answer | None = None
    offered: tuple[Candidate, ...] = ()
    rejected: frozenset[str] = frozenset()

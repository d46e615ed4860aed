"""Dialogue session of one drive: each sentence is read in the context of the earlier ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.errors import AppoccError
from grounding.answer import Answer, pick
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.parts import answer_turn
from grounding.dialogue.plans.following import follow_plan, follow_question, relocate
from grounding.language.problems import check_type
from grounding.referent.resolver import Candidate
from tracking.tracks import Track

if TYPE_CHECKING:
    from grounding.grounder import Grounder


class Session:
    """A conversation with a grounder: `say` each sentence, `update` the scene while driving.

    Example:
        session = grounder.session()
        session.say("park behind the white car").question  # "the one on the left, or the one on the right?"
        session.say("the left one").target
        session.say("in front of it instead").target
    """

    def __init__(self, grounder: Grounder) -> None:
        """Begin a conversation about the scene of a grounder."""
        self._talk = Conversation(grounder)

    @property
    def goal(self) -> Answer | None:
        """The answer whose goal is in force; None without one."""
        return self._talk.state.goal

    @property
    def question(self) -> str:
        """The open question; '' without one."""
        question = self._talk.state.question
        return question.question if question else ""

    @property
    def proposes(self) -> bool:
        """Whether the open question proposes something: yes or no is an answer to it."""
        question = self._talk.state.question
        return question is not None and (
            bool(question.plan.question) or (bool(question.question) and len(question.candidates) == 1)
        )

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The vehicles that `choose` numbers from 1: those of the open question, else of the goal in force."""
        about = self._talk.state.question or self._talk.state.goal
        return about.candidates if about else ()

    def say(self, text: str) -> Answer:
        """Answer a sentence: a command, or a reply in the conversation.

        The status is "ok" if there is a goal. It is also "ok" for an answer in words ("where are you heading?") and
        after a goal is dropped ("never mind").

        Raises:
            CommandError: if the sentence is no text.
            AppoccError: if no scene is set.
        """
        check_type(text)
        talk = self._talk
        talk.begin_turn()
        return replace(answer_turn(talk, text), chooser=self.choose)

    def choose(self, number: int) -> Answer:
        """Choose a candidate of the last question, or of the last answer, by its number from 1.

        Raises:
            AppoccError: if there is no such candidate.
        """
        talk, state = self._talk, self._talk.state
        if state.question is not None and state.question.alternatives:
            return replace(talk.take_reading(state.question.choose(number)), chooser=self.choose)
        about, request = state.question or state.goal, state.request
        if about is None or request is None:
            raise AppoccError("session: expected a question before a choice")
        return replace(talk.choose(pick(about.candidates, number, "candidate"), request), chooser=self.choose)

    def update(
        self,
        bev: BEVMap,
        vehicles: Sequence[Track] | Boxes | None = None,
        world_from_ego: FloatArray | None = None,
        *,
        speed_mps: float | None = None,
    ) -> Answer | None:
        """Set the scene of the next moment and plan anew; arguments as in `Grounder.set_scene`.

        A referent keeps its id; on maps without ids it is the nearest vehicle that looks the same. Steps that are
        done are left out.

        Returns:
            The answer of the plan in force: "not_found" if its referent is lost; None without a plan.
        """
        talk, before = self._talk, self._talk.grounder.scene
        scene = talk.grounder.set_scene(bev, vehicles, world_from_ego, speed_mps=speed_mps)
        state = talk.state
        if before is None:
            return None
        if state.focus is not None:
            found = relocate(state.focus[0], before, scene)
            # A lost referent is remembered as it was last seen, so that it can be told and found again.
            state = replace(state, focus=(found or state.focus[0], state.focus[1]))
        if state.question is not None:
            asked = follow_question(state.question, before, scene)
            state = replace(state, question=asked, offered=asked.candidates if asked else ())
        talk.state = state
        if not state.plan or state.goal is None:
            return None
        plan = follow_plan(state.plan, state.goal, before, scene)
        answer = plan.lost or talk.answer_steps(plan.requests)
        answer = replace(answer, reasons=(*plan.reasons, *answer.reasons), chooser=self.choose)
        goal = answer if answer.status == "ok" else replace(state.goal, scene=scene)
        talk.state = replace(state, plan=plan.requests, goal=goal)
        return answer

"""The state of a conversation, and how steps are asked for, settled and put into force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.answering import accept_proposal, answer_steps
from grounding.dialogue.memory import Memory, Told
from grounding.dialogue.telling.phrases import ask, said
from grounding.language import Reading
from grounding.language.questions import Question
from grounding.language.reader.network import Prediction
from grounding.language.reader.turns import State
from grounding.query import Query, Referent
from grounding.referent.ordinals import is_plural
from grounding.referent.resolver import Candidate, find_all
from grounding.referent.scene import SceneModel
from grounding.requests import Request, join_drives, requests_of
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS

if TYPE_CHECKING:
    from grounding.grounder import Grounder

# Vehicles fit alike if their log scores differ by less, as by their places alone, and the words fit by this share.
_ALIKE, _ALIKE_FIT = 2.5, 0.5


def _without_given_up(steps: Sequence[Request]) -> tuple[Request, ...]:
    """Return steps without those that the next one replaces: staying behind a vehicle replaces passing it."""
    given_up = [_gives_up(one, following) for one, following in pairwise(steps)]
    return tuple(one for one, is_given_up in zip(steps, [*given_up, False], strict=True) if not is_given_up)


def _gives_up(step: Request, following: Request) -> bool:
    here, there, query = step.chosen, following.chosen, step.query
    if here is None or there is None or here.item.id != there.item.id:
        return False
    stays = following.query.action == "follow" or following.query.relation == "behind"
    # "Just tuck in and follow it": to tuck in is no place of its own.
    parks = query.action in ("park", "stop", "pull_over") and query.relation == "none"
    return stays and (query.action in PASSING_ACTIONS or parks)


class Conversation:
    """State of a conversation, and the grounder that answers its sentences."""

    def __init__(self, grounder: Grounder) -> None:
        """Begin without a goal and without a question."""
        self.grounder = grounder
        self.state = Memory()
        self._read: dict[tuple[str, Referent | None, str, bool], tuple[Reading, ...]] = {}
        # Predictions of words by state and last command: a part of a turn is first told apart, then answered.
        self.predictions: dict[tuple[str, State, Query | None], Prediction | None] = {}
        # The question answered last, the ids of what an answer lists, and the number of this turn.
        self.told: Told | None = None
        self.listed: tuple[str, ...] = ()
        self.turn = 0
        # The question that offers another vehicle beside the goal in force.
        self.offer: Answer | None = None

    # What words refer to --------------------------------------------------------------------------------------------

    @property
    def scene(self) -> SceneModel:
        """The present scene.

        Raises:
            AppoccError: if none is set.
        """
        if self.grounder.scene is None:
            raise AppoccError("session: expected a scene to be set before a sentence is said")
        return self.grounder.scene

    @property
    def antecedent(self) -> Referent | None:
        """The vehicle that pronouns and "one" refer to: that of the open question, else the last one."""
        state = self.state
        if state.question is not None and (asked := state.question.query.referent or state.question.query.sought):
            return asked
        if state.focus is not None and state.topic is None:
            named = state.focus[1]
            return replace(named, head=named.noun) if is_plural(named.head) else named  # "it" is one of "the cars"
        if state.request is None or state.topic is not None:
            return state.topic
        excluded = [Referent(one.noun, one.noun, one.colour) for one in state.request.query.excluded]
        return state.request.query.referent or next(iter(excluded), None)

    @property
    def meant(self) -> Candidate | None:
        """The vehicle of the scene that a pronoun refers to."""
        state = self.state
        if state.question is not None and state.question.candidates:
            return state.question.candidates[0]
        return state.focus[0] if state.focus else None

    @property
    def aimed_at(self) -> Request | None:
        """The last step in force that has a vehicle; None without one, and beside an open question."""
        steps = () if self.state.question is not None else reversed(self.state.plan)
        return next((one for one in steps if one.chosen is not None), None)

    def spoken_of(self, candidates: Sequence[Candidate]) -> Candidate | None:
        """Return the only one of several vehicles that fit alike which an earlier plan was about; None without one.

        A definite description refers to what is known to both: "back to the red one".
        """
        fit = [math.prod(one.fits.values()) for one in candidates]  # a red car is not like a green one
        alike = [
            one
            for one, fits in zip(candidates, fit, strict=True)
            if one.score > candidates[0].score - _ALIKE and fits > _ALIKE_FIT * fit[0]
        ]
        ids = {step.chosen.item.id for plan in self.state.earlier for step in plan if step.chosen is not None}
        known = [one for one in alike if one.item.id in ids]
        return known[0] if len(alike) > 1 and len(known) == 1 else None

    def in_focus(self, query: Query) -> Candidate | None:
        """Return the vehicle that was spoken of last, if a query names it by a plain noun phrase: "the van"."""
        named, focus = query.referent, self.state.focus
        if focus is None or named is None or not named.definite or named.qualifiers or named.colour:
            return None
        return focus[0] if any(one.id == focus[0].item.id for one in find_all(named, self.scene)) else None

    @property
    def is_opening(self) -> bool:
        """Whether nothing was asked for yet: a sentence then stands alone."""
        return self.state.request is None and self.state.question is None

    def begin_turn(self) -> None:
        """Forget the readings and predictions of the turn before."""
        self._read.clear()
        self.predictions.clear()
        self.turn += 1

    # What was told -----------------------------------------------------------------------------------------------

    @property
    def last_told(self) -> Told | None:
        """The question that this turn may follow up: one answered in it or in the turn before; None without one."""
        return self.told if self.told is not None and self.told.turn >= self.turn - 1 else None

    def told_ids(self) -> tuple[str, ...]:
        """Return the ids of what the answer told that this turn may follow up, best first."""
        return self.last_told.ids if self.last_told is not None else ()

    def list_items(self, items: Sequence[SceneObject]) -> None:
        """Keep the things that an answer to a question tells."""
        self.listed = tuple(one.id for one in items)

    def keep_told(self, question: Question) -> None:
        """Keep a question that was answered, for the questions that follow it up."""
        best = self.told_ids()[:1]
        self.told, self.listed = Told(question, self.listed, self.turn, best), ()

    def readings(
        self, words: str, antecedent: Referent | None = None, verb: str = "", *, alone: bool = True
    ) -> tuple[Reading, ...]:
        """Return the readings of some words, as `Grounder.read`; within a turn the same words are read once."""
        key = words, antecedent, verb, alone
        if key not in self._read:
            self._read[key] = self.grounder.read(words, antecedent, verb, alone=alone)
        return self._read[key]

    def read(self, words: str) -> Reading:
        """Return the best reading of some words."""
        return self.readings(words, self.antecedent, alone=False)[0]

    # Steps ----------------------------------------------------------------------------------------------------------

    def answer_steps(self, steps: Sequence[Request], primary: int = -1) -> Answer:
        """Answer steps in the present scene."""
        return answer_steps(steps, self.scene, primary=primary, limit=self.grounder.config.max_candidates)

    def take(self, requests: Sequence[Request], then: bool = False, answer: Answer | None = None) -> Answer:
        """Make steps the plan in force, or ask; with `then`, after the steps in force.

        Staying behind a vehicle replaces a step that passes it.
        """
        steps = _without_given_up(join_drives((*self.state.plan, *requests)) if then else tuple(requests))
        answer = answer if steps == tuple(requests) else None
        if answer is None:
            answer = self.answer_steps(steps)
        self.state = replace(self.state, rejected=frozenset())
        if self.state.plan and len(steps) == 1 and answer.pace in ("slower", "faster"):
            return answer  # another speed on the way to the goal in force
        if answer.plan.later and answer.reading.condition:
            return answer  # what is done in another case changes nothing now
        return self.settle(steps, answer)

    def take_steps(self, text: str, steps: Sequence[Request]) -> Answer:
        """Plan known steps as a sentence leaves them: fewer, or in another order."""
        return self.take(tuple(replace(one, reading=said(one.reading, text)) for one in steps))

    def take_reading(self, answer: Answer) -> Answer:
        """Take one of several readings of a sentence."""
        return self.take(requests_of(answer.reading), answer=answer)

    def settle(self, steps: tuple[Request, ...], answer: Answer) -> Answer:
        """Remember an answer: the plan in force if it has a goal, else the question."""
        about = next((i for i, step in enumerate(answer.steps) if step.status != "ok"), None)
        if about is None:
            about = next((i for i, step in enumerate(steps) if step.query == answer.query), len(steps) - 1)
        state = replace(self.state.with_spoken(answer.referent), asked=steps, at=about)
        if answer.status == "ok":
            steps = tuple(
                replace(step, chosen=done.referent)
                for step, done in zip(steps, answer.steps or (answer,), strict=False)
            )
            state = replace(state.with_earlier(), plan=steps, goal=answer, question=None, asked=steps)
            named = ((one.referent, one.query.referent) for one in (answer, *reversed(answer.steps)))
            focus = next(((item, referent) for item, referent in named if item and referent), None)
            if focus is None and (first := answer.plan.passes_first) is not None:  # "wait until he's past"
                focus = Candidate(first, {}, 1.0), Referent(first.class_name, first.common_name)
            if focus is not None:
                state = replace(state, focus=focus, topic=None)
        elif answer.plan.refused and not answer.question:  # nothing is asked; the vehicle was spoken of
            vehicle, said_of_it = answer.referent, answer.query.referent
            spoken_of = (vehicle, said_of_it) if vehicle and said_of_it else state.focus
            state = replace(state, question=None, focus=spoken_of)
        elif answer.candidates or answer.alternatives or answer.plan.question:
            state = replace(state, question=answer, offered=answer.candidates)
        else:
            state = replace(state, question=None)
        self.state = state
        return answer

    def choose(self, candidate: Candidate, request: Request, text: str | None = None) -> Answer:
        """Take a candidate as the referent of a step and plan anew."""
        state, chosen = self.state, replace(request, chosen=candidate)
        if text is not None:
            chosen = replace(chosen, reading=said(chosen.reading, text))
        answer = self.answer_steps(state.with_request(chosen), state.at)
        behind = candidate.item.centre_m[0] < self.scene.ego.centre_m
        if answer.plan.question and answer.plan.instead is None and behind:
            # The vehicle behind us was agreed to, so its place is not asked for again.
            chosen = accept_proposal(chosen, answer)
            answer = self.answer_steps(state.with_request(chosen), state.at)
        return self.settle(state.with_request(chosen), answer)

    def narrow(self, candidates: Sequence[Candidate], request: Request) -> Answer:
        """Take the only candidate, or ask which one is meant."""
        if len(candidates) == 1:
            return self.choose(candidates[0], request)
        return self.settle(self.state.with_request(request), ask(candidates, request.reading, self.scene))

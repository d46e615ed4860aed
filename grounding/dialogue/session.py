"""A conversation about one drive: each sentence is read with what was said before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.answering import Request, accept_proposal, answer_steps, pick, requests_of, without
from grounding.dialogue.descriptions import (
    find_fitting,
    is_plainly_definite,
    with_description,
    without_qualifiers,
)
from grounding.dialogue.following import follow_plan, relocate
from grounding.dialogue.fragments import complete, has_verb, keep_action, names_pronoun, read_description
from grounding.dialogue.memory import Memory
from grounding.dialogue.telling import ask, describe_goal, said
from grounding.goal.shift import Shift
from grounding.language import Reading
from grounding.language.replies import Reply, read_reply
from grounding.query import Query, Referent
from grounding.referent.resolver import Candidate, resolve
from grounding.referent.scene import SceneModel
from grounding.vocabulary import Action
from tracking.tracks import Track

if TYPE_CHECKING:
    from grounding.grounder import Grounder

# Distance of "a bit".
_BIT_M = 2.0


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
        self._grounder = grounder
        self._state = Memory()

    @property
    def goal(self) -> Answer | None:
        """The answer whose goal is in force; None without one."""
        return self._state.goal

    @property
    def question(self) -> str:
        """The open question; '' without one."""
        return self._state.question.question if self._state.question else ""

    def say(self, text: str) -> Answer:
        """Answer a sentence: a command, or a reply to what was said before.

        The status is "ok" for a goal, and for what is answered in words while the goal stays as it is ("where are you
        heading?") or is dropped ("never mind").

        Raises:
            AppoccError: if no scene is set.
        """
        reply = read_reply(text, self._grounder.lexicon)
        answer = self._answer(text, reply)
        return replace(answer, chooser=self.choose)

    def choose(self, number: int) -> Answer:
        """Choose a candidate of the last question, or of the last answer, by its number from 1.

        Raises:
            AppoccError: if there is no such candidate.
        """
        state = self._state
        if state.question is not None and state.question.alternatives:
            return replace(self._take_reading(state.question.choose(number)), chooser=self.choose)
        about, request = state.question or state.goal, self._state.request
        if about is None or request is None:
            raise AppoccError("session: expected a question before a choice")
        return replace(self._choose(pick(about.candidates, number, "candidate"), request), chooser=self.choose)

    def update(
        self,
        bev: BEVMap,
        vehicles: Sequence[Track] | Boxes | None = None,
        world_from_ego: FloatArray | None = None,
    ) -> Answer | None:
        """Set the scene of the next moment and plan anew; arguments as in `Grounder.set_scene`.

        A referent keeps its id; on maps without ids it is the nearest vehicle that looks the same. Steps that are
        done are left out.

        Returns:
            The answer of the plan in force: "not_found" if its referent is lost; None without a plan.
        """
        before = self._grounder.scene
        scene = self._grounder.set_scene(bev, vehicles, world_from_ego)
        state = self._state
        if before is None:
            return None
        if state.focus is not None:
            found = relocate(state.focus[0], before, scene)
            # A lost referent is remembered as it was last seen, so that it can be told and found again.
            state = replace(state, focus=(found or state.focus[0], state.focus[1]))
        if state.question is not None:
            kept = [found for one in state.question.candidates if (found := relocate(one, before, scene))]
            asked = ask(kept, state.question.reading, scene) if kept else None
            state = replace(state, question=asked, offered=tuple(kept))
        self._state = state
        if not state.plan or state.goal is None:
            return None
        plan = follow_plan(state.plan, state.goal, before, scene)
        answer = plan.lost or self._answer_steps(plan.requests)
        answer = replace(answer, reasons=(*plan.reasons, *answer.reasons), chooser=self.choose)
        self._state = replace(
            state, plan=plan.requests, goal=answer if answer.status == "ok" else replace(state.goal, scene=scene)
        )
        return answer

    # What a sentence does -------------------------------------------------------------------------------------------

    def _answer(self, text: str, reply: Reply) -> Answer:
        """Answer a sentence that is split into replies and the rest."""
        if reply.number is not None and (not reply.rest or self._state.question is not None):
            return self._answer_number(text, reply.number)
        if reply.shift:
            distance_m = _BIT_M if reply.distance_m is None else reply.distance_m
            return self._shift(text, Shift(reply.shift, distance_m))
        if not reply.rest:
            acts = {
                "cancel": self._cancel,
                "heading": self._tell_goal,
                "why": self._tell_reasons,
                "repeat": self._ask_again,
                "other": self._take_other,
                "neither": self._take_other,
                "yes": self._confirm,
                "no": self._refuse,
                "thanks": self._keep,
            }
            act = acts.get(reply.kinds[-1]) if reply.kinds else None
            return act(text) if act else self._command(text, text)
        reading = self._read(reply.rest)
        if "cancel" in reply.kinds and not has_verb(reading) and reading.query.action:
            return self._drop_steps(text, reading.query.action)
        if has_verb(reading):
            return self._command(text, reply.rest, then="then" in reply.kinds, agreed="yes" in reply.kinds)
        if "then" in reply.kinds and not reading.problem:
            return self._command(text, reply.rest, then=True)
        return self._answer_fragment(text, reply) or self._command(text, text if reading.problem else reply.rest)

    def _command(self, text: str, words: str, then: bool = False, agreed: bool = False) -> Answer:
        """Answer a command; `then`: as a further step of the plan in force; `agreed`: with the first candidate."""
        state, scene = self._state, self._scene
        readings = self._grounder.read(words, self._antecedent())
        if readings[0].problem:
            return self._not_understood(text, readings[0], words)
        base = self._state.request
        readings = tuple(keep_action(said(one, text), base.query if base else None) for one in readings)
        first = readings[0]
        if names_pronoun(first):
            if state.question is not None and len(state.question.candidates) > 1 and not agreed:
                return self._ask_again(text)
            if (meant := self._meant()) is not None:
                chosen = tuple(replace(one, chosen=meant) for one in requests_of(first))
                return self._take(chosen, scene, then)
        elif (
            state.question is not None
            and first.query.referent is not None
            and first.query.referent.anaphora
            and (fitting := find_fitting(first, state.question.candidates, self._scene))
        ):
            return self._narrow(fitting, Request(reading=first))
        answer = self._grounder.check(words, first, self._grounder.best_answer(readings))
        if answer.alternatives:
            self._state = replace(state, question=answer, offered=(), asked=requests_of(answer.reading), at=0)
            return answer
        if answer.status == "ambiguous" and state.focus and not state.question and is_plainly_definite(first):
            # "The van" is the one that the conversation is about.
            again = [one for one in answer.candidates if one.item.id == state.focus[0].item.id]
            if again:
                return self._take((replace(requests_of(answer.reading)[-1], chosen=again[0]),), scene, then)
        return self._take(requests_of(answer.reading), scene, then, answer)

    def _take(
        self, requests: tuple[Request, ...], scene: SceneModel, then: bool = False, answer: Answer | None = None
    ) -> Answer:
        """Make steps the plan in force, or ask; with `then`, after the steps in force."""
        state = self._state
        steps = (*state.plan, *requests) if then else requests
        if answer is None or then:
            answer = self._answer_steps(steps)
        self._state = replace(state, rejected=frozenset())
        return self._settle(steps, answer)

    def _answer_steps(self, steps: tuple[Request, ...], primary: int = -1) -> Answer:
        return answer_steps(steps, self._scene, primary=primary, limit=self._grounder.config.max_candidates)

    def _settle(self, steps: tuple[Request, ...], answer: Answer) -> Answer:
        """Remember an answer: the plan in force if it has a goal, else the question."""
        state = self._state
        about = next((i for i, step in enumerate(answer.steps) if step.status != "ok"), None)
        if about is None:
            about = next((i for i, step in enumerate(steps) if step.query == answer.query), len(steps) - 1)
        state = replace(state, asked=steps, at=about)
        if answer.status == "ok":
            steps = tuple(
                replace(step, chosen=done.referent)
                for step, done in zip(steps, answer.steps or (answer,), strict=False)
            )
            state = replace(state, plan=steps, goal=answer, question=None, asked=steps)
            if answer.referent is not None and answer.query.referent is not None:
                state = replace(state, focus=(answer.referent, answer.query.referent))
        elif answer.candidates or answer.alternatives or answer.plan.question:
            state = replace(state, question=answer, offered=answer.candidates)
        else:
            state = replace(state, question=None)
        self._state = state
        return answer

    # Answers to questions -------------------------------------------------------------------------------------------

    def _answer_number(self, text: str, number: int) -> Answer:
        about = self._state.question or self._state.goal
        request = self._state.request
        if about is not None and 1 <= number <= len(about.alternatives):
            return self._take_reading(about.alternatives[number - 1])
        if about is None or request is None or not 1 <= number <= len(about.candidates):
            return self._ask_again(text)
        return self._choose(about.candidates[number - 1], request, text)

    def _choose(self, candidate: Candidate, request: Request, text: str | None = None) -> Answer:
        """Take a candidate as the referent of a step and plan anew."""
        state, chosen = self._state, replace(request, chosen=candidate)
        if text is not None:
            chosen = replace(chosen, reading=said(chosen.reading, text))
        answer = self._answer_steps(state.with_request(chosen), state.at)
        behind = candidate.item.centre_m[0] < self._scene.ego.centre_m
        if answer.plan.question and answer.plan.instead is None and behind:
            # The vehicle behind us was agreed to, so its place is not asked for again.
            chosen = accept_proposal(chosen, answer)
            answer = self._answer_steps(state.with_request(chosen), state.at)
        return self._settle(state.with_request(chosen), answer)

    def _take_reading(self, answer: Answer) -> Answer:
        """Take one of several readings of a sentence."""
        return self._take(requests_of(answer.reading), self._scene, answer=answer)

    def _confirm(self, text: str) -> Answer:
        """Take the only candidate of the open question, or the nearest place if that was offered."""
        question, request = self._state.question, self._state.request
        if question is None or request is None:
            return self._inform(text, "the goal stays as it is") if self._state.goal else self._keep(text)
        if len(question.alternatives) == 1:
            return self._take_reading(question.alternatives[0])
        if question.plan.question:
            accepted = accept_proposal(request, question)
            accepted = replace(accepted, reading=said(accepted.reading, text))
            return self._take(self._state.with_request(accepted), self._scene)
        if len(question.candidates) == 1:
            return self._choose(question.candidates[0], request, text)
        return self._ask_again(text)

    def _refuse(self, text: str) -> Answer:
        """Drop the open question; without one, take another candidate than the one in force."""
        if self._state.question is None:
            return self._take_other(text)
        self._state = replace(self._state, question=None)
        return self._inform(text, "then nothing is changed: say what to do instead")

    def _take_other(self, text: str) -> Answer:
        """Take the remaining candidate, ask among the remaining ones, or look for another one."""
        state, request = self._state, self._state.request
        if request is None or request.query.referent is None:
            return self._not_understood(text, self._read(text))
        refused = {one.item.id for one in state.question.candidates[:1]} if state.question else set[str]()
        if state.question is None and request.chosen is not None:
            refused = {request.chosen.item.id}
        rejected = state.rejected | refused
        if rejected >= {one.item.id for one in state.offered}:
            rejected = frozenset(refused)  # after all were refused, the others are meant again
        self._state = replace(state, rejected=rejected, question=None)
        request = replace(request, chosen=None, shifts=(), reading=said(request.reading, text))
        left = [one for one in state.offered if one.item.id not in rejected]
        if len(state.offered) > 1 and left:
            return self._narrow(left, request)
        for wanted in (request, without_qualifiers(request)):
            found = resolve(wanted.query, without(self._scene, rejected))
            if found.status == "ok" and found.candidates:
                return self._choose(found.candidates[0], wanted)
            if found.status == "ambiguous":
                return self._narrow(found.candidates, wanted)
        named = request.query.referent.phrase() if request.query.referent else "vehicle"
        answer = Answer(
            status="not_found",
            reading=request.reading,
            scene=self._scene,
            reasons=(f"no other vehicle here fits '{named}'",),
        )
        return self._settle(state.with_request(request), answer)

    def _narrow(self, candidates: Sequence[Candidate], request: Request) -> Answer:
        """Take the only candidate, or ask which one is meant."""
        if len(candidates) == 1:
            return self._choose(candidates[0], request)
        return self._settle(self._state.with_request(request), ask(candidates, request.reading, self._scene))

    # Fragments ------------------------------------------------------------------------------------------------------

    def _answer_fragment(self, text: str, reply: Reply) -> Answer | None:
        """Answer a sentence without a verb: a description, or another relation; None if it is neither."""
        state, request = self._state, self._state.request
        if request is None:
            return None
        if state.question is not None and (answer := self._answer_description(text, reply, state.question)):
            return answer
        base = request.query
        reading = complete(reply.rest, base, self._antecedent(), self._grounder.read)
        if reading is not None and not (reading.query.relation == "none" and base.referent is not None):
            return self._modify(said(reading, text), request)
        if answer := self._answer_description(text, reply, None):
            return answer
        if reading is not None:
            return self._modify(said(reading, text), request)
        return self._ask_again(text) if state.question is not None else None

    def _answer_description(self, text: str, reply: Reply, question: Answer | None) -> Answer | None:
        """Answer the description of a vehicle: one of the candidates of a question, else any vehicle of the scene."""
        request = self._state.request
        reading = read_description(reply.rest, self._antecedent(), self._grounder.read)
        if request is None or reading is None:
            return None
        described = with_description(request, reading, text)
        if question is not None and (fitting := find_fitting(reading, question.candidates, self._scene)):
            return self._narrow(fitting, described)
        rejected = frozenset[str]()
        if "no" in reply.kinds and request.chosen is not None and question is None:
            rejected = frozenset({request.chosen.item.id})
        found = resolve(described.query, without(self._scene, rejected))
        if found.status == "ok" and found.candidates:
            return self._choose(found.candidates[0], described)
        if found.status == "ambiguous":
            return self._narrow(found.candidates, described)
        return self._take(self._state.with_request(described), self._scene) if question is None else None

    def _modify(self, reading: Reading, request: Request) -> Answer:
        """Plan a command that changes the relation, the side or the distance of the last one."""
        base, query = request.query, reading.query
        modified = Request(reading=reading)
        if query.referent is None and query.landmark is None:
            query = replace(query, referent=base.referent, relation=base.relation, landmark=base.landmark)
            modified = Request(reading=replace(reading, query=query, steps=(query,)), chosen=request.chosen)
        elif names_pronoun(reading) and (meant := self._meant()) is not None:
            modified = replace(modified, chosen=meant)
        return self._take(self._state.with_request(modified), self._scene)

    # What changes or tells the goal ---------------------------------------------------------------------------------

    def _shift(self, text: str, shift: Shift) -> Answer:
        """Move the goal in force."""
        state = self._state
        if not state.plan or state.goal is None:
            return self._ask_again(text)
        last = state.plan[-1]
        moved = replace(last, shifts=(*last.shifts, shift), reading=said(last.reading, text))
        steps = (*state.plan[:-1], moved)
        answer = self._answer_steps(steps)
        if answer.status != "ok":
            return replace(answer, reasons=(*answer.reasons, "the goal stays where it was"))
        return self._settle(steps, answer)

    def _drop_steps(self, text: str, action: Action) -> Answer:
        """Drop the steps of an action: "never mind the overtaking"."""
        state = self._state
        left = tuple(step for step in state.plan if step.query.action != action)
        if not left:
            return self._cancel(text)
        if len(left) == len(state.plan):
            return self._inform(text, f"the plan has no step '{action}': it stays as it is")
        return self._take(tuple(replace(one, reading=said(one.reading, text)) for one in left), self._scene)

    def _cancel(self, text: str) -> Answer:
        """Drop the goal and the question."""
        had = self._state.plan or self._state.question
        self._state = replace(self._state, plan=(), goal=None, question=None)
        return self._inform(
            text, "the command is dropped: no goal is set" if had else "no command to drop: no goal is set"
        )

    def _keep(self, text: str) -> Answer:
        """Acknowledge a sentence that changes nothing."""
        if self._state.question is not None:
            return self._ask_again(text)
        if self._state.goal is None:
            return self._not_understood(text, self._read(text))
        return replace(self._not_understood(text, self._read(text)), reasons=("the goal stays as it is",))

    def _tell_goal(self, text: str) -> Answer:
        """Tell the goal in force."""
        goal = self._state.goal
        if goal is None:
            question = self._state.question
            return self._ask_again(text) if question else self._inform(text, "nowhere: no command is set")
        return self._inform(text, *describe_goal(goal))

    def _tell_reasons(self, text: str) -> Answer:
        """Tell the reasons for the goal in force, or for the question."""
        about = self._state.question or self._state.goal
        if about is None:
            return self._inform(text, "no command is set")
        return self._inform(text, *(about.reasons or ("it is what the command asks for",)))

    def _ask_again(self, text: str) -> Answer:
        """Ask the open question again; without one, tell the goal."""
        question = self._state.question
        if question is None:
            return self._tell_goal(text) if self._state.goal else self._not_understood(text, self._read(text))
        status = "ambiguous" if question.question else question.status
        return replace(question, status=status, reading=said(question.reading, text))

    def _inform(self, text: str, *reasons: str) -> Answer:
        """Return an answer in words; its goal is the one in force."""
        goal, question = self._state.goal, self._state.question
        if goal is None:
            sentence = Reading(Query(text), tokens=self._read(text).tokens)
            asked = question.question if question else ""
            return Answer(status="ok", reading=sentence, scene=self._scene, reasons=reasons, question=asked)
        return replace(goal, reading=said(goal.reading, text), reasons=reasons)

    def _not_understood(self, text: str, reading: Reading, words: str = "") -> Answer:
        """Return that a sentence is no command; an open question stays open. A language model may read `words`."""
        reasons = (reading.problem.message, *reading.notes) if reading.problem else reading.notes
        problem = reading if reading.problem else self._grounder.read(text, None)[0]
        question = self._state.question
        answer = Answer(
            status="not_a_command",
            reading=problem,
            scene=self._scene,
            reasons=reasons,
            question=question.question if question else "",
        )
        checked = self._grounder.check(words, reading, answer) if words else answer
        if checked.alternatives:
            self._state = replace(self._state, question=checked, asked=requests_of(checked.reading), at=0)
        return checked

    # Context --------------------------------------------------------------------------------------------------------

    @property
    def _scene(self) -> SceneModel:
        """The present scene.

        Raises:
            AppoccError: if none is set.
        """
        if self._grounder.scene is None:
            raise AppoccError("session: expected a scene to be set before a sentence is said")
        return self._grounder.scene

    def _read(self, words: str) -> Reading:
        return self._grounder.read(words, self._antecedent())[0]

    def _antecedent(self) -> Referent | None:
        """Return the vehicle that pronouns and "one" refer to: that of the open question, else the last one."""
        state = self._state
        if state.question is not None and state.question.query.referent is not None:
            return state.question.query.referent
        if state.focus is not None:
            return state.focus[1]
        return state.request.query.referent if state.request else None

    def _meant(self) -> Candidate | None:
        """Return the vehicle that a pronoun refers to."""
        state = self._state
        if state.question is not None and state.question.candidates:
            return state.question.candidates[0]
        return state.focus[0] if state.focus else None

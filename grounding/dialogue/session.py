"""Dialogue session of one drive: each sentence is read in the context of the earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.errors import AppoccError
from grounding.answer import Answer
from grounding.answering import pick
from grounding.dialogue.changes import (
    BIT_M,
    all_but,
    answer_fragment,
    change_distance,
    described_by,
    drop_steps,
    move_elsewhere,
    scale_distance,
    shift_from_named,
    shift_last,
    shift_more,
)
from grounding.dialogue.choices import (
    choose_middle,
    choose_number,
    choose_offered,
    confirm,
    go_back,
    refuse,
    take_any,
    take_next,
    take_none,
    take_other,
)
from grounding.dialogue.commands import answer_command, ask_to_stop
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.following import follow_plan, follow_question, relocate
from grounding.dialogue.fragments import complete, has_verb, names_pronoun
from grounding.dialogue.reports import (
    ask_again,
    cancel,
    count,
    keep,
    look_for,
    notice,
    pause,
    tell_goal,
    tell_reasons,
    tell_room,
    tell_seen,
    tell_vehicle,
)
from grounding.dialogue.parts import Part, clauses_of, is_misunderstood, sentences_of
from grounding.dialogue.turns import Turn, read_turn, state_of
from grounding.goal.shift import Shift
from grounding.language.problems import check_type
from grounding.language.reader.fields import NONE
from grounding.language.replies import Reply, read_reply
from grounding.referent.resolver import Candidate
from grounding.vocabulary import POSITIONS, REFUSED
from tracking.tracks import Track

if TYPE_CHECKING:
    from grounding.grounder import Grounder

# What replies without further words do.
_ACTS: Mapping[str, Callable[[Conversation, str], Answer]] = {
    "cancel": cancel,
    "heading": tell_goal,
    "why": tell_reasons,
    "repeat": ask_again,
    "seen": tell_seen,
    "other": take_other,
    "neither": take_none,
    "yes": confirm,
    "no": refuse,
    "thanks": keep,
    "remark": keep,
    "pause": pause,
    "any": take_any,
    "undo": go_back,
    "about": tell_vehicle,
    "following": partial(take_next, sign=1.0),
    "previous": partial(take_next, sign=-1.0),
    "former": partial(choose_offered, index=0),
    "latter": partial(choose_offered, index=-1),
    "middle": choose_middle,
    "half": partial(scale_distance, factor=0.5),
    "double": partial(scale_distance, factor=2.0),
    "more": partial(shift_more, sign=1.0),
    "less": partial(shift_more, sign=-1.0),
    "elsewhere": move_elsewhere,
}
# Replies that mean something before any command.
_WITHOUT_COMMAND = ("seen", "cancel")
# Replies that hold where what follows is not understood: "cancel, I'm taking a call first".
_BEFORE_REASONS = ("cancel", "any", "yes", "neither", "thanks", "undo", "why")
# Replies about the words that follow them.
_ABOUT_WORDS: Mapping[str, Callable[[Conversation, str, str], Answer]] = {
    "seek": look_for,
    "count": count,
    "room": tell_room,
}


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
        return replace(_say(talk, text), chooser=self.choose)

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
    ) -> Answer | None:
        """Set the scene of the next moment and plan anew; arguments as in `Grounder.set_scene`.

        A referent keeps its id; on maps without ids it is the nearest vehicle that looks the same. Steps that are
        done are left out.

        Returns:
            The answer of the plan in force: "not_found" if its referent is lost; None without a plan.
        """
        talk, before = self._talk, self._talk.grounder.scene
        scene, state = talk.grounder.set_scene(bev, vehicles, world_from_ego), talk.state
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


def _say(talk: Conversation, text: str) -> Answer:
    """Answer a sentence, or several: each one in turn, if each is plain by itself and does something else."""
    before = talk.state
    sentences = [] if talk.is_opening else sentences_of(talk, text)
    acts = [one.act for one in sentences if not one.is_aside]
    plain = all(one.is_sure for one in sentences) and len({*acts}) == len(acts)
    if plain and (answer := _say_each(talk, sentences)):
        return answer
    answer = _say_one(talk, text)
    if is_misunderstood(answer):
        after, talk.state = talk.state, before
        again = _say_each(talk, clauses_of(talk, text))
        if again is not None and not is_misunderstood(again):
            return again
        talk.state = after
    return answer


def _say_each(talk: Conversation, parts: Sequence[Part]) -> Answer | None:
    """Answer the parts of a turn one after the other; None if all of them are chat.

    Returns:
        The answer to the last part that chooses or changes something, else to the last question. One that comes to nothing, and asks for nothing
        new, is a reason: "The second one. It's right outside my house".
    """
    several = any(not (one.is_aside or one.is_reply) for one in parts)
    answer = aside = None
    for one in parts:
        before = talk.state
        if one.is_chat or (one.is_reply and several):
            notice(talk, one.text)
        elif one.is_aside:
            aside = _say_one(talk, one.text)
        else:
            told = _say_one(talk, one.text)
            if answer is None or one.is_command or told.status == "ok":
                answer = told
            else:
                talk.state = before
    return answer or aside


def _say_one(talk: Conversation, text: str) -> Answer:
    """Answer one sentence: by its reader where that is sure, else by the grammar, else by what its reader deems likely."""
    before = talk.state
    reply = read_reply(text, talk.grounder.lexicon)
    guess = read_turn(talk, text, reply)
    turn = guess if guess is not None and guess.is_sure else None
    answer = _answer_turn(talk, text, reply, turn) if turn else None
    if turn is None and guess is not None and guess.is_change and not talk.is_opening:
        answer = _answer_likely(talk, text, reply, guess)
    plain = reply.rest and {*reply.kinds} <= {"meant"} and not talk.is_opening
    if answer is None and guess is not None and guess.is_chat and plain:
        answer = _answer_likely(talk, text, reply, guess) or keep(talk, text)
    answer = answer or _answer(talk, text, reply, turn)
    if guess is not None and not talk.is_opening and is_misunderstood(answer):
        after, talk.state = talk.state, before
        if likely := _answer_likely(talk, text, reply, guess):
            return likely
        talk.state = after
        if state_of(talk) == "goal" and not guess.is_likely_command:
            return keep(talk, text)
    return answer


def _answer_likely(talk: Conversation, text: str, reply: Reply, guess: Turn) -> Answer | None:
    """Answer a turn by the likeliest act that comes to something; None if none does."""
    before = talk.state
    for act in guess.likely_acts:
        answer = _answer_turn(talk, text, reply, replace(guess, act=act))
        if answer is not None and (answer.status == "ok" or act == "remark"):
            return answer
        talk.state = before
    return None


def _answer_turn(talk: Conversation, text: str, reply: Reply, turn: Turn) -> Answer | None:
    """Answer a turn by what its reader takes it for; None where the grammar is to answer."""
    act, state = turn.act, talk.state
    if act in ("seek", "count", "about") and (named := described_by(turn, talk.antecedent)):
        if act == "about" and turn.best("noun") == NONE:
            return tell_vehicle(talk, text)
        asked = "" if act == "about" else reply.rest or text  # "what colour is the van" describes none by itself
        return (count if act == "count" else look_for)(talk, text, asked, named)
    if talk.is_opening:
        if act in ("describe", "place") and not reply.kinds and talk.readings(text)[0].problem:
            return ask_to_stop(talk, text, reply.rest)
        return _ACTS[act](talk, text) if act in _WITHOUT_COMMAND else None
    if _says_more(talk, reply, turn) or talk.read(reply.rest or text).query.manoeuvre in REFUSED:
        return None
    if act == "no" and "cancel" in reply.kinds:
        return cancel(talk, text)
    if act in ("neither", "previous", "following") and turn.names_vehicle:
        return answer_fragment(talk, text, reply, replace(turn, act="describe"))  # "neither, she has the van today"
    if act == "number":
        return _answer_number(talk, text, reply, turn.number)
    if act == "shift":
        moved = shift_from_named(talk, text, reply)
        return moved or shift_last(talk, text, Shift(turn.shift, turn.distance_m or BIT_M))
    if act in ("more", "less"):
        return shift_more(talk, text, 1.0 if act == "more" else -1.0, turn.distance_m or BIT_M)
    if act in ("describe", "place"):
        return answer_fragment(talk, text, reply, turn) or (ask_again(talk, text) if state.question else None)
    if act == "drop":
        known = turn.action in {one.query.action for one in state.plan}
        return drop_steps(talk, text, turn.action) if known or turn.is_certain else None
    if act == "room":
        return tell_room(talk, text, reply.rest or text)
    if act == "undo":
        return go_back(talk, text, turn.described(None))
    return _ACTS[act](talk, text) if act in _ACTS else None


def _says_more(talk: Conversation, reply: Reply, turn: Turn) -> bool:
    """Return whether a turn says more than its act, which the grammar reads."""
    act = turn.act
    if act in ("pause", "remark", "cancel"):
        return "meant" in reply.kinds and bool(reply.rest) and not turn.is_certain  # "oh wait, I meant right"
    if act == "other" or (act in ("shift", "more", "less") and reply.leading_shift):
        return _names_place_only(talk, reply.rest)  # "the other van. In front of it", "a bit before it"
    question = talk.state.question
    return question is not None and bool(all_but(talk, reply.rest, question))  # "not the near one"


def _answer_number(talk: Conversation, text: str, reply: Reply, number: int | None) -> Answer | None:
    """Answer a number: of the listed vehicles, else of a row of them: "make it the second"; None without one."""
    if number is None:
        return None
    question = talk.state.question
    listed = question is not None and len(question.alternatives or question.candidates) > 1
    if ((listed and number > 0) or not reply.rest) and not reply.rest.startswith("not "):
        return choose_number(talk, text, number)
    word = next((name for name, position in POSITIONS.items() if position == number), "last" if number < 0 else "")
    return answer_fragment(talk, text, replace(reply, rest=f"the {word} one")) if word else None


def _answer_reply(talk: Conversation, text: str, reply: Reply) -> Answer | None:
    """Answer a number, a shift, a reply without further words, or a question about them; None for what else."""
    state = talk.state
    offered = state.question is not None and not state.question.plan.question
    if reply.number is not None and (not reply.rest or offered):
        named = state.question is None and state.request is not None and state.request.query.distance_m is not None
        return (change_distance if named else choose_number)(talk, text, reply.number)
    if reply.distance_m is not None and reply.kinds[-1] in ("more", "less"):
        return shift_more(talk, text, 1.0 if reply.kinds[-1] == "more" else -1.0, reply.distance_m)
    if reply.shift:
        distance_m = BIT_M if reply.distance_m is None else reply.distance_m
        return shift_last(talk, text, Shift(reply.shift, distance_m))
    last = reply.kinds[-1] if reply.kinds else ""
    if not reply.rest:
        if last in ("room", "seek"):
            return tell_room(talk, text, text)  # "will we fit?", "is there?" after "if there's space"
        return _ACTS[last](talk, text) if last in _ACTS else None
    if last == "why":
        return tell_reasons(talk, text)
    return _ABOUT_WORDS[last](talk, text, reply.rest) if last in _ABOUT_WORDS else None


def _answer(talk: Conversation, text: str, reply: Reply, turn: Turn | None) -> Answer:
    """Answer a sentence that is split into replies and the rest; `turn`: what its reader takes it for."""
    state = talk.state
    turn = turn if turn is not None and turn.act in ("command", "then") else None
    # "Forget that then, go behind the van" begins anew.
    then = ("then" in reply.kinds and "cancel" not in reply.kinds) or (turn is not None and turn.act == "then")
    if turn is not None and turn.act == "then" and turn.is_certain and reply.rest:
        return answer_command(talk, text, reply.rest, then=True, turn=turn)
    if answer := _answer_reply(talk, text, reply):
        return answer
    if not reply.rest:
        return answer_command(talk, text, text, turn=turn)
    if talk.is_opening and not talk.readings(text, talk.antecedent)[0].problem:
        return answer_command(talk, text, text)  # the first sentence stands alone
    reading = talk.read(reply.rest)
    if "without" in reply.kinds and reading.query.action is None:
        reading = talk.read(reply.rest.removeprefix("the "))  # "skip the stop"
    if ("without" in reply.kinds or ("cancel" in reply.kinds and not has_verb(reading))) and reading.query.action:
        return drop_steps(talk, text, reading.query.action)
    if (
        "yes" in reply.kinds
        and reading.query.direction == "around"
        and state.question
        and state.question.plan.question
    ):
        return confirm(talk, text)
    if answer := shift_from_named(talk, text, reply):
        return answer
    if reply.leading_shift and reading.problem:
        if answer := answer_fragment(talk, text, reply):
            return answer
        if state.question is None:
            return shift_last(talk, text, Shift(reply.leading_shift, BIT_M))
    doubted = bool(reading.doubt) and turn is None and state.request is not None
    if doubted and (answer := answer_fragment(talk, text, reply)):
        return answer  # "in front, easier to get out": the verb is that of a reason
    reasoned = bool(reading.problem) and turn is None and reply.kinds[-1:] and reply.kinds[-1] in _BEFORE_REASONS
    if has_verb(reading) and not reasoned:
        edits = "no" in reply.kinds or "meant" in reply.kinds
        return answer_command(talk, text, reply.rest, then, "yes" in reply.kinds, edits, turn)
    if then and not reading.problem and reading.query.relation == "none":
        return answer_command(talk, text, reply.rest, then=True, turn=turn)  # "then behind the van" is another place
    if "other" in reply.kinds and _names_place_only(talk, reply.rest):
        take_other(talk, text)  # "no, the other van. In front of it"
    if answer := answer_fragment(talk, text, reply):
        return answer
    if reasoned:
        return _ACTS[reply.kinds[-1]](talk, text)
    if state.question is not None and state.request is not None and not turn:
        return ask_again(talk, text)
    return answer_command(talk, text, text if reading.problem else reply.rest, turn=turn)


def _names_place_only(talk: Conversation, words: str) -> bool:
    """Return whether words name another place at a vehicle that they do not describe, while a goal is in force."""
    state = talk.state
    if state.goal is None or state.question is not None or state.request is None:
        return False
    placed = complete(words, state.request.query, talk.antecedent, talk.readings)
    return placed is not None and names_pronoun(placed)

"""Answers to one sentence of a conversation: a reply, a change, or a command."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from grounding.answer import Answer
from grounding.dialogue.changes import (
    answer_fragment,
    described_by,
    drop_step_at,
    drop_step_number,
    drop_steps,
    names_place_only,
    refuse_described,
    unknown_one,
)
from grounding.dialogue.choices import (
    choose_middle,
    choose_number,
    choose_offered,
    confirm,
    go_back,
    refuse,
    returns_to_first,
    take_any,
    take_next,
    take_none,
    take_other,
    take_roomiest,
)
from grounding.dialogue.clauses import clauses_of
from grounding.dialogue.commands import answer_command, ask_to_stop, forbids_hindering, keep_clear
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import (
    begins_with_place,
    carries_on,
    goes_onto_pavement,
    has_verb,
    is_understood,
    read_description,
    stops_at_side,
)
from grounding.dialogue.merging import merge_request
from grounding.dialogue.outcomes import insists, is_misunderstood, names_no_place
from grounding.dialogue.places.gaps import take_gap
from grounding.dialogue.places.shifts import (
    BIT_M,
    change_distance,
    move_elsewhere,
    move_in_lane,
    scale_distance,
    shift_from_named,
    shift_last,
    shift_more,
    shift_place,
    usual_shift_m,
)
from grounding.dialogue.plans.waits import stands
from grounding.dialogue.telling.questions import answer_question
from grounding.dialogue.telling.reports import (
    ask_again,
    cancel,
    count,
    keep,
    look_for,
    notice,
    pause,
    remember,
    tell_goal,
    tell_reasons,
    tell_seen,
    tell_vehicle,
)
from grounding.dialogue.telling.room import tell_room
from grounding.dialogue.turns import Turn, read_turn, state_of
from grounding.goal.shift import Shift
from grounding.language import WordCategory
from grounding.language.reader.fields import NONE, unlearnt_qualifiers
from grounding.language.replies import Reply, read_reply
from grounding.query import Query
from grounding.vocabulary import POSITIONS, REFUSED

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
    "remark": remember,
    "pause": pause,
    "any": take_any,
    "roomiest": take_roomiest,
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
# Replies that give up the goal or the question: "neither, keep going".
_GIVING_UP = frozenset(("cancel", "neither"))
# Manoeuvres that only the grammar knows: "a bit faster" is no shift.
_OF_THE_GRAMMAR = (*REFUSED, "faster")
# "Then put me behind the van instead" is no further step.
_INSTEAD = re.compile(r"\b(?:instead|rather)\b(?! of)", re.IGNORECASE)
_OTHER_TURN = re.compile(r"a (left|right)(?: turn)?", re.IGNORECASE)
# How far a movement goes.
_UNTIL_WE = re.compile(r"\b(?:until|till|til|so that|so) (?:we|you|i)(?:'re|'m| are| am)\b", re.IGNORECASE)
# Least probability of a remark at the beginning where the grammar is lost.
_SURE_REMARK = 0.75
# Acts that change where we stand.
_MOVING = ("shift", "more", "place")
# Replies about the words that follow them.
_ABOUT_WORDS: Mapping[str, Callable[[Conversation, str, str], Answer]] = {
    "seek": look_for,
    "count": count,
    "room": tell_room,
}


def answer_sentence(talk: Conversation, text: str) -> Answer:
    """Answer a sentence by the likeliest act if it is certain, else by the grammar, else by the other likely acts."""
    before = talk.state
    if told := answer_question(talk, text):
        return told
    talk.state = before
    if not talk.is_opening and _ends_beside(talk, text):
        return answer_command(talk, text, text)
    reply = read_reply(text, talk.grounder.lexicon)
    # After a goal is dropped, "carry on" agrees with nothing.
    dropped = not talk.is_opening and before.goal is None and before.question is None
    gives_up = not (talk.is_opening or _GIVING_UP.isdisjoint(reply.kinds))
    ends = gives_up or ((stands(before) or dropped) and "then" not in reply.kinds)
    if ends and talk.read(text).query.manoeuvre == "onward":
        onward = reply.rest or (" ".join(clauses_of(talk, text)[-1]) if gives_up else text)
        return answer_command(talk, text, onward)  # "carry on" ends a wait, "neither, keep going" a plan
    if forbids_hindering(talk, reply):
        return keep_clear(talk, text, reply.rest)
    guess = read_turn(talk, text, reply)
    turn = guess if guess is not None and guess.is_sure else None
    answer = _answer_turn(talk, text, reply, turn) if turn else None
    if turn is None and guess is not None and guess.is_change and not talk.is_opening:
        answer = _answer_likely(talk, text, reply, guess)
    plain = reply.rest and {*reply.kinds} <= {"meant"} and not talk.is_opening
    if answer is None and guess is not None and guess.is_chat and plain:
        answer = _answer_likely(talk, text, reply, guess) or keep(talk, text)
    answer = answer or _answer(talk, text, reply, turn)
    if "no" not in reply.kinds and insists(answer, before, talk.state):
        talk.state = before
        return confirm(talk, text)
    if guess is not None and not guess.is_likely_command and before.goal is not None:
        if answer.query.manoeuvre == "onward" and len(answer.steps) < 2 and carries_on(answer.reading):
            talk.state = before
            return confirm(talk, text)  # "do carry on"
        if names_no_place(answer):
            talk.state = before
            return _answer_likely(talk, text, reply, guess) or keep(talk, text)
    if guess is not None and not talk.is_opening and is_misunderstood(answer):
        after, talk.state = talk.state, before
        if likely := _answer_likely(talk, text, reply, guess):
            return likely
        talk.state = after
        if state_of(talk) == "goal" and not guess.is_likely_command:
            return keep(talk, text)
    return answer


def _ends_beside(talk: Conversation, text: str) -> bool:
    """Return whether a turn moves us until we are at a vehicle: "come forward till we're next to it"."""
    reading = talk.read(text) if _UNTIL_WE.search(text) else None
    return reading is not None and reading.query.relation != "none" and is_understood(reading)


def _place_at_end(talk: Conversation, text: str) -> str:
    """Return the last clause of a turn if it names a place at a vehicle: "a bit more ahead, up to behind the van"."""
    clauses = clauses_of(talk, text)
    last = " ".join(clauses[-1]).removeprefix("up to ").removeprefix("to ") if len(clauses) > 1 else ""
    named = last and any(token.category is WordCategory.NOUN for token in talk.read(last).tokens)
    return last if named and begins_with_place(last, talk.readings) else ""


def _answer_likely(talk: Conversation, text: str, reply: Reply, guess: Turn) -> Answer | None:
    """Answer a turn by its likeliest act that succeeds; None if none does."""
    before = talk.state
    if guess.leaves_out and (dropped := drop_step_at(talk, text, guess.leaves_out)):
        return dropped
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
        if act == "about" and turn.best("noun") == NONE and not (named := unknown_one(named, reply.rest)):
            return tell_vehicle(talk, text)
        asked = "" if act == "about" else reply.rest or text  # "what colour is the van" describes none by itself
        return (count if act == "count" else look_for)(talk, text, asked, named)
    if act == "count" and talk.antecedent is not None:
        return count(talk, text, "")  # "how many are there?"
    if talk.is_opening:
        if act in ("describe", "place") and not reply.kinds and talk.readings(text)[0].problem:
            return ask_to_stop(talk, text, reply.rest)
        if act == "remark" and turn.sure >= _SURE_REMARK and _is_lost(talk, text, reply):
            notice(talk, text)
            return keep(talk, text)  # "twelve hours to go, wish me luck"
        return _ACTS[act](talk, text) if act in _WITHOUT_COMMAND else None
    if refused := refuse_described(talk, text, reply.rest):
        return refused
    if reply.leading_shift and act in ("describe", "place") and (moved := shift_from_named(talk, text, reply)):
        return moved  # "nearer the red one"
    reading = talk.read(reply.rest or text)
    if _says_more(talk, text, reply, turn) or reading.query.manoeuvre in _OF_THE_GRAMMAR:
        return None
    if act in _MOVING and state.request is not None and goes_onto_pavement(reading.tokens):
        climbing = merge_request(state.request, Query(text, manoeuvre="pavement"))
        return talk.take(state.with_request(climbing))  # "half up on the pavement": it is refused
    if act == "drop" and (dropped := drop_step_number(talk, text, turn.number)):
        return dropped
    if turn.leaves_out and (dropped := drop_step_at(talk, text, turn.leaves_out)):
        return dropped
    if act == "no" and "cancel" in reply.kinds:
        return cancel(talk, text)
    may_describe = act in ("neither", "previous", "following") or turn.answers_by_description
    if may_describe and (turn.names_vehicle or _names_unlearnt(talk, reply)):
        return answer_fragment(talk, text, reply, replace(turn, act="describe"))  # "neither, she has the van today"
    if act == "number":
        numbered = _answer_number(talk, text, reply, turn.number)
        return numbered or answer_fragment(talk, text, reply, replace(turn, act="describe"))
    if turn.shifts_to_place:
        return answer_fragment(talk, text, reply, replace(turn, act="place"))
    turns = state.request is not None and state.request.query.action == "turn"
    if act == "shift" and turns and (other := _OTHER_TURN.fullmatch(reply.rest)):
        return answer_fragment(talk, text, replace(reply, rest=other[1]))  # "make that a left"
    if act == "shift" and (place := _place_at_end(talk, text)):
        return answer_fragment(talk, text, replace(reply, rest=place), replace(turn, act="place"))
    if act == "shift":
        return shift_place(talk, text, reply, Shift(turn.shift, turn.distance_m or usual_shift_m(talk, text)))
    if act in ("more", "less"):
        return shift_more(talk, text, 1.0 if act == "more" else -1.0, turn.distance_m)
    if gap := take_gap(talk, text, turn):
        return gap
    if act in ("describe", "place"):
        return answer_fragment(talk, text, reply, turn) or (ask_again(talk, text) if state.question else None)
    if act == "drop":
        known = turn.action in {one.query.action for one in state.plan}
        return drop_steps(talk, text, turn.action) if known or turn.is_certain else None
    if act == "room":
        return tell_room(talk, text, reply.rest or text)
    if act == "undo":
        return go_back(talk, text, turn.described(None), turn.number)
    return _ACTS[act](talk, text) if act in _ACTS else None


def _names_unlearnt(talk: Conversation, reply: Reply) -> bool:
    """Return whether a turn describes a vehicle by a word that its reader has not learnt: "the one next to us"."""
    described = read_description(reply.rest, talk.antecedent, talk.readings)
    referent = described.query.referent if described is not None else None
    return referent is not None and bool(unlearnt_qualifiers(referent))


def _is_lost(talk: Conversation, text: str, reply: Reply) -> bool:
    """Return whether the grammar alone would misunderstand a sentence; the state stays as it is."""
    before = talk.state
    lost = is_misunderstood(_answer(talk, text, reply, None))
    talk.state = before
    return lost


def _says_more(talk: Conversation, text: str, reply: Reply, turn: Turn) -> bool:
    """Return whether a turn says more than its act, which the grammar reads."""
    act = turn.act
    if act == "shift":
        return stops_at_side(talk.read(reply.rest or text))  # "drop me 20 metres further on, on the right"
    if act in ("pause", "remark", "cancel"):
        return "meant" in reply.kinds and bool(reply.rest) and not turn.is_certain  # "oh wait, I meant right"
    may_place = act == "other" or (act in ("shift", "more", "less") and reply.leading_shift)
    return bool(may_place) and names_place_only(
        talk, reply.rest
    )  # "the other van. In front of it", "a bit before it"


def _answer_number(talk: Conversation, text: str, reply: Reply, number: int | None) -> Answer | None:
    """Answer a number: of the listed vehicles, else of a row of them: "make it the second"; None without one."""
    if number is None:
        return None
    if (talk.state.lists and number > 0) or not reply.rest:
        return choose_number(talk, text, number)
    word = next((name for name, position in POSITIONS.items() if position == number), "last" if number < 0 else "")
    return answer_fragment(talk, text, replace(reply, rest=f"the {word} one")) if word else None


def _answer_reply(talk: Conversation, text: str, reply: Reply) -> Answer | None:
    """Answer a number, a shift, a reply without further words, or a question about them; None for what else."""
    state = talk.state
    if reply.number == 1 and returns_to_first(talk, text):
        return go_back(talk, text, number=1)
    if reply.number is not None and (not reply.rest or state.lists):
        named = state.question is None and state.request is not None and state.request.query.distance_m is not None
        return (change_distance if named else choose_number)(talk, text, reply.number)
    if reply.distance_m is not None and reply.kinds[-1] in ("more", "less"):
        return shift_more(talk, text, 1.0 if reply.kinds[-1] == "more" else -1.0, reply.distance_m)
    if reply.shift:
        distance_m = usual_shift_m(talk, text) if reply.distance_m is None else reply.distance_m
        return shift_place(talk, text, reply, Shift(reply.shift, distance_m))
    last = reply.kinds[-1] if reply.kinds else ""
    if not reply.rest:
        if last in ("room", "seek"):
            return tell_room(talk, text, text)  # "will we fit?", "is there?" after "if there's space"
        if last == "count" and talk.antecedent is not None:
            return count(talk, text, "")  # "how many are there?"
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
    then = then and not _INSTEAD.search(text)
    if then and turn is not None and turn.act == "then" and turn.is_certain and reply.rest:
        return answer_command(talk, text, reply.rest, then=True, turn=turn)
    if moved := move_in_lane(talk, text, reply):
        return moved
    moves = reply.shift or "elsewhere" in reply.kinds
    if talk.is_opening and moves and not talk.readings(text)[0].problem:
        return answer_command(talk, text, text)  # "forward ten metres": there is no goal yet that it may move
    if answer := _answer_reply(talk, text, reply):
        return answer
    if not reply.rest:
        return answer_command(talk, text, text, turn=turn)
    if talk.is_opening and not talk.readings(text, talk.antecedent)[0].problem:
        return answer_command(talk, text, text)  # the first sentence stands alone
    reading = talk.read(reply.rest)
    if "without" in reply.kinds and reading.query.action is None:
        reading = talk.read(reply.rest.removeprefix("the "))  # "skip the stop"
    given_up = "cancel" in reply.kinds and not has_verb(reading) and reading.query.relation == "none"
    if ("without" in reply.kinds or given_up) and reading.query.action:
        return drop_steps(talk, text, reading.query.action)
    turns = "yes" in reply.kinds and reading.query.direction == "around"
    if turns and state.question and state.question.plan.question:
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
    if "other" in reply.kinds and names_place_only(talk, reply.rest):
        take_other(talk, text)  # "no, the other van. In front of it"
    if answer := answer_fragment(talk, text, reply):
        return answer
    if reasoned:
        return _ACTS[reply.kinds[-1]](talk, text)
    if state.question is not None and state.request is not None and not turn:
        return ask_again(talk, text)
    return answer_command(talk, text, text if reading.problem else reply.rest, turn=turn)

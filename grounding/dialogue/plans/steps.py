"""Steps of a plan as a passenger names them: stops in their order, steps that are dropped or change places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from grounding.answer import Answer
from grounding.dialogue.clauses import JOINING, MARKS, Words, whole_number
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import begins_with_place, has_verb, is_understood, read_description
from grounding.dialogue.merging import names_place
from grounding.dialogue.telling.phrases import describe_goal, said
from grounding.dialogue.telling.reports import cancel, inform
from grounding.language import WordCategory
from grounding.language.replies import named_distance, words_after_opening, words_end
from grounding.language.syntax.phrase_patterns import WORD
from grounding.language.syntax.tokenizer import normalise
from grounding.query import Query, Referent
from grounding.referent.resolver import find_all
from grounding.requests import HOLDING, STOPS, Request, after_turns, requests_of
from grounding.vocabulary import PASSING_ACTIONS, POSITIONS

# Actions that lead around a vehicle.
_PASSING = (*PASSING_ACTIONS, "avoid")
_ARTICLES = ("the", "that", "this", "our", "my", "a", "your")
# Who is dropped at a place.
_PASSENGERS = ("me", "us", "him", "her", "them")
# Positions from the end, and that of a further step.
_LAST, _FURTHER = -1, 0
_ENDS = {"last": _LAST, "final": _LAST, "next": _FURTHER}


def edit_steps(talk: Conversation, text: str) -> Answer | None:
    """Answer a turn that names stops in their order, drops steps or moves them; None for other turns."""
    words = words_after_opening(text, talk.grounder.lexicon)
    # "First drop me at the van" is a first stop only where stops are counted.
    before = _put_before(talk, text, words) if talk.state.steps and not talk.state.counts_stops else None
    if answer := before or _name_stops(talk, text, words):
        return answer
    if not talk.state.steps:
        return None
    edited = (
        _keep_only(talk, text) or _drop(talk, text, words) or _swap(talk, text, words) or _move(talk, text, words)
    )
    return edited or _change_back(talk, text, words)


# What a step is called ----------------------------------------------------------------------------------------------


def _position(words: Words, start: int) -> tuple[int, int] | None:
    """Return the position that words name ("the second", "last", "stop two") and the end of its name."""
    at = start + 1 if words[start : start + 1] and words[start] in _ARTICLES else start
    if not words[at:]:
        return None
    if (number := POSITIONS.get(words[at], _ENDS.get(words[at]))) is not None:
        return number, at + 1
    noun = _noun_end(words, at)
    counted = whole_number(words[noun]) if noun > at and words[noun:] else None
    metres = named_distance(" ".join(words[noun : noun + 2])) is not None  # "stop 10 metres behind the car"
    return (counted, noun + 1) if counted and not metres else None


def _noun_end(words: Words, start: int) -> int:
    """Return the end of a noun for a step; `start` if there is none."""
    return max(words_end("stop", words, start), words_end("step", words, start))


def _counted(steps: Sequence[Request], only_stops: bool) -> list[int]:
    """Return the steps that are counted: the stops, or all but the waits."""
    acts = [step.query.action for step in steps]
    return [i for i, act in enumerate(acts) if (act in STOPS if only_stops else act not in HOLDING)]


def _at_position(steps: Sequence[Request], words: Words) -> list[int] | None:
    """Return the step that words name by its position, none if the plan has no such step; None for other words."""
    number, end = _position(words, 0) or (_FURTHER, 0)
    if number == _FURTHER or words[_noun_end(words, end) :]:
        return None
    only_stops = any(words_end("stop", words, i) > i for i in range(len(words)))
    return _counted(steps, only_stops)[number - 1 if number > 0 else number :][:1]


def _named(talk: Conversation, steps: Sequence[Request], words: Words) -> list[int] | None:
    """Return the steps that words name: "the second stop", "the overtaking", "the van"; None if they name none.

    A list without a step stands for one that the plan has not.
    """
    if not words or any(mark in words for mark in MARKS):
        return None
    if (found := _at_position(steps, words)) is not None:
        return found
    if words_end("remainder", words, 0) == len(words):
        return _counted(steps, only_stops=False)[1:]
    phrase = " ".join(words)
    reading = talk.readings(phrase.removeprefix("the "), None, alone=False)[0]
    query = reading.query
    if query.action is not None and is_understood(reading):
        acts = STOPS if query.action == "stop" else (query.action,)
        same = [i for i, step in enumerate(steps) if step.query.action in acts]
        about = query.referent
        return same if about is None else [i for i in same if _is_about(talk, steps[i], about)]
    end = next((i for i in range(1, len(words)) if words_end("stop", words, i) == len(words)), len(words))
    described = read_description(" ".join(words[:end]), None, talk.readings, whole=True)
    if described is None or described.query.referent is None or described.query.referent.anaphora:
        return None
    named = described.query.referent
    return [i for i, step in enumerate(steps) if _is_about(talk, step, named)]


def _is_about(talk: Conversation, step: Request, named: Referent) -> bool:
    """Return whether a step is about a vehicle as it is described, by the words of the step or by its looks."""
    own = step.query.referent
    if own is None:
        return False
    alike = named.noun in (own.noun, "vehicle") and named.colour in (own.colour, None)
    if alike and {*named.qualifiers} <= {*own.qualifiers}:
        return True
    return step.chosen is not None and any(one.id == step.chosen.item.id for one in find_all(named, talk.scene))


# What is done with steps --------------------------------------------------------------------------------------------


def _tell_missing(talk: Conversation, text: str) -> Answer:
    """Tell that the plan has no such step, and which it has."""
    told = describe_goal(talk.state.goal) if talk.state.goal is not None else ()
    return inform(talk, text, "the plan has no such step: it stays as it is", *told)


def _cut(words: Words) -> tuple[Words, Words]:
    """Return the words before the first mark or conjunction, and those after it."""
    end = next((i for i, word in enumerate(words) if word in JOINING), len(words))
    return words[:end], words[end:]


def _drop(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Drop the steps that a turn gives up: "skip the truck", "cancel the last instruction, the rest stands"."""
    steps = after_turns(talk.state.steps)
    start = words_end("dropping", words, 0)
    named, tail = _cut(words[start or words_end("rejecting", words, 0) :])
    as_stop = any(words_end("stop", named, i) == len(named) for i in range(1, len(named)))
    off = next((i for i in range(len(named)) if words_end("dropped", named, i) == len(named)), None)
    if not named or named == words or (not start and not as_stop) or (words[0] == "take" and off is None):
        return None
    if has_verb(talk.read(" ".join(named))) and named[0] not in _ARTICLES and words[start - 1] != "to":
        return None  # "never mind, just let me out"
    found = _named(talk, steps, named[:off])
    if found is None or (not found and len(steps) == 1 and not talk.state.counts_stops and tail):
        return None
    left = tuple(step for i, step in enumerate(steps) if i not in found)
    while left and left[-1].query.action in HOLDING and left[-1] is not steps[-1]:
        left = left[:-1]  # what was awaited before the step
    if not _keeps(talk, left, tail):
        return None
    if not found:
        return _tell_missing(talk, text)
    return talk.take_steps(text, left) if left else cancel(talk, text)


def _keeps(talk: Conversation, left: Sequence[Request], tail: Words) -> bool:
    """Return whether what is said after a step was given up names a step that is left, or asks for nothing."""
    after = words_after_opening(" ".join(tail), talk.grounder.lexicon)
    if not after or words_end("rest", after, 0) == len(after) or _named(talk, left, after):
        return True
    reading = talk.read(" ".join(after))
    names = any(token.category in (WordCategory.NOUN, WordCategory.COLOUR) for token in reading.tokens)
    return not names and reading.query.action is None


def _keep_only(talk: Conversation, text: str) -> Answer | None:
    """Drop all steps but those that a clause names: "no van today. Only the truck"; None for other turns."""
    steps, words = after_turns(talk.state.steps), tuple(WORD.findall(normalise(text)))
    begins = [i for i in range(len(words)) if _begins_clause(talk, words, i)]
    start = next((i for i in reversed(begins) if words_end("keeping", words, i) > i), None)
    if start is None:
        return None
    before = talk.read(" ".join(words[:start])) if start else None
    if before is not None and not before.problem and names_place(before.query):
        return None  # "park behind the van, just the small one"
    named, tail = _cut(words[words_end("keeping", words, start) :])
    kept = words_after_opening(" ".join(named), talk.grounder.lexicon)
    placed = begins_with_place(" ".join(kept), talk.readings)  # "just opposite it"
    found = None if placed else _named(talk, steps, kept)
    if not found or not _drops_only(talk, tail):
        return None
    if len(_counted(steps, only_stops=False)) == 1 and talk.state.goal is not None and not talk.state.question:
        return inform(talk, text, "the goal stays as it is: it is the only step")
    return talk.take_steps(text, tuple(steps[i] for i in found)) if len(found) < len(steps) else None


def _begins_clause(talk: Conversation, words: Words, at: int) -> bool:
    """Return whether a clause begins at a word, or the words before it only open the sentence: "ok, only the van"."""
    if at == 0 or words[at - 1] in (*JOINING, "so"):
        return True
    opens = not words_after_opening(" ".join(words[:at]), talk.grounder.lexicon)
    return opens and not words_end("keeping", words, 0)  # not the "only" of "keep only the van"


def _drops_only(talk: Conversation, tail: Words) -> bool:
    """Return whether what follows asks for nothing, or gives something up: "only the van, forget the second bit"."""
    while tail and tail[0] in JOINING:
        tail = tail[1:]
    after = words_after_opening(" ".join(tail), talk.grounder.lexicon)
    drops = any(words_end(kind, after, 0) for kind in ("dropping", "rejecting"))
    return not after or drops or words_end("nothingelse", after, 0) == len(after)


def _swap(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Swap two steps: "swap the first and the second", "swap them"."""
    steps, named = talk.state.steps, words[words_end("swapping", words, 0) :]
    if named == words or not named:
        return None
    if words_end("both", named, 0) == len(named):
        pair = _counted(steps, only_stops=False)
        if len(pair) != 2:
            return inform(talk, text, "say which two steps are to be swapped: the plan stays as it is")
    else:
        joint = next((i for i, word in enumerate(named) if word in ("and", "with")), 0)
        found = [_named(talk, steps, part) for part in (named[:joint], named[joint + 1 :])]
        if None in found:
            return None
        pair = [at for each in found for at in each or ()]
        if len(pair) != 2 or pair[0] == pair[1]:
            return _tell_missing(talk, text)
    order = list(steps)
    order[pair[0]], order[pair[1]] = steps[pair[1]], steps[pair[0]]
    return talk.take_steps(text, order)


def _move(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Make a step the first or the last one: "do the truck first"."""
    steps = talk.state.steps
    words, tail = _cut(words)
    end = _ENDS.get(words[-1], POSITIONS.get(words[-1])) if words else None
    found = _named(talk, steps, words[words_end("visiting", words, 0) : -1]) if end in (1, _LAST) else None
    if not found or len(found) > 1 or len(steps) < 2 or not _keeps(talk, steps, tail):
        return None
    others = [step for i, step in enumerate(steps) if i not in found]
    moved = steps[found[0]]
    return talk.take_steps(text, [moved, *others] if end == 1 else [*others, moved])


def _change_back(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Go back to our lane after a change of lane, or after passing a vehicle; None after other steps."""
    last, goal = talk.state.steps[-1], talk.state.goal
    returns = bool(words) and words_end("return", words, 0) == len(words)
    passes = any(step.query.action in _PASSING for step in talk.state.steps)
    if returns and passes and last.query.manoeuvre == "onward" and goal is not None:
        return inform(talk, text, "the goal stays as it is: it is back in our lane")
    if returns and last.query.action in _PASSING and "lane" in words:
        query = Query(text, "other", ("other",), manoeuvre="onward")
        return talk.take((*talk.state.steps, Request(reading=last.reading.with_query(query))))
    side = last.query.direction
    if side is None and goal is not None and goal.target is not None:
        side = "left" if goal.target.ego_m[1] > 0 else "right"
    if last.query.action != "change_lane" or side is None or not returns:
        return None
    query = Query(text, "change_lane", ("change_lane",), direction="left" if side == "right" else "right")
    return talk.take((*talk.state.steps, Request(reading=last.reading.with_query(query))))


# Stops in their order -----------------------------------------------------------------------------------------------


def _name_stops(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Put stops that are named in their order into the plan: "second stop behind the truck"; None for other turns."""
    numbered = (
        i for i in range(len(words) - 1) if whole_number(words[i]) and words_end("stop", words, i + 1) > i + 1
    )
    if next(numbered, None) is not None:
        talk.state = replace(talk.state, counts_stops=True)  # "three stops"
    steps = talk.state.steps
    for number, place in _stops_in(words, talk):
        requests = _stop_at(talk, text, place)
        if requests is None:
            return None
        stops = _counted(steps, only_stops=True)
        at = stops[number - 1] if 0 < number <= len(stops) else len(steps)
        steps = (*steps[:at], *requests, *steps[at + 1 :])
    if steps == talk.state.steps:
        return None
    talk.state = replace(talk.state, counts_stops=True)
    return talk.take(steps)


def _stops_in(words: Words, talk: Conversation) -> Iterator[tuple[int, Words]]:
    """Yield position and place of each stop that is named."""
    begins = [0, *(i + 1 for i, word in enumerate(words) if word in JOINING)]
    marks = [(i, *found) for i in begins if (found := _stop_number(words, i, talk))]
    for (_, number, start), end in zip(marks, [*(mark[0] for mark in marks[1:]), len(words)], strict=False):
        place = words[start:end]
        while place and place[-1] in JOINING:
            place = place[:-1]
        if place:
            yield number, place


def _stop_number(words: Words, start: int, talk: Conversation) -> tuple[int, int] | None:
    """Return the position of a stop that is named from a word on, and the beginning of its place; None if none is."""
    state = talk.state
    start = words_end("visiting", words, start)
    found = _position(words, start)
    if found is None:
        return None
    number, end = found
    noun = words_end("stop", words, end)
    by_noun = noun > end or any(words_end("stop", words, i) > i for i in range(start, end))
    at = noun if by_noun else words_end("step", words, end)
    if words[at : at + 1] and words[at] in _PASSENGERS:
        return None  # "first drop me at the van": a verb, and no first drop
    place = max(words_end("being", words, at), at + (words[at : at + 1] == (",",)))
    # "The second one" may be a vehicle, unless the stops are counted or "is" follows.
    follows = number == len(_counted(state.steps, only_stops=True)) + 1 > 1 and place > at
    which = state.question is not None and len(state.question.candidates) > 1
    return (number, place) if by_noun or state.counts_stops or (follows and not which) else None


def _stop_at(talk: Conversation, text: str, place: Words) -> tuple[Request, ...] | None:
    """Return the steps of a stop at a place, or of the command that its words are; None if they are neither."""
    phrase = " ".join(place)
    begins = begins_with_place(phrase, talk.readings)
    command = f"stop {phrase}" if begins else phrase if has_verb(talk.read(phrase)) else f"stop by {phrase}"
    readings = talk.readings(command, talk.antecedent, alone=False)
    if readings[0].problem or readings[0].doubt or not names_place(readings[0].query):
        return None
    return requests_of(said(talk.grounder.best_answer(readings).reading, text))


def _put_before(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Put a stop before the last place of the plan: "but first drop me at the van"; None for other turns."""
    start = max(words_end("beforehand", words, 0), words_end("beforethat", words, 0))
    ends = (i for i in range(1, len(words)) if words_end("beforehand", words, i) == len(words))
    end = next((i for i in ends if words[i - 1] not in _ARTICLES), len(words))  # but not "stop at the first"
    stop = words[start:end]
    if stop == words:
        return None  # "but stop before the van" is another place, and none on the way
    while stop and stop[0] in JOINING:
        stop = stop[1:]
    requests = _stop_on_the_way(talk, text, stop) if stop else None
    if requests is None:
        return None
    *earlier, last = talk.state.steps
    return talk.take((*earlier, *requests, last))


def _stop_on_the_way(talk: Conversation, text: str, words: Words) -> tuple[Request, ...] | None:
    """Return the step of a stop that words command, or tell as a wish: "I have to get something at the van"."""
    phrase = " ".join(words)
    if words[0] in _ARTICLES or begins_with_place(phrase, talk.readings):
        return _stop_at(talk, text, words)
    reading = talk.read(phrase)
    reading = reading if is_understood(reading) else talk.readings(phrase)[0]
    query = reading.query
    calls = query.action == "drive_past" and query.relation == "near"  # "swing by the van"
    if reading.problem or len(reading.steps) > 1 or not (calls or query.action in STOPS):
        return None
    steps = requests_of(said(replace(reading, doubt=""), text))
    return tuple(replace(one, reading=one.reading.with_query(_as_stop(one.query))) for one in steps)


def _as_stop(query: Query) -> Query:
    """Return the query of a stop: who swings by the van stops there."""
    return query if query.action in STOPS else replace(query, action="stop", actions=("stop",))

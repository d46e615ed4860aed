"""Turns that only rule out a place at something beside the road: "but not on the crossing"; the goal is kept."""

from __future__ import annotations

from grounding.answer import Answer
from grounding.dialogue.clauses import MARKS, Words, is_phrase
from grounding.dialogue.commands import keep_clear
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import begins_with_place, complete, is_understood, names_pronoun
from grounding.dialogue.merging import merge_request
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import inform
from grounding.language import WordCategory
from grounding.language.replies import words_after_opening, words_end
from grounding.query import Exclusion, Query
from grounding.requests import Request
from grounding.vocabulary import KNOWN_NOUNS, LANDMARK_KINDS, Relation

# Words of turns that say more than one thing, or until when.
_JOINED = frozenset((*MARKS, "and", "until", "till"))
# Categories of words for what stands beside the road, or is a part of it.
_THINGS = (WordCategory.THING, WordCategory.REGION)


def answer_exclusion(talk: Conversation, text: str) -> Answer | None:
    """Plan the goal in force away from what a turn rules out, or tell that it is not known; None for other turns."""
    state, words = talk.state, words_after_opening(text, talk.grounder.lexicon)
    words = words[words[:1] == ("but",) :]
    if state.goal is None or state.question is not None or state.request is None or not _JOINED.isdisjoint(words):
        return None
    if named := _hindered(talk, words):
        return keep_clear(talk, text, " ".join(named))
    if limited := _limited(talk, text, words):
        return limited
    if (refused := _refused_place(talk, words, state.request)) is not None:
        told = "say where else" if refused == state.request.query.relation else "it is not there"
        return inform(talk, text, f"the goal stays as it is: {told}")
    excluded = _ruled_out(talk, words)
    if not excluded or any(one.noun in KNOWN_NOUNS for one in excluded):
        return None
    unknown = [one.noun.replace("_", " ") for one in excluded if not _is_known(talk, one)]
    if unknown:
        return inform(talk, text, f"no {unknown[0]} is known here: the goal stays as it is")
    return talk.take(state.with_request(merge_request(state.request, Query(text, excluded=excluded))))


def _limited(talk: Conversation, text: str, words: Words) -> Answer | None:
    """Keep a goal that is not beyond what a turn forbids to pass, else stop short of that; None for other turns."""
    said_alone, goal, road = " ".join(words), talk.state.goal, talk.scene.road
    readings = (talk.readings(said_alone, alone=False)[0], talk.read(said_alone))
    reading = next((one for one in readings if one.query.limit and is_understood(one)), None)
    if reading is None or goal is None or road is None:
        return None
    meant = talk.meant if names_pronoun(reading) else None
    step = Request(reading=said(reading, text), chosen=meant)
    short = talk.answer_steps([step]).target
    if short is not None and goal.target is not None:
        ours_m, limit_m = (road.ego_lane.project(one.ego_m)[0] for one in (goal.target, short))
        if ours_m <= limit_m + road.style.stop_gap_m:
            return inform(talk, text, "the goal stays as it is: it is not beyond that")
    return talk.take([step])


def _hindered(talk: Conversation, words: Words) -> Words:
    """Return the words for the vehicle or person that a clause forbids to hinder: "don't box the van in"."""
    start = words_end("hindering", words, 0)
    named = words[start:]
    if named and is_phrase("particle", named[-1:]):
        named = named[:-1]
    if not (start and named):
        return ()
    reading = talk.read(f"stop behind {' '.join(named)}")
    return named if is_understood(reading) and reading.query.referent is not None else ()


def _refused_place(talk: Conversation, words: Words, request: Request) -> Relation | None:
    """Return the place at the vehicle in force that a clause only refuses: "not behind it"; None for others."""
    start = words_end("elsewherethan", words, 0)
    where = " ".join(words[start:])
    if not start or words_end("tooclose", words, 0) or not begins_with_place(where, talk.readings):
        return None  # "not too close to it"
    placed = complete(where, request.query, talk.antecedent, talk.readings)
    named = placed is not None and names_pronoun(placed) and placed.query.relation != "none"
    return placed.query.relation if placed is not None and named else None


def _is_known(talk: Conversation, one: Exclusion) -> bool:
    kind, road = LANDMARK_KINDS.get(one.noun), talk.scene.road
    return kind is not None and road is not None and road.landmarks.knows(kind)


def _ruled_out(talk: Conversation, words: Words) -> tuple[Exclusion, ...]:
    """Return the places that a clause rules out; none if it says anything else."""
    if start := words_end("hindering", words, 0):
        words = ("don't", "stop", "in", "front", "of", *words[start:])
    elif start := words_end("elsewherethan", words, 0):
        words = ("don't", "stop", *words[start:])
    reading = talk.read(" ".join(words))
    query = reading.query
    says_more = query.referent or query.secondary or query.direction or query.manoeuvre or query.distance_m
    forbids = bool(reading.tokens) and reading.tokens[0].category is WordCategory.NOT
    things = any(token.category in _THINGS for token in reading.tokens)
    if not (forbids and things) or not is_understood(reading) or query.relation != "none" or says_more:
        return ()
    return query.excluded if all(one.relation is not None for one in query.excluded) else ()

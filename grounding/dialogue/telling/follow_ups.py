"""Questions that take what they lack from the question before: "and behind us?", "I mean the red ones"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import has_verb
from grounding.dialogue.telling.things import NAMING
from grounding.dialogue.turns import names_command
from grounding.language import WordCategory
from grounding.language.questions import FurtherWords, Question, read_further_words
from grounding.language.syntax.tokenizer import Token

# Kinds that tell what is there: other words for it correct the question, and not the command in force.
_LISTING = ("exists", "which", "what", "count", "place", "coming", "people")
# Kinds that other words ask again of other things.
_ASKED_AGAIN = (
    *(*_LISTING, "distance", "measured", "size", "description", "facing", "moving", "standing", "pace"),
    *("room", "spot", "gap", "tight", "between"),
)
# Kinds that are about the words of their own sentence alone.
_OF_ITS_WORDS = ("people", "kerb", "beside", "else", "together", "there", "slow")
# "The one after that" is beyond it, and not later.
_AFTER = re.compile(r"\bafter\b")
_PLACING = (WordCategory.RELATION, WordCategory.WHERE, WordCategory.SIDE, WordCategory.SUB)  # also "before it"
_COUNTED = (WordCategory.SUPERLATIVE, WordCategory.ORDINAL)
_NAMED = (*NAMING, WordCategory.ONE, *_COUNTED)
_SKIPPED = (WordCategory.THE, WordCategory.ANY, WordCategory.AUX, WordCategory.EXISTS, WordCategory.BE)


def follow_up(talk: Conversation, text: str) -> Question | None:
    """Return the question before with other words in it; None for a sentence that follows up no question."""
    last = talk.last_told
    further = read_further_words(text, talk.grounder.lexicon) if last is not None and not talk.state.lists else None
    if last is None or further is None or (further.instead and talk.state.goal is not None):
        return None
    if names_command(talk.read(text)):
        return None  # "wait for him"
    if further.bare and (talk.state.request is not None or talk.state.question is not None):
        return None  # it changes what was asked for
    words = _AFTER.sub("beyond", further.words)
    further = replace(further, words=f"{words} it" if words.endswith(" beyond") else words)
    read = talk.read(further.words)
    if has_verb(read) or any(one.category is WordCategory.UNKNOWN for one in read.tokens):
        return None
    categories = [one.category for one in read.tokens]
    placed, named = any(one in _PLACING for one in categories), any(one in _NAMED for one in categories)
    of_goal = talk.state.goal is not None and (further.corrects or further.proposes)
    if not (placed or named) or (of_goal and last.question.kind not in _LISTING):
        return None  # it changes the goal
    if last.question.kind not in _ASKED_AGAIN:
        return Question(("what",), further.words) if named else None
    words = _fill(talk, further, last.question, read.tokens)
    if last.question.kind in _LISTING and any(one in _COUNTED for one in categories):
        return Question(("which",), words)
    kept = ("people",) if not any(one in NAMING for one in categories) else ()  # "I mean on the left"
    kinds = tuple(
        one for one in last.question.kinds if one not in _OF_ITS_WORDS or one in kept or one == last.question.kind
    )
    return replace(last.question, kinds=kinds, words=words, options=(), event=False)


def _fill(talk: Conversation, further: FurtherWords, before: Question, tokens: Sequence[Token]) -> str:
    """Return words with what they lack: the noun, the place, and the thing that the place is at."""
    old = talk.read(before.words).tokens if before.words else ()
    at = next((i for i, one in enumerate(old) if one.category in _PLACING), len(old))
    head = [one for one in old[:at] if one.category not in _SKIPPED]
    # "And behind it?" is no other blue car; people are told of by their own question.
    at_it = any(one.category in (WordCategory.PRONOUN, WordCategory.THAT) for one in tokens)
    no_head = at_it or "people" in before.kinds or any(one.category is WordCategory.ONE for one in head)
    head_words = "" if no_head else " ".join(one.text for one in head)
    noun = next((one.text for one in head if one.category in (WordCategory.NOUN, WordCategory.PERSON)), "vehicles")
    words = _with_landmark(further.words.replace("to the ", "on the "), tokens, old[at:])
    counted = any(one.category in _COUNTED for one in tokens)
    # "And the white ones?" are among those that were told.
    among = any(one.category is WordCategory.THE for one in tokens[:1]) and "ones" in words.split()
    if (further.corrects or among) and old[at:] and not (counted or any(one.category in _PLACING for one in tokens)):
        words = f"{words} {' '.join(one.text for one in old[at:])}"
    if any(one.category in NAMING and one.category is not WordCategory.COLOUR for one in tokens):
        return words
    if any(one.category is WordCategory.ONE for one in tokens):
        return " ".join(noun if one == "ones" else one for one in words.split())
    if counted:
        return f"{further.words} one"
    if any(one.category is WordCategory.COLOUR for one in tokens):
        return f"{further.words} {noun}"
    return f"{head_words} {words}".strip()


def _with_landmark(words: str, tokens: Sequence[Token], place: Sequence[Token]) -> str:
    """Return a place at the thing that the place before was at: "in front of it" after "behind the van"."""
    (first, *others) = tokens
    points = all(one.category in (WordCategory.PRONOUN, WordCategory.THAT, WordCategory.ONE) for one in others)
    if first.category not in (WordCategory.RELATION, WordCategory.WHERE) or not points:
        return words
    if place and place[0].category is WordCategory.RELATION and len(place) > 1:
        relation = "in front of" if first.text == "in front" else first.text
        return f"{relation} {' '.join(one.text for one in place[1:])}"
    return f"{words} us" if first.category is WordCategory.RELATION and not others else words

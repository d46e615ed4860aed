"""Fragments and run-on sentences: commands without the verb or the mark that would show them.

A place or a direction without a verb is a command, because it can be nothing else; a verb in its base form after a
complete statement begins a sentence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import HEADS, WordCategory

# Categories with which a sentence is no fragment.
_PREDICATES = frozenset(
    (
        WordCategory.VERB,
        WordCategory.NONDRIVE,
        WordCategory.MEANWHILE,
        WordCategory.EGO,
        WordCategory.BE,
        WordCategory.AUX,
        WordCategory.EXISTS,
        WordCategory.QUESTION,
        WordCategory.CORRECT,
    )
)
# Categories of "is fine", "would be great".
_PRAISE = (WordCategory.BE, WordCategory.AUX)
# Categories that may end a sentence.
_ENDS = HEADS | frozenset(
    (
        WordCategory.PRONOUN,
        WordCategory.SIDE,
        WordCategory.WHERE,
        WordCategory.HERE,
        WordCategory.THERE,
        WordCategory.COLOUR,
        WordCategory.ORDINAL,
        WordCategory.STATE,
        WordCategory.VERB,
        WordCategory.SUPERLATIVE,
    )
)
# Names of things that may be a vehicle and the verb of the next sentence: "I see the car | park behind it".
_COMPOUNDS = ("car park", "truck stop", "bus stop")
_NO_PLACES = ("with", "for")
_MARKS = (WordCategory.COMMA, WordCategory.BREAK)
_JOINTS = (*_MARKS, WordCategory.AND, WordCategory.THEN)
# Categories of places at something, and relations that are none.
_PLACES = (WordCategory.RELATION, WordCategory.BETWEEN)
_AS_PLACES = ("after", "before")
_ANYWHERE = ("anywhere", "everywhere")
_WEAK = ("in", "into", "on", "along", "with", "for")
# Categories of what a place may be at, and words that praise it.
_TOPICS = (WordCategory.NOUN, WordCategory.MODEL, WordCategory.SPOT)
_PRAISES = ("better", "best", "safer", "nicer", "easier", "good", "preferable")
# Categories of words that tell which spot.
_WHICH_SPOT = (WordCategory.ANY, WordCategory.SUPERLATIVE, WordCategory.ORDINAL)
# Regions that branch off, and categories after a lane that is all a sentence names.
_BRANCHES = ("road", "turn", "exit", "driveway", "corner")
_AFTER_LANE = (WordCategory.NOT, WordCategory.EXCEPT)


def complete_fragment(tagged: Sequence[Token], verb: str = "") -> Sequence[Token]:
    """Return the tagged tokens of a sentence with the verb that a fragment implies; other sentences as they are.

    Examples: "beside the blue one" and "any gap on the left is fine" imply to park, "right" to turn.

    Args:
        tagged: tokens of the sentence.
        verb: verb class that a fragment has from the command before it; '': it has to imply one itself.
    """
    words = [token for token in tagged if token.category not in _MARKS]
    if not words:
        return tagged
    first, *rest = words
    if _passes_first(tagged):
        return [_verb_before(first, "go"), *tagged]
    if verb:
        has_verb = any(token.category in _PREDICATES for token in words)
        return tagged if has_verb else [_verb_before(first, verb), *tagged]
    if first.category is WordCategory.DIRECTION and not rest and first.value != "straight":
        return [replace(_verb_before(first, f"turn {first.value}"), end=first.end)]
    if all(token.category is WordCategory.DISTANCE or token.value == "straight" for token in words) and (
        WordCategory.DISTANCE in (token.category for token in words)
    ):
        return [_verb_before(first, "go"), *tagged]  # "ten metres more", "forward fifteen"
    if _names_branch(words):
        return [_verb_before(first, "take"), *tagged]
    if first.category is WordCategory.LANE and (not rest or rest[0].category in _AFTER_LANE):
        return [_verb_before(first, "get"), *tagged]
    if _names_any_spot(words) or _names_any_place(words):
        ends = [i for i, token in enumerate(tagged) if token.category in _PRAISE]
        return [_verb_before(first, "park"), *tagged[: ends[0] if ends else len(tagged)]]
    near = [token.category for token in words[:2]] == [WordCategory.NOT, WordCategory.RELATION]
    if near and words[0].start == words[1].start:
        return [_verb_before(first, "avoid"), *words[2:]]  # "not so close to the bus"
    passed = near and words[1].value == "past" and not any(token.category is WordCategory.VERB for token in rest)
    if passed:
        return [first, _verb_before(words[1], "go"), *words[1:]]  # "no further than the van"
    if any(token.category in _PREDICATES for token in words) or not any(token.category in HEADS for token in rest):
        return tagged
    begins = rest[0] if first.category is WordCategory.DISTANCE else first  # "two metres behind the bus"
    place = begins.category in (WordCategory.RELATION, WordCategory.BETWEEN) and begins.value not in _NO_PLACES
    place = place or (first.category is WordCategory.SUB and first.value in _AS_PLACES)
    sided = first.category in (WordCategory.SIDE, WordCategory.WHERE)  # "left side, after the bus"
    place = place or (sided and any(token.category in (WordCategory.RELATION, WordCategory.SUB) for token in rest))
    return [_verb_before(first, "park"), *tagged] if place else tagged


def split_run_ons(tagged: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the tokens with the end of a sentence before each verb that may begin one, the first verb first.

    Example: "there is a van ahead | park behind it". Questions are left whole: "did the van stop".
    """
    for i, token in enumerate(tagged):
        if token.category is WordCategory.QUESTION:
            return
        if token.text in _COMPOUNDS and i + 1 < len(tagged) and tagged[i + 1].category is WordCategory.RELATION:
            noun, verb = token.text.split()
            vehicle = replace(token.with_category(WordCategory.NOUN, noun), text=noun)
            first = replace(token.with_category(WordCategory.VERB, verb), text=verb)
            yield [*tagged[:i], vehicle, _end_before(first), first, *tagged[i + 1 :]]
        begins = token.category is WordCategory.VERB and not token.form and token.value not in ("none", "danger")
        if begins and i > 1 and tagged[i - 1].category in _ENDS:
            yield [*tagged[:i], _end_before(token), *tagged[i:]]


def complete_last_sentence(tagged: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the tokens with a verb before a place at a vehicle named before: "see the grey jeep? | behind that"."""
    end = max((i for i, token in enumerate(tagged[:-1]) if token.category is WordCategory.BREAK), default=None)
    if end is None or not any(token.category in _TOPICS for token in tagged[:end]):
        return
    place = [token.category for token in tagged[end + 1 : end + 3]]
    refers = place in ([WordCategory.RELATION, WordCategory.PRONOUN], [WordCategory.RELATION, WordCategory.THAT])
    if refers or place[:1] == [WordCategory.THERE]:
        yield [*tagged[: end + 1], _verb_before(tagged[end + 1], "park"), *tagged[end + 1 :]]


def drop_opinion(tagged: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the tokens without praise of what follows: "it is better when | we park behind the bus"."""
    for i, token in enumerate(tagged[:-2]):
        praised = i > 0 and tagged[i - 1].text in _PRAISES and tagged[i + 1].category is WordCategory.EGO
        if token.category is WordCategory.SUB and praised and any(one.category in _TOPICS for one in tagged[i:]):
            yield list(tagged[i + 1 :])


def _end_before(token: Token) -> Token:
    return replace(token.with_category(WordCategory.BREAK), text=".", written="", end=token.start)


def _passes_first(tagged: Sequence[Token]) -> bool:
    """Return whether a command begins past something and then names a place: "past the van and stop by the bus"."""
    begins = tagged[0].category is WordCategory.RELATION and tagged[0].value == "past"
    verb = next((i for i, token in enumerate(tagged) if token.category in _PREDICATES), 0)
    joined = verb > 1 and tagged[verb].category is WordCategory.VERB and tagged[verb - 1].category in _JOINTS
    clause = takewhile(lambda token: token.category not in _JOINTS, tagged[verb + 1 :])
    placed = any(_is_place(token) for token in clause)
    return begins and joined and placed and any(one.category in HEADS for one in tagged[1:verb])


def _is_place(token: Token) -> bool:
    """Return whether a word places something: "behind", "between", "before"."""
    if token.category is WordCategory.SUB:
        return token.value in _AS_PLACES
    return token.category in _PLACES and token.value not in _WEAK


def _names_branch(words: Sequence[Token]) -> bool:
    """Return whether words name a side road by order and side: "the second street left"."""
    named = [token for token in words if token.category is not WordCategory.THE][:3]
    order = (WordCategory.ORDINAL, WordCategory.BRANCH)
    return (
        len(named) == 3
        and named[0].category in order
        and named[1].value in _BRANCHES
        and named[2].category in (WordCategory.DIRECTION, WordCategory.SIDE)
    )


def _names_any_spot(words: Sequence[Token]) -> bool:
    """Return whether words name a spot and at most call it good: "any gap on the left is fine", "nearest space"."""
    begins = words[0].category in _WHICH_SPOT or (len(words) > 1 and words[1].category in _WHICH_SPOT[1:])
    return begins and any(token.category is WordCategory.SPOT for token in words[1:4]) and _only_praises(words)


def _names_any_place(words: Sequence[Token]) -> bool:
    """Return whether words leave a place open but for its side or vehicle: "somewhere on the left after the bus"."""
    if words[0].category is WordCategory.EXCEPT and words[0].text.startswith(_ANYWHERE):
        return len(words) > 1 and words[1].category in _PLACES and _only_praises(words)  # "anywhere but behind it"
    places = (*_PLACES, WordCategory.SUB, WordCategory.SIDE)
    begins = words[0].category is WordCategory.HERE and not words[0].value
    placed = len(words) > 2 and words[1].category in places and any(one.category in HEADS for one in words[2:])
    return begins and placed and _only_praises(words)


def _only_praises(words: Sequence[Token]) -> bool:
    """Return whether words have no predicate, or end with praise: "is fine"."""
    predicates = [i for i, token in enumerate(words) if token.category in _PREDICATES]
    praises = all(words[i].category in _PRAISE for i in predicates)
    return not predicates or (praises and len(words) <= predicates[-1] + 2)


def _verb_before(token: Token, value: str) -> Token:
    """Return the token of an implied verb."""
    verb = token.with_category(WordCategory.VERB, value)
    return replace(verb, text=value, written="", end=token.start)

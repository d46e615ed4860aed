"""Fragments: sentences without a verb, completed by the command before ("in front of it", "the red one")."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

from grounding.language import Reading, WordCategory
from grounding.language.replies import with_superlatives
from grounding.language.syntax.noun_phrases import NounPhrase, chunk
from grounding.language.syntax.tokenizer import Token, normalise
from grounding.query import Query, Referent
from grounding.requests import STOPS

# The reader of sentences: text, antecedent and verb to readings, best first.
Reader = Callable[[str, Referent | None, str], tuple[Reading, ...]]

# Ways to complete a fragment to a command about a vehicle; the first that is understood counts.
_PHRASES = ("follow {}", "follow the {}", "follow the one {}", "follow the one on the {}", "follow the {} one")
# Ways to complete a fragment to a place: "behind" is behind the vehicle that was spoken of.
_PLACES = ("{}", "{} it", "{} of it")
# Marks between the parts of a sentence, and words that begin a reason.
_MARK = re.compile(r"[,.;!?]|\b(?:if|as|because|'?cause|cos|coz|cuz|since|so)\b")
# Verb class of each action, to complete a fragment with a relation or a side; of the others it is the action.
_VERBS = {
    "follow": "stay",
    "approach": "go",
    "drive_past": "drive",
    "give_way": "stop",
    "slow_down": "stop",
    "avoid": "go",
    "other": "go",
}
# Actions of a verb that names none of its own: "go in front of it" keeps the action before.
_LIGHT_ACTIONS = ("other", "approach", "drive_past")
# "with people standing by it", "it has a van in front", and relations that are others from the neighbour's side.
_NEIGHBOUR = re.compile(
    r"(?:\bwith|\bthat has|\bthat's got|\bwhich has|\bwho has|\bhaving|\b(?<=one )have"
    r"|^(?:it|he|she) has|^(?:(?:it|he|she)'s )?got|^there's|^there is) (?P<neighbour>.+?)"
    r"(?: (?:standing|parked|sitting|waiting|right|just))*"
    r" (?:(?P<relation>next to|beside|by|near|close to|behind|in front of|ahead of|left of|right of|opposite)"
    r" (?:it|him|her|them)\b|(?P<alone>behind|in front|ahead|close by|nearby)$)"
)
# "The one closer to the bus", "nearer the bus".
_NEARER = re.compile(r"\b(?:closer|closest|nearer|nearest) (?:to )?(?=(?:the|that|this|my|your|our) (?!left|right))")
# Verbs before a description: "take the one with the bus behind it".
_CHOOSING = re.compile(
    r"^(?:(?:just|please|then|let's|i'll|we'll) )*(?:take|pick|choose|use|go (?:for|with)) (?=the |that |one )"
)
_TURNED = {
    "behind": "in front of",
    "in front of": "behind",
    "ahead of": "behind",
    "left of": "right of",
    "right of": "left of",
}
# Relations of a neighbour whose other end is left out: "with a van in front".
_WHOLE = {"in front": "in front of", "ahead": "ahead of", "close by": "near", "nearby": "near"}
_PLACE_ACTIONS = ("park", "stop", "pull_over", "wait")
# Most ways to divide a fragment into a vehicle and a place that are tried.
_MOST_CUTS = 12
# Most parts of a fragment: each is left out in turn, so that the time grows with their square.
_MOST_PARTS = 8
_VERB_CATEGORIES = (WordCategory.VERB, WordCategory.NONDRIVE, WordCategory.MEANWHILE)


def carries_on(reading: Reading) -> bool:
    """Return whether a command only says "carry on", which agrees with a goal; "keep driving" gives it up."""
    query = reading.query
    named = query.referent is not None or query.relation != "none" or len(reading.steps) > 1
    return not named and any(token.text == "carry on" for token in reading.tokens)


def goes_onto_pavement(tokens: Sequence[Token]) -> bool:
    """Return whether some words name no person, and a place on the pavement."""
    named = [one for one in tokens if one.category is not WordCategory.THE]
    on_foot = any(one.category is WordCategory.PERSON for one in tokens)
    after = [*named[2:], None]
    onto = (  # but not "on the pavement side"
        one.value == "on" and thing.value == "sidewalk" and not (then and then.text == "side")
        for (one, thing), then in zip(pairwise(named), after, strict=False)
    )
    return not on_foot and any(onto)


def only_named(tokens: Sequence[Token]) -> Referent | None:
    """Return the only vehicle or person that some words name: "I'd have that lady in red in the back already".

    A friend who is not seen is none: "my friend lives by the silver van".
    """
    ours = {one.start for one in tokens if one.category is WordCategory.POSSESSIVE}
    named = [one for one in chunk(tokens) if isinstance(one, NounPhrase)]
    seen = [one for one in named if one.kind == "vehicle" or (one.kind == "person" and one.start not in ours)]
    phrases = seen or [one for one in named if one.kind == "person"]
    if len(phrases) != 1:
        return None
    (one,) = phrases
    return Referent(one.noun, one.head, one.colour, tuple(one.qualifiers), definite=one.definite, clothes=one.clothes)


def has_verb(reading: Reading) -> bool:
    """Return whether a sentence has a verb in its base form ("stop", not "the parked one") or is a question."""
    return any(map(_is_base_verb, reading.tokens)) or _is_question(reading)


def _is_base_verb(token: Token) -> bool:
    return token.category in _VERB_CATEGORIES and not token.form


def _is_question(reading: Reading) -> bool:
    return any(token.category is WordCategory.QUESTION for token in reading.tokens)


def names_pronoun(reading: Reading) -> bool:
    """Return whether the referent is named by a pronoun only ("it", "that one"), or left out ("stay behind")."""
    referent = reading.query.referent
    if referent is None or not referent.anaphora:
        return False
    heads = (WordCategory.PRONOUN, WordCategory.ONE, WordCategory.NOUN, WordCategory.ORDINAL, WordCategory.COLOUR)
    verb = next((i for i, token in enumerate(reading.tokens) if _is_base_verb(token)), 0)
    named = [(i, token.category) for i, token in enumerate(reading.tokens) if token.category in heads]
    # "She has left. Then park behind the red one"; "the blue car is hers, get in behind that".
    until = next((at for at, (i, _) in enumerate(named) if i >= verb), len(named))
    return all(category is WordCategory.PRONOUN for _, category in named[: until + 1])


def points(tokens: Sequence[Token]) -> bool:
    """Return whether some words point at something: "go to her", "stop behind that"; "stay behind" does not."""
    pronouns = (WordCategory.PRONOUN, WordCategory.POSSESSIVE)
    demonstratives = (WordCategory.THAT, WordCategory.THE)
    places = (
        one.category is WordCategory.RELATION and then.category in demonstratives for one, then in pairwise(tokens)
    )
    return any(token.category in pronouns for token in tokens) or any(places)


def read_description(text: str, antecedent: Referent | None, read: Reader, *, whole: bool = False) -> Reading | None:
    """Read a fragment as the description of a vehicle: "the closer one", "on the left", "red".

    Args:
        text: the fragment.
        antecedent: what "one" stands for.
        read: the grammar.
        whole: whether no part of the fragment may be left out.

    Returns:
        A reading whose query is partial: it has the vehicle, and neither an action nor a place; None if the fragment
        describes none.
    """
    text = with_superlatives(turn_neighbours(text))
    if _begins_with_event(read(text, None, "")[0]):
        return None
    # With the colour of what was spoken of, the same colour would be a word without effect.
    bare = antecedent and Referent(antecedent.noun, antecedent.head)
    second: Reading | None = None
    for part, meant, phrase in product(
        [text] if whole else _shortened(text), dict.fromkeys((antecedent, bare)), _PHRASES
    ):
        reading = read(phrase.format(_CHOOSING.sub("", part)), meant, "")[0]
        referent = reading.query.referent
        if referent is None or reading.query.relation != "none" or not is_understood(reading):
            continue
        if any(one.category is WordCategory.ORDINAL and one.written not in normalise(part) for one in reading.tokens):
            continue  # "number" is no "number one"
        if not _is_bare(referent, reading):
            found = _with_query(reading, replace(reading.query, action=None, actions=(), landmark=None))
            if not _has_unknown(reading):
                return found
            second = second or found
    return second


def complete(
    text: str, base: Query, antecedent: Referent | None, read: Reader, *, whole: bool = False
) -> Reading | None:
    """Read a fragment with the verb of an earlier command: "in front of it" after "park behind the red car".

    `whole`: whether no part of the fragment may be left out.

    Returns:
        A reading whose query is partial: it has what the fragment names; None if that is no relation, side or
        distance.
    """
    text = with_superlatives(text)
    verb = _VERBS.get(base.action or "stop", base.action or "stop")
    for part, phrase, said in product([text] if whole else _shortened(text), _PLACES, dict.fromkeys((verb, "stop"))):
        reading = read(phrase.format(part), antecedent, said)[0]
        query = reading.query
        if phrase != "{}" and query.excluded:
            continue  # "instead" of nothing
        sides = query.goal_side or query.road_side or query.direction
        gap = query.distance_m is not None and query.distance_of != "descriptor"
        if (query.relation != "none" or sides or gap) and is_understood(reading):
            return _with_query(reading, replace(query, action=None, actions=()))
    return None


def describe_and_place(text: str, base: Query, antecedent: Referent | None, read: Reader) -> Reading | None:
    """Read a fragment of a description and a place of what it describes: "the green car, in front of it".

    Returns:
        A reading whose query is partial: it has the vehicle and the place; None if the fragment has not both.
    """
    parts = _parts(text)
    if len(parts) > _MOST_PARTS:
        return None
    # What comes before and after may be a reason: "I don't trust that. The grey one, behind".
    ends = range(len(parts) + 1)
    cuts = [(start, i, end) for start in ends for i in ends[start + 1 :] for end in reversed(ends[i + 1 :])]
    halves = [(", ".join(parts[start:i]), ", ".join(parts[i:end])) for start, i, end in cuts[:_MOST_CUTS]]
    for named, place in (*halves, *((after, before) for before, after in halves)):
        described = read_description(named, antecedent, read, whole=True)
        if described is None or not names_vehicle(described):
            continue
        placed = complete(place, base, described.query.referent, read, whole=True)
        if placed is not None and names_pronoun(placed) and not placed.query.excluded:
            found = replace(placed.query, referent=described.query.referent, secondary=described.query.secondary)
            return _with_query(placed, found)
    return None


def names_vehicle(described: Reading) -> bool:
    """Return whether a description has a colour, a qualifier or a class of its own, and excludes nothing."""
    referent = described.query.referent
    own = referent is not None and (referent.colour or referent.qualifiers)
    noun = any(token.category is WordCategory.NOUN for token in described.tokens)
    return bool(own or noun) and not described.query.excluded


def _shortened(text: str) -> Iterator[str]:
    """Yield a text, and what is left of it without its last and its first parts: reasons and second thoughts."""
    parts = _parts(text)
    yield text
    for length in range(len(parts) - 1, 0, -1) if len(parts) <= _MOST_PARTS else ():
        yield ", ".join(parts[:length])
        yield ", ".join(parts[-length:])


def _parts(text: str) -> list[str]:
    return [part for found in _MARK.split(text) if (part := found.strip().removesuffix(" then"))]


def _with_query(reading: Reading, query: Query) -> Reading:
    return reading.with_query(query)


def keep_action(reading: Reading, base: Query | None) -> Reading:
    """Return a reading with the action of the command before if its own verb is light: "go in front of it"."""
    query = reading.query
    verbs = [token for token in reading.tokens if token.category is WordCategory.VERB]
    stays = bool(verbs) and verbs[-1].value == "stay"
    if base is None or base.action not in _PLACE_ACTIONS or not (query.action in _LIGHT_ACTIONS or stays):
        return reading
    if query.relation in ("none", "past") or not names_pronoun(reading):
        return reading
    return _with_query(reading, replace(query, action=base.action, actions=(base.action,)))


def refers_to_place(reading: Reading) -> bool:
    """Return whether a command says where by "there" alone: "stop there", "wait there for my wife"."""
    query = reading.query
    pairs = [*pairwise(token.category for token in reading.tokens)]
    waits = query.action == "wait" and (WordCategory.VERB, WordCategory.THERE) in pairs
    for_whom = waits and query.referent is not None and (query.referent.noun == "person" or names_pronoun(reading))
    named = (query.referent is not None and not for_whom) or query.secondary or query.relation != "none"
    there = (token.category is WordCategory.THERE or token.text.endswith(" there") for token in reading.tokens)
    # "Stay there", "in that gap".
    return not named and (any(there) or (WordCategory.THAT, WordCategory.SPOT) in pairs)


def turn_neighbours(text: str) -> str:
    """Return a description with the relation that it has to its neighbour: "with a bus behind it" is before a bus."""
    text = _NEARER.sub("near ", text)
    found = _NEIGHBOUR.search(text)
    if found is None or (found["alone"] and text.startswith("there")):
        return text  # "there's a bike ahead": of us
    relation = found["relation"] or _WHOLE.get(found["alone"], found["alone"])
    described = text[: found.start()].strip() or "the one"
    return f"{described} {_TURNED.get(relation, relation)} {found['neighbour']}{text[found.end() :]}".strip()


def _begins_with_event(reading: Reading) -> bool:
    """Return whether a sentence begins with a verb that describes no vehicle: "took you long enough"."""
    first = next(iter(reading.tokens), None)
    return first is not None and first.category is WordCategory.VERB and bool(first.form) and not first.state


def begins_with_place(text: str, read: Reader) -> bool:
    """Return whether the first word of a fragment is a relation: "behind the beige one", "after the van"."""
    reading = read(text, None, "stop")[0]
    first = next(iter(reading.tokens), None)
    named = reading.query.relation != "none" and first is not None and first.category is WordCategory.SUB
    return named or (first is not None and first.category is WordCategory.RELATION)


def is_understood(reading: Reading) -> bool:
    """Return whether a reading is a command that uses all its words."""
    return not (reading.problem or reading.dropped or reading.doubt)


def _has_unknown(reading: Reading) -> bool:
    return any(token.category is WordCategory.UNKNOWN for token in reading.tokens)


def _is_bare(referent: Referent, reading: Reading) -> bool:
    """Return whether a referent has no words of its own that distinguish it."""
    nouns = (WordCategory.NOUN, WordCategory.PERSON)
    noun = not referent.anaphora and any(token.category in nouns for token in reading.tokens)
    query = reading.query
    beside = any(one.of != "goal" for one in query.secondary)
    described = referent.colour or referent.qualifiers or beside
    return not (noun or described or query.excluded or query.distance_of == "descriptor")


def stops_at_side(reading: Reading) -> bool:
    """Return whether a command to stop names a distance and a side, and no shift to a side: "2 m to the right"."""
    query = reading.query
    placed = query.action in STOPS and query.distance_of == "ego" and is_understood(reading)
    sides = (token.text.split() for token in reading.tokens if token.category is WordCategory.SIDE)
    return placed and any(len(words) > 1 and words[0] != "to" for words in sides)

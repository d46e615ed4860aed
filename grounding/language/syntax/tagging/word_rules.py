"""Tagging rules for words other than verbs: parts of noun phrases and function words of clauses."""

from __future__ import annotations

from collections.abc import Sequence

from grounding.language.syntax.tagging.context import (
    CLAUSE_ENDS,
    PHRASE_STARTS,
    PHRASE_WORDS,
    TURNS,
    as_passing,
    category_at,
    clause_start,
    ends_waiting,
    is_adjective,
)
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, HEADS, MODIFIERS, WordCategory

# Categories that follow a verb without an object.
_AFTER_VERB = frozenset(
    (
        WordCategory.BREAK,
        WordCategory.COMMA,
        WordCategory.AND,
        WordCategory.THEN,
        WordCategory.SUB,
        WordCategory.SIDE,
        WordCategory.WHERE,
        WordCategory.LANE,
        WordCategory.HERE,
    )
)
_PREDICATES = frozenset(
    (
        WordCategory.VERB,
        WordCategory.BE,
        WordCategory.AUX,
        WordCategory.EGO,
        WordCategory.NOT,
        WordCategory.QUESTION,
        WordCategory.MEANWHILE,
    )
)
# Categories after a "no" in the middle of a clause that begin a repair.
_AFTER_REPAIR = (
    WordCategory.THE,
    WordCategory.THAT,
    WordCategory.RELATION,
    WordCategory.SIDE,
    WordCategory.DIRECTION,
)
# Units of length that are places after a determiner.
_PLACES_OF_UNITS = {
    "yard": (WordCategory.REGION, "parking_lot"),
    "foot": (WordCategory.REGION, "foot"),
}


def tag_that(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "that" as relative pronoun, determiner or pronoun."""
    following = category_at(after, 0)
    antecedents = HEADS | {WordCategory.WHERE, WordCategory.SIDE, WordCategory.PRONOUN}
    if category_at(before, -1) in antecedents and following in _PREDICATES:
        return token.with_category(WordCategory.WHICH)
    named = following in PHRASE_WORDS or (bool(after) and after[0].text in _PLACES_OF_UNITS)
    if named or (following is WordCategory.VERB and is_adjective(before, after[0], after[1:])):
        return token.with_category(WordCategory.THE)
    if following in DETERMINERS:
        return token.with_category(WordCategory.WHICH if category_at(before, -1) in HEADS else WordCategory.FILLER)
    return token.with_category(WordCategory.PRONOUN)


def tag_determiner(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a determiner without a noun as a pronoun or a filler."""
    noun_follows = category_at(after, 0) in PHRASE_STARTS | {WordCategory.VERB, WordCategory.DIRECTION}
    named = category_at(after, 0) is WordCategory.EXCEPT and token.text == "the"  # "the skip"
    named = named or (bool(after) and after[0].text in _PLACES_OF_UNITS)
    return token if noun_follows or named else _tag_without_noun(token)


def _tag_without_noun(token: Token) -> Token:
    """Tag "this", "her", "those" without a noun as pronouns, articles as fillers."""
    alone = token.text in ("this", "these", "those", "her", "both", "all", "another", "each")
    return token.with_category(WordCategory.PRONOUN if alone else WordCategory.FILLER)


def tag_possessive(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "whose" as a relative pronoun, "her" before a verb as a pronoun, others as determiners."""
    if token.text == "whose":
        return token.with_category(WordCategory.WHICH)
    if token.text == "her" and category_at(after, 0) is WordCategory.VERB and not after[0].form:
        return token.with_category(WordCategory.PRONOUN)  # "let her cross"
    said_last = len(after) == 1 or category_at(after, 1) in (WordCategory.COMMA, WordCategory.BREAK)
    if token.text == "its" and category_at(after, 0) is WordCategory.COLOUR and said_last:
        if category_at(before, -1) is WordCategory.VERB:
            return token.with_category(WordCategory.COMMA)  # "go go its green"
        return token.with_category(WordCategory.PRONOUN)  # "behind the van, its white"
    return tag_determiner(before, token, after)


def tag_person(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag an owner as a possessive, with or without the mark: "my friend's car"."""
    owner = token.form == "own" or category_at(after, 0) in (WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL)
    return token.with_category(WordCategory.POSSESSIVE) if owner else token


def tag_ordinal(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag an ordinal before a turn as that of a branch, or as a verb with it: "second left, please".

    "First" after what it orders is an adverb: "drop me at the van first, then park".
    """
    turning = category_at(after, 0) is WordCategory.DIRECTION or (
        category_at(after, 0) is WordCategory.VERB and after[0].value in TURNS
    )
    ends = not after or after[0].category in CLAUSE_ENDS | {WordCategory.COMMA, WordCategory.AND}
    ordered = category_at(before, -1) in (WordCategory.NOUN, WordCategory.PERSON)
    lets = any(one.value == "give_way" for one in before[clause_start(before) :])  # "let the van through first"
    if token.value == "first" and ends and (ordered or (lets and category_at(before, -1) is WordCategory.RELATION)):
        return token.with_category(WordCategory.FILLER, "")
    begins = not before[clause_start(before) :] and category_at(after, 0) is WordCategory.VERB and not turning
    if token.value == "first" and begins:
        return token.with_category(WordCategory.FILLER, "")  # "first drop me at the van"
    alone = all(other.category in DETERMINERS for other in before[clause_start(before) :])
    if alone and category_at(after, 0) is WordCategory.DIRECTION and category_at(after, 1) not in HEADS | MODIFIERS:
        return token.with_category(WordCategory.VERB, f"turn {token.value}")  # "next left, please"
    return token.with_category(WordCategory.BRANCH, token.value) if turning else token


def tag_direction(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a direction as a state in "the left car", as a verb in "left at the lights"."""
    following = [other for other in after if other.category not in MODIFIERS][:1]
    if token.value != "straight" and before and before[-1].text.endswith(" from"):
        return token.with_category(WordCategory.SIDE, f"{token.value}_side")  # "coming from left"
    first = category_at(before, -1) in CLAUSE_ENDS | {WordCategory.COMMA} and token.value != "straight"
    if first and category_at(after, 0) is WordCategory.RELATION and after[0].value in ("at", "into"):
        return token.with_category(WordCategory.VERB, f"turn {token.value}")  # "left at the lights"
    modifies = category_at(following, 0) in HEADS and category_at(before, -1) in PHRASE_STARTS | {
        WordCategory.RELATION
    }
    if modifies and token.value != "straight":
        return token.with_category(WordCategory.STATE, f"{token.value}_side")
    return token


def tag_side(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a side as a state of the vehicle in "the left car", as an event in "until they are over the road"."""
    if token.value == "opposite_side" and ends_waiting(before, after):
        return as_passing(token)
    following = [other for other in after if other.category not in MODIFIERS][:1]
    inside = token.text.split()[0] in ("the", "our", "my") and category_at(following, 0) in HEADS
    return token.with_category(WordCategory.STATE, token.value) if inside else token


def tag_shade(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "light" as a traffic light where no colour or noun follows."""
    following = [other for other in after if other.category is not WordCategory.EXTRA][:1]
    if category_at(following, 0) in MODIFIERS | HEADS:
        return token
    thing = token.text == "light" and category_at(before, -1) in DETERMINERS | {
        WordCategory.COLOUR,
        WordCategory.ORDINAL,
        WordCategory.RELATION,
    }
    return token.with_category(WordCategory.THING, "traffic_light") if thing else token


def tag_superlative(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "far" as a superlative in "the far van" only."""
    named = category_at(before, -1) in DETERMINERS and category_at(after, 0) in HEADS | MODIFIERS
    return token if token.text != "far" or named else token.with_category(WordCategory.UNKNOWN)


def tag_one(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "one" before a noun as a number."""
    counts = category_at(after, 0) in HEADS | {WordCategory.COLOUR}
    return token.with_category(WordCategory.NUMBER, "1") if counts else token


def tag_number(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Drop a number that counts nothing."""
    counts = category_at(after, 0) in PHRASE_WORDS | {WordCategory.OF, WordCategory.VERB}
    return token if counts else token.with_category(WordCategory.FILLER)


def tag_joint(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Drop a comma or "and" between two modifiers of one noun, but not "between the white and grey cars"."""
    inside = category_at(before, -1) in MODIFIERS and category_at(after, 0) in MODIFIERS
    same = inside and (
        token.category is WordCategory.COMMA or before[-1].category is after[0].category is WordCategory.COLOUR
    )
    if same and token.category is WordCategory.AND and _begins_between(before) and _names_several(after):
        return token
    return token.with_category(WordCategory.FILLER) if same else token


def _begins_between(before: Sequence[Token]) -> bool:
    """Return whether tokens end with "between" and the modifiers of its first end."""
    inner = MODIFIERS | DETERMINERS
    last = next((token for token in reversed(before) if token.category not in inner), None)
    return last is not None and last.category is WordCategory.BETWEEN


def _names_several(after: Sequence[Token]) -> bool:
    """Return whether the noun of a phrase is a plural: "grey cars"."""
    head = next((token for token in after if token.category not in MODIFIERS), None)
    return head is not None and (head.form == "plural" or head.written == "ones")


def tag_to(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "to" as a relation unless an infinitive follows."""
    verb = next(
        (other for other in after if other.category not in (WordCategory.AUX, WordCategory.BE, WordCategory.NOT)),
        None,
    )
    infinitive = verb is not None and verb.category in (WordCategory.VERB, WordCategory.NONDRIVE) and not verb.form
    return token if infinitive else token.with_category(WordCategory.RELATION, "toward")


def tag_question(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag question words inside a sentence: "where" is a relation, "when" a conjunction."""
    if category_at(before, -1) in CLAUSE_ENDS or (
        len(before) == 1 and before[0].category in (WordCategory.AND, WordCategory.COMMA)
    ):
        return token
    if token.text.startswith("where"):
        return token.with_category(WordCategory.RELATION, "at")
    if token.text.startswith("when"):
        return token.with_category(WordCategory.SUB, "when")
    if token.text.startswith("who "):
        return token.with_category(WordCategory.WHICH)
    if token.text in ("is", "are", "was", "were", "has"):
        return token.with_category(WordCategory.BE)
    return token.with_category(WordCategory.AUX if token.text in ("does", "did") else WordCategory.FILLER)


def tag_exists(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "have" as a filler in "the truck we have on our right"."""
    last = category_at(before, -1)
    verb = not token.text.startswith(("there", "here"))
    inside = verb and last in HEADS | {WordCategory.WHICH, WordCategory.THAT}
    inside = inside or (token.text in ("see", "notice") and bool(before))
    return token.with_category(WordCategory.FILLER) if inside and last not in CLAUSE_ENDS else token


def tag_ego(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag the ego as a relative pronoun where "which" is omitted: "the first van we pass"."""
    if category_at(before, -1) not in HEADS:
        return token
    auxiliaries = (WordCategory.AUX, WordCategory.BE, WordCategory.NOT)
    predicate = [other for other in after if other.category not in auxiliaries]
    verb = category_at(predicate, 0) in (WordCategory.VERB, WordCategory.NONDRIVE)
    stranded = category_at(predicate, 1) in (WordCategory.RELATION, WordCategory.TO)  # "the van we drove to"
    open_end = category_at(predicate, 1) in _AFTER_VERB or (stranded and category_at(predicate, 2) in _AFTER_VERB)
    clause = [other.category for other in before[clause_start(before) :]]
    named = WordCategory.VERB in clause or clause[0] in DETERMINERS | MODIFIERS | {WordCategory.THAT}
    return token.with_category(WordCategory.WHICH, "ego") if verb and open_end and named else token


def tag_correct(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "never mind the bus" as an exclusion, "there is actually no space" as a negation."""
    begins = bool(before) and category_at(before, -1) in CLAUSE_ENDS | {WordCategory.COMMA}
    if token.text == "actually" and not begins:
        return token.with_category(WordCategory.FILLER)
    if token.text.endswith(" no") and category_at(after, 0) in PHRASE_WORDS:
        return token.with_category(WordCategory.NOT)
    dropped = token.text in ("never mind", "nevermind", "cancel that", "forget that", "scratch that")
    return token.with_category(WordCategory.EXCEPT) if dropped and category_at(after, 0) in PHRASE_STARTS else token


def tag_except(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "skip" after a determiner as a thing."""
    named = category_at(before, -1) in DETERMINERS | MODIFIERS and " " not in token.text
    return token.with_category(WordCategory.THING, "container") if named else token


def tag_not(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a "no" on its own as the start of a self-repair."""
    ends = category_at(after, 0) in (WordCategory.COMMA, WordCategory.BREAK, WordCategory.CORRECT)
    begins = category_at(before, -1) in CLAUSE_ENDS | {WordCategory.COMMA}
    # "The silver car no the white car": a negated noun phrase has no other determiner.
    another = bool(before) and category_at(after, 0) in _AFTER_REPAIR
    named = HEADS | {WordCategory.SIDE, WordCategory.DIRECTION, WordCategory.HERE}
    another = another and (category_at(before, -1) in named or before[-1].value in TURNS)
    another = another or (begins and category_at(after, 0) is WordCategory.DIRECTION)  # "turn that way, no left"
    repairs = another or (begins and ends)
    return token.with_category(WordCategory.CORRECT) if token.text == "no" and repairs else token


def tag_then(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "after that" as a conjunction in "after that van", and drop "finally" inside a clause."""
    if token.text in ("finally", "subsequently") and category_at(before, -1) not in CLAUSE_ENDS | {
        WordCategory.COMMA
    }:
        inside = category_at(after, 0) is WordCategory.VERB and bool(after[0].form)
        return token.with_category(WordCategory.FILLER) if inside else token
    named = token.text.endswith(("that", "this")) and category_at(after, 0) in PHRASE_WORDS
    return token.with_category(WordCategory.SUB, "after") if named else token


def tag_unit(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a unit after "the" as a place ("into the yard"), and drop other units without a number."""
    named = category_at(before, -1) in (
        WordCategory.THE,
        WordCategory.POSSESSIVE,
        WordCategory.THING,
        WordCategory.NOUN,
    )
    place = _PLACES_OF_UNITS.get(token.text)
    return token.with_category(*place) if named and place else token.with_category(WordCategory.FILLER)


def drop(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag the word as a filler, which the tagger removes."""
    return token.with_category(WordCategory.FILLER)

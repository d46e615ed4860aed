"""Tagging rules for verbs: verbs used as nouns and adjectives, and other words used as verbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from grounding.language.syntax.tagging.context import (
    CLAUSE_ENDS,
    COMMAND_STARTS,
    PHRASE_STARTS,
    PHRASE_WORDS,
    TURNS,
    as_passing,
    category_at,
    ends_waiting,
    is_adjective,
)
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import DETERMINERS, HEADS, MODIFIERS, WordCategory

# Verbs used as nouns: "the next turn", "at that stop".
_NOUNS_OF_VERBS = {
    "park": "park",
    "stop": "stop",
    "turn": "turn",
    "pass": "pass",
    "drive": "driveway",
    "exit": "exit",
}
# Nouns used as verbs: "shadow that van".
_VERBS_OF_NOUNS = {"shadow": "follow", "mirror": "follow", "dodge": "avoid", "block": "danger", "track": "follow"}
# Relations before "the line" for which it is a stop line and no queue.
_BEFORE_LINE = ("at", "toward", "before", "behind")
# Categories before "passed" used as a relation.
_BEFORE_PASSED = (
    WordCategory.VERB,
    WordCategory.DIRECTION,
    WordCategory.COMMA,
    WordCategory.SIDE,
    WordCategory.HERE,
)
# Categories, besides those of a noun phrase, that begin a repair: "wait, right".
_REPAIRS = {WordCategory.RELATION, WordCategory.DIRECTION, WordCategory.SIDE, WordCategory.NOT}
# Categories that precede and follow "parking" used as a verb.
_BEFORE_PARKING = (
    WordCategory.BREAK,
    WordCategory.BE,
    WordCategory.AUX,
    WordCategory.EGO,
    WordCategory.COMMA,
    WordCategory.NOT,
    WordCategory.AND,
    WordCategory.SUB,
)
_AFTER_PARKING = (
    WordCategory.RELATION,
    WordCategory.SIDE,
    WordCategory.BETWEEN,
    WordCategory.HERE,
    WordCategory.WHERE,
    WordCategory.THERE,
    WordCategory.DISTANCE,
    WordCategory.SUB,
)
# Pronouns that stand for a noun before "behind": "anyone behind on the left".
_ANYONE = ("anyone", "anybody", "someone", "somebody", "anything", "something")
# Relations of somebody who has passed: "until it is past", "until they are over".
_PASSED = ("past", "along", "opposite")
# Verbs that turn round, but before a distance drive backwards.
_GO_BACK = ("go back", "head back", "drive back")


def tag_verb(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag verbs that are nouns, states or fillers in context, and shorten phrasal verbs."""
    last = category_at(before, -1)
    if last in CLAUSE_ENDS and after and after[0].text in ("is", "was"):
        return token.with_category(WordCategory.THING, token.text)  # "park is closed"
    if is_adjective(before, token, after) and last not in HEADS:
        return token.with_category(WordCategory.STATE, token.state)
    if token.value == "turn" and token.form and category_at(after, 0) is WordCategory.COLOUR:
        return replace(token, value="none", state="", event="other")  # "until the light turns green"
    interjection = last in CLAUSE_ENDS and category_at(after, 0) is WordCategory.COMMA and after[0].start == token.end
    if token.value == "wait" and interjection and category_at(after, 1) in (WordCategory.NOT, WordCategory.CORRECT):
        return token.with_category(WordCategory.FILLER)  # "wait, don't stop"
    following = category_at(after, 0)
    repairs = last is following is WordCategory.COMMA
    after_no = category_at(before, -2) is WordCategory.CORRECT
    repairs |= following is WordCategory.BREAK and after_no  # "No, wait. The blue one."
    if token.value == "wait" and repairs and category_at(after, 1) in PHRASE_STARTS | _REPAIRS:
        return token.with_category(WordCategory.CORRECT)  # "behind the red car, wait, the blue one"
    onward = token.text in ("go", "come") and last not in (WordCategory.NOT, WordCategory.EGO)
    if onward and category_at(after, 0) is WordCategory.VERB and not after[0].form:
        return token.with_category(WordCategory.FILLER)  # "go park there"
    if token.text == "go" and [one.category for one in after[:2]] == [WordCategory.AND, WordCategory.VERB]:
        return token.with_category(WordCategory.FILLER)  # "go and park there"
    if token.text == "lets" and last in CLAUSE_ENDS | {WordCategory.COMMA}:
        return token.with_category(WordCategory.FILLER)  # "lets park here"
    if token.value == "other onward" and token.text.endswith(" on") and category_at(after, 0) is WordCategory.LANE:
        return token.with_category(WordCategory.VERB, "go")  # "go on the lane in the middle"
    if token.value == "turn around" and token.text.endswith("round") and (head := _head(after)) is not None:
        if head.category in (WordCategory.NOUN, WordCategory.ONE):
            return token.with_category(WordCategory.VERB, "overtake")  # "swing round that van"
        if head.value == "corner":
            said = "turn right" if "right" in token.text.split() else "turn"  # "turn right round the corner"
            return token.with_category(WordCategory.VERB, said)
    if token.value == "overtake" and token.text.endswith("round"):
        head = _head(after)
        if head is not None and head.value == "corner":
            return token.with_category(WordCategory.VERB, "turn")  # "go round the corner"
    if token.value == "turn around" and token.text in _GO_BACK and following is WordCategory.DISTANCE:
        return token.with_category(WordCategory.VERB, "other back")  # "go back two metres"
    if token.value in TURNS and after and after[0].text.startswith("lane"):
        # "take the left lane"
        return token.with_category(WordCategory.VERB, token.value.replace("turn", "change_lane"))
    if token.text in ("pull in", "move in") and after and after[0].text in ("front of", "back of"):
        return token.with_category(WordCategory.VERB, token.text.split()[0])
    relation = after[0].value if category_at(after, 0) is WordCategory.RELATION else ""
    if token.value == "avoid" and token.text.endswith(" back") and relation in ("behind", "next_to", "in_front_of"):
        return token.with_category(WordCategory.VERB, "get")  # "get back behind the van"
    if token.form == "ing" and last in DETERMINERS and category_at(after, 0) in HEADS | {WordCategory.COLOUR}:
        return token.with_category(WordCategory.EXTRA)
    if _is_idle(token, after):
        return token.with_category(WordCategory.NONDRIVE)  # "stop teasing him", "stay healthy"
    if token.form == "ing" and _is_praised(before, after):
        return token.with_category(WordCategory.THING, token.text)  # "nice driving, thank you"
    own = bool(before) and before[-1].form == "own" and category_at(after, 0) not in HEADS  # "the van's tail"
    named = last in DETERMINERS or (own and last is not WordCategory.WHICH)
    named = named or (last in MODIFIERS and category_at(before, -2) in DETERMINERS)
    noun_form = not token.form or (token.form == "ing" and token.value == "turn")  # "the second turning"
    if named and noun_form and token.value not in TURNS and " " not in token.text:
        return token.with_category(WordCategory.THING, _NOUNS_OF_VERBS.get(token.value, token.text))
    if token.text == "passed" and last in _BEFORE_PASSED and category_at(after, 0) in PHRASE_STARTS:
        return token.with_category(WordCategory.RELATION, "past")  # "turn left passed the van"
    return token


def _is_idle(token: Token, after: Sequence[Token]) -> bool:
    """Return whether the word after "stop" or "stay" makes them verbs that are not about driving."""
    word = after[0].text if category_at(after, 0) in (WordCategory.UNKNOWN, WordCategory.EXTRA) else ""
    if token.text in ("stop", "quit", "keep") and category_at(after, 0) is WordCategory.UNKNOWN:
        return word.endswith("ing")
    ends = category_at(after, 1) in CLAUSE_ENDS | {WordCategory.COMMA}
    return token.text in ("stay", "remain") and ends and word not in ("", "slow", "close")


def _head(after: Sequence[Token]) -> Token | None:
    """Return the head of a noun phrase with a determiner that follows; None if none does."""
    before = DETERMINERS | {WordCategory.THAT}
    if category_at(after, 0) not in before:
        return None
    within = before | MODIFIERS | {WordCategory.VERB}  # "that parked lorry"
    return next((one for one in after if one.category not in within), None)


def _is_praised(before: Sequence[Token], after: Sequence[Token]) -> bool:
    """Return whether the words before a verb in -ing make a noun of it: "lovely overtaking there"."""
    last = category_at(before, -1)
    if category_at(before, -2) not in CLAUSE_ENDS | {WordCategory.COMMA, WordCategory.THAT, WordCategory.BE}:
        return False
    ends = category_at(after, 0) in CLAUSE_ENDS | {WordCategory.COMMA, WordCategory.THERE, WordCategory.HERE}
    return last is WordCategory.EXTRA or (last is WordCategory.UNKNOWN and ends)


def tag_nondrive(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a verb that is not about driving after a determiner as an unknown noun."""
    named = category_at(before, -1) in DETERMINERS | MODIFIERS
    return token.with_category(WordCategory.UNKNOWN) if named and " " not in token.text else token


def tag_noun(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "pick up" as a verb where it takes an object: "pick up my friend"."""
    named = category_at(before, -1) in DETERMINERS | MODIFIERS | {WordCategory.RELATION, WordCategory.THAT}
    # Written as one word it is a truck, unless it takes an object: "pickup that girl".
    verb = token.text == "pick up" or (token.text == "pickup" and category_at(after, 0) in PHRASE_STARTS)
    return token.with_category(WordCategory.VERB, "stop") if verb and not named else token


def tag_region(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a region as a verb: "would you mind parking beside"."""
    if _is_verb(before, token, after):
        return token.with_category(WordCategory.VERB, _VERBS_OF_NOUNS[token.text])
    reached = category_at(before, -2) is WordCategory.RELATION and before[-2].value in _BEFORE_LINE
    reached = reached or (category_at(before, -2) is WordCategory.VERB and before[-2].text.endswith((" to", " at")))
    if token.text == "line" and reached and category_at(before, -1) is WordCategory.THE and not _is_of(after):
        return token.with_category(WordCategory.THING, "stop_line")  # "roll up to the line"
    if token.text == "blocks" and category_at(before, -1) in HEADS:
        return replace(token, category=WordCategory.VERB, value="none", form="s")  # "that van blocks the road"
    if token.text == "exit" and category_at(before, -1) in COMMAND_STARTS | {WordCategory.AUX, WordCategory.TO}:
        return token.with_category(WordCategory.VERB, "turn")
    verb = token.text == "parking" and category_at(after, 0) in _AFTER_PARKING
    verb = verb or (token.text == "parking" and category_at(before, -1) is WordCategory.SUB)
    ended = category_at(before, -1) is WordCategory.VERB and before[-1].value in ("avoid", "stop")  # "avoid parking"
    if verb and (ended or category_at(before, -1) in _BEFORE_PARKING):
        return replace(token, category=WordCategory.VERB, value="park", form="ing", state="parked", event="stop")
    return token


def _is_of(after: Sequence[Token]) -> bool:
    return category_at(after, 0) is WordCategory.OF


def tag_thing(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag a thing as a verb: "the man crossing the street"."""
    if _is_verb(before, token, after):
        return token.with_category(WordCategory.VERB, _VERBS_OF_NOUNS[token.text])
    walks = token.text == "crossing" and category_at(before, -1) in HEADS - {WordCategory.THING} | {
        WordCategory.BE,
        WordCategory.WHICH,
        WordCategory.PRONOUN,
    }
    return replace(token, category=WordCategory.VERB, value="none", form="ing", event="pass") if walks else token


def tag_relation(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag the verb in "I like that car", places at us ("from behind", "the car alongside"), "until they are over"."""
    if token.value in _PASSED and ends_waiting(before, after):
        return as_passing(token)
    origin = token.text == "behind" and bool(before) and before[-1].text.split()[-1] == "from"
    if origin and category_at(after, 0) not in PHRASE_STARTS | {WordCategory.PRONOUN}:
        return token.with_category(WordCategory.WHERE, "behind_ego")
    named = category_at(before, -1) in HEADS or (bool(before) and before[-1].text in _ANYONE)
    if token.text == "behind" and named and category_at(after, 0) is WordCategory.SIDE:
        return token.with_category(WordCategory.WHERE, "behind_ego")  # "the car behind on the left"
    if token.text == "alongside" and category_at(before, -1) in HEADS and category_at(after, 0) not in PHRASE_WORDS:
        return token.with_category(WordCategory.WHERE, "beside_ego")
    verb = token.text == "like" and category_at(before, -1) is WordCategory.EGO
    return token.with_category(WordCategory.NONDRIVE) if verb else token


def tag_extra(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "slow" at the start of a clause as a verb: "slow, there is a bus"."""
    alone = (
        token.text == "slow" and category_at(before, -1) in CLAUSE_ENDS and category_at(after, 0) not in PHRASE_WORDS
    )
    return token.with_category(WordCategory.VERB, "slow_down") if alone else token


def tag_aux(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag the verb in "we are going to the house"."""
    wanted = [one for one in after if one.category not in DETERMINERS | MODIFIERS | {WordCategory.THAT}][:1]
    ego = category_at(before, -1) is WordCategory.EGO or token.text.startswith(("i'd", "we'd", "i would", "we would"))
    if ego and category_at(wanted, 0) is WordCategory.SPOT and category_at(after, 0) is not WordCategory.VERB:
        return token.with_category(WordCategory.VERB, "take")  # "I want that space"
    if not (token.text.endswith("going to") and category_at(after, 0) in PHRASE_STARTS):
        return token
    if category_at(before, -1) in COMMAND_STARTS:
        return token.with_category(WordCategory.VERB, "approach toward")
    return token.with_category(WordCategory.FILLER)


def tag_be(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "be" as a verb of motion in "we need to be behind that truck"."""
    places = (WordCategory.LANE, WordCategory.RELATION, WordCategory.SIDE, WordCategory.THERE)
    commanded = category_at(before, -2) in COMMAND_STARTS
    commanded = commanded and category_at(before, -1) in (WordCategory.AUX, WordCategory.TO)
    motion = token.text == "be" and commanded and category_at(after, 0) in places
    return token.with_category(WordCategory.VERB, "get") if motion else token


def tag_out(before: Sequence[Token], token: Token, after: Sequence[Token]) -> Token:
    """Tag "let me out" as a verb where the ego is commanded."""
    ours = " " in token.text and category_at(before, -1) in COMMAND_STARTS | {WordCategory.AUX}
    return token.with_category(WordCategory.VERB, "other") if ours else token


def _is_verb(before: Sequence[Token], token: Token, after: Sequence[Token]) -> bool:
    """Return whether a noun is the verb of a command: "shadow that van"."""
    commanded = category_at(before, -1) in COMMAND_STARTS | {WordCategory.AUX, WordCategory.TO, WordCategory.NOT}
    return token.text in _VERBS_OF_NOUNS and commanded and category_at(after, 0) in PHRASE_STARTS

"""Accounting of words: which content words of a command its query does not use, and whether one of them matters.

A word is used if the query changes without it. This test needs no book-keeping in the rules that read the words, and
it holds for every rule: also a negation or a correction that no rule takes up is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from grounding.language.semantics.discourse.command_frames import ENTERABLE
from grounding.language.semantics.discourse.relation_attachment import GROUPS
from grounding.language.syntax.clauses import split_clauses
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import LIGHT_VERBS, MODIFIERS, NOUNS, POLARITY, WordCategory

# Categories whose words place the goal or choose the vehicle.
PLACING = frozenset(
    (
        WordCategory.NOUN,
        WordCategory.COLOUR,
        WordCategory.ORDINAL,
        WordCategory.SUPERLATIVE,
        WordCategory.SIDE,
        WordCategory.LANE,
        WordCategory.DISTANCE,
        WordCategory.DIRECTION,
        WordCategory.BRANCH,
        WordCategory.BETWEEN,
    )
)
# Of these, where to steer: they count with every verb, also with those that have no meaning of their own.
_STEERING = (WordCategory.LANE, WordCategory.SIDE)
_CONTENT = (
    POLARITY
    | PLACING
    | MODIFIERS
    | NOUNS
    | {
        WordCategory.VERB,
        WordCategory.NONDRIVE,
        WordCategory.MODEL,
        WordCategory.RELATION,
        WordCategory.WHERE,
        WordCategory.DIRECTION,
        WordCategory.BRANCH,
        WordCategory.UNKNOWN,
    }
) - {WordCategory.SPOT}
_PREDICATES = (
    *(WordCategory.VERB, WordCategory.NONDRIVE, WordCategory.BE, WordCategory.AUX, WordCategory.EXISTS),
    WordCategory.EGO,
)
_CLAUSE_ENDS = (WordCategory.BREAK, WordCategory.COMMA)
_COMMAND_STARTS = (WordCategory.VERB, WordCategory.NOT, WordCategory.EGO, WordCategory.TO, WordCategory.COMMA)
_OTHER_NOUNS = NOUNS - {WordCategory.NOUN}
_WEAK_RELATIONS = ("at", "toward", "in", "into", "along", "on", "with", "for")
# "Don't turn until it has gone" orders the turn.
_UNTIL = ("until", "before")
# The place that is nearest on our way.
_FIRST = ("first", "next", "nearest")
# Tokens read in all tests of one text, which bounds their time.
_MAX_TOKENS_READ = 2500


class Account(NamedTuple):
    """Content words that a query does not use.

    Attributes:
        dropped: the words as written, in order.
        doubtful: of these, those without which the place may be another one, or the opposite of the one meant.
        strange: of these, those that no lexicon holds.
    """

    dropped: tuple[str, ...] = ()
    doubtful: tuple[str, ...] = ()
    strange: tuple[str, ...] = ()


def account_for(
    tokens: Sequence[Token], build: Callable[[Sequence[Token]], object], repaired: bool = False
) -> Account:
    """Return the content words that do not change what is built from the tokens.

    Args:
        tokens: tagged tokens.
        build: tokens -> meaning, comparable with ==.
        repaired: whether the text corrects itself, or was corrected: then no dropped word is mere context.
    """
    whole = build(tokens)
    without_effect = (_is_group, _is_first_spot, _is_kept_anyway)
    content = [
        i for i, token in enumerate(tokens) if _is_content(token) and not any(f(tokens, i) for f in without_effect)
    ]
    # Negations first: they are tested in a text of any length.
    tested = sorted(content, key=lambda i: tokens[i].category not in POLARITY)[: _MAX_TOKENS_READ // len(tokens)]
    unused = [
        i for i in sorted(tested) if not _commands(tokens[i]) and build([*tokens[:i], *tokens[i + 1 :]]) == whole
    ]
    unused = [i for i in unused if not _said_twice(tokens, i, unused, build, whole)]
    used = [tokens[i] for i in content if i not in unused]
    meanings = {
        _meaning(token) for token in (*used, *(token for token in tokens if token.category is WordCategory.HERE))
    }
    # A word is not dropped if the same is said, and used, elsewhere.
    dropped = [i for i in unused if _meaning(tokens[i]) not in meanings]
    commanding = _commanding_starts(tokens, {token.start for token in used if token.category is WordCategory.VERB})
    steered = _commanding_starts(tokens, {token.start for token in tokens if _commands(token)})
    steered = {token.start for token in tokens if token.category in _STEERING and token.start in steered}
    stated = commanding | steered
    replaced = _replaced_end(tokens)
    doubtful = [i for i in dropped if (repaired or tokens[i].start in stated) and _is_doubtful(tokens, i)]
    doubtful = [i for i in doubtful if i >= replaced or tokens[i].category in POLARITY]
    doubtful += [i for i in range(len(tokens)) if _names_another(tokens, i)]
    dropped = sorted({*dropped, *doubtful})
    strange = [i for i in doubtful if tokens[i].category is WordCategory.UNKNOWN]
    return Account(*(tuple(dict.fromkeys(tokens[i].text for i in part)) for part in (dropped, doubtful, strange)))


def _meaning(token: Token) -> tuple[object, object]:
    """Return what a word says: our side of the road is that of the kerb."""
    return ("side", "kerb") if token.value in ("kerb", "own_side") else (token.category, token.value)


def _said_twice(
    tokens: Sequence[Token], i: int, unused: Sequence[int], build: Callable[[Sequence[Token]], object], whole: object
) -> bool:
    """Return whether a word changes nothing only because the same is said again: "the red car, the other red one"."""
    same = {j for j in unused if _meaning(tokens[j]) == _meaning(tokens[i])}
    return len(same) > 1 and build([token for j, token in enumerate(tokens) if j not in same]) != whole


def _replaced_end(tokens: Sequence[Token]) -> int:
    """Return where the command begins that replaces the words before it: "follow the bus, no, follow the van"."""
    ends = [i for i, token in enumerate(tokens) if token.category is WordCategory.CORRECT]
    return max((i for i in ends if i + 1 < len(tokens) and _commands(tokens[i + 1])), default=0)


def _names_another(tokens: Sequence[Token], i: int) -> bool:
    """Return whether a word tells a vehicle from one named before: "the red car? no, the other one"."""
    named = any(token.category is WordCategory.NOUN for token in tokens[:i])
    return tokens[i].value == "other" and named and _category_at(tokens, i + 1) is WordCategory.ONE


def _commanding_starts(tokens: Sequence[Token], verbs: set[int]) -> set[int]:
    """Return the starts of all tokens in clauses with a used verb, and in those without a predicate after them.

    Statements and topics are context: "there is a van ahead", "of the bus and the van"; but the colour that a
    statement gives to a vehicle counts.
    """
    starts: set[int] = set()
    begun = False
    for clause in split_clauses(tokens):
        categories = {token.category for token in clause.tokens}
        if WordCategory.COLOUR in categories and not categories & _OTHER_NOUNS:
            last = clause.tokens[-1]  # "it is blue", but not "a blue car"
            starts |= {last.start} if last.category is WordCategory.COLOUR else set()
        commands = any(token.start in verbs for token in clause.tokens)
        completes = begun and not any(token.category in _PREDICATES for token in clause.tokens)
        begun = begun or commands
        if commands or completes:
            starts |= {token.start for token in clause.tokens}
    return starts


def _commands(token: Token) -> bool:
    """Return whether a word is a commanding verb; without one, a bare fragment may mean the same."""
    return token.category is WordCategory.VERB and not token.form and token.value != "none"


def _is_content(token: Token) -> bool:
    """Return whether a word has a meaning of its own in a command."""
    if token.category is WordCategory.VERB:
        return token.value not in LIGHT_VERBS
    if token.category is WordCategory.RELATION:
        return token.value not in _WEAK_RELATIONS
    return token.category in _CONTENT


def _is_group(tokens: Sequence[Token], i: int) -> bool:
    """Return whether a word only groups the vehicles that are named after it: "the row of parked cars"."""
    named = next((one for one in tokens[i + 2 :] if one.category in NOUNS), None)
    several = named is not None and named.category is WordCategory.NOUN and named.form == "plural"
    return tokens[i].text in GROUPS and _category_at(tokens, i + 1) is WordCategory.OF and several


def _is_first_spot(tokens: Sequence[Token], i: int) -> bool:
    """Return whether a word asks for the first place or street, which is taken anyway: "the next free space"."""
    noun = next((one for one in tokens[i + 1 :] if one.category not in MODIFIERS), None)
    named = noun is not None and (
        noun.category is WordCategory.SPOT or noun.value in ENTERABLE or noun.value.startswith("turn")
    )
    return tokens[i].value in _FIRST and named


def _is_kept_anyway(tokens: Sequence[Token], i: int) -> bool:
    """Return whether a word asks for the distance that a follower keeps anyway: "follow it at a safe distance"."""
    distance = tokens[i].category is WordCategory.DISTANCE and tokens[i].form != "counted"
    return distance and any(token.value in ("follow", "stay") for token in tokens[:i])


def _is_doubtful(tokens: Sequence[Token], i: int) -> bool:
    """Return whether a dropped word may change the place, or turn it into its opposite."""
    category = tokens[i].category
    before, following = (_category_at(tokens, i + step) for step in (-1, 1))
    if tokens[i].value == "other_lane":  # "scoot over into the next lane"
        return not any(token.value == "change_lane" for token in tokens)
    if category is WordCategory.CORRECT:
        return following not in _COMMAND_STARTS
    if category in POLARITY:
        manner = tokens[i].text == "without" or following in (WordCategory.BREAK, WordCategory.PART)  # "not so fast"
        held = following is WordCategory.VERB and any(token.value in _UNTIL for token in tokens[i:])
        return not manner and not held
    if category is WordCategory.UNKNOWN:  # "far from", "refuse to park"
        governs = following in (WordCategory.RELATION, WordCategory.VERB)
        governs = governs or (following is WordCategory.TO and before in _CLAUSE_ENDS)
        return governs and not tokens[i].text.endswith(("ly", "ing", "ed"))
    if category is WordCategory.RELATION:  # "not the van, the car in front of it"
        contrast = any(token.category in POLARITY for token in tokens)
        return contrast and following in (WordCategory.THE, WordCategory.PRONOUN, WordCategory.NOUN, WordCategory.NOT)
    if category is WordCategory.DIRECTION:
        joined = before in (*_CLAUSE_ENDS, WordCategory.BE, WordCategory.QUESTION, WordCategory.OR)
        return joined and following in _CLAUSE_ENDS
    if category in MODIFIERS:
        joint = WordCategory.COLOUR in (before, following)  # "the black and yellow taxi"
        named = next((token.category for token in tokens[i:] if token.category not in MODIFIERS), WordCategory.BREAK)
        predicate = category is WordCategory.COLOUR and named in _CLAUSE_ENDS
        return category in PLACING and not joint and (predicate or named in (WordCategory.NOUN, WordCategory.ONE))
    # "The tram tracks", "the bus stop": the noun is part of a name.
    return category in PLACING and not (category is WordCategory.NOUN and following in NOUNS)


def _category_at(tokens: Sequence[Token], i: int) -> WordCategory:
    return tokens[i].category if 0 <= i < len(tokens) else WordCategory.BREAK

"""Typed tokens -> query, by an Earley grammar over the kinds of tokens; unknown words are left out, and told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby, pairwise

from lark import Lark, Tree
from lark import Token as Leaf
from lark.exceptions import UnexpectedInput

from grounding.lexicon import QUESTION_WORDS, Kind
from grounding.query import Landmark, Query, Referent
from grounding.tokens import MAX_CHARACTERS, Token, did_you_mean, normalise, tokenise

# One letter a kind: the parser reads a string of them, and a column in it is the number of a token.
_LETTER = {kind: chr(ord("A") + i) for i, kind in enumerate(Kind)}
_GRAMMAR = """
command: ACTION (place | landmark)* [goal landmark*]
place: SIDE | WHERE
goal: distance? RELATION? referent
distance: NUMBER UNIT
referent: (THE | ANY)* mark* NOUN said*
mark: SHADE | COLOUR | ORDINAL | SUPERLATIVE | STATE | SIZE | SIDE
said: SIDE | WHERE | STATE | COLOUR
landmark: RELATION (THE | ANY)* mark* LANDMARK
"""
_QUALIFIERS = (Kind.ORDINAL, Kind.SUPERLATIVE, Kind.STATE, Kind.SIZE, Kind.SIDE, Kind.WHERE)
_SKIPPED = (Kind.FILLER, Kind.UNKNOWN)
_WANTED = {
    Kind.NOUN: "a vehicle (car, truck, van, bus, motorcycle, vehicle)",
    Kind.RELATION: "a relation (behind, in front of, next to, near, left of, right of)",
    Kind.UNIT: "a unit (metres, feet)",
}
_EXAMPLE = "park behind the silver car"
_ACTIONS = "park, stop, pull over or go to"


@dataclass(frozen=True)
class Problem:
    """Why a sentence is no command: one line, and the characters of the normalised sentence it is about."""

    message: str
    start: int = 0
    end: int = 0


@dataclass(frozen=True)
class Reading:
    """What was made of a sentence.

    Attributes:
        query: the typed query; without an action where there is a problem.
        notes: what was mended or left out, one sentence each.
        problem: why the sentence is no command, None where it is one.
    """

    query: Query
    notes: tuple[str, ...] = ()
    problem: Problem | None = None


class _NotACommandError(Exception):
    """Carries a problem up to `read`."""

    def __init__(self, message: str, at: Sequence[Token] = ()) -> None:
        super().__init__(message)
        self.problem = Problem(message, at[0].start if at else 0, at[-1].end if at else 0)


def read(text: str) -> Reading:
    """The query of a sentence, or the problem with it; never raises for any text."""
    shown = text if len(text) <= MAX_CHARACTERS else text[:MAX_CHARACTERS]
    try:
        if len(text) > MAX_CHARACTERS:
            raise _NotACommandError(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        tokens = tokenise(normalise(text))
        clause = _command_clause(tokens)
        query = _query(shown, clause)
        return Reading(query, tuple(_notes(tokens, clause)))
    except _NotACommandError as error:
        return Reading(Query(shown), problem=error.problem)


def caret(text: str, problem: Problem) -> str:
    """The normalised sentence with carets under the place of a problem, '' where it has none."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def _command_clause(tokens: list[Token]) -> list[Token]:
    """The tokens of the one command, from its action on."""
    if not tokens:
        raise _NotACommandError("the sentence holds no words")
    if all(token.kind in (*_SKIPPED, Kind.BREAK) for token in tokens):
        raise _NotACommandError(f"no word of it is understood: expected a command such as '{_EXAMPLE}'")
    if tokens[0].text.split()[0] in QUESTION_WORDS:
        raise _NotACommandError("a question is no driving command", tokens[:1])
    beyond = [token for token in tokens if token.kind is Kind.BEYOND]
    if beyond:
        raise _NotACommandError(
            f"'{beyond[0].text}' goes beyond what is placed: expected {_ACTIONS}, by one vehicle", beyond[:1]
        )
    clauses = [list(part) for at_break, part in groupby(tokens, lambda t: t.kind is Kind.BREAK) if not at_break]
    commands = [clause for clause in clauses if any(token.kind is Kind.ACTION for token in clause)]
    if not commands:
        raise _NotACommandError(f"no driving action in it: expected {_ACTIONS}")
    if len(commands) > 1:
        raise _NotACommandError("one command at a time: expected a single sentence", commands[1])
    first = next(i for i, token in enumerate(commands[0]) if token.kind is Kind.ACTION)
    return commands[0][first:]


def _query(text: str, clause: list[Token]) -> Query:
    """The query of a clause."""
    kept = _significant(clause)
    try:
        tree = _parser().parse("".join(_LETTER[token.kind] for token in kept))
    except UnexpectedInput as error:
        raise _misread(clause, kept, error) from None
    action, *implied = kept[0].value.split()
    goal = next(iter(tree.find_data("goal")), None)
    relation = _values(goal, kept, Kind.RELATION) if goal else []
    if goal and not relation and not implied:
        raise _NotACommandError(f"'{kept[0].text}' what way? expected {_WANTED[Kind.RELATION]}", _leaves(goal, kept))
    places = [token.value for part in tree.children if _is(part, "place") for token in _leaves(part, kept)]
    sides = [place.removesuffix("_side") for place in places if place.endswith("_side")]
    return Query(
        command=text,
        action=action,
        relation=(relation or implied)[0] if goal else "none",
        referent=_referent(goal, kept, tuple(place for place in places if not place.endswith("_side")))
        if goal
        else None,
        goal_side=sides[-1] if sides else None,
        landmarks=tuple(_landmark(part, kept) for part in tree.children if _is(part, "landmark")),
        distance_m=_distance_m(goal, kept) if goal else None,
    )


def _significant(clause: list[Token]) -> list[Token]:
    """What the grammar sees: no fillers, the last of actions in a row, articles only before their noun phrase."""
    kept = [token for token in clause if token.kind not in _SKIPPED]
    last = Token(Kind.BREAK, "", "", "", 0, 0)
    articles = (Kind.THE, Kind.ANY)
    ends = (Kind.BREAK, Kind.ACTION, Kind.RELATION, Kind.NUMBER, Kind.WHERE)
    return [
        token
        for token, following in pairwise([*kept, last])
        if not (token.kind in articles and following.kind in ends)
        and not (token.kind is Kind.ACTION and following.kind is Kind.ACTION)
    ]


def _referent(goal: Tree[Leaf], kept: list[Token], optional: tuple[str, ...]) -> Referent:
    """The vehicle of a goal."""
    tokens = _leaves(next(iter(goal.find_data("referent"))), kept)
    noun = next(token for token in tokens if token.kind is Kind.NOUN)
    colours = [token for token in tokens if token.kind is Kind.COLOUR]
    if len(colours) > 1:
        raise _NotACommandError("one colour at a time: expected a single colour word", colours[1:])
    colour = [token.value for token in tokens if token.kind in (Kind.SHADE, Kind.COLOUR)]
    return Referent(
        noun=noun.value,
        head=noun.meant,
        colour=" ".join(colour) or None,
        qualifiers=tuple(dict.fromkeys(token.value for token in tokens if token.kind in _QUALIFIERS)),
        qualifiers_optional=optional,
        definite=all(token.kind is not Kind.ANY for token in tokens),
    )


def _landmark(part: Tree[Leaf], kept: list[Token]) -> Landmark:
    return Landmark(_values(part, kept, Kind.LANDMARK)[0], _values(part, kept, Kind.RELATION)[0])


def _distance_m(goal: Tree[Leaf], kept: list[Token]) -> float | None:
    numbers, units = _values(goal, kept, Kind.NUMBER), _values(goal, kept, Kind.UNIT)
    return float(numbers[0]) * float(units[0]) if numbers else None


def _is(part: Tree[Leaf] | Leaf | None, name: str) -> bool:
    return isinstance(part, Tree) and part.data == name


def _leaves(part: Tree[Leaf], kept: list[Token]) -> list[Token]:
    """The tokens below a node, in order."""
    columns = [leaf.start_pos for leaf in part.scan_values(lambda leaf: isinstance(leaf, Leaf))]
    return [kept[column] for column in sorted(columns)]


def _values(part: Tree[Leaf], kept: list[Token], kind: Kind) -> list[str]:
    return [token.value for token in _leaves(part, kept) if token.kind is kind]


def _misread(clause: list[Token], kept: list[Token], error: UnexpectedInput) -> _NotACommandError:
    """The problem of a clause that the grammar does not read: where, and what was expected there."""
    expected = {Kind(name) for name in getattr(error, "expected", ()) if name in Kind.__members__}
    wanted = next((text for kind, text in _WANTED.items() if kind in expected), "the end of the command")
    position = getattr(error, "pos_in_stream", None)
    at = kept[position] if position is not None and 0 <= position < len(kept) else None
    before = kept[position - 1] if position and at else kept[-1]
    gap = [
        t for t in clause if t.kind is Kind.UNKNOWN and t.start >= before.end and (at is None or t.end <= at.start)
    ]
    if gap and Kind.NOUN in expected:
        guess = did_you_mean(gap[-1].text, (Kind.NOUN, Kind.COLOUR, Kind.ORDINAL))
        hint = f" (did you mean '{guess}'?)" if guess else ""
        return _NotACommandError(f"'{gap[-1].text}' is not understood{hint}: expected {wanted}", gap[-1:])
    if at is None:
        return _NotACommandError(f"something is missing after '{before.text}': expected {wanted}", [before])
    return _NotACommandError(f"'{at.text}' is not understood here: expected {wanted}", [at])


def _notes(tokens: list[Token], clause: list[Token]) -> list[str]:
    """What was mended and what was left out."""
    mended = [
        token for token in clause if token.kind is not Kind.UNKNOWN and _letters(token.text) != _letters(token.meant)
    ]
    notes = [f"'{token.text}' was read as '{token.meant}'" for token in mended]
    idle = [token for token in tokens if token.kind not in (Kind.FILLER, Kind.BREAK, Kind.THE, Kind.ANY)]
    unread = [token.text for token in idle if token.kind is Kind.UNKNOWN or token not in clause]
    if unread:
        notes.append("not understood and left out: " + ", ".join(f"'{word}'" for word in unread[:8]))
    return notes


def _letters(text: str) -> str:
    """A phrase without the blanks and marks between its words."""
    return "".join(character for character in text if character.isalnum())


@cache
def _parser() -> Lark:
    terminals = "\n".join(f'{kind.name}: "{letter}"' for kind, letter in _LETTER.items() if kind.name in _GRAMMAR)
    return Lark(_GRAMMAR + terminals, parser="earley", lexer="basic", start="command")

"""Typed tokens -> query, by an Earley grammar over the kinds of tokens; unknown words are left out, and told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import dropwhile, groupby, pairwise

from lark import Lark, Tree
from lark import Token as Leaf
from lark.exceptions import UnexpectedInput

from grounding.lexicon import DIRECTIONS, NOT_SEEN, PLACED_ACTIONS, PLACED_RELATIONS, QUESTION, WEAK_VERBS, Kind
from grounding.query import Landmark, Query, Referent
from grounding.tokens import MAX_CHARACTERS, Token, did_you_mean, normalise, tokenise

# One letter a kind: the parser reads a string of them, and a column in it is the number of a token.
_LETTER = {kind: chr(ord("A") + i) for i, kind in enumerate(Kind)}
_GRAMMAR = """
command: ACTION (place | landmark)* [goal landmark*] | ACTION place* distance place*
place: SIDE | WHERE
goal: distance? RELATION? referent
distance: NUMBER UNIT
referent: (THE | ANY)* mark* NOUN said*
mark: SHADE | COLOUR | ORDINAL | SUPERLATIVE | STATE | SIZE | SIDE
said: SIDE | WHERE | STATE | COLOUR | distance WHERE
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
# Who acts after these is the other vehicle: "let it pass", "wait for it to turn".
_YIELDING = ("give_way", "wait")
_TRAFFIC = (Kind.NOUN, Kind.LANDMARK, Kind.SIDE, Kind.WHERE, Kind.UNIT)


@dataclass(frozen=True)
class Problem:
    """Why a sentence leads to no place: one line, and the characters of the normalised sentence it is about."""

    message: str
    start: int = 0
    end: int = 0


@dataclass(frozen=True)
class Reading:
    """What was made of a sentence.

    Attributes:
        query: the typed query; without an action where the sentence is no driving command, and with little else where
            it is one that is not read to its end.
        notes: what was mended or left out, one sentence each.
        problem: why the sentence is no command, or one that cannot be placed; None where it can.
    """

    query: Query
    notes: tuple[str, ...] = ()
    problem: Problem | None = None


class _UnreadError(Exception):
    """Carries a problem up to `read`."""

    def __init__(self, message: str, at: Sequence[Token] = ()) -> None:
        super().__init__(message)
        self.problem = Problem(message, at[0].start if at else 0, at[-1].end if at else 0)


def read(text: str) -> Reading:
    """The query of a sentence, or the problem with it; never raises for any text."""
    shown = text if len(text) <= MAX_CHARACTERS else text[:MAX_CHARACTERS]
    try:
        if len(text) > MAX_CHARACTERS:
            raise _UnreadError(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        tokens = tokenise(normalise(text))
        commands = _commands(tokens)
    except _UnreadError as error:
        return Reading(Query(shown), problem=error.problem)
    kept = _significant(commands[-1])
    try:
        _check_plain(tokens, commands)
        query = _query(shown, commands[0], kept)
        return Reading(query, tuple(_notes(tokens, commands[0])), _not_placed(kept, query))
    except _UnreadError as error:
        action, _, direction = _action(kept[0])
        return Reading(Query(shown, action, (action,), direction=direction), problem=error.problem)


def caret(text: str, problem: Problem) -> str:
    """The normalised sentence with carets under the place of a problem, '' where it has none."""
    if problem.end <= problem.start:
        return ""
    return f"  {normalise(text)}\n  {' ' * problem.start}{'^' * (problem.end - problem.start)}"


def _commands(tokens: list[Token]) -> list[list[Token]]:
    """The clauses that command something, each from its action on; at least one."""
    if not tokens:
        raise _UnreadError("the sentence holds no words")
    if all(token.kind in (*_SKIPPED, Kind.BREAK) for token in tokens):
        raise _UnreadError(f"no word of it is understood: expected a command such as '{_EXAMPLE}'")
    clauses = [list(part) for at_break, part in groupby(tokens, lambda t: t.kind is Kind.BREAK) if not at_break]
    statements = [clause for clause in clauses if not QUESTION.match(" ".join(token.text for token in clause))]
    commands = [command for clause in statements if (command := _from_action(clause)) and _drives(command, clause)]
    if not commands and len(statements) < len(clauses):
        raise _UnreadError("a question is no driving command", tokens[:1])
    if not commands:
        raise _UnreadError(f"no driving action in it: expected {_ACTIONS}")
    return commands


def _from_action(clause: list[Token]) -> list[Token]:
    return list(dropwhile(lambda token: token.kind is not Kind.ACTION, clause))


def _drives(command: list[Token], clause: list[Token]) -> bool:
    """Whether the verb is one of driving here: "turn left", "turn at the house", not "turn the music down"."""
    if command[0].meant not in WEAK_VERBS or all(token.kind is not Kind.UNKNOWN for token in command):
        return True
    return any(token.kind in _TRAFFIC for token in clause)


def _check_plain(tokens: list[Token], commands: list[list[Token]]) -> None:
    """Nothing in it that no grammar here reads, and one command only."""
    beyond = [token for token in tokens if token.kind is Kind.BEYOND]
    if beyond:
        raise _UnreadError(_cannot(beyond[:1]), beyond[:1])
    if len(commands) > 1:
        raise _UnreadError("one command at a time: expected a single sentence", commands[1])


def _not_placed(kept: list[Token], query: Query) -> Problem | None:
    """The problem of what is understood and has no place here, None where all of it has."""
    at = _unplaced(kept)
    if query.distance_of in ("ego", "descriptor"):
        at = at or [token for token in kept if token.kind in (Kind.NUMBER, Kind.UNIT)][-2:]
    return _UnreadError(_cannot(at), at).problem if at else None


def _unplaced(kept: list[Token]) -> list[Token]:
    """The first of the tokens whose meaning has no place here, if there is one."""
    return [
        token
        for token in kept
        if (token.kind is Kind.ACTION and _action(token)[0] not in PLACED_ACTIONS)
        or (token.kind is Kind.RELATION and token.value not in PLACED_RELATIONS)
        or token.value in NOT_SEEN
    ][:1]


def _cannot(at: list[Token]) -> str:
    return f"'{' '.join(token.text for token in at)}': cannot be placed yet; expected {_ACTIONS}, by one vehicle"


def _action(token: Token) -> tuple[str, str | None, str | None]:
    """Action, implied relation and direction of an ACTION."""
    action, *more = token.value.split()
    implied = more[0] if more else None
    return (action, None, implied) if implied in DIRECTIONS else (action, implied, None)


def _query(text: str, clause: list[Token], kept: list[Token]) -> Query:
    """The query of a clause and of those of its tokens that the grammar sees."""
    try:
        tree = _parser().parse("".join(_LETTER[token.kind] for token in kept))
    except UnexpectedInput as error:
        raise _misread(clause, kept, error) from None
    action, implied, direction = _action(kept[0])
    goal = next(iter(tree.find_data("goal")), None)
    relation = next(iter(_values(goal, kept, Kind.RELATION)), implied) if goal else None
    if goal and not relation and action in PLACED_ACTIONS:
        raise _UnreadError(f"'{kept[0].text}' what way? expected {_WANTED[Kind.RELATION]}", _leaves(goal, kept))
    places = [token for part in tree.children if _is(part, "place") for token in _leaves(part, kept)]
    sides = [place.value.removesuffix("_side") for place in places if place.value in ("left_side", "right_side")]
    optional = tuple(place.value for place in places if place.kind is Kind.WHERE)
    distance_m, distance_of = _distance(tree, kept)
    return Query(
        command=text,
        action=action,
        actions=(action,),
        relation=relation or "none",
        landmark="referent" if goal else "secondary" if any(tree.find_data("landmark")) else None,
        referent=_referent(goal, kept, optional) if goal else None,
        goal_side=sides[-1] if sides else None,
        secondary=tuple(_landmark(part, kept) for part in tree.children if _is(part, "landmark")),
        distance_m=distance_m,
        distance_of=distance_of,
        direction=direction,
    )


def _significant(clause: list[Token]) -> list[Token]:
    """What the grammar sees: no fillers, the last of actions in a row, articles only before their noun phrase."""
    kept = _last_of_a_row([token for token in clause if token.kind not in _SKIPPED])
    if kept[0].value in _YIELDING:
        kept = [kept[0], *(token for token in kept[1:] if token.kind is not Kind.ACTION)]
    last = Token(Kind.BREAK, "", "", "", 0, 0)
    articles = (Kind.THE, Kind.ANY)
    ends = (Kind.BREAK, Kind.ACTION, Kind.RELATION, Kind.NUMBER, Kind.WHERE)
    return [
        token
        for token, following in pairwise([*kept, last])
        if not (token.kind in articles and following.kind in ends)
    ]


def _last_of_a_row(tokens: list[Token]) -> list[Token]:
    """Without actions that another one follows at once: "pull up and stop" is to stop."""
    following = [*(token.kind for token in tokens[1:]), Kind.BREAK]
    return [t for t, kind in zip(tokens, following, strict=True) if not (t.kind is kind is Kind.ACTION)]


def _referent(goal: Tree[Leaf], kept: list[Token], optional: tuple[str, ...]) -> Referent:
    """The vehicle of a goal."""
    tokens = _leaves(next(iter(goal.find_data("referent"))), kept)
    noun = next(token for token in tokens if token.kind is Kind.NOUN)
    colours = [token for token in tokens if token.kind is Kind.COLOUR]
    if len(colours) > 1:
        raise _UnreadError("one colour at a time: expected a single colour word", colours[1:])
    colour = [token.value for token in tokens if token.kind in (Kind.SHADE, Kind.COLOUR)]
    return Referent(
        noun=noun.value,
        head=noun.meant,
        colour=" ".join(colour) or None,
        qualifiers=_qualifiers(tokens),
        qualifiers_optional=optional,
        definite=all(token.kind is not Kind.ANY for token in tokens),
    )


def _landmark(part: Tree[Leaf], kept: list[Token]) -> Landmark:
    return Landmark(_values(part, kept, Kind.LANDMARK)[0], _values(part, kept, Kind.RELATION)[0])


def _qualifiers(tokens: list[Token]) -> tuple[str, ...]:
    """What is said of a vehicle; "the second from the left" is counted from there, "the car from the left" is not."""
    counted = any(token.kind is Kind.ORDINAL for token in tokens)
    values = [token.value for token in tokens if token.kind in _QUALIFIERS]
    sides = {f"from_{side}": f"{side}most" if counted else f"{side}_side" for side in ("left", "right")}
    return tuple(dict.fromkeys(sides.get(value, value) for value in values))


def _distance(tree: Tree[Leaf], kept: list[Token]) -> tuple[float | None, str | None]:
    """The first distance in metres and what it is of: the referent (the gap), the ego's way, or a descriptor."""
    for parent, of in (("goal", "referent"), ("said", "descriptor"), ("command", "ego")):
        for part in tree.find_data(parent):
            for child in part.children:
                if _is(child, "distance") and isinstance(child, Tree):
                    number, unit = (float(token.value) for token in _leaves(child, kept))
                    return number * unit, of
    return None, None


def _is(part: Tree[Leaf] | Leaf | None, name: str) -> bool:
    return isinstance(part, Tree) and part.data == name


def _leaves(part: Tree[Leaf], kept: list[Token]) -> list[Token]:
    """The tokens below a node, in order."""
    columns = [leaf.start_pos for leaf in part.scan_values(lambda leaf: isinstance(leaf, Leaf))]
    return [kept[column] for column in sorted(columns)]


def _values(part: Tree[Leaf], kept: list[Token], kind: Kind) -> list[str]:
    return [token.value for token in _leaves(part, kept) if token.kind is kind]


def _misread(clause: list[Token], kept: list[Token], error: UnexpectedInput) -> _UnreadError:
    """The problem of a clause that the grammar does not read: where, and what was expected there."""
    if at_once := _unplaced(kept):
        return _UnreadError(_cannot(at_once), at_once)
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
        return _UnreadError(f"'{gap[-1].text}' is not understood{hint}: expected {wanted}", gap[-1:])
    if at is None:
        return _UnreadError(f"something is missing after '{before.text}': expected {wanted}", [before])
    return _UnreadError(f"'{at.text}' is not understood here: expected {wanted}", [at])


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

"""Tokens of a clause -> parts: noun phrases, each with what is said of it before its noun, and single words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind

# One letter a kind; all others, which stand alone, are dots.
_LETTERS = (
    {Kind.THE: "d", Kind.ANY: "d", Kind.POSSESSIVE: "d", Kind.NUMBER: "n", Kind.UNKNOWN: "u", Kind.MAKE: "k"}
    | dict.fromkeys((Kind.COLOUR, Kind.SHADE, Kind.ORDINAL, Kind.SUPERLATIVE, Kind.STATE, Kind.SIZE, Kind.EXTRA), "m")
    | dict.fromkeys(
        (Kind.NOUN, Kind.MODEL, Kind.PERSON, Kind.THING, Kind.REGION, Kind.SPOT, Kind.PART, Kind.ONE), "h"
    )
    | {Kind.PRONOUN: "p", Kind.EGO: "e", Kind.RELATION: "r"}
)
# A noun phrase: with an article ("the red one", "the big bakery", "the second"), or without ("parked black cars").
_PHRASE = re.compile(r"d+[mukn]+h*|d+h+|[mkn]*[hk]+|m+|n+|p|e|(?<=r)u+")
_ANYBODY = ("everyone", "everybody", "someone", "somebody", "anyone", "anybody", "people")
_EXTRA = (Kind.EXTRA, Kind.UNKNOWN, Kind.POSSESSIVE, Kind.MAKE)
_QUALIFIERS = (Kind.ORDINAL, Kind.SUPERLATIVE, Kind.STATE, Kind.SIZE)


@dataclass(eq=False)
class Phrase:
    """A noun phrase while a sentence is read; what follows it is added.

    Attributes:
        kind: vehicle, traffic, person, thing, region, spot, part; one (stands for a noun said before), pronoun, ego;
            adjective (no noun at all).
        noun: what the word stands for, '' for what has none.
        head: the word itself.
        start: first character in the normalised sentence.
        colour: as in `Referent`.
        qualifiers: as in `Referent`, in order.
        optional: likewise.
        number: of things, 0 where a plural leaves it open.
        definite: "the", "that" and not "a".
        extra: what no map can show.
        excluded: colour and qualifiers that it may not have.
        links: what stands in a relation to it.
        late: qualifiers said after the noun.
        known: whether the lexicon has its noun.
        in_line: as in `Referent`.
    """

    kind: str
    noun: str = ""
    head: str = ""
    start: int = 0
    colour: str | None = None
    qualifiers: list[str] = field(default_factory=list)
    optional: list[str] = field(default_factory=list)
    number: int = 1
    definite: bool = True
    extra: list[str] = field(default_factory=list)
    excluded: list[tuple[str | None, tuple[str, ...]]] = field(default_factory=list)
    links: list[tuple[str, Phrase]] = field(default_factory=list)
    late: list[str] = field(default_factory=list)
    known: bool = True
    in_line: bool = False

    def qualify(self, value: str) -> None:
        """Add what is said after the noun; "the second from the left" is counted from there."""
        counted = any(word in ("first", "second", "third", "fourth", "next", "last") for word in self.qualifiers)
        if value in ("from_left", "from_right"):
            value = value.removeprefix("from_") + ("most" if counted else "_side")
        if value not in self.qualifiers:
            self.qualifiers.append(value)
            self.late.append(value)

    def become(self, other: Phrase) -> None:
        """Take the noun of another phrase."""
        self.kind, self.noun, self.head = other.kind, other.noun, other.head

    def refine_into(self, one: Phrase) -> None:
        """Give a phrase without a noun this noun, and what is said of it."""
        one.become(self)
        one.colour = one.colour or self.colour
        for value in self.qualifiers:
            one.qualify(value)


Part = Phrase | Token


def parts(tokens: Sequence[Token]) -> Iterator[Part]:
    """The parts of a clause in order; every token is in one."""
    letters = "".join(_LETTERS.get(token.kind, ".") for token in tokens)
    at = 0
    for match in _PHRASE.finditer(letters):
        yield from tokens[at : match.start()]
        middle = _second(tokens, match.start(), match.end())
        yield _phrase(tokens[match.start() : middle])
        if middle < match.end():
            yield _phrase(tokens[middle : match.end()])
        at = match.end()
    yield from tokens[at:]


def _second(tokens: Sequence[Token], start: int, end: int) -> int:
    """Where a second noun phrase begins, as in "give the truck room", "the bus everyone takes"; else the end."""
    for i in range(start + 1, end):
        if tokens[i].text in _ANYBODY and tokens[i - 1].kind is Kind.NOUN:
            return i
    verb, last = tokens[start - 1] if start else tokens[start], tokens[end - 1]
    given = verb.kind is Kind.VERB and verb.value in ("give", "leave", "give_way") and last.kind is Kind.SPOT
    owner = tokens[end - 2].kind in (Kind.NOUN, Kind.PERSON) if end - start > 1 else False
    return end - 1 if given and owner else end


def _phrase(tokens: Sequence[Token]) -> Phrase:
    phrase = _head(tokens)
    phrase.start = tokens[0].start
    for token in tokens:
        if token.kind in (Kind.THE, Kind.ANY):
            phrase.definite = token.kind is Kind.THE
        elif token.kind is Kind.COLOUR and phrase.colour is None:
            shades = [other.value for other in tokens if other.kind is Kind.SHADE]
            phrase.colour = " ".join([*shades[:1], token.value])
        elif token.kind in _QUALIFIERS:
            phrase.qualifiers += [value for value in token.value.split() if value not in phrase.qualifiers]
        elif token.kind is Kind.NUMBER:
            phrase.number = 2 if token.value == "2" else int(token.value == "1")
        elif token.kind in _EXTRA and token.meant not in (phrase.head, "my", "our", "your"):
            phrase.extra.append(token.meant)
    if phrase.colour is None:
        phrase.colour = next((token.value for token in tokens if token.kind is Kind.SHADE), None)
    return phrase


def _head(tokens: Sequence[Token]) -> Phrase:
    """The phrase with its noun only."""
    last = tokens[-1]
    owners = [token for token in tokens if token.kind is Kind.NOUN]
    if last.kind is Kind.PART and owners:
        last = owners[-1]  # "the van's blinker", "the car door": what is said of it is said of the vehicle
    plural = int(last.form != "plural")
    if last.kind is Kind.NOUN:
        kind = "traffic" if last.value == "traffic" else "vehicle"
        head = last.text.removesuffix("'s")
        return Phrase(kind, "vehicle" if kind == "traffic" else last.value, head, number=plural)
    if last.kind in (Kind.MAKE, Kind.MODEL):
        return Phrase("vehicle", last.value or "car", last.text, number=plural)
    if last.kind is Kind.PERSON:
        return Phrase("person", "person", last.text, number=plural)
    if last.kind in (Kind.THING, Kind.REGION):
        return Phrase(last.kind.value, last.value or last.meant.replace(" ", "_"), last.text, number=plural)
    if last.kind in (Kind.SPOT, Kind.PART):
        noun = "parking_spot" if last.kind is Kind.SPOT else last.meant.replace(" ", "_")
        return Phrase(last.kind.value, noun, last.text, number=plural)
    if last.kind is Kind.UNKNOWN:
        unknown = [token.meant for token in tokens if token.kind is Kind.UNKNOWN]
        return Phrase("thing", "_".join(unknown), last.text, known=False)
    if last.kind is Kind.PRONOUN:
        return Phrase("pronoun", head=last.text)
    if last.kind is Kind.EGO:
        return Phrase("ego", head=last.text)
    named = last.kind is Kind.ONE or tokens[0].kind in (Kind.THE, Kind.ANY)
    return Phrase("one" if named else "adjective", head=last.text, number=plural)

"""Chunker: groups the tokens of a clause into noun phrases; the other tokens stay single."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import MODIFIERS, NOUNS, WordCategory
from grounding.vocabulary import ORDINALS

# Letter of each category in a noun phrase; all other categories are dots.
_LETTERS = (
    {
        WordCategory.THE: "d",
        WordCategory.ANY: "d",
        WordCategory.POSSESSIVE: "d",
        WordCategory.NUMBER: "n",
        WordCategory.UNKNOWN: "u",
        WordCategory.MAKE: "k",
    }
    | dict.fromkeys(MODIFIERS - {WordCategory.MAKE}, "m")
    | dict.fromkeys(
        (
            WordCategory.NOUN,
            WordCategory.MODEL,
            WordCategory.PERSON,
            WordCategory.THING,
            WordCategory.REGION,
            WordCategory.SPOT,
            WordCategory.PART,
            WordCategory.ONE,
        ),
        "h",
    )
    | {WordCategory.PRONOUN: "p", WordCategory.EGO: "e", WordCategory.RELATION: "r"}
)
# Noun phrases with an article ("the red one", "the big bakery", "the second") and without ("parked black cars").
_PHRASE = re.compile(r"d+[mukn]+h*|d+h+|[mkn]*[hk]+|m+|n+|p|e|(?<=r)u+")
# What a person wears: "the woman in blue", "the girl with the yellow coat".
_WORN = re.compile(r"r(?:m(?![mukhn])|[dmun]*m[mun]*h)")
_INDEFINITE_PRONOUNS = ("everyone", "everybody", "someone", "somebody", "anyone", "anybody", "people")
_PLURALS = ("people", "folks", "police", "cattle", "everyone", "everybody")
_EXTRA = (WordCategory.EXTRA, WordCategory.UNKNOWN, WordCategory.POSSESSIVE, WordCategory.MAKE)
_QUALIFIERS = (WordCategory.ORDINAL, WordCategory.SUPERLATIVE, WordCategory.STATE, WordCategory.SIZE)
# Kinds of noun phrases for vehicles and for places.
VEHICLE_KINDS = ("vehicle", "traffic")
PLACE_KINDS = ("spot", "region")


@dataclass(eq=False, kw_only=True)
class NounPhrase:
    """A noun phrase; the interpreter adds the words that qualify it later in the sentence.

    Attributes:
        kind: vehicle, traffic, person, thing, region, spot, part; one (stands for an earlier noun), pronoun, ego;
            adjective (no noun).
        noun: meaning of the head, '' for a word without meaning of its own.
        head: head word as written.
        start: first character in the normalised sentence.
        colour: as in `Referent`.
        qualifiers: as in `Referent`, in order.
        number: number of objects, 0 for a plural without a number.
        definite: whether the determiner is definite ("the", "that").
        extra: attributes that the map cannot show.
        excluded: colours and qualifiers that it may not have.
        related: further noun phrases, each with the relation of this one to it.
        postmodifiers: the qualifiers that follow the noun.
        in_lexicon: whether the lexicon holds its noun.
        in_line: as in `Referent`.
        clothes: as in `Referent`.
        distance_m: as in `Exclusion`.
    """

    kind: str
    noun: str = ""
    head: str = ""
    start: int = 0
    colour: str | None = None
    qualifiers: list[str] = field(default_factory=list)
    number: int = 1
    definite: bool = True
    extra: list[str] = field(default_factory=list)
    excluded: list[tuple[str | None, tuple[str, ...]]] = field(default_factory=list)
    related: list[tuple[str, NounPhrase]] = field(default_factory=list)
    postmodifiers: list[str] = field(default_factory=list)
    in_lexicon: bool = True
    in_line: bool = False
    clothes: str | None = None
    distance_m: float | None = None

    def add_qualifier(self, value: str) -> None:
        """Add a qualifier that follows the noun; "from the left" after an ordinal is the start of counting."""
        ordinal = any(word in (*ORDINALS, "last") for word in self.qualifiers)
        if value in ("from_left", "from_right"):
            value = value.removeprefix("from_") + ("most" if ordinal else "_side")
        if value not in self.qualifiers:
            self.qualifiers.append(value)
            self.postmodifiers.append(value)

    def take_noun(self, other: NounPhrase) -> None:
        """Take kind, noun and head of another noun phrase."""
        self.kind, self.noun, self.head = other.kind, other.noun, other.head

    def merge_into(self, other: NounPhrase) -> None:
        """Give a noun phrase without a noun this noun, colour and qualifiers."""
        other.take_noun(self)
        other.colour = other.colour or self.colour
        for value in self.qualifiers:
            other.add_qualifier(value)


Chunk = NounPhrase | Token


def chunk(tokens: Sequence[Token]) -> Iterator[Chunk]:
    """Yield the chunks of a clause in order; every token is in exactly one."""
    letters = "".join(_LETTERS.get(token.category, ".") for token in tokens)
    at = 0
    for match in _PHRASE.finditer(letters):
        if match.start() < at:
            continue  # the colour of clothes
        yield from tokens[at : match.start()]
        middle = _second_start(tokens, match.start(), match.end())
        phrase, at = _noun_phrase(tokens[match.start() : middle]), match.end()
        if phrase.kind == "person" and (worn := _WORN.match(letters, at)) and _is_clothing(tokens[at : worn.end()]):
            clothing, at = _noun_phrase(tokens[at + 1 : worn.end()]), worn.end()
            phrase.clothes, phrase.colour = clothing.clothes, None if clothing.clothes else clothing.colour
        yield phrase
        if middle < match.end():
            yield _noun_phrase(tokens[middle : match.end()])
    yield from tokens[at:]


def named_clothes(tokens: Sequence[Token]) -> str | None:
    """Return the colour of the clothes that a person is said to wear in some words, the first if several are."""
    phrases = (one for one in chunk(tokens) if isinstance(one, NounPhrase))
    return next((one.clothes for one in phrases if one.clothes), None)


def _is_clothing(tokens: Sequence[Token]) -> bool:
    """Return whether a preposition and what follows it tell the colour of clothes."""
    coloured = any(token.category is WordCategory.COLOUR for token in tokens)
    return coloured and tokens[0].value in ("in", "with") and tokens[-1].value in ("clothes", tokens[1].value)


def _second_start(tokens: Sequence[Token], start: int, end: int) -> int:
    """Return where a second noun phrase begins ("give the truck room", "the bus everyone takes"); `end` if none."""
    for i in range(start + 1, end):
        if tokens[i].text in _INDEFINITE_PRONOUNS and tokens[i - 1].category is WordCategory.NOUN:
            return i
    verb, last = tokens[start - 1] if start else tokens[start], tokens[end - 1]
    takes_two = verb.category is WordCategory.VERB and verb.value in ("give", "leave", "give_way")
    recipient = end - start > 1 and tokens[end - 2].category in (WordCategory.NOUN, WordCategory.PERSON)
    return end - 1 if takes_two and last.category is WordCategory.SPOT and recipient else end


def _noun_phrase(tokens: Sequence[Token]) -> NounPhrase:
    """Return the noun phrase of a group of tokens."""
    phrase = _head(tokens)
    phrase.start = tokens[0].start
    for token in tokens:
        if token.category in (WordCategory.THE, WordCategory.ANY):
            phrase.definite = token.category is WordCategory.THE
        elif token.category is WordCategory.COLOUR and phrase.colour is None:
            shades = [other.value for other in tokens if other.category is WordCategory.SHADE]
            phrase.colour = " ".join([*shades[:1], token.value])
        elif token.category in _QUALIFIERS:
            phrase.qualifiers += [value for value in token.value.split() if value not in phrase.qualifiers]
        elif token.category is WordCategory.NUMBER:
            phrase.number = 2 if token.value == "2" else int(token.value == "1")
        elif token.category in _EXTRA and token.text not in (phrase.head, "my", "our", "your"):
            phrase.extra.append(token.text)
    if phrase.colour is None:
        phrase.colour = next((token.value for token in tokens if token.category is WordCategory.SHADE), None)
    if phrase.kind == "part" and tokens[-1].value == "clothes":
        phrase.clothes = phrase.colour
    return phrase


def _head(tokens: Sequence[Token]) -> NounPhrase:
    """Return the noun phrase with kind, noun, head and number, without its modifiers."""
    last = tokens[-1]
    owners = [token for token in tokens if token.category is WordCategory.NOUN]
    if last.category is WordCategory.PART and owners:
        last = owners[-1]  # "the van's blinker", "the car door": qualifiers belong to the vehicle
    number = int(last.form != "plural" and last.text not in _PLURALS)
    if last.category is WordCategory.UNKNOWN:
        unknown = [token.text for token in tokens if token.category is WordCategory.UNKNOWN]
        return NounPhrase(kind="thing", noun="_".join(unknown), head=last.text, in_lexicon=False)
    if last.category in (WordCategory.PRONOUN, WordCategory.EGO):
        return NounPhrase(kind=last.category.value, head=last.text)
    if last.category is WordCategory.NOUN:
        kind = "traffic" if last.value == "traffic" else "vehicle"
        noun = "vehicle" if kind == "traffic" else last.value
        return NounPhrase(kind=kind, noun=noun, head=last.text.removesuffix("'s"), number=number)
    if last.category in (WordCategory.MAKE, WordCategory.MODEL):
        return NounPhrase(kind="vehicle", noun=last.value or "car", head=last.text, number=number)
    if last.category in NOUNS:
        return NounPhrase(kind=last.category.value, noun=_noun(last), head=last.text, number=number)
    has_noun = last.category is WordCategory.ONE or tokens[0].category in (WordCategory.THE, WordCategory.ANY)
    return NounPhrase(kind="one" if has_noun else "adjective", head=last.text, number=number)


def _noun(head: Token) -> str:
    """Return the meaning of a noun other than a vehicle's."""
    if head.category is WordCategory.PERSON:
        return "person"
    if head.category is WordCategory.SPOT:
        return "parking_spot"
    value = head.value if head.category in (WordCategory.THING, WordCategory.REGION) else ""
    return value or head.text.replace(" ", "_")

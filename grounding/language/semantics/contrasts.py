"""Contrasts and self-repairs: rewrite "not X, Y" and "X, no, Y" to forms without a reparandum.

The tagged tokens of a text become a string with one letter for each category. Regular expressions over these
letters are the grammar of contrasts. Each rule replaces the tokens of its match; the first rule that matches is
applied until none does. The terms are those of Shriberg (1994), "Preliminaries to a Theory of Speech Disfluencies":
the *repair* replaces the *reparandum* before the *editing term* ("no", "i mean").
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from grounding.language.syntax.clauses import conjunction_as_relation
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import MODIFIERS, NOUNS, WordCategory

_LETTERS = (
    dict.fromkeys((WordCategory.THE, WordCategory.ANY, WordCategory.POSSESSIVE), "d")
    | dict.fromkeys(MODIFIERS - {WordCategory.MAKE}, "m")
    | dict.fromkeys((*NOUNS, WordCategory.MAKE, WordCategory.MODEL), "h")
    | dict.fromkeys((WordCategory.RELATION, WordCategory.BETWEEN), "r")
    | {
        WordCategory.NUMBER: "n",
        WordCategory.UNKNOWN: "u",
        WordCategory.ONE: "o",
        WordCategory.PRONOUN: "p",
        WordCategory.EGO: "e",
        WordCategory.SIDE: "s",
        WordCategory.WHERE: "w",
        WordCategory.LANE: "l",
        WordCategory.DIRECTION: "t",
        WordCategory.DISTANCE: "x",
        WordCategory.VERB: "v",
        WordCategory.NOT: "N",
        WordCategory.EXCEPT: "E",
        WordCategory.CORRECT: "C",
        WordCategory.COMMA: ",",
        WordCategory.BREAK: ".",
        WordCategory.BUT: "B",
        WordCategory.AND: "A",
        WordCategory.OR: "O",
        WordCategory.WHICH: "W",
        WordCategory.BE: "b",
        WordCategory.AUX: "a",
        WordCategory.SUB: "S",
        WordCategory.TO: "T",
        WordCategory.THEN: "H",
        WordCategory.HERE: "k",
        WordCategory.OF: "f",
    }
)
# A noun phrase, with the places that follow it, and a place: a preposition with its noun phrase, or a single word.
_NOUN = r"(?:d*[mnu]*[ho]+|d+[mn]+|p)"
_WHOLE_NOUN = rf"(?:{_NOUN}(?:(?:Wb?)?[swlt]+|(?:Wb?)r+{_NOUN})*)"
_PLACE = rf"(?:r+{_NOUN}(?:Wb?)?[swl]*|[swlt])"
_END = r"(?=[,.]|$|[AH]|v|T|(?<=[ho])d)"
_MAX_REWRITES = 12
_SIDES = ("left", "right")

# The matched tokens -> their replacement; None if the rule does not apply after all.
_Rewrite = Callable[[list[Token], "re.Match[str]"], list[Token] | None]


def resolve_contrasts(tokens: Sequence[Token]) -> list[Token]:
    """Return tagged tokens with contrasts in the order "Y, not X" and with self-repairs carried out.

    A repair whose reparandum is not found stays as it is.
    """
    if not any(_letter(token) in "NECBMF" or _is_ending(token) for token in tokens):
        return list(tokens)
    current = [conjunction_as_relation(token, tokens[i + 1 :]) for i, token in enumerate(tokens)]
    for _ in range(_MAX_REWRITES):
        rewritten = _rewrite_once(current)
        if rewritten is None:
            break
        current = rewritten
    return current


def has_partial_repair(tokens: Sequence[Token]) -> bool:
    """Return whether a text repairs a part of a command, not a whole one: "no, the bus"."""
    return bool(re.search(r"[^.,C][,.]*C[,.C]*[^evNT.,C]", "".join(map(_letter, tokens))))


def _letter(token: Token) -> str:
    """Return the letter of a token; "M" for a negation of the next word alone ("non"), "F" for "far from"."""
    if token.category is WordCategory.NOT and token.value:
        return {"attribute": "M", "far": "F"}[token.value]
    return _LETTERS.get(token.category, "z")


def _rewrite_once(tokens: list[Token]) -> list[Token] | None:
    """Return the tokens after the first rule that applies, None if none does."""
    letters = "".join(map(_letter, tokens))
    for pattern, rewrite in _RULES:
        for match in pattern.finditer(letters):
            replacement = rewrite(tokens, match)
            if replacement is not None:
                return [*tokens[: match.start()], *replacement, *tokens[match.end() :]]
    return None


def _span(tokens: Sequence[Token], match: re.Match[str], group: str) -> list[Token]:
    return list(tokens[match.start(group) : match.end(group)])


# ---------------------------------------------------------------- negation


def _is_ending(token: Token) -> bool:
    """Return whether a verb ends an action: "stop following", "avoid parking"."""
    return token.category is WordCategory.VERB and token.value in ("stop", "avoid") and " " not in token.text


def _negate_ended(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "avoid parking" to "not parking", and "stop parking and go" to "not parking, then go"."""
    (first, second), after = tokens[match.start() :][:2], _span(tokens, match, "after")
    if not _is_ending(first) or second.form != "ing":
        return None
    if after and _letter(after[-1]) == "A":
        after[-1] = replace(after[-1].with_category(WordCategory.THEN), text="then")
    return [first.with_category(WordCategory.NOT), replace(second, form=""), *after]


def _negate_modifier(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "a non-black car" to "a car that is not black"."""
    negation = _span(tokens, match, "not")
    which = negation[0].with_category(WordCategory.WHICH, "that is")
    before, noun, modifier = (_span(tokens, match, group) for group in ("before", "noun", "modifier"))
    return [*before, *noun, replace(which, text="that is"), *negation, *modifier]


def _end_negation(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "don't stop until you are past the bus" to "stop past the bus"."""
    verb, relation = tokens[match.start() + 1 :][:2]
    return [verb, relation] if relation.text.startswith(("until", "till")) else None


def _negate_place(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "near no truck" and "near anything but a truck" to ", not near a truck"."""
    relation, negation, noun = (_span(tokens, match, group) for group in ("relation", "not", "noun"))
    named = [_vehicle(token) if token.category is WordCategory.ONE else token for token in noun]
    return [_comma(relation[0]), negation[0].with_category(WordCategory.NOT), *relation, *named]


def _vehicle(token: Token) -> Token:
    return replace(token.with_category(WordCategory.NOUN, "vehicle"), text="vehicle", written="vehicle")


def _negate_nearness(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "far from the bus" to ", not near the bus"."""
    far, noun = _span(tokens, match, "far"), _span(tokens, match, "noun")
    near = far[0].with_category(WordCategory.RELATION, "near")
    return [_comma(far[0]), far[0].with_category(WordCategory.NOT), near, *noun]


# ---------------------------------------------------------------- contrast


def _contrast(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "not X, Y" and "don't stop behind X but behind Y" to "Y, not X"."""
    negation, verb, rejected, chosen = (_span(tokens, match, name) for name in ("not", "verb", "rejected", "chosen"))
    if _letter(rejected[0]) in "st" and _letter(rejected[0]) != _letter(chosen[0]):
        return None
    if _letter(rejected[0]) == "t":
        return [*verb, *chosen]  # of two directions the other one is excluded by the choice
    chosen = _complete(chosen, rejected)
    return [*verb, *chosen, _comma(negation[0]), negation[0].with_category(WordCategory.NOT), *rejected]


def _share_noun(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "in front of, not behind, the van" to "in front of the van, not behind the van"."""
    chosen, rejected, noun = (_span(tokens, match, name) for name in ("chosen", "rejected", "noun"))
    negation = chosen[0].with_category(WordCategory.NOT)
    return [*chosen, *noun, _comma(chosen[0]), negation, *rejected, *noun]


def _choose_relation(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "not behind, in front" to "in front of it"."""
    chosen = tokens[match.start("chosen")]
    if _letter(chosen) == "w":
        if "front" not in chosen.text:
            return None
        chosen = chosen.with_category(WordCategory.RELATION, "in_front_of")
    return [chosen, replace(chosen.with_category(WordCategory.PRONOUN), text="it", written="")]


def _choose_direction(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "don't go left around the van, go right" to "go right around the van"."""
    rejected, chosen = tokens[match.start("rejected")], tokens[match.start("chosen")]
    values = [rejected.value, chosen.value]
    return [chosen, *_span(tokens, match, "place")] if {*values} == {"turn left", "turn right"} else None


def _comma(token: Token) -> Token:
    return replace(token.with_category(WordCategory.COMMA), text=",", written=",")


def _complete(chosen: Sequence[Token], model: Sequence[Token]) -> list[Token]:
    """Return a phrase with its pronoun or its "one" replaced by the words of the phrase that it stands for."""
    letters = "".join(map(_letter, model))
    found = list(re.finditer(_NOUN, letters))
    if not found or "p" in found[-1].group():
        return list(chosen)
    whole = list(model[found[-1].start() : found[-1].end()])
    heads = [token for token in whole if _letter(token) in "h"]
    completed: list[Token] = []
    for token in chosen:
        if _letter(token) == "p":
            completed += whole
        elif _letter(token) == "o" and heads:
            completed += heads
        else:
            completed.append(token)
    adjective = not any(_letter(token) in "hop" for token in chosen) and _letter(chosen[0]) in "dm"
    return [*completed, *heads] if adjective else completed  # "the first van, or rather the second"


# ---------------------------------------------------------------- self-repair


def _repair(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Replace the reparandum by the repair: "the blue, no, the green truck"."""
    before, repair = _span(tokens, match, "before"), _span(tokens, match, "repair")
    letters = "".join(map(_letter, before))
    first = _letter(repair[0])
    if first == "r":
        return _replace_from(before, letters.rfind("r"), repair)
    if first == "w" and "front" in repair[0].text and (at := letters.rfind("r")) >= 0:
        return [*before[:at], before[at].with_category(WordCategory.RELATION, "in_front_of"), *before[at + 1 :]]
    if first in "st":
        return _replace_side(before, repair)
    if first in "lwx":
        return _replace_from(before, letters.rfind(first), repair, length=1)
    if all(_letter(token) == "m" for token in repair):
        return _replace_modifier(before, repair)
    nouns = [found for found in re.finditer(_WHOLE_NOUN, letters) if "p" not in found.group()]
    if not nouns or not _may_replace(before[nouns[-1].start() : nouns[-1].end()], repair):
        return None
    repaired = _replace_from(before, nouns[-1].start(), repair)
    reparandum = before[nouns[-1].start() : nouns[-1].end()]
    if repaired is None or not _names_another(reparandum, repair):
        return repaired
    return [*repaired, _comma(repair[0]), repair[0].with_category(WordCategory.NOT), *reparandum]


def _replace_from(
    before: list[Token], at: int, repair: Sequence[Token], length: int | None = None
) -> list[Token] | None:
    """Return `before` with its tokens from `at` on, or `length` of them, replaced; None without a reparandum."""
    if at < 0:
        return None
    end = len(before) if length is None else at + length
    return [*before[:at], *_complete(repair, before[at:end]), *before[end:]]


def _replace_side(before: list[Token], repair: Sequence[Token]) -> list[Token] | None:
    """Replace the last side or direction, which may be part of a verb ("turn left")."""
    side = repair[0].value.removesuffix("_side")
    for at in range(len(before) - 1, -1, -1):
        token = before[at]
        words = token.value.replace("_", " ").split()
        named = [word for word in words if word in _SIDES]
        if not named or side not in _SIDES:
            continue
        changed = replace(token, value=token.value.replace(named[0], side))
        return [*before[:at], changed, *before[at + 1 :], *repair[1:]]
    return None


def _replace_modifier(before: list[Token], repair: Sequence[Token]) -> list[Token] | None:
    """Replace the last modifier of the same category: "the blue truck, no, green"."""
    for at in range(len(before) - 1, -1, -1):
        if before[at].category is repair[0].category:
            return [*before[:at], *repair, *before[at + 1 :]]
    return None


def _may_replace(reparandum: Sequence[Token], repair: Sequence[Token]) -> bool:
    """Return whether both noun phrases are vehicles, or neither is; one without a noun may be either."""
    kinds = [
        {token.category in (WordCategory.NOUN, WordCategory.MAKE, WordCategory.MODEL) for token in part}
        for part in ([t for t in reparandum if _letter(t) == "h"], [t for t in repair if _letter(t) == "h"])
    ]
    return not kinds[0] or not kinds[1] or bool(kinds[0] & kinds[1])


def _names_another(reparandum: Sequence[Token], repair: Sequence[Token]) -> bool:
    """Return whether a complete reparandum differs from the repair in its modifiers alone: "the red car"."""
    heads = [[token.value for token in part if _letter(token) == "h"] for part in (reparandum, repair)]
    described = any(_letter(token) in "msw" for token in reparandum)
    return described and bool(heads[0]) and heads[1] in ([], heads[0])


def _contrast_patterns(verb: str, separator: str) -> list[re.Pattern[str]]:
    """Return the patterns of a contrast between noun phrases and of one between places."""
    return [
        re.compile(
            rf"(?P<not>[NE])(?P<verb>{verb})(?P<rejected>{part})(?:W?ea)?{separator},?(?:ea)?(?P<chosen>{part}){_END}"
        )
        for part in (_WHOLE_NOUN, _PLACE)
    ]


_REPAIR = rf"x?r+{_WHOLE_NOUN}|{_WHOLE_NOUN}|r|[swlt]|x|m+"


def _drop_direction(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Drop "not right" after "turn left", "not on the right" after "on the left", "not the left lane"."""
    rejected = tokens[match.end() - 1].value.split("_")[0]
    values = (token.value.replace("_", " ") for token in tokens[: match.start()])
    before = [word for value in values for word in value.split() if word in _SIDES]
    return [] if before and rejected in _SIDES and before[-1] != rejected else None


def _relate_side(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "to the left, not to the right, of" to "left of"."""
    chosen, rejected = (tokens[match.start(group)].value.removesuffix("_side") for group in ("chosen", "rejected"))
    if {chosen, rejected} != {*_SIDES}:
        return None
    return [tokens[match.start()].with_category(WordCategory.RELATION, f"{chosen}_of")]


def _name_lane(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "the left lane, the right one" to "the left lane, the right lane"."""
    lane, between, side = (_span(tokens, match, group) for group in ("lane", "between", "side"))
    named = side[0].value.removesuffix("_side")
    value = f"{named}_lane" if named in _SIDES else ""
    return [*lane, *between, side[0].with_category(WordCategory.LANE, value)] if value else None


def _share_head(tokens: list[Token], match: re.Match[str]) -> list[Token]:
    """Rewrite "the second and not the first truck" to "the second truck, not the first truck"."""
    chosen, rejected, noun = (_span(tokens, match, name) for name in ("chosen", "rejected", "noun"))
    negation = chosen[0].with_category(WordCategory.NOT)
    return [*chosen, *noun, _comma(chosen[0]), negation, *rejected, *noun]


def _choose_modifier(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "white, not silver" to "white", and "silver, no white" to "white"."""
    at = match.start("not")
    first, second = tokens[match.start()], tokens[at + 1]
    colours = first.category is second.category is WordCategory.COLOUR
    return ([second] if tokens[at].text == "no" else [first]) if colours else None


def _drop_prohibition(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Drop "don't stop here" before "stop past the car": the second command says where."""
    values = {tokens[match.start("verb")].value, tokens[match.end()].value}
    return [] if len(values) == 1 else None


def _correct_place(tokens: list[Token], match: re.Match[str]) -> list[Token] | None:
    """Rewrite "next to the van, not next to it, behind it" to "behind the van"."""
    first, same = tokens[match.start()], tokens[match.start("same")]
    return [*_span(tokens, match, "chosen"), *_span(tokens, match, "noun")] if first.value == same.value else None


# In order of precedence.
_RULES: tuple[tuple[re.Pattern[str], _Rewrite], ...] = (
    (re.compile(r"(?P<lane>l)(?P<between>[,.CB]+)d*(?P<side>[ms])o"), _name_lane),
    (re.compile(r"vv(?P<after>(?:[^vA,.]*A(?=v))?)"), _negate_ended),
    (re.compile(r"(?P<before>d*)(?P<not>M|(?<=d)N)(?P<modifier>m+)(?P<noun>[ho]+)"), _negate_modifier),
    (re.compile(rf"(?P<chosen>r),?[NE](?P<rejected>r),?(?P<noun>{_NOUN})"), _share_noun),
    (re.compile(rf"[NE](?P<rejected>r),?B,?(?P<chosen>r)(?P<noun>{_NOUN})"), _share_noun),
    (re.compile(rf"[NE](?P<rejected>r)(?P<noun>{_NOUN}),?[B,]+(?P<chosen>r){_END}"), _share_noun),
    (re.compile(rf"r(?P<noun>{_WHOLE_NOUN})[,C]+[NE](?P<same>r)p[,C]+(?P<chosen>r)p"), _correct_place),
    (re.compile(r"(?P<chosen>[st]),?A?[NE](?P<rejected>[st]),?f"), _relate_side),
    (re.compile(r"(?<![NEMm])(?P<chosen>d*m+),?[AB]?[NE](?P<rejected>d*m+)(?P<noun>[ho]+)"), _share_head),
    (re.compile(rf",?A?[NE][stl]{_END[:-1]}|S|r)"), _drop_direction),
    (re.compile(r"N(?P<verb>v)k?[,.]+(?=v)"), _drop_prohibition),
    (re.compile(r"(?<![NM])m,?(?P<not>N)m(?:(?=[,.ho]|$)|,(?=[ho]))"), _choose_modifier),
    (re.compile(r"Nvr"), _end_negation),
    (re.compile(rf"(?P<far>F)(?P<noun>{_WHOLE_NOUN})"), _negate_nearness),
    (re.compile(r"(?P<relation>r)(?P<not>N)(?P<noun>[mn]*h)"), _negate_place),
    (re.compile(rf"(?P<relation>r)(?P<not>E)(?P<noun>{_NOUN})"), _negate_place),
    *((pattern, _contrast) for pattern in _contrast_patterns("", "(?:,?B|,?[,.C]+)")),
    *((pattern, _contrast) for pattern in _contrast_patterns("v", ",?B")),
    (re.compile(rf"N(?P<rejected>r),+(?P<chosen>r|w){_END}"), _choose_relation),
    (re.compile(rf"N(?P<rejected>v)(?P<place>r{_WHOLE_NOUN}),(?P<chosen>v){_END}"), _choose_direction),
    (
        # "Don't park next to the bus, try behind the taxi."
        re.compile(rf"(?P<not>N)(?P<verb>v)(?P<rejected>r{_WHOLE_NOUN}),(?P<chosen>r{_WHOLE_NOUN}){_END}"),
        _contrast,
    ),
    (re.compile(rf"(?P<before>[^.]*[^.,C])[,.]*C[,C]*(?P<repair>{_REPAIR}){_END}"), _repair),
    (re.compile(r"(?P<before>[^.]*[^.,C])[,.]*C[,C]*(?P<repair>[swlt])(?=r)"), _repair),
)

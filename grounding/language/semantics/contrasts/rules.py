"""The grammar of contrasts: rules in order of precedence, and their application."""

from __future__ import annotations

import re
from collections.abc import Sequence

from grounding.language.semantics.contrasts.choices import (
    choose_direction,
    choose_modifier,
    choose_relation,
    contrast,
    correct_place,
    drop_direction,
    drop_prohibition,
    name_lane,
    relate_side,
    share_head,
    share_noun,
    stop_elsewhere,
    take_other_side,
)
from grounding.language.semantics.contrasts.letters import END, NOUN, PLACE, WHOLE_NOUN, Rewrite, letter
from grounding.language.semantics.contrasts.negations import (
    end_negation,
    is_ending,
    measure_from,
    negate_ended,
    negate_modifier,
    negate_nearness,
    negate_place,
    negate_presence,
    stop_short,
)
from grounding.language.semantics.contrasts.repairs import carry_out_repair
from grounding.language.syntax.clauses import conjunction_as_relation
from grounding.language.syntax.tokenizer import Token

_MAX_REWRITES = 12


def resolve_contrasts(tokens: Sequence[Token]) -> list[Token]:
    """Return tagged tokens with contrasts in the order "Y, not X" and with self-repairs carried out.

    A repair whose reparandum is not found stays as it is.
    """
    if not any(letter(token) in "NECBMF" or is_ending(token) for token in tokens):
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
    return bool(re.search(r"[^.,C][,.]*C[,.C]*[^evNT.,C]", "".join(map(letter, tokens))))


def _rewrite_once(tokens: list[Token]) -> list[Token] | None:
    """Return the tokens after the first rule that applies, None if none does."""
    letters = "".join(map(letter, tokens))
    for pattern, rewrite in _RULES:
        for match in pattern.finditer(letters):
            replacement = rewrite(tokens, match)
            if replacement is not None:
                return [*tokens[: match.start()], *replacement, *tokens[match.end() :]]
    return None


def _contrast_patterns(verb: str, separator: str) -> list[re.Pattern[str]]:
    """Return the patterns of a contrast between noun phrases and of one between places."""
    return [
        re.compile(
            rf"(?P<not>[NE])(?P<verb>{verb})(?P<rejected>{part})(?:W?ea)?{separator},?(?:ea)?"
            rf"(?P<chosen>{part}(?:r+p)?){END}"
        )
        for part in (WHOLE_NOUN, PLACE)
    ]


_REPAIR = rf"x?r+{WHOLE_NOUN}|d*or+{WHOLE_NOUN}|{WHOLE_NOUN}|r|[swlt]|x|m+"
# In order of precedence.
_RULES: tuple[tuple[re.Pattern[str], Rewrite], ...] = (
    (re.compile(r"(?P<lane>l)(?P<between>[,.CB]+)d*(?P<side>[ms])o"), name_lane),
    (re.compile(r"vv(?P<after>(?:[^vA,.]*A(?=v))?)"), negate_ended),
    (re.compile(r"(?P<before>d*)(?P<not>M|(?<=d)N)(?P<modifier>m+)(?P<noun>[ho]+)"), negate_modifier),
    (re.compile(rf"(?P<chosen>r),?[NE](?P<rejected>r),?(?P<noun>{NOUN})"), share_noun),
    (re.compile(rf"[NE](?P<rejected>r),?B,?(?P<chosen>r)(?P<noun>{NOUN})"), share_noun),
    (re.compile(rf"[NE](?P<rejected>r)(?P<noun>{NOUN}),?[B,]+(?P<chosen>r){END}"), share_noun),
    (re.compile(rf"r(?P<noun>{WHOLE_NOUN})[,C]+[NE](?P<same>r)p[,C]+(?P<chosen>r)p"), correct_place),
    (re.compile(r"(?P<chosen>[st]),?A?[NE](?P<rejected>[st]),?f"), relate_side),
    (re.compile(r"(?<![NEMm])(?P<chosen>d*m+),?[AB]?[NE](?P<rejected>d*m+)(?P<noun>[ho]+)"), share_head),
    (re.compile(rf",?A?[NE][stl]{END[:-1]}|S|r)"), drop_direction),
    (re.compile(rf",?E[st]{END}"), take_other_side),
    (re.compile(r"N(?P<verb>v)k?[,.]+(?=v)"), drop_prohibition),
    (re.compile(r"N(?P<verb>v)k?[,.B]+(?P<chosen>[rxw][^v]*?)(?:b[am]*u?)?$"), stop_elsewhere),
    (re.compile(r"(?<![NM])m,?(?P<not>N)m(?:(?=[,.ho]|$)|,(?=[ho]))"), choose_modifier),
    (re.compile(r"Nvr"), end_negation),
    (re.compile(r"(?<=x)F"), measure_from),
    (re.compile(rf"(?P<far>F)(?P<noun>{WHOLE_NOUN})"), negate_nearness),
    (re.compile(rf"(?<=v)(?P<not>N)(?P<relation>r)(?P<noun>{WHOLE_NOUN})"), stop_short),
    (re.compile(rf"rz(?P<not>N)(?P<noun>{NOUN})(?P<near>r?){END}"), negate_presence),
    (re.compile(rf"(?P<with>r?)(?P<not>N)(?P<noun>{NOUN})(?P<near>r){END}"), negate_presence),
    (re.compile(r"(?P<relation>r)(?P<not>N)(?P<noun>[mn]*h)"), negate_place),
    (re.compile(rf"(?P<relation>r)(?P<not>E)(?P<noun>{NOUN})"), negate_place),
    *((pattern, contrast) for pattern in _contrast_patterns("", "(?:,?B|,?[,.C]+)")),
    *((pattern, contrast) for pattern in _contrast_patterns("v", ",?B")),
    (re.compile(rf"N(?P<rejected>r),+(?P<chosen>r|w){END}"), choose_relation),
    (re.compile(rf"N(?P<rejected>v)(?P<place>r{WHOLE_NOUN}),(?P<chosen>v){END}"), choose_direction),
    (
        # "Don't park next to the bus, try behind the taxi."
        re.compile(rf"(?P<not>N)(?P<verb>v)(?P<rejected>r{WHOLE_NOUN}),(?P<chosen>r{WHOLE_NOUN}){END}"),
        contrast,
    ),
    (re.compile(rf"(?P<before>[^.]*[^.,C])[,.]*C[,.C]*(?P<repair>{_REPAIR}){END}"), carry_out_repair),
    (re.compile(r"(?P<before>[^.]*[^.,C])[,.]*C[,.C]*(?P<repair>[swlt])(?=r)"), carry_out_repair),
)

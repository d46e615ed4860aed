"""How an answer came about: what each word was read as, and what every vehicle and place scored."""

from __future__ import annotations

import textwrap

from grounding.answer import Answer
from grounding.describe import phrase
from grounding.language import WordCategory
from grounding.query import Query

_SILENT = (WordCategory.FILLER,)
_WIDTH = 110


def explained(answer: Answer) -> str:
    """Lines for people: words, query, candidates with each predicate, and places that would do as well."""
    lines = ["words:", *_wrapped(" ".join(chips(answer))), "query:", *_wrapped(summary(answer.query))]
    if answer.candidates:
        lines.append("scores (1 fits, 0 does not; the last is the logarithm of all together):")
    for number, one in enumerate(answer.candidates, start=1):
        fits = ", ".join(f"{word} {value:.2f}" for word, value in one.fits.items())
        lines.append(f"  {number}. {phrase(one.item, answer.scene)}: {fits}; {one.score:+.2f}")
    if answer.plan.runners_up:
        lines.append("other places:")
    for place in answer.plan.runners_up:
        lines.append(f"  ({place.ego_m[0]:.1f}, {place.ego_m[1]:.1f}) m, score {place.score:.2f}")
    return "\n".join(lines)


def chips(answer: Answer) -> list[str]:
    """Each word or phrase with its kind and what it stands for: "[behind: relation]"."""
    marked = []
    for token in answer.reading.tokens:
        kind = token.category.value.lower()
        meaning = "" if token.value in ("", token.text) else f" {token.value}"
        marked.append(token.text if token.category in _SILENT else f"[{token.text}: {kind}{meaning}]")
    return marked


def summary(query: Query) -> str:
    """A query in one line: what is not empty, by its key."""
    told = {
        key: value for key, value in query.to_dict().items() if key != "command" and value not in (None, [], "none")
    }
    if query.referent:
        told["referent"] = query.referent.phrase()
    for key in ("secondary", "excluded"):
        if key in told:
            told[key] = "; ".join(f"{one['relation'] or 'not'} {one['noun']}" for one in told[key])
    return ", ".join(f"{key} {' '.join(value) if isinstance(value, list) else value}" for key, value in told.items())


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="  ") or ["  -"]

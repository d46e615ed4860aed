"""Explanation of an answer: token categories, the query, and the scores of candidates and goals."""

from __future__ import annotations

import textwrap

from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.language import WordCategory
from grounding.query import Query

_UNLABELLED = (WordCategory.FILLER,)
_WIDTH = 110


def explain_answer(answer: Answer) -> str:
    """Return lines that list tokens, query, candidates with each predicate, and other goals."""
    lines = ["words:", *_wrap(" ".join(label_tokens(answer))), "query:", *_wrap(summarise_query(answer.query))]
    if revised := answer.reading.revised:
        changes = "; ".join(f"{field} {before} -> {after}" for field, before, after in revised)
        lines += ["changed by the reader network:", *_wrap(changes)]
    if answer.candidates:
        lines.append("scores (1 fits, 0 does not; the last is the logarithm of all together):")
    for number, one in enumerate(answer.candidates, start=1):
        fits = ", ".join(f"{word} {value:.2f}" for word, value in one.fits.items())
        lines.append(f"  {number}. {describe_object(one.item, answer.scene)}: {fits}; {one.score:+.2f}")
    if answer.plan.runners_up:
        lines.append("other places:")
    for goal in answer.plan.runners_up:
        lines.append(f"  ({goal.ego_m[0]:.1f}, {goal.ego_m[1]:.1f}) m, score {goal.score:.2f}")
    return "\n".join(lines)


def label_tokens(answer: Answer) -> list[str]:
    """Label each token with its category and value: "[behind: relation]"."""
    labelled = []
    for token in answer.reading.tokens:
        category = token.category.value.lower()
        value = "" if token.value in ("", token.text) else f" {token.value}"
        labelled.append(token.text if token.category in _UNLABELLED else f"[{token.text}: {category}{value}]")
    return labelled


def summarise_query(query: Query) -> str:
    """Return the non-empty fields of a query in one line."""
    fields = {
        key: value for key, value in query.to_dict().items() if key != "command" and value not in (None, [], "none")
    }
    if query.referent:
        fields["referent"] = query.referent.phrase()
    for key in ("secondary", "excluded"):
        if key in fields:
            fields[key] = "; ".join(f"{one['relation'] or 'not'} {one['noun']}" for one in fields[key])
    return ", ".join(
        f"{key} {' '.join(value) if isinstance(value, list) else value}" for key, value in fields.items()
    )


def _wrap(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="  ") or ["  -"]

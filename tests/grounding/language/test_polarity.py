from __future__ import annotations

import json
from pathlib import Path

import pytest

from grounding.language import Reading, parse
from grounding.language.semantics.contrasts.rules import resolve_contrasts
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import normalise, tokenise
from grounding.query import Query

RECORDS = [json.loads(line) for line in (Path(__file__).parent / "polarity.jsonl").read_text().splitlines()]


def excludes(query: Query, wanted: str) -> bool:
    """Return whether an exclusion "relation,noun,colour,qualifier" is there; "*" stands for any relation."""
    relation, noun, colour, *qualifiers = [*wanted.split(","), ""]
    return any(
        relation in ("*", str(one.relation))
        and one.noun == noun
        and colour in ("", one.colour)
        and set(filter(None, qualifiers)) <= set(one.qualifiers)
        for one in query.excluded
    )


def holds(query: Query, wanted: str) -> bool:
    """Return whether a query has a value ("colour=grey|silver"), or has it not ("notcolour=red,blue")."""
    key, value = wanted.split("=", 1)
    referent = query.referent
    if key == "x":
        return excludes(query, value)
    if key == "beside":  # the relation of the referent to its neighbour
        return any(one.of == "referent" and f"{one.relation},{one.noun}" == value for one in query.secondary)
    qualifiers = referent.qualifiers if referent else ()
    if key in ("q", "notq"):
        return bool({*qualifiers} & {*value.split(",")}) == (key == "q")
    got = {
        "action": query.action,
        "colour": referent.colour if referent else None,
        "noun": referent.noun if referent else None,
        "rel": query.relation,
        "relation": query.relation,
        "dir": query.direction,
        "direction": query.direction,
        "side": query.goal_side,
    }[key.removeprefix("not")]
    return str(got) not in value.split(",") if key.startswith("not") else str(got) in value.split("|")


def is_asked(reading: Reading) -> bool:
    return bool(reading.problem or reading.doubt or reading.query.unresolved)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record["command"][:60])
def test_no_command_is_read_as_its_opposite(record: dict[str, list[str]]) -> None:
    reading = parse(str(record["command"]))
    assert is_asked(reading) or [want for want in record["want"] if not holds(reading.query, want)] == []


def test_most_commands_with_a_contrast_are_read() -> None:
    answered = [not is_asked(parse(str(record["command"]))) for record in RECORDS]
    assert sum(answered) > 0.8 * len(answered)


@pytest.mark.parametrize(
    ("text", "rewritten"),
    [
        ("park behind the blue, no, the green truck", "park behind the green truck"),
        ("don't stop behind the bus but next to it", "stop next to the bus , don't behind the bus"),
        ("stop near no truck", "stop , no near truck"),
        ("stop in front of, not behind, the van", "stop in front of the van , in front of behind the van"),
        ("follow the van", "follow the van"),
    ],
)
def test_contrasts_are_rewritten(text: str, rewritten: str) -> None:
    tokens = resolve_contrasts(tag(tokenise(normalise(text))))
    assert " ".join(token.text for token in tokens) == rewritten

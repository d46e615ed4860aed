"""Readings with the reader network: what changes, what is asked, what stays the grammar's."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from asking import row

from grounding.explain import explain_answer
from grounding.grounder import Grounder
from grounding.language import Reading, parse, parse_all
from grounding.language.evaluation import read_labelled_commands, score_parser
from grounding.language.reader.reader import Reader
from grounding.language.reader.revision import Evidence, Revision
from grounding.language.syntax.tokenizer import Token
from grounding.query import Query, Referent

SPEAKERS = Path(__file__).parents[3] / "benchmarks" / "grounding_truth" / "speakers"


class Scripted(Reader):
    """A reader that changes queries by a function."""

    def __init__(self, change: Callable[[Query], Query], sure: float = 0.9) -> None:
        object.__setattr__(self, "change", change)
        object.__setattr__(self, "sure", sure)
        self.seen: list[Evidence]
        object.__setattr__(self, "seen", [])

    def revise(self, query: Query, evidence: Evidence, tokens: tuple[Token, ...]) -> Revision:  # type: ignore[override]
        self.seen.append(evidence)
        after: Query = self.change(query)  # type: ignore[attr-defined]
        changed = () if after == query else (("relation", query.relation, after.relation),)
        return Revision(after, changed, self.sure)  # type: ignore[attr-defined]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Scripted]:
    def install(change: Callable[[Query], Query], sure: float = 0.9) -> Scripted:
        reader = Scripted(change, sure)
        monkeypatch.setattr("grounding.language.revised_readings.default_reader", lambda: reader)
        return reader

    return install


def test_an_agreeing_network_leaves_the_reading(script: Callable[..., Scripted]) -> None:
    text = "park behind the van on the left"
    script(lambda query: query)
    assert parse_all(text) == parse_all(text, revised=False)


def test_a_changed_field_reaches_query_steps_and_explanation(script: Callable[..., Scripted]) -> None:
    script(lambda query: replace(query, relation="next_to"))
    text = "stop behind the red car and then turn left"
    reading, plain = parse(text), parse(text, revised=False)
    assert reading.query.relation == "next_to"
    assert [step.relation for step in reading.steps] == ["next_to", *(step.relation for step in plain.steps[1:])]
    assert (reading.revised, plain.revised) == ((("relation", "behind", "next_to"),), ())
    grounder = Grounder()
    grounder.set_scene(row().bev(), row().boxes())
    explained = explain_answer(grounder.ground("stop behind the red car"))
    assert "changed by the reader network:\n  relation behind -> next_to" in explained


def test_other_attachments_change_alike_or_go(script: Callable[..., Scripted]) -> None:
    text = "park behind the van on the left"
    assert len(parse_all(text, revised=False)) > 1
    script(lambda query: replace(query, action="stop"))
    assert {one.query.action for one in parse_all(text)} == {"stop"}
    script(lambda query: replace(query, referent=Referent("car", "car")))
    assert [one.query.referent for one in parse_all(text)] == [Referent("car", "car")]


@pytest.mark.parametrize(
    ("text", "sure", "asked"),
    [
        ("my legs would be happy with that van over there", 0.9, False),
        ("my legs would be happy with that van over there", 0.6, True),
        ("my legs would be happy with that van over there, not the bus", 0.9, True),
    ],
)
def test_a_command_that_only_the_network_finds(
    script: Callable[..., Scripted], text: str, sure: float, asked: bool
) -> None:
    found = Query(text, "stop", ("stop",), "near", landmark="referent", referent=Referent("van", "van"))
    script(lambda query: found, sure)
    assert parse(text, revised=False).problem
    reading = parse(text)
    assert (reading.query, reading.steps, reading.problem) == (found, (found,), None)
    assert reading.doubt == ("do you mean 'stop near the van'?" if asked else "")
    assert "read as 'stop near the van'" in reading.notes


def test_a_command_that_the_network_takes_for_none(script: Callable[..., Scripted]) -> None:
    script(lambda query: Query(query.command))
    reading = parse("park behind the van")
    assert reading.query == Query("park behind the van")
    assert reading.problem


def test_unreadable_words_and_replies_are_left_to_the_grammar(script: Callable[..., Scripted]) -> None:
    reader = script(lambda query: replace(query, action="wait"))
    readings: list[Reading] = [parse("pprrk behind the van"), parse(""), parse("xyzzy plugh")]
    assert all(reading.problem for reading in readings)
    parse("the red one", antecedent=Referent("car", "car"))
    parse_all("behind it", verb="park")
    assert reader.seen == []
    session = Grounder().session()
    session._talk.grounder.set_scene(row().bev(), row().boxes())
    session.say("follow the grey car")
    assert len(reader.seen) == 1
    session.say("and then stop behind the blue car")
    assert len(reader.seen) == 1


def test_evidence(script: Callable[..., Scripted]) -> None:
    reader = script(lambda query: query)
    for text in ("park behind the van", "don't overtake the flumpy van", "stop overtaking, get behind it"):
        parse(text)
    plain, negated, stopped = reader.seen
    assert plain == Evidence(words=4)
    assert plain.whole
    assert negated.contrary
    assert negated.unknown == 1
    assert stopped.contrary


def test_strangers_are_read_better_than_by_the_grammar_alone() -> None:
    labels = read_labelled_commands(SPEAKERS / "sentences_openings.jsonl")  # never trained on
    shares = [
        score_parser(labels, lambda text, on=on: parse(text, revised=on).query.to_dict()).as_json()  # type: ignore[misc]
        for on in (False, True)
    ]
    assert shares[1]["core_parse_right"] >= shares[0]["core_parse_right"] + 0.05
    assert shares[1]["false_rejects"] <= shares[0]["false_rejects"]


def test_an_unknown_word_is_no_vehicle_without_asking() -> None:
    for text in ("stop behind the flamingo", "park behind the wibble"):
        reading = parse(text)
        assert reading.doubt or reading.query.referent is None


def test_reading_needs_no_torch() -> None:
    code = "import sys, json; from grounding.language import parse; parse('park behind the van'); "
    code += "print(json.dumps([name in sys.modules for name in ('torch', 'safetensors')]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [False, True]

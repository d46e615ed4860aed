from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from appocc.errors import DataError
from cli.main import app
from grounding.language import parse
from grounding.language.evaluation import (
    ParseScores,
    read_labelled_commands,
    score_command,
    score_parser,
    wilson_interval,
)

GOLD: dict[str, Any] = {
    "command": "stop next to the second red bike on the left",
    "status": "ok",
    "action": "stop",
    "action_alt": ["park"],
    "actions": ["stop"],
    "relation": "next_to",
    "relation_alt": ["near"],
    "landmark": "referent",
    "referent": {
        "noun": "motorcycle",
        "noun_alt": ["bicycle"],
        "colour": "red",
        "qualifiers": ["second", "left_side"],
        "qualifiers_optional": ["parked"],
        "number": 1,
    },
}


def gold(tmp_path: Path, *records: dict[str, Any]) -> list[dict[str, Any]]:
    path = tmp_path / "gold.jsonl"
    path.write_text("\n".join(json.dumps(record) for record in records) + "\n\n")
    return read_labelled_commands(path)


def wrong_fields(tmp_path: Path, **changes: Any) -> set[str]:
    """Return the fields that changes of a right query make wrong; referent__noun changes a key of its referent."""
    (record,) = gold(tmp_path, GOLD)
    got = parse(record["command"]).query.to_dict()
    for key, value in changes.items():
        outer, _, inner = key.partition("__")
        if inner:
            got[outer] = {**got[outer], inner: value}
        else:
            got[outer] = value
    scored = score_command(record, got)
    return {field for field, right in scored.correct.items() if not right} | (
        {"core"} if not scored.core_correct else set()
    )


def test_a_right_query_is_right(tmp_path: Path) -> None:
    assert wrong_fields(tmp_path) == set()


@pytest.mark.parametrize(
    ("changes", "wrong"),
    [
        ({"action": "park"}, set()),
        ({"action": "follow"}, {"action", "core"}),
        ({"relation": "near"}, set()),
        ({"relation": "behind"}, {"relation", "core"}),
        ({"referent__noun": "bicycle"}, set()),
        ({"referent__noun": "car"}, {"noun", "core"}),
        ({"referent__colour": None}, {"colour", "core"}),
        ({"referent__qualifiers": ["left_side", "parked", "second"]}, set()),
        ({"referent__qualifiers": ["second"]}, {"qualifiers", "core"}),
        ({"referent__number": 2}, {"number"}),
        ({"referent": None}, {"noun", "colour", "qualifiers", "core"}),
        ({"direction": "left"}, {"direction", "core"}),
        ({"status": "reject"}, {"status", "core"}),
        ({"actions": ["stop", "stop"]}, {"actions"}),
        ({"goal_side": "left"}, {"goal_side"}),
        ({"landmark": None}, {"landmark"}),
        ({"trigger": "pass"}, {"trigger"}),
        ({"distance_m": 3.0, "distance_of": "ego"}, {"distance"}),
        ({"secondary": [{"noun": "tree", "relation": "near"}]}, {"secondary"}),
        ({"excluded": [{"noun": "car", "relation": None}]}, {"excluded"}),
    ],
)
def test_scoring_rules(tmp_path: Path, changes: dict[str, Any], wrong: set[str]) -> None:
    assert wrong_fields(tmp_path, **changes) == wrong


def test_distances_and_landmarks(tmp_path: Path) -> None:
    record = {
        "command": "x",
        "status": "ok",
        "action": "park",
        "distance_m": 3.0,
        "distance_of": "referent",
        "secondary": [{"noun": "tree", "relation": "near", "of": "goal"}],
        "excluded": [{"noun": "car", "relation": None, "colour": "red", "qualifiers": ["b", "a"]}],
    }
    (labelled,) = gold(tmp_path, record)
    got = {**labelled, "distance_m": 3.04, "secondary": [{"noun": "tree", "relation": "near", "of": "referent"}]}
    got["excluded"] = [{"noun": "car", "relation": None, "colour": "red", "qualifiers": ["a", "b"]}]
    assert all(score_command(labelled, got).correct.values())
    assert not score_command(labelled, {**got, "distance_m": 3.06}).correct["distance"]
    assert not score_command(labelled, {**got, "distance_of": "ego"}).correct["distance"]
    assert not score_command(labelled, {**got, "distance_m": None}).correct["distance"]


def test_lenient_takes_near_toward_and_at_for_next_to(tmp_path: Path) -> None:
    (record,) = gold(tmp_path, {**GOLD, "relation_alt": []})
    got = parse(record["command"]).query.to_dict()
    for relation, right in (("near", True), ("toward", True), ("at", True), ("behind", False)):
        scored = score_command(record, {**got, "relation": relation})
        assert (scored.core_correct, scored.lenient) == (False, right)
    assert not score_command(record, {**got, "relation": "near", "direction": "left"}).lenient


def test_figures(tmp_path: Path) -> None:
    reject = {"command": "sing a song", "status": "reject"}
    records = gold(tmp_path, {**GOLD, "category": "simple"}, reject, {**GOLD, "command": "park here"})
    answer = score_parser(records, lambda text: parse(text).query.to_dict()).as_json()
    assert answer["records"] == 3
    assert answer["core_parse_right"] == pytest.approx(2 / 3)
    assert (answer["false_rejects"], answer["reject_recall"]) == (0.0, 1.0)
    # Two of the four labelled qualifiers are found, and none is added.
    assert answer["per_field"]["qualifiers"] == pytest.approx(2 * 2 / (2 * 2 + 2))
    assert answer["per_field"]["secondary"] is None
    assert answer["by_category"] == {"simple": {"records": 1, "right": 1}, "none": {"records": 2, "right": 1}}
    assert answer["wilson"] == list(wilson_interval(2, 3))


def test_scores_of_no_commands() -> None:
    answer = ParseScores([]).as_json()
    assert (answer["records"], answer["core_parse_right"], answer["reject_recall"]) == (0, None, None)


def test_wilson() -> None:
    assert wilson_interval(108, 120) == pytest.approx((0.8333, 0.9419), abs=1e-4)
    assert wilson_interval(0, 10)[0] == 0.0
    assert wilson_interval(10, 10) == pytest.approx((0.7225, 1.0), abs=1e-4)
    assert wilson_interval(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("{", "no valid JSON"),
        ("[1]", "expected a JSON object, got list"),
        ('{"status": "ok", "action": "park"}', "command: expected str, got NoneType"),
        ('{"command": "x", "status": "fine", "action": "park"}', "status: expected 'ok' with an action"),
        ('{"command": "x", "status": "ok"}', "status: expected 'ok' with an action"),
        ('{"command": "x", "status": "reject", "action": "park"}', "or 'reject' without one"),
        (
            '{"command": "x", "status": "ok", "action": "park", "distance_m": true}',
            "distance_m: expected int or float",
        ),
        ('{"command": "x", "status": "ok", "action": "park", "distance_m": NaN}', "distance_m: expected a finite"),
        ('{"command": "x", "status": "ok", "action": "park", "actions": [1]}', "actions: expected a list of words"),
        ('{"command": "x", "status": "ok", "action": "park", "secondary": ["car"]}', "secondary: expected objects"),
        (
            '{"command": "x", "status": "ok", "action": "park", "excluded": [{"noun": 1}]}',
            "excluded: expected a list of words",
        ),
        ('{"command": "x", "status": "ok", "action": "park", "referent": {}}', "referent.noun: expected str"),
        (
            '{"command": "x", "status": "ok", "action": "park", "referent": {"noun": "car", "qualifiers": "red"}}',
            "referent.qualifiers: expected a list of words",
        ),
        ('"' + "x" * 100_001 + '"', "at most 100000 characters a line"),
        ("[" * 50_000, ""),
    ],
)
def test_invalid_lines_are_reported(tmp_path: Path, line: str, reason: str) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_text(json.dumps(GOLD) + "\n" + line + "\n")
    with pytest.raises(DataError) as raised:
        read_labelled_commands(path)
    assert str(raised.value).startswith(f"{path}: line 2: ")
    assert reason in str(raised.value)
    result = CliRunner().invoke(app, ["eval", "parses", str(path)])
    assert isinstance(result.exception, DataError)


def test_invalid_files_are_reported(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"cannot be read \(No such file"):
        read_labelled_commands(tmp_path / "none.jsonl")
    (tmp_path / "empty.jsonl").write_text("\n")
    with pytest.raises(DataError, match="expected labelled commands, one JSON object a line, got none"):
        read_labelled_commands(tmp_path / "empty.jsonl")


def test_the_command_prints_a_table_and_json(tmp_path: Path) -> None:
    wrong = {**GOLD, "command": "stop behind the bus", "category": "other"}
    gold(tmp_path, GOLD, wrong)
    path = str(tmp_path / "gold.jsonl")
    result = CliRunner().invoke(app, ["eval", "parses", path, "--errors"])
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "2 commands, core parse right 50.0 %" in result.stderr
    assert "core: stop behind the bus" in result.stderr
    assert "relation: labelled next_to, read behind" in result.stderr
    assert "false rejects 0.0 %, reject recall - %" in result.stderr
    assert "qualifiers (F1)" in result.stderr
    answer = json.loads(CliRunner().invoke(app, ["eval", "parses", path, "--json"]).stdout)
    assert answer["core_parse_right"] == 0.5
    keys = {"core_parse_right", "lenient", "per_field", "false_rejects", "reject_recall", "wilson", "records"}
    assert keys <= set(answer)

"""Scores of the parser on labelled commands, by the scoring rules of the labelled files."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from appocc.errors import DataError
from appocc.files import read_text

# Fields of the headline figure ("core parse right"); all fields are also scored on their own.
CORE_FIELDS = ("status", "action", "relation", "noun", "colour", "qualifiers", "direction")
FIELDS = (
    *CORE_FIELDS,
    *("actions", "goal_side", "landmark", "trigger", "distance", "number", "secondary", "excluded"),
)
_SET_FIELDS = ("qualifiers", "secondary", "excluded")
_DISTANCE_TOLERANCE_M = 0.05
# Relations that the lenient figure identifies: near = next_to, toward = near = at.
_LENIENT_RELATIONS = {"near": "next_to", "toward": "near", "at": "near"}
_MAX_CHARACTERS = 100_000
_OPTIONAL_STR = (str, type(None))
_TYPES: dict[str, tuple[type, ...]] = {
    "command": (str,),
    "status": (str,),
    "relation": (str,),
    "distance_m": (int, float, type(None)),
    "referent": (dict, type(None)),
    **dict.fromkeys(("action", "direction", "goal_side", "landmark", "trigger", "distance_of"), _OPTIONAL_STR),
    **dict.fromkeys(("action_alt", "actions", "relation_alt", "secondary", "excluded"), (list,)),
}
_DEFAULTS: dict[str, Any] = {
    "relation": "none",
    "action_alt": [],
    "actions": [],
    "relation_alt": [],
    "secondary": [],
    "excluded": [],
}


@dataclass(frozen=True, eq=False)
class ScoredCommand:
    """The scores of one command.

    Attributes:
        label: the labelled record.
        parsed: the parsed query as `Query.to_dict` writes it.
        correct: field -> whether the parsed value is right.
        lenient: whether the core fields are right with the relations next_to, near, toward and at identified.
        counts: qualifiers, secondary, excluded -> number of values in both, only in the label, only in the query.
    """

    label: dict[str, Any]
    parsed: dict[str, Any]
    correct: dict[str, bool]
    lenient: bool
    counts: dict[str, tuple[int, int, int]]

    @property
    def core_correct(self) -> bool:
        """Whether all core fields are right."""
        return all(self.correct[field] for field in CORE_FIELDS)

    def errors(self) -> list[tuple[str, Any, Any]]:
        """Return (field, labelled value, parsed value) of all fields that differ."""
        wrong = (field for field in FIELDS if not self.correct[field])
        return [(field, _value(self.label, field), _value(self.parsed, field)) for field in wrong]


@dataclass(frozen=True, eq=False)
class ParseScores:
    """The scores of a set of commands, in the order of the labels."""

    commands: Sequence[ScoredCommand]

    def as_json(self) -> dict[str, Any]:
        """Return all figures; shares are in 0..1, None if there is nothing to count."""
        core = [one.core_correct for one in self.commands]
        accepted = [one for one in self.commands if one.label["status"] == "ok"]
        rejected = [one for one in self.commands if one.label["status"] != "ok"]
        fields = {field: _share([one.correct[field] for one in self.commands]) for field in FIELDS}
        return {
            "records": len(self.commands),
            "core_parse_right": _share(core),
            "wilson": list(wilson_interval(sum(core), len(core))),
            "lenient": _share([one.lenient for one in self.commands]),
            "per_field": fields | {field: self._f1(field) for field in _SET_FIELDS},
            "false_rejects": _share([not one.correct["status"] for one in accepted]),
            "reject_recall": _share([one.correct["status"] for one in rejected]),
            "by_category": self._by_category(),
        }

    def _f1(self, field: str) -> float | None:
        """Return the micro-averaged F1 score of a set field."""
        both, missed, added = (sum(one.counts[field][i] for one in self.commands) for i in range(3))
        return 2 * both / (2 * both + missed + added) if both + missed + added else None

    def _by_category(self) -> dict[str, dict[str, int]]:
        groups: dict[str, list[bool]] = {}
        for one in self.commands:
            groups.setdefault(str(one.label.get("category") or "none"), []).append(one.core_correct)
        return {name: {"records": len(group), "right": sum(group)} for name, group in groups.items()}


def score_parser(labels: Iterable[dict[str, Any]], parse: Callable[[str], dict[str, Any]]) -> ParseScores:
    """Score `parse` (text -> fields as `Query.to_dict` writes them) on labelled commands."""
    return ParseScores([score_command(label, parse(label["command"])) for label in labels])


def score_command(label: dict[str, Any], parsed: dict[str, Any]) -> ScoredCommand:
    """Compare a query, as `Query.to_dict` writes it, with a label; alternatives in the label count as right."""
    expected, got = label["referent"] or {}, parsed["referent"] or {}
    optional = set(expected.get("qualifiers_optional", ()))
    sets = {
        "qualifiers": [{*one.get("qualifiers", ())} - optional for one in (expected, got)],
        "secondary": [_landmarks(one["secondary"]) for one in (label, parsed)],
        "excluded": [_exclusions(one["excluded"]) for one in (label, parsed)],
    }
    exact = ("status", "actions", "direction", "goal_side", "landmark", "trigger")
    correct = {field: bool(label[field] == parsed[field]) for field in exact}
    correct |= {field: labelled == read for field, (labelled, read) in sets.items()}
    correct["action"] = parsed["action"] in (label["action"], *label["action_alt"])
    relations = [label["relation"], *label["relation_alt"]]
    correct["relation"] = parsed["relation"] in relations
    nouns = (expected.get("noun"), *expected.get("noun_alt", ()))
    correct["noun"] = got.get("noun") in nouns and bool(expected) == bool(got)
    correct["colour"] = expected.get("colour") == got.get("colour")
    correct["number"] = (expected.get("number") == 2) == (got.get("number") == 2)
    correct["distance"] = _same_distance(label, parsed)
    counts = {field: (len(a & b), len(a - b), len(b - a)) for field, (a, b) in sets.items()}
    lenient_relation = _lenient_relation(parsed["relation"]) in map(_lenient_relation, relations)
    lenient = lenient_relation and all(correct[field] for field in CORE_FIELDS if field != "relation")
    return ScoredCommand(label, parsed, correct, lenient, counts)


def _lenient_relation(relation: str) -> str:
    relation = _LENIENT_RELATIONS.get(relation, relation)
    return _LENIENT_RELATIONS.get(relation, relation)


def _same_distance(label: dict[str, Any], parsed: dict[str, Any]) -> bool:
    expected_m, got_m = label["distance_m"], parsed["distance_m"]
    if expected_m is None or got_m is None:
        return expected_m is got_m
    close = abs(expected_m - got_m) <= _DISTANCE_TOLERANCE_M
    return close and bool(label["distance_of"] == parsed["distance_of"])


def _landmarks(items: Iterable[dict[str, Any]]) -> set[tuple[Any, ...]]:
    return {(item.get("noun"), item.get("relation")) for item in items}


def _exclusions(items: Iterable[dict[str, Any]]) -> set[tuple[Any, ...]]:
    keys = ("relation", "noun", "colour")
    return {(*(item.get(key) for key in keys), *sorted(item.get("qualifiers") or ())) for item in items}


def _value(record: dict[str, Any], field: str) -> Any:
    if field in ("noun", "colour", "qualifiers", "number"):
        return (record["referent"] or {}).get(field)
    if field == "distance":
        return (record["distance_m"], record["distance_of"])
    if field in ("secondary", "excluded"):
        return [{key: item[key] for key in ("relation", "noun", "colour") if item.get(key)} for item in record[field]]
    return record[field]


def _share(values: Sequence[bool]) -> float | None:
    return sum(values) / len(values) if values else None


def wilson_interval(right: int, total: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a share; (0, 1) for a total of 0."""
    if total == 0:
        return 0.0, 1.0
    z = 1.959964
    share, squared = right / total, z * z / total
    middle = (share + squared / 2) / (1 + squared)
    half = z * math.sqrt(share * (1 - share) / total + squared / (4 * total)) / (1 + squared)
    return max(0.0, middle - half), min(1.0, middle + half)


def read_labelled_commands(path: str | PathLike[str]) -> list[dict[str, Any]]:
    """Return the records of a JSONL file of labelled commands, one object a line; omitted keys are empty.

    Raises:
        DataError: if the file cannot be read or a line is invalid; the message holds the line number.
    """
    records = []
    for number, line in enumerate(read_text(Path(path)).splitlines(), start=1):
        if line.strip():
            try:
                records.append(_record(line))
            except (TypeError, ValueError, RecursionError) as error:
                raise DataError(f"{path}: line {number}: {error}") from error
    if not records:
        raise DataError(f"{path}: expected labelled commands, one JSON object a line, got none")
    return records


def _record(line: str) -> dict[str, Any]:
    if len(line) > _MAX_CHARACTERS:
        raise ValueError(f"expected at most {_MAX_CHARACTERS} characters a line, got {len(line)}")
    try:
        record = json.loads(line)
    except json.JSONDecodeError as error:
        raise ValueError(f"no valid JSON ({error.msg} at column {error.colno})") from error
    if not isinstance(record, dict):
        raise TypeError(f"expected a JSON object, got {type(record).__name__}")
    record = {**dict.fromkeys(_TYPES), **_DEFAULTS, **record}
    for key, types in _TYPES.items():
        value = record[key]
        if not isinstance(value, types) or isinstance(value, bool):
            wanted = " or ".join("null" if one is type(None) else one.__name__ for one in types)
            raise TypeError(f"{key}: expected {wanted}, got {type(value).__name__}")
    if record["status"] not in ("ok", "reject") or (record["status"] == "ok") != bool(record["action"]):
        raise ValueError("status: expected 'ok' with an action, or 'reject' without one")
    if record["distance_m"] is not None and not math.isfinite(record["distance_m"]):
        raise ValueError(f"distance_m: expected a finite number, got {record['distance_m']}")
    for key in ("action_alt", "actions", "relation_alt"):
        _check_words(key, record[key])
    for key in ("secondary", "excluded"):
        for item in record[key]:
            if not isinstance(item, dict):
                raise TypeError(f"{key}: expected objects, got {type(item).__name__}")
            _check_words(f"{key}.qualifiers", item.get("qualifiers") or [])
            _check_words(key, [item[name] for name in ("noun", "relation", "colour") if item.get(name) is not None])
    if record["referent"] is not None:
        _check_referent(record["referent"])
    return record


def _check_referent(referent: dict[str, Any]) -> None:
    if not isinstance(referent.get("noun"), str):
        raise TypeError("referent.noun: expected str, got " + type(referent.get("noun")).__name__)
    for key in ("noun_alt", "qualifiers", "qualifiers_optional"):
        _check_words(f"referent.{key}", referent.setdefault(key, []))


def _check_words(name: str, value: Any) -> None:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise TypeError(f"{name}: expected a list of words, got {str(value)[:60]}")

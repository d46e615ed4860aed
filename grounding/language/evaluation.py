"""How many labelled commands are read right, by the scoring rules of the labelled files."""

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

# What must be right for the headline figure; the others are judged one by one.
CORE = ("status", "action", "relation", "noun", "colour", "qualifiers", "direction")
FIELDS = (*CORE, "actions", "goal_side", "landmark", "trigger", "distance", "number", "secondary", "excluded")
_SETS = ("qualifiers", "secondary", "excluded")
_DISTANCE_M = 0.05
# The lenient figure takes these for the same.
_LENIENT = {"near": "next_to", "toward": "near", "at": "near"}
_MOST_CHARACTERS = 100_000
_WORD = (str, type(None))
_KEYS: dict[str, tuple[type, ...]] = {
    "command": (str,),
    "status": (str,),
    "relation": (str,),
    "distance_m": (int, float, type(None)),
    "referent": (dict, type(None)),
    **dict.fromkeys(("action", "direction", "goal_side", "landmark", "trigger", "distance_of"), _WORD),
    **dict.fromkeys(("action_alt", "actions", "relation_alt", "secondary", "excluded"), (list,)),
}
_EMPTY: dict[str, Any] = {
    "relation": "none",
    "action_alt": [],
    "actions": [],
    "relation_alt": [],
    "secondary": [],
    "excluded": [],
}


@dataclass(frozen=True)
class Judged:
    """One command, and what of its query is right.

    Attributes:
        record: as labelled.
        got: the query as `Query.to_dict` writes it.
        right: field -> whether it is right.
        lenient: whether the core is right where toward, near and at are taken for next to.
        counts: qualifiers, secondary, excluded -> numbers of those labelled and read, only labelled, only read.
    """

    record: dict[str, Any]
    got: dict[str, Any]
    right: dict[str, bool]
    lenient: bool
    counts: dict[str, tuple[int, int, int]]

    @property
    def core(self) -> bool:
        """Whether everything is right that counts for the headline figure."""
        return all(self.right[field] for field in CORE)

    def wrong(self) -> list[tuple[str, Any, Any]]:
        """Fields that differ, as labelled and as read."""
        return [
            (field, _value(self.record, field), _value(self.got, field)) for field in FIELDS if not self.right[field]
        ]


@dataclass(frozen=True)
class Result:
    """How a set of commands was read, one by one in their order."""

    judged: Sequence[Judged]

    def as_json(self) -> dict[str, Any]:
        """All figures; shares of 1, None where there was nothing to be counted."""
        cores = [one.core for one in self.judged]
        commands = [one for one in self.judged if one.record["status"] == "ok"]
        others = [one for one in self.judged if one.record["status"] != "ok"]
        fields = {field: _share([one.right[field] for one in self.judged]) for field in FIELDS}
        return {
            "records": len(self.judged),
            "core_parse_right": _share(cores),
            "wilson": list(wilson(sum(cores), len(cores))),
            "lenient": _share([one.lenient for one in self.judged]),
            "per_field": fields | {field: self._f1(field) for field in _SETS},
            "false_rejects": _share([not one.right["status"] for one in commands]),
            "reject_recall": _share([one.right["status"] for one in others]),
            "by_category": self._by_category(),
        }

    def _f1(self, field: str) -> float | None:
        both, missed, added = (sum(one.counts[field][i] for one in self.judged) for i in range(3))
        return 2 * both / (2 * both + missed + added) if both + missed + added else None

    def _by_category(self) -> dict[str, dict[str, int]]:
        groups: dict[str, list[bool]] = {}
        for one in self.judged:
            groups.setdefault(str(one.record.get("category") or "none"), []).append(one.core)
        return {name: {"records": len(group), "right": sum(group)} for name, group in groups.items()}


def evaluate(records: Iterable[dict[str, Any]], parse: Callable[[str], dict[str, Any]]) -> Result:
    """Judge what `parse` makes of the commands: text -> fields as `Query.to_dict` writes them."""
    return Result([judge(record, parse(record["command"])) for record in records])


def judge(record: dict[str, Any], got: dict[str, Any]) -> Judged:
    """Compare a query, as `Query.to_dict` writes it, with a label; the label's alternatives count as right."""
    gold, own = record["referent"] or {}, got["referent"] or {}
    optional = set(gold.get("qualifiers_optional", ()))
    pairs = {
        "qualifiers": [{*one.get("qualifiers", ())} - optional for one in (gold, own)],
        "secondary": [_landmarks(one["secondary"]) for one in (record, got)],
        "excluded": [_exclusions(one["excluded"]) for one in (record, got)],
    }
    plain = ("status", "actions", "direction", "goal_side", "landmark", "trigger")
    right = {field: bool(record[field] == got[field]) for field in plain}
    right |= {field: labelled == read for field, (labelled, read) in pairs.items()}
    right["action"] = got["action"] in (record["action"], *record["action_alt"])
    relations = [record["relation"], *record["relation_alt"]]
    right["relation"] = got["relation"] in relations
    right["noun"] = own.get("noun") in (gold.get("noun"), *gold.get("noun_alt", ())) and bool(gold) == bool(own)
    right["colour"] = gold.get("colour") == own.get("colour")
    right["number"] = (gold.get("number") == 2) == (own.get("number") == 2)
    right["distance"] = _same_distance(record, got)
    counts = {field: (len(a & b), len(a - b), len(b - a)) for field, (a, b) in pairs.items()}
    loosely = _loose(got["relation"]) in map(_loose, relations)
    lenient = loosely and all(right[field] for field in CORE if field != "relation")
    return Judged(record, got, right, lenient, counts)


def _loose(relation: str) -> str:
    relation = _LENIENT.get(relation, relation)
    return _LENIENT.get(relation, relation)


def _same_distance(record: dict[str, Any], got: dict[str, Any]) -> bool:
    labelled, read = record["distance_m"], got["distance_m"]
    if labelled is None or read is None:
        return labelled is read
    near = abs(labelled - read) <= _DISTANCE_M
    return near and bool(record["distance_of"] == got["distance_of"])


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


def wilson(right: int, total: int) -> tuple[float, float]:
    """The 95 % interval of a share by Wilson's score; (0, 1) of nothing."""
    if total == 0:
        return 0.0, 1.0
    z = 1.959964
    share, squared = right / total, z * z / total
    middle = (share + squared / 2) / (1 + squared)
    half = z * math.sqrt(share * (1 - share) / total + squared / (4 * total)) / (1 + squared)
    return max(0.0, middle - half), min(1.0, middle + half)


def read_labelled(path: str | PathLike[str]) -> list[dict[str, Any]]:
    """The records of a JSONL file of labelled commands, one object a line; keys that are left out are empty.

    Raises:
        DataError: if the file cannot be read, or a line of it is no record, with its number.
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
    if len(line) > _MOST_CHARACTERS:
        raise ValueError(f"expected at most {_MOST_CHARACTERS} characters a line, got {len(line)}")
    try:
        record = json.loads(line)
    except json.JSONDecodeError as error:
        raise ValueError(f"no valid JSON ({error.msg} at column {error.colno})") from error
    if not isinstance(record, dict):
        raise TypeError(f"expected a JSON object, got {type(record).__name__}")
    record = {**dict.fromkeys(_KEYS), **_EMPTY, **record}
    for key, types in _KEYS.items():
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

"""Validation of chains (prev, next), first and last tokens and counts of scenes and instances, and key frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from appocc.checks import BoolArray, IntArray
from appocc.nuscenes.problem import Problem, Severity, broken_reference, row_problems
from appocc.nuscenes.table import Table, take_rows
from appocc.nuscenes.tables import Tables


def check_chains(tables: Tables) -> Iterator[Problem]:
    """Yield the problems of chains of samples, sensor files and annotations, and of their scenes and instances."""
    yield from _chains(tables)
    yield from _ends(tables)
    yield from _key_frames(tables)


def pair_keys(a: IntArray, b: IntArray, size: int) -> IntArray:
    """Return one key (N,) per pair of rows a and b (b below `size`), -1 where either is -1."""
    return np.where((a >= 0) & (b >= 0), a * size + b, -1)


def repeated_keys(keys: IntArray) -> BoolArray:
    """Return (N,) whether an earlier row has the same key; -1 is no key."""
    known = np.flatnonzero(keys >= 0)
    _, first = np.unique(keys[known], return_index=True)
    again = np.zeros(len(keys), dtype=np.bool_)
    again[np.delete(known, first)] = True
    return again


def _chains(tables: Tables) -> Iterator[Problem]:
    samples, data, annotations = tables["sample"], tables["sample_data"], tables["sample_annotation"]
    scene = tables["scene"].rows_of(samples.array("scene_token"))
    sample = samples.rows_of(data.array("sample_token"))
    stream = pair_keys(take_rows(scene, sample), tables.data_channel, len(tables["sensor"]))
    instance = tables["instance"].rows_of(annotations.array("instance_token"))
    time_us = take_rows(samples.array("timestamp"), samples.rows_of(annotations.array("sample_token")))
    yield from _chain(samples, samples.array("timestamp"), scene, "scene")
    yield from _chain(data, data.array("timestamp"), stream, "channel of the scene")
    yield from _chain(annotations, time_us, instance, "instance")


def _chain(table: Table, time_us: IntArray, group: IntArray, what: str) -> Iterator[Problem]:
    """Yield links that do not match, go back in time or leave their group, and groups with several chains."""
    tokens = table.array("token")
    for ahead, back in (("next", "prev"), ("prev", "next")):
        values = table.array(ahead)
        other = table.rows_of(values)
        linked = other >= 0
        yield from row_problems(
            table, ~linked & (values != b""), "broken reference", broken_reference(table, ahead, table.name)
        )
        unmatched = linked & (table.array(back)[other] != tokens)
        yield from row_problems(table, unmatched, "broken chain", _mismatch(table, ahead, back, other))
        if ahead == "next":
            backwards = linked & (time_us[other] <= time_us) & (time_us[other] >= 0)
            yield from row_problems(table, backwards, "time runs backwards", _earlier(table, time_us, other))
            leaves = linked & (group[other] != group) & (group >= 0) & (group[other] >= 0)
            yield from row_problems(table, leaves, "broken chain", lambda row: f"its next is of another {what}")
    yield from _beginnings(table, group, what)


def _mismatch(table: Table, ahead: str, back: str, other: IntArray) -> Callable[[int], str]:
    return lambda row: (
        f"its {ahead} is {table.text(ahead, row)}, whose {back} is '{table.text(back, int(other[row]))}'"
    )


def _earlier(table: Table, time_us: IntArray, other: IntArray) -> Callable[[int], str]:
    return lambda row: f"its next {table.text('next', row)} is {time_us[row] - time_us[other[row]]} us earlier"


def _beginnings(table: Table, group: IntArray, what: str) -> Iterator[Problem]:
    """Yield rows without prev that are not the first of their group; a gap in a stream of files is only a note."""
    extra = repeated_keys(np.where(table.array("prev") == b"", group, -1))
    severity: Severity = "note" if table.name == "sample_data" else "error"
    yield from row_problems(
        table, extra, "chain in pieces", lambda row: f"it has no prev, nor has another row of its {what}", severity
    )


# Scenes, instances, samples ---------------------------------------------------------------------------------------


def _ends(tables: Tables) -> Iterator[Problem]:
    """Yield wrong first and last tokens and counts of scenes and instances."""
    samples, annotations = tables["sample"], tables["sample_annotation"]
    annotation_time_us = take_rows(samples.array("timestamp"), samples.rows_of(annotations.array("sample_token")))
    for parent, children, time_us, key, word, count in (
        (tables["scene"], samples, samples.array("timestamp"), "scene_token", "sample", "nbr_samples"),
        (tables["instance"], annotations, annotation_time_us, "instance_token", "annotation", "nbr_annotations"),
    ):
        group = parent.rows_of(children.array(key))
        placed = (group >= 0) & (time_us >= 0)
        numbers = np.bincount(group[group >= 0], minlength=len(parent))
        stated = parent.array(count)
        wrong = (stated >= 0) & (stated != numbers)
        yield from row_problems(parent, wrong, "wrong count", _count(count, stated, numbers))
        for side, extreme in (("first", np.minimum), ("last", np.maximum)):
            field = f"{side}_{word}_token"
            row = children.rows_of(parent.array(field))
            foreign = (row >= 0) & (take_rows(group, row) != np.arange(len(parent)))
            yield from row_problems(
                parent, foreign, "wrong end", _end(parent, field, f"belongs to another {parent.name}")
            )
            bound = np.full(len(parent), np.iinfo(np.int64).max if side == "first" else -1)
            extreme.at(bound, group[placed], time_us[placed])
            off = (row >= 0) & ~foreign & (take_rows(time_us, row) != bound)
            yield from row_problems(parent, off, "wrong end", _end(parent, field, f"is not its {side} in time"))


def _count(field: str, stated: IntArray, numbers: IntArray) -> Callable[[int], str]:
    return lambda row: f"{field} is {stated[row]}, but {numbers[row]} rows refer to it"


def _end(parent: Table, field: str, reason: str) -> Callable[[int], str]:
    return lambda row: f"{field} {parent.text(field, row)} {reason}"


def _key_frames(tables: Tables) -> Iterator[Problem]:
    """Yield scenes without samples; samples without files, with two of a channel, or (a note) a missing channel."""
    samples, data = tables["sample"], tables["sample_data"]
    # Two sensors may share a name, for example of two vehicles, but not in one sample.
    names, number = np.unique(np.array(tables["sensor"]["channel"], dtype=np.str_), return_inverse=True)
    sample, channel = samples.rows_of(data.array("sample_token")), take_rows(number, tables.data_channel)
    keys = np.where(data.array("is_key_frame"), pair_keys(sample, channel, len(names)), -1)
    yield from row_problems(data, repeated_keys(keys), "two key frames", _other_file(data))
    has = np.zeros((len(samples), len(names)), dtype=np.bool_)
    has.flat[keys[keys >= 0]] = True
    without = np.asarray(~has.any(axis=1))
    yield from row_problems(samples, without, "no files", lambda row: "no key-frame file refers to it")
    scene = tables["scene"].rows_of(samples.array("scene_token"))
    empty = np.bincount(scene[scene >= 0], minlength=len(tables["scene"])) == 0
    yield from row_problems(tables["scene"], empty, "no key frames", lambda row: "no sample refers to it")
    for i in range(len(tables["scene"])):
        yield from _gaps(tables, i, names.tolist(), has[scene == i])


def _other_file(data: Table) -> Callable[[int], str]:
    return lambda row: f"sample {data.text('sample_token', row)} has another such file"


def _gaps(tables: Tables, scene: int, names: list[str], has: BoolArray) -> Iterator[Problem]:
    """Yield the channels that are missing in some samples of a scene, from a mask (samples, channels)."""
    for channel in np.flatnonzero(has.any(axis=0) & ~has.all(axis=0)):
        reason = f"{int((~has[:, channel]).sum())} of {len(has)} samples have no {names[channel]}"
        yield Problem("scene", tables["scene"].text("token", scene), "samples without a channel", reason, "note")

"""Validation of a dataset: broken references, chains, counts, times, poses, boxes and files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from itertools import chain

import numpy as np

from appocc.boxes import LARGEST_M
from appocc.checks import FARTHEST_M, BoolArray, FloatArray
from appocc.errors import DataError
from appocc.geometry import is_unit
from appocc.nuscenes.chaincheck import check_chains, pair_keys, repeated_keys
from appocc.nuscenes.columns import intrinsic_of
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.filecheck import check_files
from appocc.nuscenes.problem import Problem, broken_reference, row_problems
from appocc.nuscenes.schema import EXTRA_TABLES, OPTIONAL_TABLES, TABLES
from appocc.nuscenes.table import Table
from appocc.nuscenes.tables import Tables

# Context manager of a title and a total; yields the function to call with the number of new steps.
ProgressBar = Callable[[str, int | None], AbstractContextManager[Callable[[int], None]]]
_CHAINED = ("prev", "next")


def no_progress(title: str, total: int | None) -> AbstractContextManager[Callable[[int], None]]:
    """Show nothing."""
    return nullcontext(lambda steps: None)


def validate(dataset: Dataset, images: bool = True, progress: ProgressBar = no_progress) -> tuple[Problem, ...]:
    """Return all problems of a dataset, errors and notes, in the order of the checks.

    `images` reads every image and LiDAR file completely; otherwise only size, first and last bytes are checked. If a
    table is damaged, only that is reported: the other checks need all tables.
    """
    damaged = tuple(_damaged(dataset.tables))
    if damaged:
        return damaged
    tables = dataset.tables
    in_tables = chain(
        _missing(tables),
        *(_tokens(tables[name]) for name in (*TABLES, *EXTRA_TABLES)),
        *(_times(tables[name]) for name in TABLES),
        _references(tables),
        _list_references(tables),
        check_chains(tables),
        *(_poses(tables[name]) for name in ("calibrated_sensor", "ego_pose", "sample_annotation")),
        _cameras(tables),
        _boxes(tables),
        _names(tables),
    )
    found = tuple(in_tables)
    with progress("files", len(tables["sample_data"])) as advance:
        return (*found, *check_files(dataset, images, advance))


def _damaged(tables: Tables) -> Iterator[Problem]:
    for name in (*TABLES, *EXTRA_TABLES):
        try:
            _ = tables[name]
        except DataError as error:
            yield Problem(name, "", "damaged table", str(error))


def _missing(tables: Tables) -> Iterator[Problem]:
    for name in sorted(OPTIONAL_TABLES & set(TABLES)):
        if not tables.path(name).exists():
            yield Problem(name, "", "missing table", "the file is missing; taken as empty", "note")
    for name in ("scene", "sample", "sample_data"):
        if not len(tables[name]):
            yield Problem(name, "", "empty table", "the table has no rows")


def _tokens(table: Table) -> Iterator[Problem]:
    yield from row_problems(
        table, table.repeated(), "repeated token", lambda row: "an earlier row has the same token"
    )
    yield from row_problems(table, table.array("token") == b"", "empty token", lambda row: f"row {row} has no token")


def _times(table: Table) -> Iterator[Problem]:
    for field in table.cut:
        reason = f"{field}: expected whole microseconds, got some with fractions, which are cut off"
        yield Problem(table.name, "", "times with fractions", reason, "note")


def _references(tables: Tables) -> Iterator[Problem]:
    """Yield references to missing rows; prev and next are checked with the chains."""
    for name, fields in {**TABLES, **EXTRA_TABLES}.items():
        for field in fields:
            if field.kind == "token" and field.refers_to and field.name not in _CHAINED:
                table, values = tables[name], tables[name].array(field.name)
                broken = tables[field.refers_to].rows_of(values) < 0
                if field.optional_reference:
                    broken &= values != b""
                yield from row_problems(
                    table, broken, "broken reference", broken_reference(table, field.name, field.refers_to)
                )


def _list_references(tables: Tables) -> Iterator[Problem]:
    """Yield broken references in lists; logs missing in a published part of a dataset are a note."""
    annotations, attributes = tables["sample_annotation"], _known(tables["attribute"])
    for row, tokens in enumerate(annotations["attribute_tokens"]):
        for token in set(tokens) - attributes:
            reason = f"attribute_tokens: '{token}' is not in the table attribute"
            yield Problem(annotations.name, annotations.text("token", row), "broken reference", reason)
    maps, logs = tables["map"], _known(tables["log"])
    for row, tokens in enumerate(maps["log_tokens"]):
        unknown = len(set(tokens) - logs)
        if unknown:
            reason = (
                f"{unknown} of its {len(tokens)} log_tokens are not in the table log: a part of a larger dataset?"
            )
            yield Problem(maps.name, maps.text("token", row), "logs of other parts", reason, "note")


def _known(table: Table) -> set[str]:
    return {token.decode() for token in table.array("token").tolist()}


def _poses(table: Table) -> Iterator[Problem]:
    """Yield invalid translations and rotations."""
    place, turn = table.array("translation"), table.array("rotation")
    yield from row_problems(
        table, ~_all_below(place, FARTHEST_M), "bad pose", lambda row: f"translation is {place[row].tolist()}"
    )
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(turn, axis=1)
    yield from row_problems(
        table,
        ~is_unit(turn),
        "bad pose",
        lambda row: f"rotation {turn[row].tolist()} has length {length[row]:.4g}, expected a unit quaternion",
    )


def _all_below(values: FloatArray, limit: float) -> BoolArray:
    """Return (N,) whether all absolute values of a row (N, K) are below a limit; False for NaN."""
    return np.asarray((np.abs(values) < limit).all(axis=1))


def _cameras(tables: Tables) -> Iterator[Problem]:
    """Yield invalid camera intrinsics."""
    table = tables["calibrated_sensor"]
    sensor = tables["sensor"].rows_of(table.array("sensor_token"))
    camera = np.array([modality == "camera" for modality in [*tables["sensor"]["modality"], ""]], dtype=np.bool_)
    for row in np.flatnonzero(camera[sensor]):
        value = table["camera_intrinsic"][row]
        if not _is_intrinsic(value):
            wanted = "3 x 3 numbers with positive focal lengths and a last row of 0 0 1"
            reason = f"camera_intrinsic: expected {wanted}, got {str(value)[:80]}"
            yield Problem(table.name, table.text("token", int(row)), "bad intrinsic", reason)


def _is_intrinsic(value: object) -> bool:
    try:
        intrinsic_of(value)
    except (TypeError, ValueError):
        return False
    return True


def _boxes(tables: Tables) -> Iterator[Problem]:
    """Yield sizes that are not positive, and instances annotated twice in a sample."""
    table = tables["sample_annotation"]
    size = table.array("size")
    good = _all_below(size, LARGEST_M) & (size > 0).all(axis=1)
    yield from row_problems(
        table, ~good, "bad size", lambda row: f"size {size[row].tolist()}, expected positive numbers"
    )
    sample = tables["sample"].rows_of(table.array("sample_token"))
    instance = tables["instance"].rows_of(table.array("instance_token"))
    twice = repeated_keys(pair_keys(instance, sample, len(tables["sample"])))
    yield from row_problems(
        table, twice, "annotated twice", lambda row: "its instance has another annotation in the same sample"
    )


def _names(tables: Tables) -> Iterator[Problem]:
    """Yield repeated scene names: a name would select the first scene only."""
    table = tables["scene"]
    seen: set[str] = set()
    for row, name in enumerate(table["name"]):
        if name in seen:
            yield Problem(table.name, table.text("token", row), "repeated name", f"another scene is called '{name}'")
        seen.add(name)

"""What `validate` finds in a dataset, for tests of every way in which one can be broken."""

from __future__ import annotations

from tiny_dataset import TinyDataset, token

from appocc.nuscenes import Dataset
from appocc.nuscenes.problem import Problem
from appocc.nuscenes.validate import validate

FRONT, LIDAR = token("CAM_FRONT", -10_000), token("LIDAR_TOP", 0)


def found(tiny: TinyDataset, images: bool = True) -> list[Problem]:
    return list(validate(Dataset(tiny.write()), images))


def assert_only(problems: list[Problem], *expected: tuple[str, str, str, str]) -> None:
    """The findings are these (table, token, kind, part of the reason) and no others."""
    assert [(p.table, p.token, p.kind) for p in problems] == [e[:3] for e in expected], problems
    for problem, (_, _, _, reason) in zip(problems, expected, strict=True):
        assert reason in problem.reason

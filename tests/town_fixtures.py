"""Fixtures of the tests of cases with known answers."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_town import write_town

from benchmarks.grounding_truth.case_generation import GeneratedCases, make_cases
from benchmarks.grounding_truth.key_frames import Town, TrueFrame


@pytest.fixture(scope="session")
def town_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made dataset, see `made_town`."""
    root = tmp_path_factory.mktemp("made") / "ROOT"
    write_town(root)
    return root


@pytest.fixture(scope="session")
def town(town_root: Path) -> Town:
    return Town(town_root)


@pytest.fixture(scope="session")
def moments(town: Town) -> list[TrueFrame]:
    """Its key frames."""
    return [town.moment(sample.token) for sample in town.samples()]


@pytest.fixture(scope="session")
def made(town: Town) -> GeneratedCases:
    """Cases in it."""
    return make_cases(town, 300, 1, False, lambda _: None)

"""The benchmark's made-up tables are what they stand for, and both ways of loading them agree."""

from __future__ import annotations

from pathlib import Path

import pytest

from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from benchmarks import load_tables


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    load_tables.Maker(folder / "v1.0-made").write(scenes=1)
    return folder


def test_a_scene_has_as_many_rows_as_a_850th_of_trainval(root: Path) -> None:
    rows = load_tables.load_ours(root)
    assert load_tables.load_dicts(root) == rows
    for table, published in (("sample", 34_149), ("sample_data", 2_631_083), ("sample_annotation", 1_166_187)):
        assert rows[table] * load_tables.SCENES == pytest.approx(published, rel=0.03)
    assert rows["ego_pose"] == rows["sample_data"]


def test_the_tables_are_sound_and_laid_out_as_the_published_ones(root: Path) -> None:
    kinds = {problem.kind for problem in validate(Dataset(root), images=False)}
    assert kinds == {"missing file", "missing sweeps"}
    for name in ("sample_data", "ego_pose", "sample_annotation", "scene"):
        assert (root / "v1.0-made" / f"{name}.json").read_text().startswith('[\n{\n"token": "')


def test_one_measurement_in_a_process_of_its_own(root: Path) -> None:
    result = load_tables.measure("ours", root)
    assert result["rows"]["scene"] == 1
    assert result["seconds"] > 0
    assert result["bytes"] > 10_000_000

"""Which scene and which maps a command takes where none are named; progress bars."""

from __future__ import annotations

from pathlib import Path

import pytest
from tiny_dataset import TinyDataset

import cli.common
from appocc.errors import DataError
from appocc.nuscenes import Dataset
from cli.common import choose_scene, choose_source, progress


def test_the_only_scene_is_taken(tiny_root: Path) -> None:
    dataset = Dataset(tiny_root)
    assert choose_scene(dataset, None).name == choose_scene(dataset, "scene-tiny").name == "scene-tiny"


def test_of_several_scenes_one_must_be_named(tiny: TinyDataset) -> None:
    first = tiny.tables["scene"][0]
    tiny.tables["scene"] += [{**first, "token": f"{i}", "name": f"scene-{i}"} for i in range(20)]
    with pytest.raises(DataError, match=r"expected --scene, one of scene-tiny, scene-0, .*, scene-10 and 9 more$"):
        choose_scene(Dataset(tiny.write()), None)


def made_sources(root: Path, *names: str) -> Path:
    """A root with maps of some sources, empty files."""
    for name in names:
        folder = root / "bev" / name
        folder.mkdir(parents=True)
        (folder / "a.npz").touch()
    return root


def test_a_dataset_without_scenes_has_none_to_name(tiny: TinyDataset) -> None:
    for name in ("scene", "sample", "sample_data", "sample_annotation", "instance"):
        tiny.tables[name] = []
    with pytest.raises(DataError, match=r": no scenes$"):
        choose_scene(Dataset(tiny.write()), None)


def test_a_source_that_is_chosen_among_several_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = made_sources(tmp_path, "groundtruth")
    choose_source(root, None)
    assert capsys.readouterr().err == ""
    choose_source(made_sources(root, "exact", "mine"), None)
    assert capsys.readouterr().err == "maps of groundtruth; there are also exact, mine (--bev)\n"


def test_the_only_source_is_taken_else_groundtruth_else_one_must_be_named(tmp_path: Path) -> None:
    assert choose_source(made_sources(tmp_path / "a", "mine"), None) == "mine"
    assert choose_source(made_sources(tmp_path / "b", "mine", "groundtruth"), None) == "groundtruth"
    assert choose_source(tmp_path / "b", "other") == "other"
    with pytest.raises(DataError, match=r"expected --bev, one of mine, theirs$"):
        choose_source(made_sources(tmp_path / "c", "theirs", "mine"), None)
    with pytest.raises(DataError, match=r"no maps in .*make them with: appocc infer"):
        choose_source(tmp_path, None)


def test_maps_are_not_compared_with_themselves_by_default(tmp_path: Path) -> None:
    root = made_sources(tmp_path, "groundtruth")
    with pytest.raises(DataError, match=r"no maps in .*bev beside groundtruth; make them with: appocc infer"):
        choose_source(root, None, truth="groundtruth")
    assert choose_source(made_sources(root, "mine"), None, truth="groundtruth") == "mine"
    assert choose_source(made_sources(root, "exact"), None, truth="exact") == "groundtruth"
    assert choose_source(root, "exact", truth="exact") == "exact"


def test_a_progress_bar_within_another_one_is_a_line_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    with progress("outer", 2) as outer:
        display = cli.common._shown[0]
        with progress("inner, MB", 1.5) as inner:
            inner(1.5)
            assert [task.completed for task in display.tasks] == [0, 1.5]
        outer(1)
        assert [(task.description, task.completed) for task in display.tasks] == [("outer", 1)]
    assert not cli.common._shown

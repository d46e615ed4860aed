from __future__ import annotations

import json
from pathlib import Path

import pytest

from appocc.demo.folder import MANIFEST, demo_folder
from appocc.errors import DataError


def make(out: Path, *names: str, text: str = "new") -> None:
    with demo_folder(out) as folder:
        for name in names:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)


def files(out: Path) -> set[str]:
    return {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}


def test_a_new_folder_is_made(tmp_path: Path) -> None:
    make(tmp_path / "deep" / "out", "a.png", "dataset/b.json")
    assert files(tmp_path / "deep" / "out") == {"a.png", "dataset/b.json", MANIFEST}
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["out"]


def test_an_empty_folder_is_accepted(tmp_path: Path) -> None:
    make(tmp_path, "a.png")
    assert files(tmp_path) == {"a.png", MANIFEST}


def test_a_demo_is_replaced_and_other_files_are_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    make(out, "a.png", "dataset/old.json", text="old")
    (out / "dataset" / "mine.txt").write_text("mine")
    make(out, "a.png", "dataset/b.json")
    assert files(out) == {"a.png", "dataset/b.json", "dataset/mine.txt", MANIFEST}
    assert (out / "a.png").read_text() == "new"
    assert (out / "dataset" / "mine.txt").read_text() == "mine"
    assert set(json.loads((out / MANIFEST).read_text())["files"]) == {"a.png", "dataset/b.json"}


def test_other_folders_are_refused_and_not_touched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(DataError, match=r"is no demo of ours.*--out"):
        make(tmp_path, "a.png")
    assert files(tmp_path) == {"thesis.tex"}
    with pytest.raises(DataError, match="is no demo of ours"):
        make(tmp_path / "thesis.tex", "a.png")


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ('{"made_by": "someone else", "files": []}', "not written by"),
        ("[]", "not written by"),
        ('{"made_by": "appocc demo", "files": [1]}', "expected 'files'"),
        ('{"made_by": "appocc demo"}', "expected 'files'"),
        ('{"made_by": "appocc demo", "files": ["../victim"]}', "leads out"),
        ("{", "no valid JSON"),
    ],
)
def test_a_list_of_files_that_is_not_ours_is_refused(tmp_path: Path, manifest: str, message: str) -> None:
    (tmp_path / "victim").write_text("precious")
    out = tmp_path / "out"
    out.mkdir()
    (out / MANIFEST).write_text(manifest)
    with pytest.raises(DataError, match=message):
        make(out, "a.png")
    assert files(tmp_path) == {"victim", f"out/{MANIFEST}"}


def test_nothing_changes_when_the_making_fails(tmp_path: Path) -> None:
    out = tmp_path / "out"
    make(out, "a.png", text="old")
    with pytest.raises(UnicodeEncodeError):
        make(out, "a.png", "b.png", text="\ud800")  # what no file can hold
    assert (out / "a.png").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        make(tmp_path / "file" / "out", "a.png")


def test_a_file_in_the_way_of_a_folder_is_named(tmp_path: Path) -> None:
    make(tmp_path, "a.png")
    (tmp_path / "dataset").write_text("mine")
    with pytest.raises(DataError, match="cannot be written"):
        make(tmp_path, "a.png", "dataset/b.json")
    assert (tmp_path / "dataset").read_text() == "mine"


def test_leavings_of_a_killed_run_are_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / ".unfinished-demo-x" / "dataset").mkdir(parents=True)
    make(tmp_path, "a.png")
    assert {"a.png", MANIFEST} <= files(tmp_path)

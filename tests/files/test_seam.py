"""One seam: files that users name are opened by `appocc.files` alone, so that any of them may be remote."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from in_process import run_command

REPOSITORY = Path(__file__).parents[2]
ROOMS, SEAM = ("appocc", "tracking", "grounding", "cli"), "appocc/files/"
# Calls that open a file by its path, as a function or a method.
OPENING = {
    *("open", "read_bytes", "write_bytes", "read_text", "write_text", "safe_open", "save_file", "copyfile"),
    *("fromfile", "tofile", "memmap", "load", "save", "imread", "imwrite", "VideoCapture", "VideoWriter"),
    *("scandir", "listdir", "walk"),
}
# Modules that open files of this machine by nature, and why.
LOCAL = {
    "appocc/ablation/study.py": "folder of trainings",
    "appocc/environment.py": "files of the system",
    "appocc/export/convert.py": "a file that whole_file gives",
    "appocc/export/run.py": "a folder that is renamed when whole",
    "appocc/groundtruth/store.py": "scratch on the local disk",
    "appocc/importers/ros/bag.py": "rosbags reads bags by path",
    "appocc/jpeg.py": "bytes in memory",
    "appocc/own_cameras/live.py": "cameras",
    "appocc/own_cameras/pictures.py": "OpenCV reads videos by path",
    "appocc/packing/webdataset_shards.py": "a file of a folder that is kept until whole",
    "appocc/pandaset/convert.py": "copies into a folder that is sent when whole",
    "appocc/simulation/town_generation/driving.py": "scratch of SUMO",
    "appocc/simulation/town_generation/make.py": "scratch of SUMO",
    "appocc/simulation/town_generation/opendrive.py": "scratch of SUMO",
    "appocc/simulation/town_generation/streets.py": "scratch of SUMO",
    "appocc/temporary.py": "locks",
    "appocc/training/checkpoint.py": "folder of a training",
    "appocc/training/batches/packed_dataset.py": "memory maps",
    "appocc/training/run_folder.py": "folder of a training",
    "cli/common.py": "the null device",
    "cli/demo.py": "folder of the demo",
    "grounding/language/syntax/word_model.py": "files of the package",
    "tracking/visualization/video.py": "OpenCV writes a file that whole_file gives",
}


def opens_a_file(call: ast.Call) -> bool:
    """Whether a call opens a file by its path, and not by a function of the seam or as the file that it gives."""
    function = call.func
    if isinstance(function, ast.Name):
        local = call.args and isinstance(call.args[0], ast.Call) and ast.unparse(call.args[0].func) == "local_copy"
        return function.id in ("open", "safe_open", "save_file") and not local
    if not isinstance(function, ast.Attribute) or function.attr not in OPENING:
        return False
    owner = ast.unparse(function.value)
    if function.attr in ("load", "save"):
        return owner in ("np", "numpy", "torch")
    return owner not in ("temporary", "PackedDataset")


def test_no_module_opens_files_beside_the_seam() -> None:
    found, word = set(), re.compile(rf"\b({'|'.join(OPENING)})\(")
    for path in (path for room in ROOMS for path in (REPOSITORY / room).rglob("*.py")):
        name = path.relative_to(REPOSITORY).as_posix()
        text = path.read_text()
        if name.startswith(SEAM) or not word.search(text):
            continue
        if any(opens_a_file(node) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)):
            found.add(name)
    assert found == set(LOCAL)


def test_every_path_of_the_command_line_says_whether_it_may_be_a_url() -> None:
    """By its parser: `in_path`, `out_path`, `local_path` or `local_out_path`."""
    without = []
    for path in (REPOSITORY / "cli").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Subscript) or ast.unparse(node.value) != "Annotated":
                continue
            kind, call = node.slice.elts[:2] if isinstance(node.slice, ast.Tuple) else (node.slice, None)
            if not isinstance(call, ast.Call) or not re.search(r"\bPath\b", ast.unparse(kind)):
                continue
            if not any(keyword.arg == "parser" for keyword in call.keywords):
                without.append(f"{path.name}: {ast.unparse(node)}")
    assert without == []


def test_a_url_for_a_local_path_is_refused_and_a_file_url_is_a_path(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    done = run_command(["convert", "kitti", "s3://b/x", str(tmp_path / "out")], capsys, monkeypatch)
    assert done.returncode == 2
    assert "expected a path on this machine" in " ".join(done.stderr.replace("│", "").split())
    done = run_command(["doctor", f"file://{tmp_path}/none"], capsys, monkeypatch)
    assert (done.returncode, done.stderr) == (2, f"error: {tmp_path}/none: no such folder\n")

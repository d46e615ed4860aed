"""The commands and the Python code of the README work as written."""

from __future__ import annotations

import json
import re
import shutil
import socket
from pathlib import Path

import pytest
from argoverse_twin import write_log
from dask_processes import process
from in_process import run_command
from panda_twin import PandaTwin
from walkthrough import PUBLISHED, README, Walkthrough, blocks, run_line

from appocc.bevmap import BEVMap
from appocc.frame import Frame
from grounding.answer import Answer

ROOT = README.parent


def test_the_quick_start_uses_targets_of_the_makefile() -> None:
    lines = blocks("## Quick start")[0].splitlines()
    assert lines == ["make demo", "make test"]
    targets = re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert {line.split()[1] for line in lines} <= set(targets)


def test_every_command_of_the_table_has_help_with_an_example(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    names = set(re.findall(r"^\| `appocc ((?:[a-z-]+ ?\b)+)", README.read_text(), flags=re.MULTILINE))
    assert len(names) >= 6
    for name in names:
        done = run_command([*name.split(), "--help"], capsys, monkeypatch)
        assert done.returncode == 0
        assert f"appocc {name.strip()}" in " ".join(done.stdout.replace("│", " ").split()), name


def test_every_linked_file_exists() -> None:
    links = re.findall(r"\]\(([\w./-]+)\)", README.read_text())
    assert links
    assert [link for link in links if not (ROOT / link).is_file()] == []


@pytest.mark.parametrize(
    ("section", "pictures"),
    [
        ("## In the browser", ["serve.png"]),
        ("## With your own cameras", ["fisheye.jpg"]),
        ("## Ground a command", ["grounding.png"]),
        ("## Show it", ["report.png", "viewer.png"]),
    ],
)
def test_what_is_looked_at_has_its_picture(section: str, pictures: list[str]) -> None:
    text = README.read_text().partition(f"\n{section}\n")[2].partition("\n## ")[0]
    assert re.findall(r"^!\[[^]]+\]\(docs/([\w.]+)\)$", text, flags=re.MULTILINE) == pictures
    for name in pictures:
        assert (ROOT / "docs" / name).stat().st_size < 500_000


@pytest.mark.realdata
def test_the_walkthrough_on_a_real_street_runs_line_by_line(walkthrough: Walkthrough) -> None:
    commands = ["convert", "groundtruth", "track", "ground", "infer", "eval"]
    assert [line.split()[1] for line in walkthrough.lines] == commands
    assert walkthrough.failures() == []


def test_the_published_layout_of_the_street_is_converted(tmp_path: Path) -> None:
    line = blocks("## On a real street")[0].splitlines()[0]
    assert line.endswith(PUBLISHED)
    PandaTwin(tmp_path).publish().rename(tmp_path / "pandaset")
    code, said = run_line(line, tmp_path)
    assert code == 0, said
    assert "scenes 002" in said


@pytest.mark.realdata
def test_the_walkthrough_writes_the_promised_files(walkthrough: Walkthrough) -> None:
    maps = sorted((walkthrough.folder / "OUT" / "bev" / "groundtruth").glob("*.npz"))
    assert len(maps) == 40
    bev = BEVMap.load(maps[0])
    assert bev.meta["sources"]["road"].startswith("mask")
    assert bev.meta["sources"]["lane"].startswith("semantic_lidar")
    assert (walkthrough.folder / "t.webm").stat().st_size > 100_000
    assert (walkthrough.folder / "g.png").read_bytes().startswith(b"\x89PNG")
    metrics = json.loads((walkthrough.folder / "OUT" / "tracks" / "groundtruth" / "002" / "metrics.json").read_text())
    assert metrics["metrics"]["MOTA"] >= 0.7


@pytest.mark.realdata
def test_the_python_lines_run(walkthrough: Walkthrough, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(walkthrough.folder)
    names: dict[str, object] = {}
    code = blocks("## In Python")
    assert len(code) == 2
    for block in code:
        exec(compile(block, "README.md", "exec"), names)
        assert isinstance(names["bev"], BEVMap)
        assert isinstance(names["frame"], Frame)
        assert names["bev"].occupancy[1].sum() > 100
        assert isinstance(names["answer"], Answer)
        assert names["answer"].status == "ok"


def test_the_walkthrough_of_a_simulated_town_runs_line_by_line(simulated: Walkthrough) -> None:
    assert [line.split()[1] for line in simulated.lines] == ["simulate", "doctor", "groundtruth", "infer", "eval"]
    assert simulated.failures() == []
    assert (simulated.folder / "sheet.png").read_bytes().startswith(b"\x89PNG")
    for source in ("exact", "groundtruth", "predicted"):
        assert len(list((simulated.folder / "SIM" / "bev" / source).glob("*.npz"))) == 32


def test_the_commands_with_ones_own_cameras_run_in_order(tmp_path: Path) -> None:
    lines = blocks("## With your own cameras")[0].splitlines()
    assert [line.split()[1] for line in lines] == ["simulate", "check-rig", "infer"]
    for line in lines:
        code, said = run_line(line, tmp_path)
        assert code == 0, (line, said)
    assert (tmp_path / "rig.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "wide-maps").glob("*.npz"))) == 1


def test_the_commands_with_a_published_dataset_run_in_order(tmp_path: Path) -> None:
    write_log(tmp_path / "LOGS")
    lines = blocks("## Your dataset")[0].splitlines()
    assert [line.split()[1] for line in lines] == ["convert", "doctor", "infer"]
    for line in lines:
        code, said = run_line(line, tmp_path)
        assert code == 0, (line, said)
    assert len(list((tmp_path / "AV2/bev/predicted").glob("*.npz"))) == 2


def test_the_commands_on_a_cluster_run_in_order(simulated_root: Path, tmp_path: Path) -> None:
    (tmp_path / "SIM").symlink_to(simulated_root)
    (block,) = blocks("## On a cluster")
    assert block in (ROOT / "docs" / "cluster.md").read_text()
    lines = block.splitlines()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    scheduler, worker, command = (line.replace("8786", port) for line in lines)
    with process(*scheduler.split()[1:], "--no-dashboard"), process(*worker.split()[1:], "--no-dashboard"):
        code, said = run_line(f"{command} --scene scene-0000", tmp_path)
        assert code == 0, said
    assert len(list((tmp_path / "MAPS").glob("*.npz"))) == 4


def test_the_grounding_commands_run_in_order(simulated_root: Path, tmp_path: Path) -> None:
    (tmp_path / "SIM").symlink_to(simulated_root)
    lines = blocks("## Ground a command")[0].splitlines()
    assert [line.split()[1] for line in lines] == ["ground", "track", "ground"]
    for line in lines:
        code, said = run_line(line, tmp_path)
        assert code == 0, (line, said)
    assert (tmp_path / "place.png").read_bytes().startswith(b"\x89PNG")


def test_the_report_and_the_recordings_are_written(simulated: Walkthrough, tmp_path: Path) -> None:
    assert simulated.failures() == []
    (tmp_path / "SIM").symlink_to(simulated.folder / "SIM")
    lines = blocks("## Show it")[0].splitlines()
    assert [line.split()[1] for line in lines] == ["report", "view"]
    for line in lines:
        code, said = run_line(line, tmp_path)
        assert code == 0, (line, said)
    assert "<h2>Worst frames</h2>" in (tmp_path / "report.html").read_text()
    assert (tmp_path / "scene.rrd").read_bytes().startswith(b"RRF2")
    assert (tmp_path / "scene.mcap").read_bytes().startswith(b"\x89MCAP")


@pytest.mark.slow
@pytest.mark.long
def test_the_training_commands_run_in_order(simulated_root: Path, tmp_path: Path) -> None:
    shutil.copytree(simulated_root, tmp_path / "SIM")
    lines = blocks("## Train your own")[0].splitlines()
    assert [line.split()[1] for line in lines] == ["train", "infer", "weights", "export"]
    for line in lines:
        code, said = run_line(line, tmp_path)
        assert code == 0, (line, said)
    assert (tmp_path / "appocc.onnx").stat().st_size > 5_000_000

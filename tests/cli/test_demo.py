from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner, Result

from appocc.demo import dataset
from appocc.errors import DataError
from appocc.files import read_image, read_json
from appocc.simulation.recording import VERSION
from cli import demo_pipeline
from cli.demo_pipeline import COMMANDS, CONVERSATION, FRAME
from cli.main import app

SMALL = dataset.DemoSettings(samples=7)
PICTURES = ("ground-1.png", "ground-2.png", "ground-3.png", "conversation.png")


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A demo of seven key frames, in a folder with a space in its name."""
    out = tmp_path_factory.mktemp("cli") / "my demo"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo_pipeline, "DemoSettings", lambda: SMALL)
        return out, run("demo", "--out", str(out), "--json")


def test_the_demo_writes_pictures_and_explains_them(made: tuple[Path, Result]) -> None:
    out, result = made
    assert result.exit_code == 0, result.output
    text = (out / "README.txt").read_text()
    for name in ("bev.png", "tracks.webm", "tracks.png", "dataset/", *PICTURES):
        assert (out / name).exists()
        assert f"\n{name}" in text
    for name in ("bev.png", "tracks.png", *PICTURES):
        assert read_image(out / name).std() > 20, "a picture shows something"
    assert text in result.stderr
    within, whole = (
        [int(number) for number in re.findall(r"(?:road|vehicle|lane) (\d+)", part)]
        for part in text.split("IoU within 20 m: ")[1].split("colours off")[0].split("whole map: ")
    )
    assert len(within) == len(whole) == 3
    assert sum(within) > sum(whole)
    assert result.stderr.splitlines()[-1] == f"To look around in the browser: appocc serve '{out}'"


def test_the_video_has_every_key_frame(made: tuple[Path, Result]) -> None:
    video = cv2.VideoCapture(str(made[0] / "tracks.webm"))
    frames = 0
    while video.read()[0]:
        frames += 1
    assert frames == SMALL.samples


def test_json_is_the_only_output_on_stdout(made: tuple[Path, Result]) -> None:
    out, result = made
    value = json.loads(result.stdout)
    assert value["folder"] == str(out)
    assert value["scene"] == dataset.SCENE
    assert value["metrics"]["GT"] > 30
    assert value["bev"]["iou_at_threshold"]["road"] > 0.3
    assert [answer["query"]["command"] for answer in value["ground"]] == list(COMMANDS)
    assert {answer["status"] for answer in value["ground"]} <= {"ok", "ambiguous", "not_found"}


def test_the_demo_holds_a_conversation(made: tuple[Path, Result]) -> None:
    turns = json.loads(made[1].stdout)["conversation"]
    assert [turn["said"] for turn in turns] == list(CONVERSATION)
    assert [turn["status"] for turn in turns] == ["ambiguous", "ok", "ok", "ok"]
    assert len({turn["referent"]["id"] for turn in turns[1:]}) == 1
    assert turns[3]["target"] == turns[2]["target"] != turns[1]["target"]
    text = (made[0] / "README.txt").read_text()
    assert all(f"> {said}" in text for said in CONVERSATION)


def test_the_silver_car_is_found_on_the_exact_map(made: tuple[Path, Result]) -> None:
    asked = ["--scene", dataset.SCENE, "--frame", str(FRAME), "--bev", dataset.SOURCE, "--json"]
    value = json.loads(run("ground", COMMANDS[0], str(made[0] / "dataset"), *asked).stdout)
    paint = {row["instance_token"]: row["name"] for row in read_json(made[0] / "dataset" / VERSION / "paint.json")}
    assert value["status"] == "ok"
    assert paint[value["referent"]["id"]] == "silver"


def test_vehicles_are_tracked_on_the_exact_maps(made: tuple[Path, Result]) -> None:
    result = run("track", str(made[0] / "dataset"), "--scene", dataset.SCENE, "--bev", dataset.SOURCE, "--json")
    assert json.loads(result.stdout)["metrics"]["MOTA"] > 0.8


def test_the_suggested_commands_work(
    made: tuple[Path, Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = (made[0] / "README.txt").read_text().splitlines()
    commands = [shlex.split(line) for line in lines if line.startswith("appocc ") and not line.endswith("demo")]
    assert len(commands) == 12
    assert commands.count(["appocc", "serve", str(made[0])]) == 1
    for command in commands:
        if command[1] == "serve":  # it does not end; tests/cli/test_serve.py
            continue
        result = run(*command[1:])
        # On a predicted map the vehicle may be missing.
        allowed = (0, 3) if command[1] == "ground" and "predicted" in command else (0,)
        assert result.exit_code in allowed, (command, result.output)
    assert (tmp_path / "true.png").is_file()
    assert (tmp_path / "town.png").is_file()


def test_a_foreign_folder_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    result = run("demo", "--out", str(tmp_path))
    assert isinstance(result.exception, DataError)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]

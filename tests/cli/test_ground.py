from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import ROAD, VEHICLE, BEVMap, bev_path
from appocc.errors import DataError, NotFoundError
from appocc.files import read_image
from appocc.grid import BEVGrid
from appocc.rigs import FOLDER
from cli.ground import _typed_lines
from cli.main import app
from tracking.io.writers import write_nuscenes
from tracking.tracks import Track


@pytest.fixture
def street(tiny: TinyDataset) -> Path:
    """The tiny dataset with maps: its parked car, 10 m ahead, is white on a road; source "empty" shows no vehicle."""
    grid = BEVGrid.surround()
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[ROAD] = 1
    offset = np.abs(grid.centres() - [10.0, 0.0])
    car = (offset[..., 0] < 2.3) & (offset[..., 1] < 0.95)
    occupancy[VEHICLE][car] = 1
    appearance = np.where(car, 240, 90).astype(np.uint8)[None].repeat(3, axis=0)
    valid = np.ones((3, *grid.shape), np.bool_)
    true = {"sources": {"vehicle": "cuboids"}}
    for source in ("groundtruth", "other"):
        meta = true if source == "groundtruth" else {}
        bev = BEVMap(grid, occupancy.copy(), valid.copy(), appearance.copy(), valid[0].copy(), meta)
        bev.save(bev_path(tiny.root, source, token("sample", 0)))
    occupancy[VEHICLE] = 0
    empty = BEVMap(grid, occupancy, valid, appearance, valid[0].copy())
    empty.save(bev_path(tiny.root, "empty", token("sample", 0)))
    return tiny.root


def run(root: Path, text: str, *more: str) -> Result:
    return CliRunner().invoke(app, ["ground", text, str(root), "--scene", "scene-tiny", "--frame", "0", *more])


def test_ok(street: Path) -> None:
    result = run(street, "stop behind the white car", "--json")
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert value["status"] == "ok"
    assert value["query"]["action"] == "stop"
    # The rear bumper is at 7.7 m, the gap 2 m, half the ego 2.3 m; the ego heads along world +y from (100, 200).
    assert value["target"]["ego_m"] == pytest.approx([3.4, 0.2], abs=0.41)
    x, y = value["target"]["ego_m"]
    assert value["target"]["world_m"] == pytest.approx([100 - y, 200 + x], abs=1e-3)
    assert value["target"]["heading_rad"] == pytest.approx(np.pi / 2, abs=1e-3)
    assert value["referent"]["id"] == token("car")
    assert "ok: stop behind the white car" in result.stderr


def test_the_size_of_the_ego_vehicle_comes_from_a_rig(street: Path, tmp_path: Path) -> None:
    rig = tmp_path / "small.yaml"
    paper = (FOLDER / "paper.yaml").read_text()
    rig.write_text(f"{paper}ego_vehicle: {{length_m: 2.5, width_m: 1.5, rear_overhang_m: 0.4}}\n")
    value = json.loads(run(street, "stop behind the white car", "--json", "--rig", str(rig)).stdout)
    # The rear bumper is at 7.7 m, the gap 2 m, half the ego 1.25 m.
    assert value["target"]["ego_m"] == pytest.approx([4.45, 0.0], abs=0.41)
    assert isinstance(run(street, "stop", "--rig", "no-such-rig").exception, NotFoundError)


@pytest.mark.parametrize(
    ("text", "status", "code"),
    [
        ("stop behind the white car", "ok", 0),
        ("stop behind the pink bus", "not_found", 3),
        ("turn right", "not_found", 3),
        ("follow the closest bus", "not_found", 3),
        ("tell me a joke", "not_a_command", 2),
        ("", "not_a_command", 2),
        ("park " * 2000, "not_a_command", 2),
        ("停在白色汽车后面", "not_a_command", 2),
    ],
)
def test_every_status_prints_and_draws_before_it_ends(
    street: Path, tmp_path: Path, text: str, status: str, code: int
) -> None:
    picture = tmp_path / "g.png"
    result = run(street, text, "--json", "--picture", str(picture))
    assert result.exit_code == code, result.output
    assert json.loads(result.stdout)["status"] == status
    assert read_image(picture).shape[2] == 3


def test_without_json_stdout_stays_empty(street: Path) -> None:
    result = run(street, "tell me a joke")
    assert result.stdout == ""
    assert "no driving action" in result.stderr


def test_another_source_of_maps(street: Path) -> None:
    for source in ("other", str(street / "bev" / "other")):
        result = run(street, "stop behind the car", "--bev", source, "--json")
        assert result.exit_code == 0
        assert json.loads(result.stdout)["referent"]["id"].startswith("blob")
    result = run(street, "stop behind the car", "--bev", str(street / "bev" / "groundtruth"), "--json")
    assert json.loads(result.stdout)["referent"]["id"] == token("car")


def test_a_predicted_map_is_not_completed_from_annotations(street: Path) -> None:
    result = run(street, "stop behind the car", "--bev", "empty", "--json")
    assert result.exit_code == 3
    value = json.loads(result.stdout)
    assert (value["candidates"], value["reasons"]) == ([], ["the map shows no vehicle"])


def test_a_missing_map_names_the_command_that_makes_it(street: Path) -> None:
    (street / "bev" / "groundtruth" / f"{token('sample', 0)}.npz").unlink()
    result = run(street, "stop behind the car", "--bev", "groundtruth")
    assert isinstance(result.exception, DataError)
    assert f"there are maps of source empty and other; make it with: appocc groundtruth {street}" in str(
        result.exception
    )


def test_bad_input_names_file_frame_or_scene(street: Path) -> None:
    missing = run(street, "stop behind the car", "--bev", "nowhere")
    assert isinstance(missing.exception, DataError)
    assert "nowhere" in str(missing.exception)
    late = CliRunner().invoke(app, ["ground", "stop", str(street), "--scene", "scene-tiny", "--frame", "9"])
    assert isinstance(late.exception, NotFoundError)
    assert "frames 0..2" in str(late.exception)
    lost = CliRunner().invoke(app, ["ground", "stop", str(street), "--scene", "nope", "--frame", "0"])
    assert isinstance(lost.exception, NotFoundError)


def test_a_picture_that_cannot_be_written_leaves_nothing(street: Path, tmp_path: Path) -> None:
    result = run(street, "stop behind the car", "--picture", str(tmp_path / "g.nonsense"))
    assert isinstance(result.exception, DataError)
    assert list(tmp_path.glob("*nonsense*")) == []


# Other sources of scenes ------------------------------------------------------------------------------------------


def run_ground(*words: object, typed: str | None = None) -> Result:
    return CliRunner().invoke(app, ["ground", *map(str, words)], input=typed)


KEY_FRAME = ("--scene", "scene-tiny", "--frame", "0")


def test_a_saved_map_alone(street: Path, tmp_path: Path) -> None:
    """The vehicles are the map's instances, the world frame is the ego frame, and the picture has no camera panel."""
    result = run_ground(
        *("stop behind the car", "--map", bev_path(street, "other", token("sample", 0)), "--json"),
        *("--picture", tmp_path / "g.png"),
    )
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert value["target"]["world_m"] == value["target"]["ego_m"]
    assert read_image(tmp_path / "g.png").shape[1] == 800


def test_vehicles_from_tracks(street: Path, tmp_path: Path) -> None:
    track = Track(
        id=7,
        position_world_m=np.array([100.0, 215.0, 0.0]),
        velocity_world_mps=np.zeros(2),
        yaw_world_rad=np.pi / 2,
        heading_known=True,
        length_m=4.4,
        width_m=1.8,
        rgb=np.array([20.0, 30, 200]),
        score=0.9,
        seen=True,
    )
    write_nuscenes(tmp_path / "t.json", [token("sample", 0)], [(track,)], ("camera",))
    result = run_ground(
        "stop behind the blue car", street, *KEY_FRAME, "--bev", "empty", "--tracks", tmp_path / "t.json", "--json"
    )
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert value["referent"]["ego_m"] == pytest.approx([15, 0], abs=1e-3)
    # The rear bumper is at 12.8 m, the gap 2 m, half the ego 2.3 m.
    assert value["target"]["ego_m"] == pytest.approx([8.5, 0.0], abs=0.41)


def test_several_commands_from_a_file(street: Path, tmp_path: Path) -> None:
    (tmp_path / "all.txt").write_text("stop behind the white car\n\n  tell me a joke\nfollow the bus\n")
    result = run_ground(street, *KEY_FRAME, "--commands", tmp_path / "all.txt", "--json")
    assert result.exit_code == 3
    read, values = json.JSONDecoder(), []
    left = result.stdout.strip()
    while left:
        value, end = read.raw_decode(left)
        values.append(value["status"])
        left = left[end:].strip()
    assert values == ["ok", "not_a_command", "not_found"]


def test_a_conversation(street: Path) -> None:
    typed = "stop behind the white car\n\ntell me a joke\nhelp\na bit further back\nquit\nstop\n"
    result = run_ground(street, *KEY_FRAME, "-i", "--json", typed=typed)
    assert result.exit_code == 0, result.output
    assert result.stderr.count("> ") == 6
    assert "ok: stop behind the white car" in result.stderr
    assert "not a command: tell me a joke" in result.stderr
    assert "Answer a question:" in result.stderr
    assert "ok: a bit further back" in result.stderr
    assert "ok: stop\n" not in result.stderr
    assert result.stdout.count('"steps"') == 3


def test_the_exit_code_of_a_conversation_is_that_of_its_last_answer(street: Path) -> None:
    assert run_ground(street, *KEY_FRAME, "-i", typed="stop behind the white car\ntell me a joke").exit_code == 2
    assert run_ground(street, *KEY_FRAME, "-i", typed="").exit_code == 0


def test_the_folder_of_a_picture_is_made(street: Path, tmp_path: Path) -> None:
    result = run_ground("stop", street, *KEY_FRAME, "--picture", tmp_path / "new" / "folder" / "g.png")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "new" / "folder" / "g.png").is_file()


def test_explain_prints_categories_query_and_scores(street: Path) -> None:
    result = run_ground("stop behind the white car", street, *KEY_FRAME, "--explain")
    assert "[stop: verb]" in result.stderr
    assert "[behind: relation]" in result.stderr
    assert "action stop" in result.stderr
    assert "referent white car" in result.stderr
    assert "white 1.00" in result.stderr


def test_a_custom_lexicon(street: Path, tmp_path: Path) -> None:
    (tmp_path / "own.txt").write_text("[noun car]\nschnauferl\n")
    assert run_ground("stop behind the schnauferl", street, *KEY_FRAME).exit_code == 3
    result = run_ground("stop behind the schnauferl", street, *KEY_FRAME, "--lexicon", tmp_path / "own.txt")
    assert result.exit_code == 0, result.output
    (tmp_path / "own.txt").write_text("nonsense\n")
    damaged = run_ground("stop", street, *KEY_FRAME, "--lexicon", tmp_path / "own.txt")
    assert isinstance(damaged.exception, DataError)
    assert "own.txt" in str(damaged.exception)


def test_an_unreachable_language_model_is_reported_and_not_needed(street: Path) -> None:
    url = "http://127.0.0.1:9/"
    assert run_ground("stop behind the white car", street, *KEY_FRAME, "--llm", url).exit_code == 0
    result = run_ground("glorp behind the white car", street, *KEY_FRAME, "--llm", url)
    assert result.exit_code == 3  # it asks what is meant
    assert "the language model was not used" in result.stderr


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "expected one of TEXT, --commands and --interactive, got none"),
        (("stop", "{root}", "-i"), "got TEXT and --interactive"),
        (("stop",), "expected one of ROOT and --map, got none"),
        (("stop", "{root}", "--map", "m.npz"), "got ROOT and --map"),
        (("stop", "-i", "--map", "m.npz"), "got ROOT and --map; with --commands or --interactive, ROOT is the only"),
        (("-i", *KEY_FRAME), "expected one of ROOT and --map, got none; with --commands or --interactive, ROOT is"),
        (("stop", "{root}"), "expected --frame, 0..2 of scene 'scene-tiny'"),
        (("stop", "--map", "m.npz", "--frame", "0"), "--map goes without --scene, --frame and --tracks"),
        (("stop", "--map", "{root}/nothing.npz"), "nothing.npz"),
        (("{root}", "-i", *KEY_FRAME, "--picture", "g.png"), "--picture goes only with TEXT"),
        (("{root}", "--commands", "{root}/none.txt", *KEY_FRAME), "none.txt: cannot be read"),
        (("stop", "{root}", *KEY_FRAME, "--tracks", "{root}/none.json"), "none.json"),
        (("stop", "{root}", *KEY_FRAME, "--llm", "file:///etc/passwd"), "begins with http:// or https://"),
    ],
)
def test_arguments_that_exclude_each_other(street: Path, words: tuple[str, ...], reason: str) -> None:
    result = run_ground(*(word.format(root=street) for word in words))
    assert isinstance(result.exception, DataError), result.output
    assert reason in str(result.exception)


@pytest.mark.parametrize(
    ("content", "reason"), [(b"", "got none"), (b" \n\n", "got none"), (b"a\n" * 600_000, "at most")]
)
def test_files_without_commands(street: Path, tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "all.txt").write_bytes(content)
    result = run_ground(street, *KEY_FRAME, "--commands", tmp_path / "all.txt")
    assert isinstance(result.exception, DataError)
    assert reason in str(result.exception)


def test_standard_input_that_is_closed_or_not_text(street: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["ground", str(street), "-i", *KEY_FRAME]
    result = CliRunner().invoke(app, words, input=b"\xff\xfe\n")
    assert isinstance(result.exception, DataError), result.output
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(DataError, match="standard input is closed"):
        list(_typed_lines())


def test_help_shows_an_example() -> None:
    result = CliRunner().invoke(app, ["ground", "--help"])
    assert result.exit_code == 0
    assert "Example" in result.output


def test_nothing_is_taken_from_what_no_camera_sees_unless_typed_lines_for(street: Path) -> None:
    bev = BEVMap.load(bev_path(street, "groundtruth", token("sample", 0)))
    behind = bev.grid.centres()[..., 0] < 3.0  # the view of a rear camera
    meta = {"thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}}
    blind = replace(bev, occupancy_valid=bev.occupancy_valid & behind, appearance_valid=behind, meta=meta)
    blind.save(bev_path(street, "predicted", token("sample", 0)))
    refused, trusted = (
        run(street, "stop behind the vehicle", "--bev", "predicted", "--json", *more)
        for more in ((), ("--trust-unseen",))
    )
    assert (refused.exit_code, trusted.exit_code) == (3, 0), refused.output
    assert json.loads(refused.stdout)["reasons"][-1] == "ahead of us nothing is seen"
    assert json.loads(trusted.stdout)["target"]["ego_m"][0] > 3
    saved = run_map(bev_path(street, "predicted", token("sample", 0)))
    assert (saved().exit_code, saved("--trust-unseen").exit_code) == (3, 0)


def run_map(path: Path) -> Callable[..., Result]:
    return lambda *more: CliRunner().invoke(app, ["ground", "stop behind the vehicle", "--map", str(path), *more])

"""Human commands on recorded tracks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.errors import DataError
from appocc.files import write_json
from benchmarks.real_commands import main, measure


@pytest.mark.realdata
def test_human_commands_on_real_tracks(data_root: Path) -> None:
    outcomes = [one.outcome for one in measure(data_root / "nuscenes_mini_tracks")]
    assert len(outcomes) == 27
    assert outcomes.count("top") >= 9
    assert outcomes.count("missed") <= 8


def recorded(folder: Path, **more: Any) -> dict[str, Any]:
    """A recording of two cars ahead, the second of which is named, and the sentence about it."""
    moments, cars = 8, 2
    parts: dict[str, Any] = {
        "t": np.arange(moments) / 10,
        "ids": np.array(["first", "second"]),
        "category": np.array(["vehicle.car", "vehicle.car"]),
        "position": np.tile(np.array([[[10.0, -4, 0.8]], [[20.0, 4, 0.8]]]), (1, moments, 1)),
        "heading": np.zeros((cars, moments)),
        "velocity": np.zeros((cars, moments, 2)),
        "valid": np.ones((cars, moments), np.bool_),
        "size_lwh": np.tile([4.5, 1.8, 1.5], (cars, 1)),
        "ego_position": np.zeros((moments, 3)),
        "ego_heading": np.zeros(moments),
    } | more
    np.savez(folder / "scene-1.npz", **{name: part for name, part in parts.items() if part is not None})
    return {"command": "stop behind the car on the left", "scene": "scene-1", "track": "second", "t_best": 0.6}


def test_a_made_recording(tmp_path: Path) -> None:
    record = recorded(tmp_path)
    unnamed = {**record, "track": None}
    write_json(tmp_path / "talk2car_commands.json", [record, {**record, "t_best": 0.0}, unnamed])
    assert [(one.outcome, one.rank, one.lacked) for one in measure(tmp_path)] == [("top", 1, ""), ("top", 1, "")]
    asked = {**record, "command": "stop behind the red car"}
    write_json(tmp_path / "talk2car_commands.json", [asked, {**asked, "command": "stop behind the bus"}])
    assert [(one.outcome, one.lacked) for one in measure(tmp_path)] == [("among", "colour"), ("missed", "language")]


@pytest.mark.parametrize("category", ["movable_object.trafficcone", "static_object.bicycle_rack"])
def test_a_referent_that_is_no_vehicle_is_missed(tmp_path: Path, category: str) -> None:
    record = recorded(tmp_path, category=np.array(["vehicle.car", category]))
    write_json(tmp_path / "talk2car_commands.json", [{**record, "command": "stop at the cone"}, record])
    assert [(one.outcome, one.lacked) for one in measure(tmp_path)] == [("missed", "scene"), ("missed", "scene")]


@pytest.mark.parametrize(
    ("record", "parts", "message"),
    [
        ({"track": "nobody"}, {}, "track nobody: expected it among those of its scene, got none"),
        ({"scene": "scene-2"}, {}, "scene-2.npz: expected tracks of a scene"),
        ({}, {"heading": None}, "scene-1.npz: expected tracks of a scene"),
    ],
)
def test_damaged_recordings(tmp_path: Path, record: dict[str, Any], parts: dict[str, Any], message: str) -> None:
    write_json(tmp_path / "talk2car_commands.json", [recorded(tmp_path, **parts) | record])
    with pytest.raises(DataError, match=message):
        measure(tmp_path)


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ({}, "talk2car_commands.json: expected a list of records, got dict"),
        ([{"track": "second", "scene": "scene-1"}], "expected command, scene, t_best, track in each record"),
    ],
)
def test_damaged_sentences(tmp_path: Path, records: Any, message: str) -> None:
    write_json(tmp_path / "talk2car_commands.json", records)
    with pytest.raises(DataError, match=message):
        measure(tmp_path)


def test_the_command_line_of_the_benchmark(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_json(tmp_path / "talk2car_commands.json", [recorded(tmp_path)])
    main([str(tmp_path), "--json"])
    assert json.loads(capsys.readouterr().out)["counts"] == {"top": 1}
    main([str(tmp_path)])
    assert "top 1, among 0, missed 0" in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path / "nothing")])
    assert stopped.value.code == 2

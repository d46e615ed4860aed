from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import ROAD, VEHICLE, BEVMap, bev_path, load_map
from appocc.errors import DataError
from appocc.grid import BEVGrid
from cli.bev_tables import show_evaluation
from cli.main import app

GRID = BEVGrid(-16.0, 16.0, -16.0, 16.0, 0.4)
THRESHOLDS = {"road": 0.3, "vehicle": 0.4, "lane": 0.5}


def map_of(i: int, shift: int = 0, probability: float = 1.0, thresholds: bool = False) -> BEVMap:
    """Return a map of the tiny dataset's car at sample i, shifted by cells, on a road in the right half."""
    offset = np.abs(GRID.centres() - [10.0 - 2.5 * i + shift * GRID.cell_m, 0.0])
    car = (offset[..., 0] < 2.3) & (offset[..., 1] < 0.95)
    occupancy = np.zeros((3, *GRID.shape), np.float32)
    occupancy[VEHICLE][car] = probability
    occupancy[ROAD, :, :40] = probability
    colour = np.where(car, 240, 90).astype(np.uint8)[None].repeat(3, axis=0)
    known = np.ones((3, *GRID.shape), np.bool_)
    return BEVMap(GRID, occupancy, known, colour, known[0].copy(), {"thresholds": THRESHOLDS} if thresholds else {})


@pytest.fixture
def street(tiny: TinyDataset) -> TinyDataset:
    """The tiny dataset with true maps and with those of a low-confidence model, shifted by 2 cells."""
    seen = GRID.centres()[..., 0] > 2
    for i in range(3):
        map_of(i).save(bev_path(tiny.root, "groundtruth", token("sample", i)))
        map_of(i, 2, 0.45, True).save(bev_path(tiny.root, "model", token("sample", i)), {"seen": seen})
    return tiny


def run(root: Path, source: str | None, *more: str) -> Result:
    return CliRunner().invoke(app, ["eval", "bev", str(root), *(["--bev", source] if source else []), *more])


def answer(root: Path, source: str, *more: str) -> dict[str, Any]:
    result = run(root, source, "--json", *more)
    assert result.exit_code == 0, result.stderr
    value: dict[str, Any] = json.loads(result.stdout)
    return value


def test_the_truth_scores_perfectly(street: TinyDataset) -> None:
    value = answer(street.root, "groundtruth")
    assert value["against"] == "groundtruth"
    assert value["iou"] == {"road": 1.0, "vehicle": 1.0, "lane": None}
    assert value["iou_at_threshold"] is None
    assert value["appearance_l1"] == 0
    assert (value["samples"], value["vehicles"]["count"], value["vehicles"]["detected"]) == (3, 3, 3)
    # One at 10, 7.5 and 5 m; the second and third samples are those within ten metres.
    assert [value["by_range"][ring]["vehicles"]["count"] for ring in ("0-10 m", "10-20 m")] == [2, 1]
    assert value["by_visibility"]["v80-100"]["count"] == 3
    assert value["by_sight"] is value["iou_seen"] is None
    assert value["confidence"]["iou"]["road"] is None  # one scene


def test_a_prediction_is_evaluated_at_half_and_at_its_thresholds(street: TinyDataset) -> None:
    value = answer(street.root, "model")
    assert value["iou"] == {"road": 0.0, "vehicle": 0.0, "lane": None}
    assert value["thresholds"] == pytest.approx(THRESHOLDS)
    assert value["iou_at_threshold"]["road"] == 1
    # Cars are 11 or 12 cells long; 2 cells at each end are wrong.
    assert value["iou_at_threshold"]["vehicle"] == pytest.approx(10 / 14, abs=0.04)
    assert value["vehicles"]["detected_share"] == 1
    assert value["vehicles"]["cells_found"] == pytest.approx(10 / 12, abs=0.03)
    # A sixth of the true car is road-coloured in the map; the same number of cells behind it is car-coloured.
    assert value["vehicles"]["appearance_l1"] == pytest.approx(150 / 6, abs=3)
    assert value["appearance_l1_by_class"]["vehicle"] == pytest.approx(150 / 6, abs=3)
    assert value["vehicles"]["ciede2000_median"] > 3
    assert set(value["by_sight"]) == {"seen", "unseen"}
    assert value["by_sight"]["unseen"]["iou_at_threshold"] == {"road": 1.0, "vehicle": None, "lane": None}
    assert (
        value["by_sight"]["seen"]["iou_at_threshold"] == value["iou_at_threshold_seen"] == value["iou_at_threshold"]
    )


def test_the_psnr_of_colours_that_are_all_ten_off(street: TinyDataset) -> None:
    assert answer(street.root, "groundtruth")["appearance_psnr"] is None  # no error
    for i in range(3):
        made = load_map(street.root, "groundtruth", token("sample", i))
        off = np.where(made.appearance > 100, made.appearance - 10, made.appearance + 10).astype(np.uint8)
        replace(made, appearance=off).save(bev_path(street.root, "off", token("sample", i)))
    value = answer(street.root, "off")
    assert value["appearance_l1"] == 10
    assert value["appearance_psnr"] == pytest.approx(20 * np.log10(25.5))


def test_a_prediction_has_a_reliability_table_over_valid_cells(street: TinyDataset) -> None:
    for i in range(3):
        made = map_of(i, 2, 0.45, True)
        valid = np.broadcast_to(GRID.centres()[..., 0] > 0, made.occupancy_valid.shape).copy()
        replace(made, occupancy_valid=valid).save(bev_path(street.root, "model", token("sample", i)))
    value = answer(street.root, "model")["calibration"]
    assert set(value) == {"road", "vehicle", "lane"}
    road = {round(row["from"], 1): row for row in value["road"]["table"] if row["cells"]}
    # Half of the valid cells are road, all of these at 0.45, the others at 0.
    assert {low: row["cells"] for low, row in road.items()} == {0.0: 3 * 40 * 40, 0.4: 3 * 40 * 40}
    assert road[0.4]["mean_probability"] == pytest.approx(0.45, abs=1e-3)
    assert (road[0.0]["observed_share"], road[0.4]["observed_share"]) == (0, 1)
    assert value["road"]["ece"] == pytest.approx(0.55 / 2, abs=1e-3)
    assert value["lane"]["ece"] == 0
    near = answer(street.root, "model", "--range", "6")["calibration"]
    assert sum(row["cells"] for row in near["road"]["table"]) < 3 * 80 * 40
    assert answer(street.root, "groundtruth")["calibration"] is None
    assert "calibration error" in run(street.root, "model").stderr
    assert "calibration error" not in run(street.root, "groundtruth").stderr


def test_setting_and_range_restrict_the_cells(street: TinyDataset) -> None:
    for i in range(3):
        true = map_of(i)
        wrong = true.occupancy.copy()
        wrong[ROAD, :40] = 1  # behind the ego
        known = true.occupancy_valid, true.appearance, true.appearance_valid
        BEVMap(GRID, wrong, *known).save(bev_path(street.root, "behind", token("sample", i)))
    whole, ahead = (answer(street.root, "behind", "--setting", name) for name in ("360", "180"))
    assert (whole["setting"], whole["iou"]["road"]) == ("360", pytest.approx(2 / 3))
    assert (ahead["setting"], ahead["iou"]["road"]) == ("180", 1.0)
    near = answer(street.root, "model", "--range", "6")
    assert near["range_m"] == 6
    assert near["by_range"]["10-20 m"]["iou"]["road"] is None
    assert near["vehicles"]["count"] == 2  # the first, 7.7 m away, has no cell in range


def test_tables_go_to_stderr(street: TinyDataset) -> None:
    result = run(street.root, "model", "--scene", "scene-tiny")
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "model against groundtruth, setting 360: 3 samples of 1 scenes" in result.stderr
    assert "visible 80-100 %" in result.stderr
    assert "unseen" in result.stderr
    assert "95 %" not in result.stderr  # one scene has no interval


def test_tables_fit_a_terminal_of_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    classes = ("road", "vehicle", "lane")
    part: dict[str, Any] = {
        "iou": dict.fromkeys(classes, 1.0),
        "iou_at_threshold": dict.fromkeys(classes, 1.0),
        "appearance_l1": 100.0,
        "appearance_l1_by_class": dict.fromkeys(classes, 100.0),
        "appearance_psnr": 10.0,
    }
    row = {"from": 0.9, "to": 1.0, "cells": 7, "observed_share": 1.0}
    shares = dict.fromkeys(("detected_share", "cells_found"), 1.0)
    medians = dict.fromkeys(("ciede2000_median", "ciede2000_median_detected"), 100.0)
    part["vehicles"] = {"count": 100_000, "appearance_l1": 100.0, **shares, **medians}
    draws: dict[str, Any] = dict.fromkeys((*medians, "appearance_l1"), (100.0, 120.0))
    draws["appearance_l1_by_class"] = dict.fromkeys(classes, (100.0, 120.0))
    draws["iou"] = draws["iou_at_threshold"] = dict.fromkeys(classes, (0.5, 1.0))
    show_evaluation(
        {
            **{"source": "model", "against": "exact", "setting": "360", "range_m": 20.0, "samples": 9, "scenes": 3},
            **part,
            **{"by_range": {"10-20 m": part}, "by_sight": {"unseen": part}, "by_weather": {"overcast": part}},
            **{"thresholds": THRESHOLDS, "confidence": draws, "by_visibility": {"v80-100": part["vehicles"]}},
            "calibration": {name: {"table": [row], "ece": 0.5} for name in classes},
        }
    )
    printed = capsys.readouterr().err
    assert "…" not in printed
    assert max(map(len, printed.splitlines())) <= 80
    for text in ("at 0.40", "50..100", "visible 80-100 %", "100..120"):
        assert text in printed


def test_missing_maps_are_reported_in_one_line(street: TinyDataset) -> None:
    bev_path(street.root, "model", token("sample", 1)).unlink()
    result = run(street.root, "model")
    assert isinstance(result.exception, DataError)
    assert result.exception.exit_code == 2
    assert f"1 of 3 samples have no BEV map ({token('sample', 1)}.npz is the first)" in str(result.exception)
    assert "appocc infer" in str(result.exception)
    result = run(street.root, "groundtruth", "--against", "exact")
    assert "3 of 3 samples have no BEV map" in str(result.exception)


def test_without_a_source_the_maps_beside_the_truth_are_taken_or_listed(street: TinyDataset) -> None:
    result = run(street.root, None, "--json")
    assert json.loads(result.stdout)["source"] == "model"
    (street.root / "bev" / "other").symlink_to(street.root / "bev" / "model")
    assert "expected --bev, one of model, other" in str(run(street.root, None).exception)


def test_maps_of_two_models_are_rejected(street: TinyDataset) -> None:
    map_of(2).save(bev_path(street.root, "model", token("sample", 2)))
    assert "expected maps of one model" in str(run(street.root, "model").exception)


def test_simulated_truth_has_weather_and_instances(simulated_root: Path) -> None:
    value = answer(simulated_root, "groundtruth", "--against", "exact")
    assert value["iou"]["vehicle"] > 0.99
    assert value["iou"]["road"] > 0.98
    assert value["by_weather"]
    assert sum(part["count"] for part in value["by_visibility"].values()) == value["vehicles"]["count"] > 0
    low, high = value["confidence"]["iou"]["lane"]
    assert low <= value["iou"]["lane"] <= high

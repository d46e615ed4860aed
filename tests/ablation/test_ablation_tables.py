from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_study import made_config
from tiny_dataset import TinyDataset

from appocc.ablation.paper_results import APPEARANCE_L1, DIFFERENCES, TABLES
from appocc.ablation.report import render_report
from appocc.ablation.row_evaluation import ColouringPredictor, json_value
from appocc.ablation.rows import BOTH, COLOUR, OCCUPANCY, StudyRow
from appocc.ablation.run import draw_scenes
from appocc.ablation.study import RowOutcome
from appocc.ablation.tables import appearance_table, differences, iou_table, spread, study_json
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.models.ipm import ipm
from appocc.models.model_spec import MODEL_SPECS
from appocc.nuscenes import Dataset

TEST = {"root": "sim", "against": "exact", "scenes": 3, "samples": 12}


def outcome(row: StudyRow, road: float | None, l1: float | None = None, at: float | None = None) -> RowOutcome:
    """A done row; its vehicles are 0.1 worse than its roads, and it has no lanes."""
    iou = {"road": road, "vehicle": None if road is None else road - 0.1, "lane": None}
    evaluation: dict[str, Any] = {
        "iou": iou,
        "iou_at_threshold": None if at is None else {**iou, "road": at},
        "thresholds": None,
        "appearance_l1": l1,
        "appearance_l1_by_class": dict.fromkeys(iou, l1),
        "appearance_known": None if l1 is None else 0.75,
        "vehicles": {"ciede2000_median": l1},
    }
    return RowOutcome(row, "done", {"steps": 5, "best_step": 5, "seconds": 90.0, "evaluation": evaluation})


OUTCOMES = [
    outcome(StudyRow("appocc", "360", OCCUPANCY, 0), 0.5, at=0.6),
    outcome(StudyRow("appocc", "360", BOTH, 0), 0.6, 30.0, at=0.5),
    outcome(StudyRow("lss", "360", OCCUPANCY, 0), 0.4),
    outcome(StudyRow("ipm", "360", COLOUR, None), None, 50.0),
    RowOutcome(StudyRow("paper", "360", BOTH, 0), "failed", {"reason": "no | number"}),
    RowOutcome(StudyRow("paper", "180", BOTH, 0), "begun", {"steps": 3}),
    RowOutcome(StudyRow("neat", "180", OCCUPANCY, 0), "not run", {}),
    outcome(StudyRow("appocc", "360", OCCUPANCY, 1), 0.56, at=0.6),
    outcome(StudyRow("appocc", "360", BOTH, 1), 0.54, 32.0, at=0.7),
    outcome(StudyRow("appocc", "360", OCCUPANCY, 2), 0.53, at=0.6),
]


def test_the_papers_differences_are_those_of_its_tables() -> None:
    for setting, wanted in DIFFERENCES.items():
        alone, ours = (next(each.iou for each in TABLES[setting] if word in each.name) for word in ("Lift", "paper"))
        assert [round(b - a, 4) for a, b in zip(alone, ours, strict=True) if a and b] == list(wanted)
    assert (TABLES.keys(), APPEARANCE_L1["360"]) == (DIFFERENCES.keys(), 3.046)


def test_results_are_grouped_by_seed() -> None:
    first, second, third = iou_table(OUTCOMES, "360")
    assert (first["network"], first["answers"], first["seeds"]) == ("appocc", OCCUPANCY, [0, 1, 2])
    assert first["iou"]["road"] == {
        "mean": pytest.approx(0.53),
        "deviation": pytest.approx(0.03),
        "values": [0.5, 0.56, 0.53],
    }
    assert first["iou"]["lane"] == {"mean": None, "deviation": None, "values": [None] * 3}
    assert second["seeds"] == [0, 1]
    assert third["iou"]["road"] == {"mean": 0.4, "deviation": None, "values": [0.4]}
    assert third["iou_at_threshold"] is None
    assert iou_table(OUTCOMES, "180") == []


def test_differences_are_of_pairs_with_one_seed() -> None:
    (found,) = differences(OUTCOMES, "360")
    assert (found["network"], found["seeds"]) == ("appocc", [0, 1])
    assert found["iou"]["road"]["values"] == pytest.approx([0.1, -0.02])
    assert found["iou"]["road"]["mean"] == pytest.approx(0.04)
    assert found["iou_at_threshold"]["road"]["values"] == pytest.approx([-0.1, 0.1])
    assert found["iou"]["lane"]["mean"] is None
    assert differences(OUTCOMES, "180") == []
    assert (
        differences([OUTCOMES[2], outcome(StudyRow("lss", "360", BOTH, 0), 0.4)], "360")[0]["iou_at_threshold"]
        is None
    )


def test_colour_errors_of_networks_with_appearance() -> None:
    ours, floor = appearance_table(OUTCOMES, "360")
    assert (ours["network"], ours["appearance_l1"]["mean"], ours["ciede2000_median"]["mean"]) == ("appocc", 31, 31)
    assert (floor["network"], floor["seeds"], floor["appearance_known"]["mean"]) == ("ipm", [None], 0.75)


def test_for_machines_everything_is_json() -> None:
    value = json.loads(json.dumps(study_json(made_config(), TEST, OUTCOMES), allow_nan=False))
    assert [row["state"] for row in value["rows"]] == [each.state for each in OUTCOMES]
    assert (value["rows"][4]["reason"], value["rows"][5]["steps"]) == ("no | number", 3)
    assert "seconds" not in json.dumps(value["rows"])
    assert value["published"]["180"]["iou"]["NEAT"] == {"road": 0.581, "vehicle": 0.763, "lane": None}
    assert value["published"]["360"]["differences"]["lane"] == 0.0676


def test_the_report_has_all_tables() -> None:
    text = render_report(made_config(), TEST, OUTCOMES)
    flat = " ".join(text.split())
    assert "12 steps of 4 samples" in flat
    assert "| *published: NEAT* |  |  | *58.10* | *76.30* | *-* |" in text
    assert "12 frames of 3 scenes of `sim`, against `exact`. 7 of 10 rows are done" in flat
    assert "| `appocc` | occupancy | 3 | 53.0 ± 3.0 | 43.0 ± 3.0 | - | 60.0 ± 0.0 |" in text
    assert "| `lss` | occupancy | 1 | 40.0 | 30.0 | - | - | - | - |" in text
    assert "| 360 | *published* |  |  | *+3.37* | *+1.32* | *+6.76* |" in text
    assert "| 360 | `appocc` | 0.5 | 2 | +4.00 (+10.00, -2.00) | +4.00 (+10.00, -2.00) | - |" in text
    assert "| 180 | *published* |  |  | *+4.95* | *+3.92* | *+4.96* |" in text
    assert "| 360 | `ipm` | 1 | 50.0 |" in text
    assert "Without a result: `paper-360-both-s0`, `paper-180-both-s0`, `neat-180-occupancy-s0`." in text
    assert "| `paper-360-both-s0` | failed: no / number |" in text
    assert "| `appocc-360-both-s1` | done | 5 | 5 | 1.5 |" in text
    assert max(len(line) for line in text.splitlines() if not line.startswith("|")) <= 120
    for part in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({line.count("|") for line in part.splitlines()}) == 1


def test_the_report_names_budget_and_auxiliary_losses() -> None:
    text = " ".join(
        render_report(made_config(train__steps=None, train__minutes=7.5, train__accumulate=2), TEST, []).split()
    )
    assert "7.5 minutes of steps of 8 samples" in text
    assert "learn from depth and pixel classes" in text
    assert "All rows have a result" in text
    assert "the best of the run on `none`." in text
    held_out = made_config(data={"train": "sim", "held_out": 4})
    assert "the best of the run on the last 4 samples of each of its scenes." in " ".join(
        render_report(held_out, TEST, []).split()
    )
    assert "learn from depth" not in render_report(made_config(losses__depth=0, losses__kind=0), TEST, [])


def test_mean_and_deviation_ignore_missing_values() -> None:
    assert spread([1.0, None, 3.0]) == {"mean": 2.0, "deviation": pytest.approx(2**0.5), "values": [1.0, None, 3.0]}


def test_non_finite_numbers_become_null() -> None:
    assert json_value({"a": [float("nan"), (1.0, float("inf"))], 2: "x"}) == {"a": [None, [1.0, None]], "2": "x"}


def test_a_colouring_method_colours_visible_cells_without_occupancy(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    frame = dataset.frame(dataset.samples(dataset.scenes[0])[0])
    bev, seen = ColouringPredictor(ipm, MODEL_SPECS["360"])(frame)
    assert bev.grid == MODEL_SPECS["360"].grid
    assert not bev.occupancy_valid.any()
    assert np.array_equal(bev.appearance_valid, seen)
    assert 0 < seen.sum() < seen.size
    assert np.abs(bev.appearance[:, seen].mean(axis=1) - [160, 80, 40]).max() <= 2
    ahead, _ = ColouringPredictor(ipm, MODEL_SPECS["180"])(frame)
    assert ahead.grid == MODEL_SPECS["180"].grid
    front = Frame(frame.token, 0, frame.world_from_ego, frame.rig, {"CAM_FRONT": frame.images["CAM_FRONT"]})
    fewer, _ = ColouringPredictor(ipm, MODEL_SPECS["360"])(front)
    assert 0 < fewer.appearance_valid.sum() < seen.sum()
    with pytest.raises(DataError, match="expected an image of CAM_FRONT_LEFT"):
        ColouringPredictor(ipm, MODEL_SPECS["180"])(Frame(frame.token, 0, frame.world_from_ego, frame.rig, {}))


def test_scenes_are_selected_reproducibly_and_in_order(tiny: TinyDataset) -> None:
    scene = Dataset(tiny.root).scenes[0]
    many = [replace(scene, name=f"{i:02}") for i in range(40)]
    assert draw_scenes(many, None) == draw_scenes(many, 99) == tuple(many)
    names = [each.name for each in draw_scenes(many, 12)]
    assert names == sorted(set(names))
    assert names == [each.name for each in draw_scenes(many, 12)]
    # Towns come in turn: every second scene would be of one town.
    assert {int(name) % 2 for name in names} == {0, 1}

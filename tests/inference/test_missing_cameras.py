from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from made_model import AHEAD, GRID, HIGH, MadeModel, MadePlan, predictor, save_road_everywhere
from tiny_dataset import TinyDataset
from torch import Tensor

from appocc.bevmap import ROAD
from appocc.errors import DataError
from appocc.inference.inputs import InferenceInput, dataset_inputs
from appocc.inference.predictor import Predictor
from appocc.models.base import ModelOutput
from appocc.models.memory import Past
from appocc.models.model_spec import MODEL_SPECS
from appocc.nuscenes import Dataset
from benchmarks import missing_cameras
from benchmarks.missing_cameras import as_json, choices, main, measure, score, table
from benchmarks.predicted_maps import evenly

SIX = MODEL_SPECS["360"].channels


class WhatIsSeen(MadeModel):
    """Says that there is road wherever a camera looks, and nothing else."""

    def forward(  # type: ignore[override]
        self, images: Tensor, plan: MadePlan, past: Past | None = None
    ) -> ModelOutput:
        on = torch.zeros(1, 3, *GRID.shape)
        on[:, ROAD] = HIGH * plan.seen
        return ModelOutput(torch.logit(on, 1e-4), None, None)


@pytest.fixture
def street(tiny: TinyDataset) -> Path:
    """The tiny dataset, which has a camera ahead and one behind, with road everywhere."""
    save_road_everywhere(tiny)
    return tiny.root


def inputs_of(root: Path) -> list[InferenceInput]:
    dataset = Dataset(root)
    return dataset_inputs(dataset, dataset.scenes)


def test_choices_of_living_cameras_are_fixed_and_few() -> None:
    assert choices(SIX, 6) == [SIX]
    assert [set(SIX) - set(alive) for alive in choices(SIX, 5)] == [{name} for name in reversed(SIX)]
    for alive in (4, 3):
        drawn = choices(SIX, alive)
        assert len(drawn) == len(set(drawn)) == 6
        assert all(len(set(one)) == alive and set(one) <= set(SIX) for one in drawn)
        assert drawn == choices(SIX, alive)


def test_frames_are_taken_from_all_over() -> None:
    inputs = [InferenceInput(str(i), str(i), lambda: pytest.fail("read too early"), dict) for i in range(9)]
    assert [each.token for each in evenly(inputs, 3)] == ["0", "4", "8"]
    assert evenly(inputs, 20) == inputs


def test_with_a_camera_gone_only_what_the_other_sees_is_right(street: Path) -> None:
    rows = as_json(measure(predictor(WhatIsSeen()), street, "exact", inputs_of(street)))
    assert [(row["alive"], row["choices"]) for row in rows] == [(2, 1), (1, 2), (1, 1)]
    assert rows[2]["of"][0]["alive"] == ("CAM_FRONT",)
    assert rows[0]["seen_share"] == 1
    assert rows[0]["iou"]["all"]["road"] == {"mean": 1, "worst": 1}
    share = rows[1]["seen_share"]
    assert 0.3 < share < 0.7
    assert rows[1]["iou"]["all"]["road"]["mean"] == pytest.approx(share)
    assert rows[1]["iou"]["all"]["road"]["worst"] == pytest.approx(
        min(one["iou"]["all"]["road"] for one in rows[1]["of"])
    )
    assert rows[1]["iou"]["seen"]["road"] == {"mean": 1, "worst": 1}
    assert rows[0]["unseen_road"]["guessed"]["mean"] is None  # both cameras see everything
    assert rows[1]["unseen_road"]["guessed"] == {"mean": 0, "worst": 0}
    # Nothing to compare is no number.
    assert rows[0]["iou"]["all"]["lane"] == {"mean": None, "worst": None}
    assert [cell for column in table(rows).columns for cell in column.cells][:2] == ["2", "1"]


def test_a_network_that_guesses_road_where_no_camera_looks_is_found_out(street: Path) -> None:
    class Sure(WhatIsSeen):
        """Says that there is road everywhere."""

        def forward(  # type: ignore[override]
            self, images: Tensor, plan: MadePlan, past: Past | None = None
        ) -> ModelOutput:
            output = super().forward(images, plan)
            road = torch.arange(3)[:, None, None] == ROAD
            return output._replace(occupancy=torch.where(road, 5.0, output.occupancy))

    both, one, front = as_json(measure(predictor(Sure()), street, "exact", inputs_of(street)))
    for row in (one, front):
        assert row["unseen_road"]["guessed"] == {"mean": 1, "worst": 1}
        assert row["unseen_road"]["kept"] == {"mean": 0, "worst": 0}
    assert both["unseen_road"]["kept"]["mean"] is None


def test_a_choice_is_judged_at_the_thresholds_of_the_map(street: Path) -> None:
    made = predictor(WhatIsSeen())
    assert score(made, street, "exact", inputs_of(street), ("CAM_FRONT",)).iou["seen"]["road"] == 1
    high = {"road": 0.9, "vehicle": 0.5, "lane": 0.5}
    object.__setattr__(made.weights, "thresholds", high)
    # Probabilities of 0.8 promise an IoU of 0.8, at a threshold below one half.
    assert score(made, street, "exact", inputs_of(street), ("CAM_FRONT",)).iou["seen"]["road"] == 1


def without_truth(root: Path) -> None:
    next((root / "bev" / "exact").iterdir()).unlink()


def without_picture(root: Path) -> None:
    next((root / "samples" / "CAM_BACK").iterdir()).unlink()


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [(without_truth, "no BEV map"), (without_picture, "expected pictures of all cameras, got none of CAM_BACK")],
)
def test_what_is_missing_is_told(street: Path, spoilt: Callable[[Path], None], said: str) -> None:
    spoilt(street)
    with pytest.raises(DataError, match=said):
        measure(predictor(), street, "exact", inputs_of(street))


def test_weights_must_fit_the_truth_and_the_rig(street: Path) -> None:
    with pytest.raises(DataError, match="truth on the grid of the weights"):
        measure(predictor(MadeModel(AHEAD)), street, "exact", inputs_of(street))
    other = MadeModel(AHEAD)
    other.spec = type(AHEAD)("180", ("CAM_ROOF",), AHEAD.grid, 16, 8)
    with pytest.raises(DataError, match="expected cameras CAM_ROOF"):
        measure(predictor(other), street, "exact", inputs_of(street))


def test_as_a_command(street: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def loaded(weights: Path | None) -> Predictor:
        return predictor(WhatIsSeen())

    monkeypatch.setattr(missing_cameras, "load_predictor", loaded)
    main([str(street), "--frames", "2", "--json"])
    value = json.loads(capsys.readouterr().out)
    assert (value["frames"], len(value["rows"])) == (2, 3)
    main([str(street), "--frames", "1"])
    said = capsys.readouterr().out
    assert "100.0 (100.0)" in said


@pytest.mark.parametrize(
    ("arguments", "said"), [(["nowhere"], "nowhere: no such folder"), (["x", "--frames", "0"], "expected 1 or more")]
)
def test_bad_input_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]

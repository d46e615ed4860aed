"""The benchmark of the look of images: filters keep what is there, and the swing is that of the IoU."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from made_model import GRID, MadeModel, MadePlan, predictor, save_road_everywhere
from tiny_dataset import TinyDataset
from torch import Tensor

from appocc.bevmap import ROAD
from appocc.errors import DataError
from appocc.inference.inputs import dataset_inputs
from appocc.inference.predictor import Predictor
from appocc.models.base import ModelOutput
from appocc.models.memory import Past
from appocc.nuscenes import Dataset
from benchmarks import look
from benchmarks.look import FILTERS, as_json, input_frame, main, measure, swing


class RoadIfBright(MadeModel):
    """Says that there is road everywhere, unless the images are dark."""

    def forward(  # type: ignore[override]
        self, images: Tensor, plan: MadePlan, past: Past | None = None
    ) -> ModelOutput:
        on = torch.full((1, 3, *GRID.shape), -5.0)
        on[:, ROAD] = 5.0 if images.mean() > 0.33 else -5.0
        return ModelOutput(on, None, None)


@pytest.fixture
def street(tiny: TinyDataset) -> Path:
    """The tiny dataset, whose images are of one colour, with road everywhere."""
    save_road_everywhere(tiny)
    return tiny.root


def test_filters_change_the_look_and_not_the_size() -> None:
    image = np.random.default_rng(0).integers(60, 190, (128, 352, 3)).astype(np.uint8)
    made = {name: changed(image) for name, changed in FILTERS.items()}
    assert all(each.shape == image.shape and each.dtype == np.uint8 for each in made.values())
    assert (made["as it is"] == image).all()
    assert made["contrast"].std() > image.std() > made["median"].std()
    assert made["blur"].std() < image.std()
    assert made["dark"].mean() < image.mean() - 10
    assert np.abs(made["jpeg"].astype(int) - image).mean() > 1
    # Colours keep their channels.
    red = np.full((64, 64, 3), (200, 60, 40), np.uint8)
    for name, changed in FILTERS.items():
        shown = changed(red)[32, 32].astype(int)
        assert shown[0] > shown[1] + 50, name


def test_filters_act_on_the_input_of_the_network(street: Path) -> None:
    dataset = Dataset(street)
    frame = dataset_inputs(dataset, dataset.scenes)[0].read().frame
    spec = predictor().model.spec
    small = input_frame(frame, spec)
    assert {image.shape for image in small.images.values()} == {(spec.height_px, spec.width_px, 3)}
    whole, again = predictor()(frame).bev, predictor()(small).bev
    assert (whole.occupancy == again.occupancy).all()
    assert (whole.appearance == again.appearance).all()


def test_the_swing_of_a_network_that_fails_in_the_dark(street: Path) -> None:
    dataset = Dataset(street)
    iou = measure(predictor(RoadIfBright()), street, "exact", dataset_inputs(dataset, dataset.scenes))
    assert iou["as it is"]["road"] == iou["median"]["road"] == 1
    assert iou["dark"]["road"] == 0
    assert swing(iou)["road"] == 1
    value = as_json(iou)
    assert value["swing"] == {"road": 1, "vehicle": None, "lane": None}
    assert list(value["iou"]) == list(FILTERS)


def test_look_as_a_command(street: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def loaded(weights: Path | None) -> Predictor:
        return predictor(RoadIfBright())

    monkeypatch.setattr(look, "load_predictor", loaded)
    main([str(street), "--frames", "2", "--json"])
    value = json.loads(capsys.readouterr().out)
    assert (value["frames"], value["swing"]["road"]) == (2, 1)
    main([str(street), "--frames", "1"])
    assert "swing" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main([str(street / "nowhere")])
    assert ended.value.code == 2
    assert "no such folder" in capsys.readouterr().err.splitlines()[-1]


def test_look_needs_key_frames(street: Path) -> None:
    with pytest.raises(DataError, match="expected key frames, got none"):
        measure(predictor(), street, "exact", [])

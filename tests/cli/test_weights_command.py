from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner, Result

from appocc.errors import DataError
from appocc.grid import BEVGrid
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import build
from appocc.models.weights import save_weights
from cli.main import app

TINY = ModelSpec("own", ("CAM_A",), BEVGrid(0.0, 8.0, -4.0, 4.0, 0.5), 96, 64)
FIGURES = {"samples": 9, "iou": {"road": 0.5}, "iou_at_threshold": {"road": 0.61, "vehicle": None}}


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["weights", *arguments])


@pytest.fixture
def written(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    path = tmp_path / "w.safetensors"
    card = {
        "training": {"train": {"batch": 4, "seed": 3}},
        "step": 20,
        "validation": {"best_iou": {"road": 0.4}},
        "thresholds": [0.4, 0.3, 0.2],
    }
    texts = {"network": "appocc", **{name: json.dumps(value) for name, value in card.items()}}
    save_weights(path, build("appocc", TINY), texts)
    return path


def test_shipped_weights_have_their_figures(written: Path, tmp_path: Path) -> None:
    (tmp_path / "eval.json").write_text(json.dumps(FIGURES))
    out = tmp_path / "out.safetensors"
    commands = ["--command", "appocc simulate X", "--command", "appocc train Y"]
    result = run("ship", str(written), "--figures", str(tmp_path / "eval.json"), "--out", str(out), *commands)
    assert result.exit_code == 0, result.output
    assert out.stat().st_size < 0.6 * written.stat().st_size
    text = run("show", str(out)).stderr
    for line in (
        "appocc, own degrees, occupancy and appearance; 2.3 million parameters",
        "thresholds: road 0.40, vehicle 0.30, lane 0.20",
        "training: 20 steps of 4 samples, seed 3",
        "validation: IoU road 40.0 percent",
        "unseen places (9 samples): IoU road 61.0, vehicle 0.0 percent",
        "made by: appocc simulate X\nmade by: appocc train Y",
    ):
        assert line in text
    value = json.loads(run("show", str(out), "--json").stdout)
    assert value["figures"] == FIGURES
    assert value["thresholds"] == [0.4, 0.3, 0.2]


def test_weights_without_a_run_can_be_shown(written: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.safetensors"
    save_weights(plain, build("lss", TINY), {"network": "lss"})
    result = run("show", str(plain))
    assert result.exit_code == 0, result.output
    assert "lss, own degrees, occupancy;" in result.stderr
    assert "training" not in result.stderr


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[1]", "expected keys and values, got [1]"),
        ('{"iou": {"road": 0.5}}', "samples: expected a value, got nothing"),
        ('{"samples": 9, "iou": {"road": NaN}}', "iou.road: expected a finite number"),
        (
            '{"samples": 9, "iou": {}, "iou_at_threshold": {"road": 61}}',
            "iou_at_threshold.road: expected 1 or less, got 61",
        ),
    ],
)
def test_figures_must_be_an_evaluation(written: Path, tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "eval.json").write_text(text)
    out = tmp_path / "out.safetensors"
    result = run("ship", str(written), "--figures", str(tmp_path / "eval.json"), "--out", str(out))
    assert isinstance(result.exception, DataError)
    assert "expected the output of 'appocc eval bev --json'" in str(result.exception)
    assert reason in str(result.exception)
    assert not out.exists()


def test_other_suffixes_are_rejected(written: Path, tmp_path: Path) -> None:
    result = run("ship", str(written), "--out", str(tmp_path / "out.onnx"))
    assert isinstance(result.exception, DataError)
    assert "expected a name that ends in .safetensors" in str(result.exception)
    assert not (tmp_path / "out.onnx").exists()


@pytest.mark.parametrize(
    ("entry", "text", "reason"),
    [
        ("training", '{"foo": 1}', "training.train: expected a value, got nothing"),
        ("validation", "3", "validation: expected keys and values, got 3"),
        ("figures", '{"samples": 1, "iou": {"road": "x"}}', "figures.iou.road: expected a number, got 'x'"),
        ("commands", "3", "commands: expected a list, got 3"),
        ("step", "many", "step: expected a whole number, got 'many'"),
        ("figures", "[" * 100_000, "figures: expected keys and values"),
    ],
)
def test_an_invalid_card_is_reported(tmp_path: Path, entry: str, text: str, reason: str) -> None:
    path = tmp_path / "odd.safetensors"
    save_weights(path, build("lss", TINY), {"network": "lss", entry: text})
    result = run("show", str(path))
    assert isinstance(result.exception, DataError)
    assert str(result.exception).startswith(f"{path}: invalid model card (")
    assert reason in str(result.exception)


def test_an_incomplete_card_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "short.safetensors"
    card = {"training": "null", "step": "3", "bytes": "no", "thresholds": '["0.1", 0.2, 0.3]'}
    figures = {"samples": 2, "iou": {"lane": 0.2, "road": 0.5}}
    save_weights(path, build("lss", TINY), {"network": "lss", **card, "figures": json.dumps(figures)})
    result = run("show", str(path))
    assert result.exit_code == 0, result.output
    assert "thresholds: road 0.10, vehicle 0.20, lane 0.30" in result.stderr
    assert "unseen places (2 samples): IoU road 50.0, lane 20.0 percent" in result.stderr
    assert json.loads(run("show", str(path), "--json").stdout)["bytes"] == path.stat().st_size

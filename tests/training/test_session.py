from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from appocc.demo.dataset import DemoSettings, record_demo
from appocc.errors import DataError
from appocc.inference.loading import load_predictor
from appocc.training.config import Config, read_config
from appocc.training.configs import config_names, config_path
from appocc.training.run import TrainingMonitor
from appocc.training.run_folder import RunFolder
from appocc.training.session import run_training
from appocc.training.shipping import describe_weights

pytestmark = pytest.mark.slow
REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three key frames of a simulated drive."""
    folder = tmp_path_factory.mktemp("session") / "drive"
    record_demo(folder, DemoSettings(samples=3), lambda _: None)
    return folder


def config(root: Path, tmp_path: Path, held_out: int, init: Path | None = None) -> Config:
    return Config.model_validate(
        {
            "init": None if init is None else str(init),
            "data": {"train": str(root), "held_out": held_out, "packs": str(tmp_path / "packs")},
            "train": {"steps": 2, "batch": 1, "threads": 1},
            "evaluate": {"norm_batches": 1},
        }
    )


def test_train_on_a_drive_and_validate_on_its_end(root: Path, tmp_path: Path) -> None:
    said: list[str] = []
    folder = RunFolder(tmp_path / "run")
    summary = run_training(
        config(root, tmp_path, 1), folder, resume=False, monitor=TrainingMonitor(on_message=said.append)
    )
    assert summary["steps"] == 2
    assert not any("pixel classes" in line for line in said)  # the simulator's pictures have them
    assert set(summary["best"]["best_iou"]) == {"road", "vehicle", "lane"}
    assert load_predictor(folder.best).weights.thresholds.keys() == {"road", "vehicle", "lane"}
    assert len(list((tmp_path / "packs").iterdir())) == 1
    # With these weights another training begins.
    run_training(
        config(root, tmp_path, 1, folder.best), RunFolder(tmp_path / "more"), resume=False, monitor=TrainingMonitor()
    )


def test_held_out_samples_must_leave_training_samples(root: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="held_out leaves nothing to train on"):
        run_training(config(root, tmp_path, 3), RunFolder(tmp_path / "run"), resume=False, monitor=TrainingMonitor())


@pytest.mark.parametrize("name", config_names())
def test_every_shipped_config_trains(root: Path, tmp_path: Path, name: str) -> None:
    data = [
        f"data.train={root}",
        "data.val=null",
        "data.held_out=1",
        "data.source=exact",
        f"data.packs={tmp_path}/packs",
    ]
    short = [
        "train.minutes=null",
        "train.steps=1",
        "train.batch=2",
        "data.clip=2",
        "train.threads=1",
        "train.precision=fp32",
    ]
    config = read_config(config_path(Path(name)), [*data, *short, "data.workers=1", "evaluate.norm_batches=1"])
    assert run_training(config, RunFolder(tmp_path / "run"), resume=False, monitor=TrainingMonitor())["steps"] == 1


@pytest.mark.long
def test_the_script_makes_weights_from_nothing(tmp_path: Path) -> None:
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "appocc").write_text(f'#!/bin/sh\nPYTHONPATH={REPOSITORY} exec {sys.executable} -m cli.main "$@"\n')
    (programs / "appocc").chmod(0o755)
    short = "train.minutes=null train.steps=1 train.batch=2 data.clip=2 train.threads=1"
    short += " evaluate.norm_batches=1 evaluate.samples=2"
    environment = {"PATH": f"{programs}:{os.environ['PATH']}", "SCENES": "1 1 1 1", "OVERRIDES": short}
    command = [str(REPOSITORY / "configs" / "release.sh"), "small", "made"]
    for _ in range(2):  # the second time, all is there
        done = subprocess.run(
            command, cwd=tmp_path, env=os.environ | environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    card = describe_weights(tmp_path / "made" / "small" / "appocc.safetensors")
    assert card["figures"]["samples"] == 5
    assert "configs/release.sh small" in card["commands"][0]


def test_the_script_asks_for_its_configuration_first(tmp_path: Path) -> None:
    for arguments in ([], ["nope.yaml"]):
        command = ["bash", str(REPOSITORY / "configs" / "release.sh"), *arguments]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stderr.startswith("error: expected CONFIG [FOLDER], got '")
        assert not list(tmp_path.iterdir())

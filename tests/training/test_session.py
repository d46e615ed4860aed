from __future__ import annotations

from pathlib import Path

import pytest

from appocc.demo.dataset import Settings, write_dataset
from appocc.errors import DataError
from appocc.inference.loading import load_predictor
from appocc.training.config import Config
from appocc.training.run import Watcher
from appocc.training.run_folder import RunFolder
from appocc.training.session import run_training

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three key frames of a simulated drive."""
    folder = tmp_path_factory.mktemp("session") / "drive"
    write_dataset(folder, Settings(samples=3), lambda _: None)
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


def test_a_drive_is_packed_trained_on_and_judged_by_its_end(root: Path, tmp_path: Path) -> None:
    said: list[str] = []
    folder = RunFolder(tmp_path / "run")
    summary = run_training(config(root, tmp_path, 1), folder, resume=False, watcher=Watcher(say=said.append))
    assert summary["steps"] == 2
    assert set(summary["best"]["best_iou"]) == {"road", "vehicle", "lane"}
    assert load_predictor(folder.best).weights.thresholds.keys() == {"road", "vehicle", "lane"}
    assert len(list((tmp_path / "packs").iterdir())) == 1
    # With these weights another training begins.
    run_training(
        config(root, tmp_path, 1, folder.best), RunFolder(tmp_path / "more"), resume=False, watcher=Watcher()
    )


def test_something_must_be_left_to_train_on(root: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="held_out leaves nothing to train on"):
        run_training(config(root, tmp_path, 3), RunFolder(tmp_path / "run"), resume=False, watcher=Watcher())

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from made_training import made_config, run

from appocc.errors import DataError
from appocc.training.summary_writer import load_summary_writer


def test_the_metrics_are_shown_in_tensorboard(tmp_path: Path) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    run(tmp_path / "run", made_config(save__tensorboard=True))
    shown = EventAccumulator(str(tmp_path / "run" / "tensorboard")).Reload()
    assert {"train/lr", "train/losses/road", "val/best_iou/vehicle"} <= set(shown.Tags()["scalars"])
    assert [event.step for event in shown.Scalars("val/mean_iou")] == [5, 10, 12]


def test_missing_tensorboard_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    with pytest.raises(DataError, match="pip install '\\.\\[tensorboard\\]'"):
        load_summary_writer()

"""The benchmark of covariances and places: noise as configured is consistent, and a lack of labels is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_kitti import made_kitti
from test_made_boxes import write_scene

from appocc.errors import DataError
from benchmarks.tracking_consistency import main, measure_kitti, measure_made
from tracking.io.kitti import read_sequences


def test_made_detections_are_about_as_noisy_as_the_tracker_thinks(tmp_path: Path) -> None:
    nis = measure_made([write_scene(tmp_path / "scene-0001.npz", 401)])
    assert len(nis) > 100
    assert 0.5 < np.minimum(nis, 9).mean() < 3.5


def test_exact_detections_and_their_tracks_are_near_the_cars(tmp_path: Path) -> None:
    nis, errors = measure_kitti(read_sequences(made_kitti(tmp_path / "kitti", 8)))
    assert np.mean(nis) < 0.5
    assert errors.shape[1] == 2
    assert 0 < len(errors) <= 8
    assert errors.max() < 0.5


def test_a_table_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([str(made_kitti(tmp_path / "kitti", 8, ("0001", "0002")))])
    printed = capsys.readouterr().out
    assert printed.count("KITTI") == 2
    assert "made boxes" not in printed


def test_labels_are_needed(tmp_path: Path) -> None:
    root = made_kitti(tmp_path / "kitti", 3, labels=False)
    with pytest.raises(DataError, match="expected labels"):
        measure_kitti(read_sequences(root))
    with pytest.raises(SystemExit, match="error: sequence 0001"):
        main([str(root)])

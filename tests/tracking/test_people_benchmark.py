"""The benchmark of people in images: SORT as published, and made boxes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.people import FPS, made_rows, main, measure, sort_rows
from tracking.io.mot_challenge import read_mot_detections


def truth_rows(frames: int = 40) -> list[str]:
    """Two people who walk past each other at different distances."""
    rows = []
    for i in range(1, frames + 1):
        rows.append(f"{i},1,{100 + 3 * i},50,60,170,1,-1,-1,-1\n")
        rows.append(f"{i},2,{600 - 3 * i},90,50,140,1,-1,-1,-1\n")
    return rows


def test_sort_writes_from_the_third_match_on_and_in_the_first_frames(tmp_path: Path) -> None:
    late = [f"{i},-1,900,50,60,170,1\n" for i in range(20, 25)]
    (tmp_path / "d").write_text("".join([*truth_rows(), *late]))
    rows = np.array(
        [[float(x) for x in row.split(",")] for row in sort_rows(read_mot_detections(tmp_path / "d", FPS))]
    )
    frames = [rows[rows[:, 1] == number, 0].tolist() for number in (1, 2, 3)]
    assert frames == [[*range(1, 41)], [*range(1, 41)], [23, 24]]
    np.testing.assert_allclose(rows[rows[:, 1] == 1][-1, 2:6], [220, 50, 60, 170], atol=1)


def test_made_boxes_are_mostly_near_people(tmp_path: Path) -> None:
    truth = np.array([[float(x) for x in row.split(",")] for row in truth_rows(400)])
    rows = np.array([[float(x) for x in row.split(",")] for row in made_rows(truth, 0)])
    seen = len(rows) / len(truth)
    assert 0.75 < seen < 0.95
    assert (rows[:, 4:6] > 0).all()
    assert made_rows(truth, 0) != made_rows(truth, 1)


def test_both_trackers_are_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "A"
    folder.mkdir()
    for name in ("gt.txt", "test.txt"):
        (folder / name).write_text("".join(truth_rows()))
    own, sort = measure(folder / "gt.txt", folder / "test.txt", tmp_path)
    assert own.MOTA > 0.95
    assert sort.MOTA > 0.95
    main([str(tmp_path)])
    assert "SORT" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="expected recordings"):
        main([str(folder)])

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import track

from appocc.errors import DataError
from tracking.io.nuscenes_tracks import read_key_frame
from tracking.io.writers import write_nuscenes


def written(folder: Path, **changes: Any) -> Path:
    """A file of results with one track, some of whose values were changed."""
    path = folder / "tracking.json"
    write_nuscenes(path, ["one", "two"], [(track(3),), ()], ("camera",))
    content = json.loads(path.read_text())
    content["results"]["one"][0].update(changes)
    path.write_text(json.dumps(content))
    return path


def test_what_was_written_is_read(tmp_path: Path) -> None:
    unsure = {"heading_known": False, "velocity_known": False, "seen": False}
    one, other = track(3), track(4, rgb=np.full(3, np.nan), height_m=2.5, kind="bus", **unsure)
    path = tmp_path / "tracking.json"
    write_nuscenes(path, ["first", "last"], [(one, other), ()], ("camera",))
    read = read_key_frame(path, "first")
    assert read_key_frame(path, "last") == ()
    for before, after in zip((one, other), read, strict=True):
        assert (after.id, after.seen, after.heading_known) == (before.id, before.seen, before.heading_known)
        assert after.velocity_known == before.velocity_known
        np.testing.assert_allclose(after.position_world_m, before.position_world_m, atol=1e-3)
        np.testing.assert_allclose(after.velocity_world_mps, before.velocity_world_mps, atol=1e-3)
        np.testing.assert_allclose(after.rgb, before.rgb, atol=0.1)
        assert after.yaw_world_rad == pytest.approx(before.yaw_world_rad, abs=1e-5)
        assert (after.length_m, after.width_m) == (before.length_m, before.width_m)
    assert (read[1].height_m, read[1].kind) == (2.5, "bus")
    assert [each.moving for each in read] == [True, False]  # its velocity is not known


def test_results_of_others_have_fewer_keys(tmp_path: Path) -> None:
    path = written(tmp_path, tracking_id="a7")
    content = json.loads(path.read_text())
    for name in ("rgb", "seen", "heading_known", "velocity_known", "tracking_score"):
        del content["results"]["one"][0][name]
    path.write_text(json.dumps(content))
    (read,) = read_key_frame(path, "one")
    assert (read.id, read.seen, read.heading_known, read.velocity_known, read.score) == (1, True, True, True, 1.0)
    assert np.isnan(read.rgb).all()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"translation": [1.0, 2.0]}, "results.one.0.translation"),
        ({"velocity": None}, "velocity"),
        ({"size": [0.0, 4.0, 1.5]}, "expected a positive size"),
        ({"rotation": [0.0, 0.0, 0.0, 0.0]}, "expected a length of 1"),
    ],
)
def test_damaged_results(tmp_path: Path, changes: dict[str, Any], reason: str) -> None:
    path = written(tmp_path, **changes)
    with pytest.raises(DataError, match=reason) as failed:
        read_key_frame(path, "one")
    assert str(path) in str(failed.value)


def test_a_key_frame_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="expected tracks of key frame three"):
        read_key_frame(written(tmp_path), "three")

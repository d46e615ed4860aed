from __future__ import annotations

import numpy as np
import pytest

from appocc.colours import lab_from_rgb
from appocc.errors import DataError, ShapeError
from tracking import Detections, Tracker


def test_lists_are_taken_as_arrays() -> None:
    found = Detections.from_boxes([[10, 0], [20, 0]], [0, 0], [[1.8, 4.5, 1.5]] * 2, [3, 3], "car")
    assert found.ground_m.tolist() == [[10, 0, 0], [20, 0, 0]]
    assert found.kind == ("car", "car")
    assert np.isnan(found.rgb).all()
    assert len(Detections.from_boxes([], [], [], [], ())) == 0
    with pytest.raises(ShapeError, match="detections yaw_rad: expected an array of numbers"):
        Detections.from_boxes([[10, 0]], ["north"], [[1.8, 4.5, 1.5]], [3], "car")


def test_colours_and_velocities_of_a_detector() -> None:
    rgb = np.array([[200.0, 10.0, 10.0]])
    found = Detections.from_boxes([[10, 0]], [0], [[1.8, 4.5, 1.5]], [3], "car", rgb=rgb, velocity_mps=[[5, 1]])
    np.testing.assert_allclose(found.lab, lab_from_rgb(rgb))
    rgb[:] = 0  # the caller's array is his own
    assert found.rgb[0, 0] == 200
    (track,) = Tracker().update(found, 0, np.eye(4))
    assert track.velocity_world_mps.tolist() == [5, 1]


def test_seconds_are_refused() -> None:
    nothing = Detections.from_boxes([], [], [], [], ())
    with pytest.raises(DataError, match=r"expected an integer time in microseconds, got 0\.5"):
        Tracker().update(nothing, 0.5, np.eye(4))  # type: ignore[arg-type]

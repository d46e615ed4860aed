from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appocc.colours import lab_from_rgb
from appocc.errors import DataError, ShapeError
from tracking import Detections, Tracker
from tracking.detections import MAX_LOG_ODDS, log_odds_from_probability


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


def test_a_pose_is_taken_as_lists() -> None:
    found = Detections.from_boxes([[10, 0]], [0], [[1.8, 4.5, 1.5]], [3], "car")
    (track,) = Tracker().update(found, 0, np.eye(4).tolist())
    assert track.position_world_m.tolist() == [10, 0, 0]
    with pytest.raises(ShapeError, match="world_from_ego: expected an array of numbers"):
        Tracker().update(found, 1, "here")


def box(**changes: Any) -> Detections:
    values: dict[str, Any] = {"ground_m": [[10, 0]], "yaw_rad": [0], "size_m": [[1.8, 4.5, 1.5]], "log_odds": [3]}
    return Detections.from_boxes(**(values | {"kind": "car"} | changes))


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"view": 50.0}, r"detections view: expected a view such as CircularView\(50.0\), got 50.0"),
        ({"view": 0.0}, "detections view: expected a view"),
        ({"kind": None}, "detections kind: expected names of classes, got None"),
        ({"kind": [7]}, "detections kind: expected names of classes, got 7"),
        ({"kind": [""]}, "detections kind: expected names of classes, got ''"),
        ({"kind": ["car", "car"]}, "detections kind: expected 1 names, got 2"),
        ({"rgb": [[0.2, 0.5, 1]]}, r"detections rgb: expected sRGB 0..255, got 0..1"),
        ({"rgb": [[0, 300, 1]]}, r"detections rgb: expected sRGB 0..255, got 300"),
        ({"rgb": [[0, 20, -1]]}, r"detections rgb: expected sRGB 0..255, got -1"),
    ],
)
def test_values_of_a_wrong_type_or_unit(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ShapeError, match=complaint):
        box(**changes)


def test_black_is_a_colour() -> None:
    assert box(rgb=[[0, 0, 0]]).rgb.tolist() == [[0, 0, 0]]
    assert box(rgb=[[0, 1, 0]]).rgb.tolist() == [[0, 1, 0]]


@pytest.mark.parametrize("wrong", [1.5, -0.2, 90, np.nan])
def test_probabilities_are_0_to_1(wrong: float) -> None:
    assert log_odds_from_probability([0.5, 1]).tolist() == pytest.approx([0, MAX_LOG_ODDS])
    with pytest.raises(ShapeError, match=f"probability: expected numbers in 0..1, got {wrong:g}"):
        log_odds_from_probability([0.5, wrong])


def test_detections_and_configurations_of_other_types() -> None:
    with pytest.raises(ShapeError, match="tracker: expected Detections, got None"):
        Tracker().update(None, 0, np.eye(4))  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match=r"tracker: expected a TrackerConfig, got \{\}"):
        Tracker({})  # type: ignore[arg-type]


def test_seconds_are_refused() -> None:
    nothing = Detections.from_boxes([], [], [], [], ())
    with pytest.raises(DataError, match=r"expected an integer time in microseconds, got 0\.5"):
        Tracker().update(nothing, 0.5, np.eye(4))  # type: ignore[arg-type]

"""A frame checks that its pictures fit its rig."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appocc.camera import Camera, CameraRig
from appocc.errors import ShapeError
from appocc.frame import Frame


def frame(**changes: Any) -> Frame:
    camera = Camera("CAM_FRONT", 4, 3, np.eye(3), np.eye(4))
    fields: dict[str, Any] = {
        "token": "t",
        "timestamp_us": 5,
        "world_from_ego": np.eye(4),
        "rig": CameraRig((camera,)),
        "images": {"CAM_FRONT": np.zeros((3, 4, 3), np.uint8)},
    }
    return Frame(**{**fields, **changes})


def test_a_frame_without_boxes_and_with_a_dead_camera() -> None:
    assert frame().boxes_ego is None
    assert frame(images={}).images == {}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"world_from_ego": np.zeros((4, 4))}, "world_from_ego: expected a rotation"),
        ({"images": {"CAM_BACK": np.zeros((3, 4, 3), np.uint8)}}, "expected channels of the rig, got 'CAM_BACK'"),
        ({"images": {"CAM_FRONT": np.zeros((4, 3, 3), np.uint8)}}, r"expected shape \(3, 4, 3\), got \(4, 3, 3\)"),
        ({"images": {"CAM_FRONT": np.zeros((3, 4, 3))}}, "image CAM_FRONT: expected uint8, got float64"),
    ],
)
def test_what_is_no_frame(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        frame(**changes)


def test_the_pose_is_frozen() -> None:
    with pytest.raises(ValueError, match="read-only"):
        frame().world_from_ego[0, 3] = 1

"""Values that hold arrays: they can be compared and hashed, and neither share nor freeze the caller's arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, freeze_arrays
from appocc.colours import Exposure
from appocc.ego_vehicle import EgoVehicle
from appocc.frame import Frame
from appocc.grid import BEVGrid

GRID = BEVGrid(0, 2, -1, 1, 0.5)
BOX_ARRAYS = {
    "centre_m": np.ones((1, 3)),
    "size_wlh_m": np.ones((1, 3)),
    "rotation": np.eye(3)[None],
    "velocity_mps": np.zeros((1, 2)),
    "lidar_points": np.zeros(1, np.int64),
}
MAP_ARRAYS = {
    "occupancy": np.zeros((3, *GRID.shape), np.float32),
    "occupancy_valid": np.ones((3, *GRID.shape), np.bool_),
    "appearance": np.zeros((3, *GRID.shape), np.uint8),
    "appearance_valid": np.ones(GRID.shape, np.bool_),
}


def boxes(**arrays: Any) -> Boxes:
    return Boxes(category=("vehicle.car",), instance=("i",), token=("t",), **arrays)


def camera(**arrays: Any) -> Camera:
    return Camera("CAM_FRONT", 4, 3, **arrays)


def frame(world_from_ego: Any) -> Frame:
    return Frame("t", 0, world_from_ego, CameraRig(()), {})


VALUES: list[tuple[Callable[..., object], Mapping[str, Any]]] = [
    (boxes, BOX_ARRAYS),
    (camera, {"intrinsic": np.eye(3), "ego_from_cam": np.eye(4)}),
    (frame, {"world_from_ego": np.eye(4)}),
    (lambda **arrays: BEVMap(GRID, **arrays), MAP_ARRAYS),
    (Exposure, {"gain": np.ones(3)}),
]


@pytest.mark.parametrize(("make", "arrays"), VALUES)
def test_values_can_be_compared_and_hashed(make: Callable[..., object], arrays: Mapping[str, Any]) -> None:
    value, other = make(**arrays), make(**arrays)
    assert value == value
    assert value != 1
    assert (value == other) is isinstance(value, Camera)
    assert len({value, value}) == 1


@pytest.mark.parametrize(("make", "arrays"), VALUES)
def test_values_copy_the_arrays_of_the_caller(make: Callable[..., object], arrays: Mapping[str, Any]) -> None:
    own = {name: np.stack([array, array]) for name, array in arrays.items()}
    value = make(**{name: array[0] for name, array in own.items()})
    for name, array in own.items():
        array[:] = array == 0
        np.testing.assert_array_equal(getattr(value, name), arrays[name])
        with pytest.raises(ValueError, match="read-only"):
            getattr(value, name)[:] = 0


def test_a_read_only_view_of_writeable_memory_is_copied() -> None:
    memory = np.eye(4)
    view = memory.view()
    view.flags.writeable = False
    value = frame(view)
    memory[0, 3] = 1
    assert value.world_from_ego[0, 3] == 0


def test_arrays_that_nobody_can_write_are_shared() -> None:
    value = frame(np.eye(4))
    assert frame(value.world_from_ego).world_from_ego is value.world_from_ego
    stored = np.frombuffer(np.eye(4).tobytes()).reshape(4, 4)
    assert frame(stored).world_from_ego is stored
    freeze_arrays(value, "world_from_ego")


def test_cameras_with_the_same_numbers_are_equal() -> None:
    one = camera(intrinsic=np.eye(3), ego_from_cam=np.eye(4))
    negative_zero = camera(intrinsic=np.eye(3), ego_from_cam=np.where(np.eye(4) == 0, -0.0, 1.0))
    assert (one, hash(one)) == (negative_zero, hash(negative_zero))
    moved = np.eye(4)
    moved[0, 3] = 1
    assert one != camera(intrinsic=np.eye(3), ego_from_cam=moved)
    assert one != one.resized(8, 6)


def test_rigs_are_equal_if_their_cameras_and_vehicles_are() -> None:
    one, other = (camera(intrinsic=np.eye(3), ego_from_cam=np.eye(4)) for _ in range(2))
    assert CameraRig((one,)) == CameraRig((other,))
    assert len({CameraRig((one,)), CameraRig((other,))}) == 1
    assert CameraRig((one,)) != CameraRig((one,), EgoVehicle(length_m=5.0))


def test_the_images_of_a_frame_are_a_mapping_of_its_own() -> None:
    rig, images = CameraRig((camera(intrinsic=np.eye(3), ego_from_cam=np.eye(4)),)), dict[str, ByteArray]()
    made = Frame("t", 0, np.eye(4), rig, images)
    images["CAM_FRONT"] = np.zeros((3, 4, 3), np.uint8)
    assert made.images == {}

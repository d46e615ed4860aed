"""Packed objects: the nearest first, with the paint of their cells; rows move as the boxes themselves do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from made_map import pose
from made_rows import SIZE_WLH_M, boxes_of
from tolerances import assert_rounded

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import Float32Array
from appocc.geometry import inverse
from appocc.grid import BEVGrid
from appocc.objects import KINDS
from appocc.training.batches.packed_objects import (
    COLUMNS,
    KIND,
    MAX_OBJECTS,
    RGB,
    VELOCITY,
    WLH,
    XY,
    YAW,
    Z,
    mirror_objects,
    move_objects,
    pack_objects,
)

GRID = BEVGrid(-16, 16, -16, 16, 0.4)
GREY = (90, 91, 92)


def map_with(**changes: Any) -> BEVMap:
    """A map with a vehicle in every cell, all grey."""
    x, y = GRID.shape
    values = {
        "occupancy": np.ones((3, x, y), np.float32),
        "occupancy_valid": np.ones((3, x, y), np.bool_),
        "appearance": np.broadcast_to(np.array(GREY, np.uint8)[:, None, None], (3, x, y)).copy(),
        "appearance_valid": np.ones((x, y), np.bool_),
    }
    return BEVMap(GRID, **(values | changes))


def kinds_of(rows: Float32Array) -> list[str]:
    return [KINDS[int(number)] for number in rows[:, KIND]]


def test_known_kinds_inside_of_the_map_are_kept_the_nearest_first() -> None:
    boxes = boxes_of(
        ("human.pedestrian.adult", 0, 5),
        ("vehicle.bus.rigid", 20, 0),
        ("vehicle.car", -3, 0),
        ("movable_object.barrier", 1, 0),
        ("vehicle.bicycle", 0, -7),
        ("vehicle.trailer", 2, 0),
        ("vehicle.motorcycle", 6, 0),
    )
    rows, _ = pack_objects(boxes, map_with())
    assert rows.dtype == np.float32
    assert kinds_of(rows) == ["truck", "car", "pedestrian", "motorcycle", "bicycle"]
    assert rows[:, XY].tolist() == [[2, 0], [-3, 0], [0, 5], [6, 0], [0, -7]]


def test_a_row_has_the_numbers_of_its_box() -> None:
    boxes = boxes_of(
        ("vehicle.car", 4, -2),
        ("vehicle.truck", 9, 3),
        yaw_rad=[0.5, -2.5],
        size_wlh_m=np.array([[1.9, 4.5, 1.5], [2.5, 8.0, 3.1]]),
        velocity_mps=np.array([[3.0, -1.0], [np.nan, np.nan]]),
    )
    rows, _ = pack_objects(boxes, map_with())
    assert rows.shape == (2, COLUMNS)
    assert_rounded(rows[:, Z], boxes.centre_m[:, 2])
    assert_rounded(rows[:, WLH], boxes.size_wlh_m)
    assert_rounded(rows[:, YAW], [0.5, -2.5], 4)
    np.testing.assert_array_equal(rows[:, VELOCITY], boxes.velocity_mps)


def test_only_the_nearest_objects_of_a_crowd_are_kept() -> None:
    random = np.random.default_rng(0)
    places = random.uniform(-15, 15, (MAX_OBJECTS + 30, 2))
    rows, _ = pack_objects(boxes_of(*(("human.pedestrian.adult", x, y) for x, y in places)), map_with())
    distance = np.sort(np.hypot(*places.T))
    assert_rounded(np.hypot(*rows[:, XY].T), distance[:MAX_OBJECTS], 4, dtype=None)


def test_cells_name_their_vehicle_by_its_row() -> None:
    boxes = boxes_of(("vehicle.car", 10.2, 0.2), ("human.pedestrian.adult", 1, 6), ("vehicle.car", -4.2, 0.2))
    rows, owner = pack_objects(boxes, map_with())
    assert kinds_of(rows) == ["car", "pedestrian", "car"]
    assert owner.dtype == np.uint8
    assert set(np.unique(owner)) == {0, 1, 3}  # the pedestrian has no cells
    for number in (1, 3):
        cells = np.argwhere(owner == number)
        assert len(cells) == 5 * 11  # 2.0 m x 4.4 m
        np.testing.assert_allclose(GRID.centre_of(cells).mean(axis=0), rows[number - 1, XY], atol=1e-5)


def test_cells_where_the_map_has_no_vehicle_or_does_not_know_have_none() -> None:
    occupancy, known = np.ones((3, *GRID.shape), np.float32), np.ones((3, *GRID.shape), np.bool_)
    occupancy[VEHICLE, 50:], known[VEHICLE, :, :40] = 0, False
    boxes = boxes_of(("vehicle.car", 4.2, 0.2))
    _, owner = pack_objects(boxes, map_with(occupancy=occupancy, occupancy_valid=known))
    i, j = np.nonzero(owner)
    assert (i.max(), j.min()) == (49, 40)
    assert len(i) == 5 * 3  # of 11 x 5 cells


def test_paint_is_the_median_of_the_known_colours_of_a_vehicle() -> None:
    boxes = boxes_of(("vehicle.car", 4, 0), ("vehicle.car", 9, 0), ("human.pedestrian.adult", 4, 0))
    appearance, known = map_with().appearance.copy(), np.ones(GRID.shape, np.bool_)
    _, owner = pack_objects(boxes, map_with())
    i, j = np.nonzero(owner == 1)
    appearance[:, i[:20], j[:20]] = 255  # windows: fewer than half
    appearance[:, i[-8:], j[-8:]], known[i[-8:], j[-8:]] = 0, False
    known[owner == 3] = False
    rows, _ = pack_objects(boxes, map_with(appearance=appearance, appearance_valid=known))
    assert kinds_of(rows) == ["car", "pedestrian", "car"]
    assert rows[0, RGB].tolist() == list(GREY)
    assert np.isnan(rows[1:, RGB]).all()


def test_an_empty_street() -> None:
    for boxes in (Boxes.empty(), boxes_of(("movable_object.barrier", 1, 0)), boxes_of(("vehicle.car", 99, 0))):
        rows, owner = pack_objects(boxes, map_with())
        assert rows.shape == (0, COLUMNS)
        assert not owner.any()


# Motion -----------------------------------------------------------------------------------------------------------


def street() -> Boxes:
    return boxes_of(
        ("vehicle.car", 4, -2),
        ("vehicle.truck", -7, 3),
        ("human.pedestrian.adult", 1, 5),
        yaw_rad=[0.5, -3.0, 1.0],
        velocity_mps=np.array([[3.0, -1.0], [np.nan, np.nan], [0.0, 1.2]]),
    )


def rows_of(boxes: Boxes) -> Float32Array:
    """The rows of boxes in their own order."""
    return np.concatenate([pack_objects(boxes.select(np.array([i])), map_with())[0] for i in range(len(boxes))])


def assert_same_rows(found: Float32Array, expected: Float32Array) -> None:
    """Rows agree but for rounding and whole turns."""
    turned = np.round((found[:, YAW] - expected[:, YAW]) / (2 * np.pi)) * 2 * np.pi
    found = found.copy()
    found[:, YAW] -= turned
    # Places of some 20 m and turns, rotated: products of float32.
    assert_rounded(found, expected, 16, 255.0)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.9, -2.7])
def test_rows_move_as_their_boxes(yaw_rad: float) -> None:
    new_from_ego = pose(2.0, -3.0, yaw_rad)
    moved = move_objects(rows_of(street()), new_from_ego)
    assert_same_rows(moved, rows_of(street().transformed(new_from_ego)))
    assert_same_rows(move_objects(moved, inverse(new_from_ego)), rows_of(street()))


def test_rows_are_mirrored_as_their_boxes() -> None:
    boxes, signs = street(), np.array([1.0, -1.0])
    mirrored = boxes_of(
        *((name, x, -y) for name, (x, y, _) in zip(boxes.category, boxes.centre_m, strict=True)),
        yaw_rad=-boxes.yaw_rad,
        velocity_mps=boxes.velocity_mps * signs,
    )
    rows = rows_of(boxes)
    assert_same_rows(mirror_objects(rows), rows_of(mirrored))
    np.testing.assert_array_equal(mirror_objects(mirror_objects(rows)), rows)


def test_a_size_is_kept_by_every_motion() -> None:
    rows = rows_of(street())
    for moved in (mirror_objects(rows), move_objects(rows, pose(1, 2, 3))):
        np.testing.assert_array_equal(moved[:, WLH], np.tile(np.array(SIZE_WLH_M, np.float32), (3, 1)))
        np.testing.assert_array_equal(moved[:, [KIND, Z]], rows[:, [KIND, Z]])

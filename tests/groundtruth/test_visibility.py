from __future__ import annotations

import numpy as np
import pytest
import torch
from made_street import Solid, beams, scan
from tolerances import assert_rounded

from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import BoolArray, FloatArray
from appocc.geometry import apply, inverse, quaternion_from_rotation, quaternion_from_yaw, transform
from appocc.groundtruth.visibility import DepthImage, image_rectangles, occluded_by_boxes, ray_box_entry

LIDAR = np.array([0.9, 0.0, 1.84])
# Elevations of nuScenes' 32 beams, and of 64 beams as PandaSet's: dense about the horizon, sparse below.
BEAMS_32 = np.linspace(-30.67, 10.67, 32)
BEAMS_64 = np.concatenate([np.linspace(-25, -6, 18, endpoint=False), np.linspace(-6, 2, 40), np.linspace(3, 15, 6)])
BEAMS = pytest.mark.parametrize("elevations", [BEAMS_32, BEAMS_64], ids=["32 beams", "64 beams"])


def camera(pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Camera:
    """The front camera of nuScenes: 65 degrees, 1.5 m above the road, tilted as asked."""
    intrinsic = np.array([[1266.0, 0, 800], [0, 1266, 450], [0, 0, 1]])
    axes = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    pitch, roll = np.deg2rad([pitch_deg, roll_deg])
    nod = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    tilt = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    return Camera("CAM_FRONT", 1600, 900, intrinsic, transform(axes @ nod @ tilt, [1.7, 0.0, 1.5]))


def hidden(view: Camera, sweep: FloatArray, points: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Which points (ego frame) a depth picture of a sweep calls hidden, and which lie in the image at all."""
    cam_from_ego = inverse(view.ego_from_cam)
    uv, depth = view.project(apply(cam_from_ego, points))
    seen = view.sees(uv, depth)
    result = np.zeros(len(points), dtype=np.bool_)
    result[seen] = DepthImage(apply(cam_from_ego, sweep), view).occludes(uv[seen], depth[seen])
    return result, seen


def test_a_depth_image_has_the_depth_of_the_sweep() -> None:
    view = camera()
    picture = DepthImage(np.array([[0.0, 0.0, 8.0], [0.0, 0.0, 20.0]]), view)
    assert_rounded(picture.depth_m(np.array([[800.0, 450.0]])), [8.0], 3, dtype=torch.float32)
    assert picture.depth_m(np.array([[100.0, 450.0], [800.0, 100.0]])).tolist() == [np.inf, np.inf]


def boxes(*rows: tuple[float, float, float, float, float, float, float]) -> Boxes:
    """Boxes of (x, y, z, length, width, height, yaw)."""
    n, table = len(rows), np.array(rows, dtype=np.float64).reshape(-1, 7)
    poses = [transform(quaternion_from_yaw(float(row[6])), row[:3]) for row in table]
    return Boxes(
        centre_m=table[:, :3].copy(),
        size_wlh_m=table[:, [4, 3, 5]].copy(),
        rotation=np.array([pose[:3, :3] for pose in poses]).reshape(-1, 3, 3),
        category=("vehicle.car",) * n,
        instance=tuple(map(str, range(n))),
        token=tuple(map(str, range(n))),
        velocity_mps=np.full((n, 2), np.nan),
        lidar_points=np.full(n, -1),
    )


@BEAMS
@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(0, 0), (2, 1), (-2, -1)])
def test_the_ground_hides_none_of_itself(elevations: FloatArray, pitch_deg: float, roll_deg: float) -> None:
    sweep, _ = scan(LIDAR, [], beams(elevations, 1080))
    own = sweep[(sweep[:, 0] > 5) & (sweep[:, 0] < 50)]
    between = np.random.default_rng(1).uniform([5, -30, 0], [50, 30, 0], (20_000, 3))
    for points in (own, between):
        is_hidden, seen = hidden(camera(pitch_deg, roll_deg), sweep, points)
        assert seen.sum() > 1000
        assert not is_hidden.any()


@BEAMS
def test_a_wall_occludes_points_behind_it_only(elevations: FloatArray) -> None:
    wall = Solid((12.0, -4.0, 0.0), (12.3, 4.0, 3.0), (0, 0, 0))
    sweep, which = scan(LIDAR, [wall], beams(elevations, 1080))
    assert (which == 0).sum() > 300
    rng = np.random.default_rng(2)
    # Their rays pass through the wall well inside its edges: heights up to 2.4 m at 12 m distance.
    behind = rng.uniform([14.0, -3.3, 0.0], [40.0, 3.3, 2.4], (5000, 3))
    behind[:, 1] *= (behind[:, 0] - 1.7) / (12.0 - 1.7)
    behind[:, 2] = 1.5 + (behind[:, 2] - 1.5) * (behind[:, 0] - 1.7) / (12.0 - 1.7)
    is_hidden, seen = hidden(camera(), sweep, behind)
    assert seen.sum() > 3000
    assert is_hidden[seen].mean() > 0.99
    before = rng.uniform([5.0, -3.0, 0.0], [11.5, 3.0, 1.0], (5000, 3))
    on_it = np.column_stack([np.full(500, 12.0), rng.uniform(-3.8, 3.8, 500), rng.uniform(0.1, 2.8, 500)])
    aside = rng.uniform([14.0, 0.45, 0.0], [40.0, 0.6, 0.0], (5000, 3))
    aside[:, 1] *= aside[:, 0] - 1.7
    for points in (before, on_it, aside, sweep[which == 0]):
        is_hidden, seen = hidden(camera(), sweep, points)
        assert seen.any()
        assert not is_hidden.any()


@BEAMS
def test_ground_between_two_rings_occludes_points_below_it(elevations: FloatArray) -> None:
    sweep, _ = scan(LIDAR, [], beams(elevations, 1080))
    below = np.random.default_rng(4).uniform([10, -4, -0.3], [25, 4, -0.3], (20_000, 3))
    is_hidden, seen = hidden(camera(), sweep, below)
    assert is_hidden[seen].mean() > 0.99


def ahead(distance: float, elevation_deg: float, lateral: float = 0.0) -> list[float]:
    """A point before the camera, at an elevation as it sees it."""
    return [1.7 + distance, lateral, 1.5 + distance * np.tan(np.deg2rad(elevation_deg))]


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_points_in_one_direction_the_nearer_hides(order: int) -> None:
    sweep = np.array([ahead(10, -3), ahead(30, -3)][::order])
    probe = np.array([ahead(9, -3), ahead(10.3, -3), ahead(15, -3), ahead(30, -3)])
    assert hidden(camera(), sweep, probe)[0].tolist() == [False, False, True, True]


def test_points_farther_apart_than_two_rings_are_not_joined() -> None:
    for gap_deg, joined in ((1.5, True), (2.5, False)):
        sweep = np.array([ahead(10, -3), ahead(10, -3 - gap_deg)])
        assert hidden(camera(), sweep, np.array([ahead(20, -3 - gap_deg / 2)]))[0].tolist() == [joined]
    # Beside them nothing is known either, but for the next column.
    beside = np.array([ahead(20, -3, 0.1), ahead(20, -3, 0.6)])
    assert hidden(camera(), np.array([ahead(10, -3)]), beside)[0].tolist() == [True, False]


def test_without_points_nothing_is_hidden() -> None:
    is_hidden, seen = hidden(camera(), np.zeros((0, 3)), np.array([[20.0, 0, 1.0]]))
    assert seen.all()
    assert not is_hidden.any()


def test_box_entry_is_that_of_small_steps() -> None:
    rng = np.random.default_rng(3)
    half = np.array([2.0, 0.9, 0.7])
    turn = quaternion_from_rotation(np.linalg.qr(rng.normal(size=(3, 3)))[0])
    pose = transform(turn, [1.0, 2.0, 0.5])
    steps = np.linspace(0, 20, 8001)
    hits = missed = 0
    for origin in rng.uniform(-6, 6, (40, 3)):
        rays = pose[:3, 3] + rng.normal(size=(20, 3)) * 1.5 - origin
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        entry = ray_box_entry(origin, rays, pose, half)
        places = apply(inverse(pose), origin + rays[:, None] * steps[None, :, None])
        inside = np.asarray((np.abs(places) <= half).all(axis=2))
        for one, row in zip(entry, inside, strict=True):
            if row.any():
                hits += 1
                assert one == pytest.approx(steps[row.argmax()], abs=0.003)
            else:  # a corner may lie between two steps
                missed += np.isfinite(one)
    assert hits > 300
    assert missed <= 3


def test_box_entry_at_the_edges_of_the_method() -> None:
    half, here = np.array([1.0, 1.0, 1.0]), np.eye(4)
    ahead, back = np.array([[1.0, 0, 0]]), np.array([[-1.0, 0, 0]])
    assert ray_box_entry(np.array([-5.0, 0, 0]), ahead, here, half)[0] == 4
    assert ray_box_entry(np.array([-5.0, 0, 0]), back, here, half)[0] == np.inf  # behind
    assert ray_box_entry(np.array([0.5, 0, 0]), ahead, here, half)[0] == 0  # begins inside
    assert ray_box_entry(np.array([-5.0, 1.5, 0]), ahead, here, half)[0] == np.inf  # runs beside it
    assert ray_box_entry(np.array([-5.0, 1.0, 0]), ahead, here, half)[0] == 4  # runs along its side
    assert ray_box_entry(np.array([-5.0, 0, 0]), 2 * ahead, here, half)[0] == 2  # in units of the ray


def hidden_behind(
    points: list[list[float]], *rows: tuple[float, float, float, float, float, float, float]
) -> list[bool]:
    view = camera()
    places = np.array(points)
    uv, _ = view.project_ego(places)
    return [bool(one) for one in occluded_by_boxes(places, uv, view, view.ego_from_cam, boxes(*rows))]


def test_hidden_by_boxes() -> None:
    car = (15.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.3)
    points = [[25.0, 0.0, 0.5], [10.0, 0.0, 0.0], [25.0, 6.0, 0.5], [40.0, 0.0, 3.0]]
    assert hidden_behind(points, car) == [True, False, False, False]
    assert hidden_behind(points) == [False] * 4
    other_side = (-15.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0)
    assert hidden_behind(points, other_side) == [False] * 4


def test_the_margin_of_a_box_counts_in_metres_however_near_it_is() -> None:
    # The side of the box is at y = 1, 3.3 m ahead of the camera; rays pass it at 0.1 m and at 0.3 m distance.
    near_car = (7.0, 0.0, 0.75, 4.0, 2.0, 3.0, 0.0)
    points = [[1.7 + 3.3 * 3, 1.1 * 3, 1.5], [1.7 + 3.3 * 3, 1.3 * 3, 1.5]]
    assert hidden_behind(points, near_car) == [True, False]


def test_a_box_around_the_camera_hides_everything() -> None:
    assert hidden_behind([[20.0, 0, 1], [20.0, 5, 1]], (1.7, 0.0, 1.5, 2.0, 2.0, 2.0, 0.0)) == [True, True]


def corners_of(*row: float) -> FloatArray:
    x, y, z, length, width, height, yaw = row
    corners = boxes((x, y, z, length, width, height, yaw)).corners()[0]
    return apply(inverse(camera().ego_from_cam), corners)


def image_rectangle(corners: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    low, high, shown = image_rectangles(camera(), corners[None])
    return (low[0], high[0]) if shown[0] else None


def test_image_rectangle_holds_all_corners() -> None:
    corners = corners_of(15, 1, 0.75, 4, 2, 1.5, 0.3)
    rectangle = image_rectangle(corners)
    assert rectangle is not None
    uv, _ = camera().project(corners)
    assert (uv >= rectangle[0]).all()
    assert (uv <= rectangle[1]).all()
    assert (rectangle[1] - rectangle[0] < np.ptp(uv, axis=0) + 2).all()


def test_image_rectangle_of_boxes_out_of_sight_or_beside_the_camera() -> None:
    assert image_rectangle(corners_of(-15, 0, 0.75, 4, 2, 1.5, 0)) is None
    assert image_rectangle(corners_of(15, 40, 0.75, 4, 2, 1.5, 0)) is None
    whole = image_rectangle(corners_of(2, 2, 0.75, 4, 2, 1.5, 0))
    assert whole is not None
    assert np.array(whole).tolist() == [[0, 0], [1600, 900]]

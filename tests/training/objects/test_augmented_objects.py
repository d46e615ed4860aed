"""Changed samples keep their objects where they are in the world, and frames changed alike still fit together."""

from __future__ import annotations

import numpy as np
import pytest
from made_map import BLUE, RED, WHITE, Car, boxes_of, map_of, pose

from appocc.bevmap import VEHICLE
from appocc.checks import FloatArray
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.models.memory import ground_motion
from appocc.training.batches.augment import Augmentation, augment, jitter_colours, mirror_sample, reframe
from appocc.training.batches.packed_objects import COLUMNS, MAX_OBJECTS, RGB, VELOCITY, XY, YAW, pack_objects
from appocc.training.batches.reading import PackedSample, crop

GRID, INNER = BEVGrid(-24, 24, -24, 24, 0.4), BEVGrid(-16, 16, -16, 16, 0.4)
# World: two parked cars and a van, seen from two poses of the ego.
CARS = (Car(108, 52, 0.4, RED), Car(96, 55, -1.2, BLUE), Car(103, 45, 2.9, WHITE, 6.0, 2.2))
BEFORE, NOW = pose(100, 50, 0.7), pose(101.5, 51.2, 0.8)


def sample_at(world_from_ego: FloatArray) -> PackedSample:
    """The cars as they are packed at a pose of the ego, with two pictures of noise."""
    ego_from_world = inverse(world_from_ego)
    cars = []
    for car in CARS:
        x, y, _ = apply(ego_from_world, np.array([[car.x_m, car.y_m, 0.0]]))[0]
        yaw = car.yaw_rad - np.arctan2(world_from_ego[1, 0], world_from_ego[0, 0])
        cars.append(car._replace(x_m=float(x), y_m=float(y), yaw_rad=float(yaw)))
    bev = map_of(cars, grid=GRID)
    rows, owner = pack_objects(boxes_of(cars), bev)
    objects = np.full((MAX_OBJECTS, COLUMNS), np.nan, np.float32)
    objects[: len(rows)] = rows
    objects[: len(rows), VELOCITY] = [[2.0, 1.0], [0.0, -1.0], [np.nan, np.nan]]
    return PackedSample(
        images=np.random.default_rng(0).integers(0, 256, (2, 16, 32, 3)).astype(np.uint8),
        intrinsic=np.tile(np.array([[20.0, 0, 15.5], [0, 20.0, 7.5], [0, 0, 1]]), (2, 1, 1)),
        ego_from_cam=np.tile(np.eye(4), (2, 1, 1)),
        alive=np.ones(2, np.bool_),
        occupancy=(bev.on[VEHICLE] * 2).astype(np.uint8),
        known=np.full(GRID.shape, 15, np.uint8),
        appearance=bev.appearance.copy(),
        depth_m=np.zeros((2, 2, 4), np.float16),
        kind=np.full((2, 2, 4), 255, np.uint8),
        world_from_ego=world_from_ego,
        time_us=np.array(0),
        objects=objects,
        owner=owner,
        grid=GRID,
        channels=("CAM_FRONT", "CAM_BACK"),
    )


def world_places(sample: PackedSample) -> FloatArray:
    """World x and y of the objects, (3, 2)."""
    xy = sample.objects[:3, XY].astype(np.float64)
    return apply(sample.world_from_ego, np.pad(xy, ((0, 0), (0, 1))))[:, :2]


def world_headings(sample: PackedSample) -> FloatArray:
    """World direction of the objects, (3, 2)."""
    yaw = sample.objects[:3, YAW].astype(np.float64)
    return np.stack([np.cos(yaw), np.sin(yaw)], axis=1) @ sample.world_from_ego[:2, :2].T


def world_velocities(sample: PackedSample) -> FloatArray:
    return sample.objects[:3, VELOCITY].astype(np.float64) @ sample.world_from_ego[:2, :2].T


def world_middles(sample: PackedSample) -> FloatArray:
    """World middle of the cells of each vehicle, (3, 2)."""
    centres = [sample.grid.centres()[sample.owner == number].mean(axis=0) for number in (1, 2, 3)]
    return apply(sample.world_from_ego, np.pad(np.array(centres), ((0, 0), (0, 1))))[:, :2]


def changed(sample: PackedSample, yaw_rad: float, mirror: bool) -> PackedSample:
    return reframe(mirror_sample(sample) if mirror else sample, pose(1.5, -0.9, yaw_rad), INNER)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, -2.2])
def test_objects_and_their_cells_stay_where_they_are_in_the_world(yaw_rad: float, mirror: bool) -> None:
    before = sample_at(BEFORE)
    after = changed(before, yaw_rad, mirror)
    signs = np.array([1.0, -1.0 if mirror else 1.0])
    assert after.owner.shape == INNER.shape
    np.testing.assert_allclose(world_places(after), world_places(before) * signs, atol=1e-4)
    np.testing.assert_allclose(world_headings(after), world_headings(before) * signs, atol=1e-5)
    np.testing.assert_allclose(world_velocities(after), world_velocities(before) * signs, atol=1e-5)
    np.testing.assert_allclose(world_middles(after), world_places(after), atol=0.2)
    np.testing.assert_array_equal(after.owner > 0, after.occupancy >> VEHICLE & 1)
    assert np.isnan(after.objects[3:]).all()


def test_cropping_keeps_the_cells_of_the_vehicles() -> None:
    before = sample_at(BEFORE)
    after = crop(before, INNER)
    assert after.owner.shape == INNER.shape
    np.testing.assert_allclose(world_middles(after), world_middles(before))


@pytest.mark.parametrize("seed", range(6))
def test_frames_changed_alike_are_linked_by_the_motion_of_the_ego(seed: int) -> None:
    ranges = Augmentation(yaw_rad=np.pi, shift_m=3.0, mirror=0.5)
    past, now = (augment(sample_at(at), ranges, INNER, np.random.default_rng(seed)) for at in (BEFORE, NOW))
    motion = ground_motion(past.world_from_ego, now.world_from_ego)
    # Parked objects of now lie where they were, and so do their cells.
    order = [int(np.argmin(np.hypot(*(world_places(past) - place).T))) for place in world_places(now)]
    moved = now.objects[:3, XY] @ motion[:, :2].T + motion[:, 2]
    np.testing.assert_allclose(moved, past.objects[order][:, XY], atol=1e-4)
    np.testing.assert_allclose(world_middles(now), world_middles(past)[order], atol=0.3)
    # The motion is that of the samples before, seen from the other frame.
    plain = ground_motion(BEFORE, NOW)
    assert np.hypot(*motion[:, 2]) > 0.5
    assert abs(motion[0, 0]) == pytest.approx(plain[0, 0])


def test_in_the_mirror_the_ego_turns_the_other_way() -> None:
    plain = ground_motion(BEFORE, NOW)
    past, now = (mirror_sample(sample_at(at)).world_from_ego for at in (BEFORE, NOW))
    np.testing.assert_allclose(ground_motion(past, now), plain * [[1, -1, 1], [-1, 1, -1]], atol=1e-9)


# Light ------------------------------------------------------------------------------------------------------------


def assert_painted_as_the_map(sample: PackedSample) -> None:
    for number in (1, 2, 3):
        cells = sample.appearance[:, sample.owner == number]
        np.testing.assert_allclose(sample.objects[number - 1, RGB], np.median(cells, axis=1), atol=1)


def test_paint_changes_with_the_colours_of_the_map() -> None:
    sample = sample_at(BEFORE)
    assert_painted_as_the_map(sample)
    after = jitter_colours(sample, 1.1, 0.8, 0.6)
    assert np.abs(after.objects[:3, RGB] - sample.objects[:3, RGB]).max() > 10
    assert_painted_as_the_map(after)
    assert np.isnan(after.objects[3:]).all()


@pytest.mark.parametrize("seed", range(3))
def test_paint_has_the_tone_of_a_camera_style(seed: int) -> None:
    after = augment(sample_at(BEFORE), Augmentation(camera_style=1.0), INNER, np.random.default_rng(seed))
    assert_painted_as_the_map(after)


def test_unknown_paint_stays_unknown() -> None:
    sample = sample_at(BEFORE)
    sample.objects[1, RGB] = np.nan
    for after in (
        jitter_colours(sample, 1.2, 0.9, 0.5),
        augment(sample, Augmentation(camera_style=1.0), INNER, np.random.default_rng(1)),
    ):
        assert np.isnan(after.objects[1, RGB]).all()
        assert np.isfinite(after.objects[[0, 2], RGB.start : RGB.stop]).all()

"""Changed samples are still true: what a camera sees at a pixel lies in the cell where the map has it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import assert_rounded

from appocc.camera import Camera
from appocc.checks import FloatArray, check_transform
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.models.model_spec import MODEL_SPECS
from appocc.rigs import read_rig
from appocc.training.batches.augment import Augmentation, augment, jitter_colours, mirror_sample, reframe
from appocc.training.batches.packed_objects import COLUMNS, MAX_OBJECTS
from appocc.training.batches.reading import ARRAYS, PackedSample, crop

WIDTH, HEIGHT = 352, 128
GRID, FRONT = BEVGrid.surround(), MODEL_SPECS["180"].grid
RIG = tuple(read_rig("paper"))
TERMS = 4 * 16  # of four poses and matrices of intrinsics, one after the other
# Where each camera of the rig looks, degrees; a mark 14 m away in that direction is seen.
YAW_DEG = (55, 0, -55, 110, 180, -110)


def blank(grid: BEVGrid = GRID) -> PackedSample:
    n, (x, y) = len(RIG), grid.shape
    return PackedSample(
        images=np.zeros((n, HEIGHT, WIDTH, 3), np.uint8),
        intrinsic=np.stack([camera.intrinsic for camera in RIG]),
        ego_from_cam=np.stack([camera.ego_from_cam for camera in RIG]),
        alive=np.ones(n, np.bool_),
        occupancy=np.zeros((x, y), np.uint8),
        known=np.full((x, y), 15, np.uint8),
        appearance=np.zeros((3, x, y), np.uint8),
        depth_m=np.zeros((n, HEIGHT // 8, WIDTH // 8), np.float16),
        kind=np.full((n, HEIGHT // 8, WIDTH // 8), 255, np.uint8),
        world_from_ego=np.eye(4),
        time_us=np.array(0),
        objects=np.full((MAX_OBJECTS, COLUMNS), np.nan, np.float32),
        owner=np.zeros((x, y), np.uint8),
        grid=grid,
        channels=tuple(camera.channel for camera in RIG),
    )


def camera_of(sample: PackedSample, n: int) -> Camera:
    k, pose = sample.intrinsic[n].copy(), sample.ego_from_cam[n].copy()
    return Camera("CAM", WIDTH, HEIGHT, k, pose)


def marked() -> PackedSample:
    """A white mark on the ground before each camera: in its picture, its depth and the map (3 x 3 vehicle cells)."""
    sample = blank()
    for n, yaw in enumerate(np.radians(YAW_DEG)):
        # A little to the side, so that mirroring shows.
        i, j = GRID.cell_of([14 * np.cos(yaw + 0.1), 14 * np.sin(yaw + 0.1)])
        point = np.array([[*GRID.centre_of([i, j]), 0.0]])
        uv, depth = camera_of(sample, n).project_ego(point)
        u, v = uv[0]
        cv2.circle(sample.images[n], (round(u), round(v)), 5, (255, 255, 255), -1)
        sample.depth_m[n, int(v + 0.5) // 8, int(u + 0.5) // 8] = depth[0]
        sample.occupancy[i - 1 : i + 2, j - 1 : j + 2] = 2
    return sample


def marks_px(sample: PackedSample, n: int) -> FloatArray:
    rows, columns = np.nonzero(sample.images[n, :, :, 0] > 127)
    return np.array([columns.mean(), rows.mean()])


def vehicle_places(sample: PackedSample) -> list[FloatArray]:
    """Middles of the marks in the map, metres."""
    count, label = cv2.connectedComponents((sample.occupancy == 2).astype(np.uint8), connectivity=8)
    centres = sample.grid.centres()
    return [centres[label == k].mean(axis=0) for k in range(1, count)]


def frame(yaw_rad: float, x_m: float, y_m: float) -> FloatArray:
    return transform(quaternion_from_yaw(yaw_rad), [x_m, y_m, 0.0])


@settings(max_examples=25)
@given(yaw_rad=st.floats(-np.pi, np.pi), x_m=st.floats(-6, 6), y_m=st.floats(-6, 6), mirror=st.booleans())
def test_images_and_map_agree_in_any_frame(yaw_rad: float, x_m: float, y_m: float, mirror: bool) -> None:
    sample = mirror_sample(marked()) if mirror else marked()
    sample = reframe(sample, frame(yaw_rad, x_m, y_m), GRID)
    places = vehicle_places(sample)
    assert len(places) == len(RIG)
    for n in range(len(RIG)):
        check_transform("pose", sample.ego_from_cam[n])
        points = np.array([[*place, 0.0] for place in places])
        uv, depth = camera_of(sample, n).project_ego(points)
        px = marks_px(sample, n)
        off = np.linalg.norm(uv - px, axis=1)
        nearest = int(np.nanargmin(off))
        # A third of a cell at 14 m is 3 pixels; a mark mirrored or turned the wrong way is tens of pixels off.
        assert off[nearest] < 6
        row, column = int(px[1] + 0.5) // 8, int(px[0] + 0.5) // 8
        assert sample.depth_m[n, row, column] == pytest.approx(depth[nearest], abs=0.5)


@settings(max_examples=25)
@given(yaw_rad=st.floats(-np.pi, np.pi), x_m=st.floats(-6, 6), y_m=st.floats(-6, 6), mirror=st.booleans())
def test_a_ground_point_keeps_its_pixel_exactly(yaw_rad: float, x_m: float, y_m: float, mirror: bool) -> None:
    before, point = blank(), np.array([[9.0, 2.5, 0.0]])
    after = reframe(mirror_sample(before) if mirror else before, frame(yaw_rad, x_m, y_m), GRID)
    moved = apply(frame(yaw_rad, x_m, y_m), point * [1, -1, 1] if mirror else point)
    uv, depth = camera_of(before, 1).project_ego(point)
    uv_after, depth_after = camera_of(after, 1).project_ego(moved)
    expected = [WIDTH - 1 - uv[0, 0], uv[0, 1]] if mirror else uv[0]
    # Metres are up to 20; a pixel is one of them over the depth, whose rounding counts once more.
    assert_rounded(uv_after[0], expected, TERMS, WIDTH * max(1.0, (20 / float(depth[0])) ** 2))
    assert_rounded(depth_after, depth, TERMS, 20.0)


def coded(grid: BEVGrid = GRID) -> PackedSample:
    """A map in which each cell's colour is its number, and its classes follow from it."""
    sample, (x, y) = blank(grid), grid.shape
    i, j = np.indices((x, y))
    sample.appearance[:] = np.stack([i, j, np.full_like(i, 7)])
    sample.occupancy[:] = (i + j) % 8
    return sample


@pytest.mark.parametrize("target", [GRID, FRONT])
def test_cells_are_resampled_at_their_centre_and_unknown_outside(target: BEVGrid) -> None:
    new_from_ego = frame(0.7, 3.0, -2.0)
    before, after = coded(), reframe(coded(), new_from_ego, target)
    assert after.grid == target
    assert after.occupancy.shape == target.shape
    centres = np.concatenate([target.centres(), np.zeros((*target.shape, 1))], axis=-1)
    cell = GRID.cell_of(apply(inverse(new_from_ego), centres)[..., :2])
    inside = GRID.contains(cell)
    assert 0.7 < inside.mean() < 1
    np.testing.assert_array_equal(after.known, np.where(inside, 15, 0))
    np.testing.assert_array_equal(np.moveaxis(after.appearance[:2], 0, 2)[inside], cell[inside])
    np.testing.assert_array_equal(after.occupancy[inside], before.occupancy[tuple(cell[inside].T)])
    assert not after.occupancy[~inside].any()


def test_a_turn_by_a_quarter_and_a_whole_shift_lose_nothing() -> None:
    before = coded()
    after = reframe(before, frame(np.pi / 2, 0, 0), GRID)
    np.testing.assert_array_equal(after.occupancy, np.rot90(before.occupancy))
    moved = reframe(before, frame(0, 0.8, -0.4), GRID)
    np.testing.assert_array_equal(moved.occupancy[2:, :-1], before.occupancy[:-2, 1:])
    assert not moved.known[:2].any()
    assert not moved.known[:, -1].any()


def test_mirroring_twice_is_nothing_and_needs_a_grid_that_is_even() -> None:
    sample = marked()
    twice = mirror_sample(mirror_sample(sample))
    for name in ARRAYS:
        assert_rounded(getattr(twice, name), getattr(sample, name), TERMS)
    with pytest.raises(ShapeError, match=r"got y -4\.\.8 m"):
        mirror_sample(blank(BEVGrid(-8, 8, -4, 8)))


def test_a_skewed_pixel_is_mirrored_too() -> None:
    sample = blank()
    sample.intrinsic[:, 0, 1] = 3.0
    point = np.array([[12.0, 1.0, 0.4]])
    uv, _ = camera_of(sample, 1).project_ego(point)
    uv_after, _ = camera_of(mirror_sample(sample), 1).project_ego(point * [1, -1, 1])
    assert_rounded(uv_after[0], [WIDTH - 1 - uv[0, 0], uv[0, 1]], TERMS, WIDTH)


# Light ------------------------------------------------------------------------------------------------------------


def test_colour_jitter_changes_images_and_map_alike() -> None:
    rng, sample = np.random.default_rng(0), blank()
    sample.appearance[:] = rng.integers(0, 256, sample.appearance.shape)
    sample.images[0, :, :200] = np.moveaxis(sample.appearance, 0, 2)[:128]
    after = jitter_colours(sample, 1.1, 0.8, 1.3)
    np.testing.assert_array_equal(after.images[0, :, :200], np.moveaxis(after.appearance, 0, 2)[:128])
    np.testing.assert_array_equal(after.occupancy, sample.occupancy)
    assert sample.images[0].max() == 255  # itself untouched


@pytest.mark.parametrize(
    ("light", "colour", "expected"),
    [
        ((1.2, 1.0, 1.0), (100, 50, 0), (120, 60, 0)),
        ((1.2, 1.0, 1.0), (250, 50, 0), (255, 60, 0)),
        ((1.0, 0.5, 1.0), (127, 227, 27), (127, 177, 77)),
        ((1.0, 1.0, 0.0), (100, 50, 200), (82, 82, 82)),  # 0.299 * 100 + 0.587 * 50 + 0.114 * 200
        ((1.0, 1.0, 1.0), (3, 77, 201), (3, 77, 201)),
    ],
)
def test_golden_colours(
    light: tuple[float, float, float], colour: tuple[int, int, int], expected: tuple[int, int, int]
) -> None:
    sample = blank()
    sample.images[:] = colour
    np.testing.assert_array_equal(jitter_colours(sample, *light).images[2, 64, 100], expected)


def test_unknown_colours_stay_black() -> None:
    sample = blank()
    sample.known[:100] = 7
    after = jitter_colours(sample, 1.0, 0.5, 1.0)
    assert not after.appearance[:, :100].any()
    assert (after.appearance[:, 100:] == 64).all()


# All together -----------------------------------------------------------------------------------------------------

STRONG = Augmentation(
    yaw_rad=np.pi,
    shift_m=4.0,
    mirror=0.5,
    brightness=0.2,
    contrast=0.2,
    saturation=0.2,
    cameras_dropped=2,
    extrinsic_rad=0.02,
    extrinsic_m=0.1,
)


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def equal(one: PackedSample, other: PackedSample, names: tuple[str, ...] = ARRAYS) -> bool:
    pairs = ((getattr(one, name), getattr(other, name)) for name in names)
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in pairs)


def test_no_strength_changes_nothing_but_crops() -> None:
    sample = coded()
    assert equal(augment(sample, Augmentation(), GRID, rng(0)), sample)
    front = augment(sample, Augmentation(), FRONT, rng(0))
    assert equal(front, crop(sample, FRONT))
    np.testing.assert_array_equal(front.occupancy, sample.occupancy[100:])


def test_augmentation_is_reproducible_and_does_not_modify_its_input() -> None:
    sample, untouched = marked(), marked()
    for name in ARRAYS:
        getattr(sample, name).flags.writeable = False
    first = augment(sample, STRONG, GRID, rng(5))
    assert equal(first, augment(sample, STRONG, GRID, rng(5)))
    assert not equal(first, augment(sample, STRONG, GRID, rng(6)))
    assert equal(sample, untouched)


def test_switching_one_change_on_leaves_the_others_as_they_were() -> None:
    sample = marked()
    everything = augment(sample, STRONG, GRID, rng(3))
    calm = augment(sample, replace(STRONG, brightness=0, contrast=0, saturation=0), GRID, rng(3))
    assert equal(everything, calm, ("intrinsic", "ego_from_cam", "alive", "occupancy", "known", "depth_m", "kind"))
    stiff = augment(sample, replace(STRONG, yaw_rad=0, shift_m=0, extrinsic_rad=0, extrinsic_m=0), GRID, rng(3))
    assert equal(everything, stiff, ("images", "alive", "intrinsic"))


def test_cameras_are_dropped_up_to_the_limit_and_one_remains() -> None:
    counts = [int(augment(blank(), Augmentation(cameras_dropped=2), GRID, rng(i)).alive.sum()) for i in range(20)]
    assert {*counts} == {4, 5, 6}
    lonely = blank()
    lonely.alive[1:] = False
    for i in range(10):
        assert augment(lonely, Augmentation(cameras_dropped=5), GRID, rng(i)).alive.tolist() == [True] + [False] * 5


def test_strengths_are_bounds_and_are_used() -> None:
    turns, moves = [], []
    for i in range(20):
        after = augment(blank(), Augmentation(extrinsic_rad=0.03, extrinsic_m=0.2), GRID, rng(i))
        for n, camera in enumerate(RIG):
            check_transform("pose", after.ego_from_cam[n])
            change = inverse(camera.ego_from_cam) @ after.ego_from_cam[n]
            turns.append(np.arccos(np.clip((np.trace(change[:3, :3]) - 1) / 2, -1, 1)))
            moves.append(np.linalg.norm(change[:3, 3]))
    assert 0.027 < max(turns) <= 0.03 + 1e-6
    assert 0.18 < max(moves) <= 0.2 + 1e-6
    yaws = []
    for i in range(40):
        after = augment(blank(), Augmentation(yaw_rad=0.5, shift_m=3), GRID, rng(i))
        new_from_ego = after.ego_from_cam[1] @ inverse(RIG[1].ego_from_cam)
        yaws.append(np.arctan2(new_from_ego[1, 0], new_from_ego[0, 0]))
        assert np.abs(new_from_ego[:2, 3]).max() <= 3
        assert new_from_ego[2, 3] == pytest.approx(0)
    assert -0.5 <= min(yaws) < -0.4
    assert 0.4 < max(yaws) <= 0.5
    sample = marked()
    flipped = [not equal(augment(sample, Augmentation(mirror=0.5), GRID, rng(i)), sample) for i in range(40)]
    assert 10 < sum(flipped) < 30


def test_a_camera_style_restyles_images_and_tone_and_leaves_geometry() -> None:
    sample = marked()
    sample = sample._replace(images=sample.images // 2 + 60, appearance=np.full_like(sample.appearance, 90))
    sample.known[:50] = 0
    plain = augment(sample, Augmentation(), GRID, np.random.default_rng(5))
    other = augment(sample, Augmentation(camera_style=1.0), GRID, np.random.default_rng(5))
    assert not np.array_equal(plain.images, other.images)
    assert np.array_equal(plain.occupancy, other.occupancy)
    assert np.array_equal(plain.ego_from_cam, other.ego_from_cam)
    assert not other.appearance[:, :50].any()
    # One tone for all cells.
    assert len(np.unique(other.appearance[:, 50:].reshape(3, -1), axis=1).T) == 1
    share = [
        not np.array_equal(
            augment(sample, Augmentation(camera_style=0.5), GRID, np.random.default_rng(seed)).images, sample.images
        )
        for seed in range(24)
    ]
    assert 6 < sum(share) < 18

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from made_street import (
    BLUE,
    EGO_FROM_LIDAR,
    GREEN,
    GREY,
    RED,
    WORLD_FROM_STREET,
    Plan,
    Solid,
    camera,
    car,
    ground_rgb,
    make,
    photograph,
    street_from_ego,
)
from tolerances import assert_rounded

from appocc.boxes import Boxes
from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.geometry import apply, inverse, transform
from appocc.groundtruth.colouring import (
    LANE,
    NO_CAMERA,
    OTHER,
    ROAD,
    UNLABELLED,
    ColouredPoints,
    colour_at,
    colour_sweep,
)
from appocc.groundtruth.inputs import PosedImage, SweepInput, gather_inputs
from appocc.nuscenes.lidar import write_lidar
from appocc.nuscenes.point_labels import PointLabels

EGO = street_from_ego(0.0)
TERMS = 4 * 4  # of four poses, one after the other
NOBODY = Boxes.empty()


def box(solid: Solid) -> Boxes:
    """An annotated box of a solid, world frame."""
    low, high = np.array(solid.low), np.array(solid.high)
    pose = WORLD_FROM_STREET @ transform(np.eye(3), (low + high) / 2)
    size = (high - low)[None, [1, 0, 2]]
    nan, minus = np.full((1, 2), np.nan), np.full(1, -1)
    return Boxes(
        centre_m=pose[None, :3, 3].copy(),
        size_wlh_m=size,
        rotation=pose[None, :3, :3].copy(),
        category=("vehicle.car",),
        instance=("a",),
        token=("a",),
        velocity_mps=nan,
        lidar_points=minus,
    )


def view(folder: Path, name: str, solids: list[Solid], boxes: Boxes, channel: str = "CAM_FRONT") -> PosedImage:
    """A photograph of solids from the ego's place, at a time when `boxes` were there."""
    model = camera(channel)
    path = folder / f"{name}.png"
    picture = photograph(model, EGO @ model.ego_from_cam, solids)
    assert cv2.imwrite(str(path), picture[..., ::-1])
    return PosedImage(path, model, WORLD_FROM_STREET @ EGO @ model.ego_from_cam, boxes, 0)


def sweep(
    folder: Path,
    street_points: FloatArray,
    *rounds: tuple[PosedImage, ...],
    boxes: Boxes = NOBODY,
    lidar_height_m: float = 1.84,
    labels: PointLabels | None = None,
) -> SweepInput:
    """A sweep of these points (street frame, NaN allowed), taken at the ego's place."""
    street_from_lidar = EGO @ EGO_FROM_LIDAR
    street_from_lidar[2, 3] = lidar_height_m
    path = folder / "sweep.pcd.bin"
    with np.errstate(invalid="ignore"):
        local = apply(inverse(street_from_lidar), street_points)
    write_lidar(path, np.pad(local, ((0, 0), (0, 2))))
    return SweepInput(path, WORLD_FROM_STREET @ street_from_lidar, boxes, labels, rounds)


def coloured(sweep: SweepInput, *channels: str) -> tuple[ColouredPoints, FloatArray]:
    """Its coloured points, and where they lie in the street."""
    points = colour_sweep(sweep, WORLD_FROM_STREET[:3, 3], tuple(sorted(channels or ("CAM_FRONT",))))
    world = points.xyz_m.astype(np.float64) + WORLD_FROM_STREET[:3, 3]
    return points, apply(inverse(WORLD_FROM_STREET), world)


def on_ground(*xy: tuple[float, float]) -> FloatArray:
    return np.array([(x, y, 0.0) for x, y in xy])


def test_colours_are_interpolated_between_pixels() -> None:
    rows, columns = np.mgrid[:20, :30]
    image = np.stack([columns * 8, rows * 10, np.full_like(rows, 7)], axis=-1).astype(np.uint8)
    places = np.array([[10.25, 5.5], [3.0, 4.0], [28.9, 18.1], [-0.4, -0.4], [29.4, 19.4]])
    expected = [[82, 55, 7], [24, 40, 7], [231.2, 181, 7], [0, 0, 7], [232, 190, 7]]
    assert_rounded(colour_at(image, places), expected, 4)


def test_points_take_the_colour_of_the_surface(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    xy = rng.uniform([5.0, -8.0], [20.0, 8.0], (400, 2))
    points, street = coloured(sweep(tmp_path, np.pad(xy, ((0, 0), (0, 1))), (view(tmp_path, "a", [], NOBODY),)))
    seen = points.camera == 0
    assert seen.sum() > 150
    # Farther than half a pixel from a change of colour.
    clear = seen & (np.abs(np.abs(street[:, 1]) - 4) > 0.3) & (np.abs(np.abs(street[:, 1]) - 0.15) > 0.3)
    assert clear.sum() > 100
    assert np.array_equal(points.rgb[clear], ground_rgb(street[clear, :2]))


def test_points_out_of_sight_are_kept_without_colour(tmp_path: Path) -> None:
    here = on_ground((8, -1), (-8, -1))
    points, street = coloured(sweep(tmp_path, here, (view(tmp_path, "a", [], NOBODY),)))
    assert points.camera.tolist() == [0, NO_CAMERA]
    assert_rounded(street, here, TERMS, dtype=torch.float32)


# A wall, 1.2 m high, hides a strip of road from the camera (1.5 m high), but not from a LiDAR high on a mast.
WALL = Solid((8.0, -5.0, 0.0), (8.2, 3.0, 1.2), GREEN)


def wall_points() -> FloatArray:
    y, z = np.meshgrid(np.linspace(-4.9, 2.9, 150), np.linspace(0.05, 1.2, 40))
    return np.stack([np.full(y.size, 8.0), y.ravel(), z.ravel()], axis=1)


def test_a_point_behind_a_wall_never_takes_its_colour(tmp_path: Path) -> None:
    behind, before = on_ground((12, -1), (16, -3), (20, 0.9)), on_ground((6, -1), (7.5, -2))
    every = np.vstack([behind, before, wall_points()])
    points, street = coloured(sweep(tmp_path, every, (view(tmp_path, "a", [WALL], NOBODY),), lidar_height_m=6.0))
    for place in behind:
        row = np.flatnonzero((np.abs(street - place) < 0.01).all(axis=1))
        assert points.camera[row].tolist() == [NO_CAMERA]
    for place in before:
        row = np.flatnonzero((np.abs(street - place) < 0.01).all(axis=1))
        assert points.camera[row].tolist() == [0]
        assert points.rgb[row].tolist() == [list(GREY)]
    low = (np.abs(street[:, 0] - 8) < 0.01) & (street[:, 2] < 1.1) & (np.abs(street[:, 1]) < 2.5)
    assert (points.camera[low] == 0).all()
    assert (points.rgb[low] == GREEN).all()


def test_a_point_behind_a_box_never_takes_its_colour(tmp_path: Path) -> None:
    # No point of the sweep lies on the car: the box alone says that it is there.
    red = car(12, -1, RED, "a")
    place = on_ground((20, -1), (20, 3.5))
    points, _ = coloured(sweep(tmp_path, place, (view(tmp_path, "a", [red], box(red)),)))
    assert points.camera.tolist() == [0, NO_CAMERA]
    assert points.rgb[0].tolist() == list(GREY)  # the one beside it


def test_a_point_seen_only_in_a_later_image_takes_its_colour(tmp_path: Path) -> None:
    red = car(12, -1, RED, "a")
    now = view(tmp_path, "now", [red], box(red))
    later = view(tmp_path, "later", [], NOBODY)
    points, street = coloured(sweep(tmp_path, on_ground((20, -1), (20, 3.5)), (now,), (later,)))
    assert (points.camera == 0).all()
    assert points.rgb.tolist() == [list(GREY)] * 2
    assert len(street) == 2  # one row each: what the first round saw is not seen again


def test_the_time_nearest_image_wins(tmp_path: Path) -> None:
    now, later = view(tmp_path, "now", [], NOBODY), view(tmp_path, "later", [], NOBODY)
    _flood(now.path, RED)
    _flood(later.path, BLUE)
    points, _ = coloured(sweep(tmp_path, on_ground((20, -1)), (now,), (later,)))
    assert points.rgb.tolist() == [list(RED)]


def _flood(path: Path, rgb: tuple[int, int, int]) -> None:
    picture: ByteArray = np.full((180, 320, 3), rgb[::-1], np.uint8)
    assert cv2.imwrite(str(path), picture)


def test_two_cameras_give_two_rows(tmp_path: Path) -> None:
    front = view(tmp_path, "front", [], NOBODY)
    left = view(tmp_path, "left", [], NOBODY, "CAM_LEFT")
    second = replace(front, path=left.path, camera=replace(front.camera, channel="CAM_LEFT"))
    _flood(front.path, RED)
    _flood(left.path, BLUE)
    points, _ = coloured(sweep(tmp_path, on_ground((9, 0)), (front, second)), "CAM_LEFT", "CAM_FRONT")
    assert points.camera.tolist() == [0, 1]
    assert points.rgb.tolist() == [list(RED), list(BLUE)]
    assert np.array_equal(points.xyz_m[0], points.xyz_m[1])


def test_points_in_boxes_are_removed(tmp_path: Path) -> None:
    red = car(12, -1, RED, "a")
    inside, below = np.array([[12.0, -1.0, 0.7], [14.05, -1, 0.5]]), np.array([[12.0, 4.0, 0.0]])
    every = np.vstack([inside, below])
    _, street = coloured(sweep(tmp_path, every, (view(tmp_path, "a", [], NOBODY),), boxes=box(red)))
    assert_rounded(street, below, TERMS, dtype=torch.float32)


def test_points_in_boxes_are_removed_at_their_own_time(tmp_path: Path) -> None:
    """A car drives past between two samples; a sweep between them finds it where no sample has it."""
    dataset = make(tmp_path, Plan(lambda t: [car(6 + 12 * t, 3, BLUE, "blue")], sweeps_s=(0.25,), with_lidar=()))
    inputs = gather_inputs(dataset, dataset.scenes[0])
    assert len(inputs.sweeps) == 1
    points = colour_sweep(
        inputs.sweeps[0], np.zeros(3), tuple(sorted(dataset.data(dataset.samples(dataset.scenes[0])[0])))
    )
    street = apply(inverse(WORLD_FROM_STREET), points.xyz_m.astype(np.float64))
    assert len(street) > 1000
    assert street[:, 2].max() < 0.05  # nothing but road is left
    assert not (points.rgb[points.camera != NO_CAMERA] == BLUE).all(axis=1).any()


def test_points_that_are_not_finite_or_on_the_ego_are_ignored(tmp_path: Path) -> None:
    nan = np.array([[np.nan, 0, 0], [10, np.nan, 0], [np.inf, 0, 0]])
    own = np.array([[0.9 + 1.7, -1.0, 1.0], [0.9, -1.0, 1.8]])
    far = on_ground((70, 0))
    good = on_ground((8, -1))
    points, street = coloured(sweep(tmp_path, np.vstack([nan, own, far, good]), (view(tmp_path, "a", [], NOBODY),)))
    assert_rounded(street, good, TERMS, dtype=torch.float32)
    assert points.camera.tolist() == [0]


def test_labels_define_the_ground_class(tmp_path: Path) -> None:
    labels = tmp_path / "labels.bin"
    labels.write_bytes(bytes([7, 8, 9]))
    is_road, is_lane = np.isin(np.arange(256), [7, 8]), np.arange(256) == 8
    place = on_ground((8, -1), (9, 0), (9, 6))
    for lane, expected in ((is_lane, [ROAD, LANE, OTHER]), (None, [ROAD, ROAD, OTHER])):
        names = PointLabels(labels, is_road, lane, "x")
        points, _ = coloured(sweep(tmp_path, place, (), labels=names))
        assert points.ground.tolist() == expected
    assert coloured(sweep(tmp_path, place, ()))[0].ground.tolist() == [UNLABELLED] * 3


def test_an_empty_sweep_and_one_without_images(tmp_path: Path) -> None:
    empty, _ = coloured(sweep(tmp_path, np.zeros((0, 3)), (view(tmp_path, "a", [], NOBODY),)))
    assert len(empty.xyz_m) == len(empty.rgb) == len(empty.camera) == len(empty.ground) == 0
    blind, _ = coloured(sweep(tmp_path, on_ground((8, -1)), (), (), ()))
    assert blind.camera.tolist() == [NO_CAMERA]


def test_labels_that_do_not_fit_the_points(tmp_path: Path) -> None:
    path = tmp_path / "labels.bin"
    path.write_bytes(bytes(2))
    names = PointLabels(path, np.zeros(256, np.bool_), None, "x")
    with pytest.raises(DataError, match=r"labels\.bin: expected 1 labels"):
        coloured(sweep(tmp_path, on_ground((8, -1)), (), labels=names))


def test_an_image_of_another_size_than_in_its_table(tmp_path: Path) -> None:
    small = view(tmp_path, "small", [], NOBODY)
    assert cv2.imwrite(str(small.path), np.zeros((90, 160, 3), np.uint8))
    with pytest.raises(DataError, match=r"small\.png: expected 320x180 pixels, as its table says, got 160x90"):
        coloured(sweep(tmp_path, on_ground((8, -1)), (small,)))

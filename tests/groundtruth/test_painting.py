from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from made_street import BLUE, GREEN, RED, Plan, Solid, camera, car, make, photograph, street_from_ego

from appocc.boxes import Boxes
from appocc.checks import BoolArray, ByteArray
from appocc.errors import DataError
from appocc.files import read_image
from appocc.geometry import apply, inverse, transform
from appocc.groundtruth.inputs import SampleInput, View, gather
from appocc.groundtruth.painting import (
    BoxPixels,
    Paint,
    Painted,
    box_pixels,
    paint_mode,
    paint_robust,
    paint_sample,
    paint_vehicles,
    pool_over_time,
)
from appocc.groundtruth.visibility import DepthPicture

BOTH = pytest.mark.parametrize("paint_name", ["mode", "robust"])
GLASS, TYRE = (40, 50, 62), (14, 14, 15)


def pixels(rgb: object, height: object = 0.5) -> BoxPixels:
    colours = np.array(rgb, dtype=np.uint8).reshape(-1, 3)
    heights = np.broadcast_to(np.asarray(height, np.float64), len(colours)).copy()
    return BoxPixels(colours, heights, float(len(colours)))


# The paper's mode ---------------------------------------------------------------------------------------------------


def test_mode_is_the_fullest_of_25_bins_of_length_10() -> None:
    # Red: 40..49 holds four values, though 131 is the single value that comes most often.
    red = [40, 43, 46, 49, 131, 131, 131, 200, 50]
    # Green: bins begin at multiples of ten: 19 and 20 lie apart. Blue: 250..255 belong to the last bin, 240..249.
    green = [19, 20, 21, 29, 10, 18, 30, 31, 99]
    blue = [255, 250, 241, 249, 239, 238, 237, 0, 0]
    assert paint_mode(pixels(np.column_stack([red, green, blue]))).tolist() == [45, 15, 245]


def test_mode_takes_each_channel_for_itself() -> None:
    rgb = [(205, 5, 5)] * 4 + [(5, 105, 5)] * 4 + [(205, 105, 5)] * 1
    assert paint_mode(pixels(rgb)).tolist() == [205, 105, 5]


@pytest.mark.parametrize("value", [0, 9, 10, 99, 128, 239, 240, 250, 255])
def test_mode_of_one_colour_is_its_bin(value: int) -> None:
    assert paint_mode(pixels([(value,) * 3] * 20)).tolist() == [min(value // 10, 24) * 10 + 5] * 3


# The robust variant -------------------------------------------------------------------------------------------------


def body_and_glass() -> BoxPixels:
    """A red car as a camera sees it: more glass than paint, tyres, a shadowed edge and a glint on the paint."""
    rng = np.random.default_rng(1)
    parts = [(TYRE, 150, 0.0, 0.27), (GLASS, 400, 0.63, 1.0), (RED, 200, 0.3, 0.6)]
    parts += [((20, 4, 4), 25, 0.3, 0.6), ((255, 250, 250), 15, 0.3, 0.6)]
    rgb = np.concatenate([np.tile(colour, (n, 1)) for colour, n, _, _ in parts]).astype(float)
    height = np.concatenate([rng.uniform(low, high, n) for _, n, low, high in parts])
    return BoxPixels(np.clip(rgb + rng.normal(0, 3, rgb.shape), 0, 255).astype(np.uint8), height, 1000.0)


def test_robust_ignores_glass_tyres_shadow_and_glint() -> None:
    car_seen = body_and_glass()
    assert np.abs(paint_robust(car_seen).astype(float) - RED).max() < 6
    assert np.abs(paint_mode(car_seen).astype(float) - RED).max() > 100  # the paper's answers with the glass


def test_robust_trims_a_dense_shadow_from_paint_of_many_shades() -> None:
    shades = np.linspace(40, 240, 172)[:, None].repeat(3, axis=1)
    shadow = np.full((28, 3), 5.0)
    assert paint_robust(pixels(np.vstack([shades, shadow]))).min() > 30


def test_robust_takes_what_there_is_where_no_bodywork_is_seen() -> None:
    assert np.abs(paint_robust(pixels([GLASS] * 40, 0.9)).astype(float) - GLASS).max() <= 1


def test_robust_of_two_paints_is_one_of_them() -> None:
    answer = paint_robust(pixels([RED] * 60 + [BLUE] * 40)).tolist()
    assert answer == list(RED)


# In pictures --------------------------------------------------------------------------------------------------------


def boxes(*solids: Solid) -> Boxes:
    """Boxes of solids, in the street frame."""
    low, high = (np.array([getattr(solid, end) for solid in solids]).reshape(-1, 3) for end in ("low", "high"))
    n = len(solids)
    names = tuple(solid.name for solid in solids)
    turns = np.tile(np.eye(3), (n, 1, 1))
    category = tuple(solid.category for solid in solids)
    nan, minus = np.full((n, 2), np.nan), np.full(n, -1)
    return Boxes((low + high) / 2, (high - low)[:, [1, 0, 2]], turns, category, names, names, nan, minus)


def seen(every: list[Solid], annotated: list[Solid], channel: str = "CAM_FRONT") -> tuple[ByteArray, View]:
    """A photograph of a street and the view that belongs to it."""
    model = camera(channel)
    pose = street_from_ego(0) @ model.ego_from_cam
    return photograph(model, pose, every), View(Path("unused"), model, pose, boxes(*annotated), 0)


def paint(every: list[Solid], annotated: list[Solid], how: Paint) -> tuple[ByteArray, BoolArray]:
    image, view = seen(every, annotated)
    painted = paint_vehicles([image], [view], np.ones(len(annotated), np.bool_), [None], how)
    return painted.rgb, painted.area_px > 0


def within_bin(rgb: ByteArray, expected: tuple[int, int, int]) -> bool:
    return bool((np.abs(rgb.astype(int) - expected) <= 5).all())


@BOTH
def test_cars_are_painted_in_their_own_colour(paint_name: Paint) -> None:
    street = [car(10, 2, RED, "a"), car(12, -4, BLUE, "b")]
    colours, known = paint(street, street, paint_name)
    assert known.all()
    assert within_bin(colours[0], RED)
    assert within_bin(colours[1], BLUE)


@BOTH
def test_a_car_behind_another_is_painted_from_its_visible_part(paint_name: Paint) -> None:
    # The blue one covers all but a strip of the red one.
    red, blue = car(16, -2.2, RED, "red"), car(9, -0.7, BLUE, "blue")
    image, view = seen([red, blue], [red, blue])
    share = len(box_pixels(image, view, view.boxes_world, 0, None).rgb) / len(
        box_pixels(image, view, boxes(red), 0, None).rgb
    )
    assert 0.05 < share < 0.5
    colours, known = paint([red, blue], [red, blue], paint_name)
    assert known.tolist() == [True, True]
    assert within_bin(colours[0], RED)
    assert within_bin(colours[1], BLUE)


@BOTH
def test_a_car_that_another_covers_is_unknown(paint_name: Paint) -> None:
    red, blue = car(16, -1, RED, "red"), Solid((6, -3, 0), (8, 1, 2.5), BLUE, "vehicle.truck", "blue")
    colours, known = paint([red, blue], [red, blue], paint_name)
    assert known.tolist() == [False, True]
    assert colours[0].tolist() == [0, 0, 0]


@BOTH
def test_cars_that_no_camera_sees_are_unknown(paint_name: Paint) -> None:
    behind, aside, tiny = car(-10, 0, RED, "a"), car(3, 9, RED, "b"), car(150, 0, RED, "c")
    _, known = paint([behind, aside, tiny], [behind, aside, tiny], paint_name)
    assert known.tolist() == [False, False, False]


def test_without_images_all_are_unknown() -> None:
    assert paint_vehicles([], [], np.ones(3, np.bool_), [], "robust").area_px.tolist() == [0.0] * 3


def test_only_the_wanted_are_painted() -> None:
    street = [car(10, 2, RED, "a"), car(12, -4, BLUE, "b")]
    image, view = seen(street, street)
    known = paint_vehicles([image], [view], np.array([False, True]), [None], "mode").area_px > 0
    assert known.tolist() == [False, True]


def test_all_views_count_together() -> None:
    """Left and front camera each see an end of the car; the mode is that of both."""
    street = [car(4.5, 3.2, RED, "a")]
    front, left = seen(street, street), seen(street, street, "CAM_LEFT")
    counts = [len(box_pixels(image, view, view.boxes_world, 0, None).rgb) for image, view in (front, left)]
    assert min(counts) > 12
    flooded = np.full_like(front[0], 77)
    few = int(np.argmin(counts))
    images = [flooded if i == few else (front, left)[i][0] for i in range(2)]
    colours, _area = paint_vehicles(images, [front[1], left[1]], np.ones(1, np.bool_), [None, None], "mode")
    assert within_bin(colours[0], RED)


def test_what_lidar_sees_before_a_car_hides_it() -> None:
    """A wall that nobody annotated covers the car's lower half."""
    red, wall = car(14, -1, RED, "a"), Solid((10, -4, 0), (10.2, 2, 1.0), GREEN)
    image, view = seen([red, wall], [red])
    y, z = np.meshgrid(np.linspace(-4, 2, 200), np.linspace(0.02, 1.0, 50))
    on_wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    depth = DepthPicture(apply(inverse(view.world_from_cam), on_wall), view.camera)
    without = box_pixels(image, view, view.boxes_world, 0, None)
    with_depth = box_pixels(image, view, view.boxes_world, 0, depth)
    assert (without.rgb == GREEN).all(axis=1).sum() > 50
    assert (with_depth.rgb == RED).all(axis=1).mean() > 0.95
    assert len(with_depth.rgb) > 50


def test_heights_are_those_of_the_box() -> None:
    red = car(10, -1, RED, "a")
    image, view = seen([red], [red])
    found = box_pixels(image, view, view.boxes_world, 0, None)
    assert found.height.min() > -1e-9
    assert found.height.max() < 1 + 1e-9
    assert found.height.min() < 0.05
    assert found.height.max() > 0.95
    assert (found.rgb == RED).all()


@pytest.mark.parametrize("distance", [8.0, 14.0, 30.0])
def test_the_area_is_that_in_the_picture(distance: float) -> None:
    red, blue = car(distance, -1.5, RED, "a"), car(distance - 2.2, 1.5, BLUE, "b")
    image, view = seen([red, blue], [red, blue])
    found = box_pixels(image, view, view.boxes_world, 0, None)
    assert found.area_px == pytest.approx((image == RED).all(axis=2).sum(), rel=0.12)


def test_a_turned_and_tilted_box_is_hit_where_it_is() -> None:
    """Pixels of a box in a picture in which only that box is white: all of them, and none beside it."""
    pose = transform(np.array([0.95, 0.05, 0.1, 0.3]), [12.0, 1.0, 1.0])
    box = Boxes(
        pose[None, :3, 3].copy(),
        np.array([[2.0, 4.5, 1.6]]),
        pose[None, :3, :3].copy(),
        ("vehicle.car",),
        ("a",),
        ("a",),
        np.full((1, 2), np.nan),
        np.full(1, -1),
    )
    model = camera(width=960, height=540)
    cam_from_street = inverse(street_from_ego(0) @ model.ego_from_cam)
    uv, _ = model.project(apply(cam_from_street, box.corners()[0]))
    hull = cv2.convexHull(uv.astype(np.float32))
    rows, columns = np.mgrid[:540, :960]
    inside = np.array(
        [
            cv2.pointPolygonTest(hull, (float(u), float(v)), True)
            for u, v in zip(columns.ravel(), rows.ravel(), strict=True)
        ]
    ).reshape(540, 960)
    image = np.where(inside > -1.0, 255, 0).astype(np.uint8)[..., None].repeat(3, axis=2)
    view = View(Path("unused"), model, inverse(cam_from_street), box, 0)
    found = box_pixels(image, view, box, 0, None)
    assert len(found.rgb) > 1000
    assert (found.rgb == 255).all()


# In datasets --------------------------------------------------------------------------------------------------------


@BOTH
def test_an_oncoming_car_does_not_hide_itself(tmp_path: Path, paint_name: Paint) -> None:
    """The image is 0.1 s older than the sweep, in which the car is 2 m nearer."""
    plan = Plan(lambda t: [car(14 - 20 * t, 2, RED, "a")], samples=2, cameras=("CAM_FRONT",), camera_delay_s=-0.1)
    dataset = make(tmp_path, plan)
    sample = gather(dataset, dataset.scenes[0]).samples[0]
    colours, area = paint_sample(sample, np.ones(1, np.bool_), paint_name)
    assert area[0] > 0
    assert within_bin(colours[0], RED)
    every = sum(box_pixels(*_one(view), view.boxes_world, 0, None).area_px for view in sample.views)
    assert area[0] > 0.95 * every


def _one(view: View) -> tuple[ByteArray, View]:
    return read_image(view.path), view


@BOTH
def test_a_sample_without_lidar_is_painted_by_boxes_alone(tmp_path: Path, paint_name: Paint) -> None:
    dataset = make(tmp_path, Plan(lambda t: [car(10, 2, BLUE, "a")], samples=1, with_lidar=()))
    colours, area = paint_sample(gather(dataset, dataset.scenes[0]).samples[0], np.ones(1, np.bool_), paint_name)
    assert area[0] > 0
    assert within_bin(colours[0], BLUE)


def test_one_colour_an_object_over_time(tmp_path: Path) -> None:
    plan = Plan(lambda t: [car(10, 2, RED, "a"), car(-9, 2, BLUE, "b")], samples=3)
    dataset = make(tmp_path, plan)
    samples = gather(dataset, dataset.scenes[0]).samples
    near, glint, hidden = [200, 0, 0], [255, 255, 255], [0, 0, 0]
    views = [([near, hidden], [900.0, 0.0]), ([[196, 2, 1], hidden], [400.0, 0.0]), ([glint, hidden], [800.0, 0.0])]
    painted = [Painted(np.array(rgb, np.uint8), np.array(area)) for rgb, area in views]
    for own in pool_over_time(samples, painted):
        assert own.rgb.tolist() == [near, hidden]  # the glint counts, but lies far from the others
        assert own.area_px.tolist() == [2100.0, 0.0]  # what was never seen stays unknown


def test_without_boxes_there_is_nothing_to_pool(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(lambda t: [], samples=1))
    samples = gather(dataset, dataset.scenes[0]).samples
    pooled = pool_over_time(samples, [Painted(np.zeros((0, 3), np.uint8), np.zeros(0))])
    assert pooled[0].rgb.shape == (0, 3)


def test_a_damaged_image(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(lambda t: [], samples=1))
    sample = gather(dataset, dataset.scenes[0]).samples[0]
    sample.views[0].path.write_bytes(b"no image")
    with pytest.raises(DataError, match=r"CAM_BACK.*\.png: not a readable image"):
        paint_sample(sample, np.zeros(0, np.bool_), "robust")


# Over a scene -------------------------------------------------------------------------------------------------------


def over_time(*samples: dict[str, tuple[tuple[int, int, int], float]]) -> list[dict[str, tuple[list[int], float]]]:
    """What becomes of the colours and areas of some objects, by name and sample."""
    inputs, painted = [], []
    for objects in samples:
        every = boxes(*(car(10 * i, 0, RED, name) for i, name in enumerate(objects)))
        inputs.append(SampleInput("t", 0, np.eye(4), every, (), None))
        rgb, area = np.array([o[0] for o in objects.values()], np.uint8), np.array([o[1] for o in objects.values()])
        painted.append(Painted(rgb.reshape(-1, 3), area.astype(np.float64)))
    pooled = pool_over_time(inputs, painted)
    return [
        {name: (rgb.tolist(), float(area)) for name, rgb, area in zip(i.boxes_world.instance, *p, strict=True)}
        for i, p in zip(inputs, pooled, strict=True)
    ]


def test_an_object_has_one_colour_in_all_samples() -> None:
    red, glare = (200, 30, 30), (255, 250, 250)
    first, second, third = over_time(
        {"a": (red, 100.0), "b": (BLUE, 10.0)}, {"a": (glare, 150.0)}, {"b": (BLUE, 5.0), "a": (red, 90.0)}
    )
    assert first["a"] == second["a"] == third["a"] == (list(red), 340.0)
    assert first["b"] == third["b"] == (list(BLUE), 15.0)


def test_an_object_keeps_its_colour_where_it_is_hidden() -> None:
    hidden, seen_later = over_time({"a": ((0, 0, 0), 0.0)}, {"a": (RED, 50.0)})
    assert hidden == seen_later == {"a": (list(RED), 50.0)}


def test_an_object_that_is_never_seen_stays_unknown() -> None:
    assert over_time({"a": ((0, 0, 0), 0.0)}, {}, {"a": ((0, 0, 0), 0.0)}) == [
        {"a": ([0, 0, 0], 0)},
        {},
        {"a": ([0, 0, 0], 0)},
    ]

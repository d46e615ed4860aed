from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_street import BLUE, GREEN, RED, Plan, Solid, beams, camera, car, make, photograph, scan, street_from_ego

from appocc.boxes import Boxes
from appocc.checks import BoolArray, ByteArray
from appocc.colours import lab_from_rgb
from appocc.errors import DataError
from appocc.files import read_image, write_image
from appocc.geometry import apply, inverse, transform
from appocc.groundtruth.bodywork import BodyworkSamples
from appocc.groundtruth.inputs import PosedImage, SampleInput, gather_inputs
from appocc.groundtruth.painting import (
    BoxColours,
    BoxPixels,
    BoxView,
    PaintMethod,
    bodywork_by_box,
    box_pixels,
    histogram_mode,
    mode_colours,
    robust_colours,
)
from appocc.groundtruth.visibility import DepthImage

BOTH = pytest.mark.parametrize("paint_name", ["mode", "robust"])


def pixels(rgb: object, height: object = 0.5) -> BoxPixels:
    colours = np.array(rgb, dtype=np.uint8).reshape(-1, 3)
    heights = np.broadcast_to(np.asarray(height, np.float64), len(colours)).copy()
    return BoxPixels(colours, heights, 1.0)


# The paper's mode ---------------------------------------------------------------------------------------------------


def test_mode_is_the_fullest_of_25_bins_of_length_10() -> None:
    # Red: 40..49 holds four values, though 131 is the single value that comes most often.
    red = [40, 43, 46, 49, 131, 131, 131, 200, 50]
    # Green: bins begin at multiples of ten: 19 and 20 lie apart. Blue: 250..255 belong to the last bin, 240..249.
    green = [19, 20, 21, 29, 10, 18, 30, 31, 99]
    blue = [255, 250, 241, 249, 239, 238, 237, 0, 0]
    assert histogram_mode(pixels(np.column_stack([red, green, blue]))).tolist() == [45, 15, 245]


def test_mode_takes_each_channel_for_itself() -> None:
    rgb = [(205, 5, 5)] * 4 + [(5, 105, 5)] * 4 + [(205, 105, 5)] * 1
    assert histogram_mode(pixels(rgb)).tolist() == [205, 105, 5]


@pytest.mark.parametrize("value", [0, 9, 10, 99, 128, 239, 240, 250, 255])
def test_mode_of_one_colour_is_its_bin(value: int) -> None:
    assert histogram_mode(pixels([(value,) * 3] * 20)).tolist() == [min(value // 10, 24) * 10 + 5] * 3


# In pictures --------------------------------------------------------------------------------------------------------


def boxes(*solids: Solid) -> Boxes:
    """Boxes of solids, in the street frame."""
    low, high = (np.array([getattr(solid, end) for solid in solids]).reshape(-1, 3) for end in ("low", "high"))
    n = len(solids)
    names = tuple(solid.name for solid in solids)
    turns = np.tile(np.eye(3), (n, 1, 1))
    category = tuple(solid.category for solid in solids)
    nan, minus = np.full((n, 2), np.nan), np.full(n, -1)
    return Boxes(
        centre_m=(low + high) / 2,
        size_wlh_m=(high - low)[:, [1, 0, 2]],
        rotation=turns,
        category=category,
        instance=names,
        token=names,
        velocity_mps=nan,
        lidar_points=minus,
    )


def seen(every: list[Solid], annotated: list[Solid], channel: str = "CAM_FRONT") -> tuple[ByteArray, PosedImage]:
    """A photograph of a street and the view that belongs to it."""
    model = camera(channel)
    pose = street_from_ego(0) @ model.ego_from_cam
    return photograph(model, pose, every), PosedImage(Path("unused"), model, pose, boxes(*annotated), 0)


def pixels_of(image: ByteArray, view: PosedImage, every: Boxes, target: int, depth: DepthImage | None) -> BoxPixels:
    """The pixels of a photograph that show a box."""
    return box_pixels(BoxView.project(image, view.camera, view.world_from_cam, every), target, depth)


def painted_of(sample: SampleInput, wanted: BoolArray, how: PaintMethod) -> BoxColours:
    """A sample by itself."""
    return (
        mode_colours(sample, wanted)
        if how == "mode"
        else robust_colours([sample], [bodywork_by_box(sample, wanted, {})])[0]
    )


def sample_of(folder: Path, pictures: list[tuple[ByteArray, PosedImage]], every: Boxes) -> SampleInput:
    """A sample without a sweep, its pictures in a folder."""
    views = []
    for image, view in pictures:
        path = folder / f"{view.camera.channel}.png"
        write_image(path, image)
        views.append(replace(view, path=path))
    return SampleInput("t", 0, np.eye(4), every, tuple(views), None)


def paint(folder: Path, every: list[Solid], annotated: list[Solid], how: PaintMethod) -> BoxColours:
    sample = sample_of(folder, [seen(every, annotated)], boxes(*annotated))
    return painted_of(sample, np.ones(len(annotated), np.bool_), how)


def within_bin(rgb: ByteArray, expected: tuple[int, int, int]) -> bool:
    return bool((np.abs(rgb.astype(int) - expected) <= 5).all())


@BOTH
def test_cars_are_painted_in_their_own_colour(tmp_path: Path, paint_name: PaintMethod) -> None:
    street = [car(10, 2, RED, "a"), car(12, -4, BLUE, "b")]
    colours, known = paint(tmp_path, street, street, paint_name)
    assert known.all()
    assert within_bin(colours[0], RED)
    assert within_bin(colours[1], BLUE)


@BOTH
def test_a_car_behind_another_is_painted_from_its_visible_part(tmp_path: Path, paint_name: PaintMethod) -> None:
    # The blue one covers all but a strip of the red one.
    red, blue = car(16, -2.2, RED, "red"), car(9, -0.7, BLUE, "blue")
    image, view = seen([red, blue], [red, blue])
    share = len(pixels_of(image, view, view.boxes_world, 0, None).rgb) / len(
        pixels_of(image, view, boxes(red), 0, None).rgb
    )
    assert 0.05 < share < 0.5
    colours, known = paint(tmp_path, [red, blue], [red, blue], paint_name)
    assert known.tolist() == [True, True]
    assert within_bin(colours[0], RED)
    assert within_bin(colours[1], BLUE)


@BOTH
def test_a_car_that_another_covers_is_unknown(tmp_path: Path, paint_name: PaintMethod) -> None:
    red, blue = car(16, -1, RED, "red"), Solid((6, -3, 0), (8, 1, 2.5), BLUE, "vehicle.truck", "blue")
    colours, known = paint(tmp_path, [red, blue], [red, blue], paint_name)
    assert known.tolist() == [False, True]
    assert colours[0].tolist() == [0, 0, 0]


@BOTH
def test_cars_that_no_camera_sees_are_unknown(tmp_path: Path, paint_name: PaintMethod) -> None:
    behind, aside, tiny = car(-10, 0, RED, "a"), car(3, 9, RED, "b"), car(150, 0, RED, "c")
    _, known = paint(tmp_path, [behind, aside, tiny], [behind, aside, tiny], paint_name)
    assert known.tolist() == [False, False, False]


@BOTH
def test_without_images_all_are_unknown(paint_name: PaintMethod) -> None:
    sample = SampleInput("t", 0, np.eye(4), boxes(*[car(10, 2, RED, name) for name in "abc"]), (), None)
    assert painted_of(sample, np.ones(3, np.bool_), paint_name).known.tolist() == [False] * 3


@BOTH
def test_only_the_wanted_are_painted(tmp_path: Path, paint_name: PaintMethod) -> None:
    street = [car(10, 2, RED, "a"), car(12, -4, BLUE, "b")]
    sample = sample_of(tmp_path, [seen(street, street)], boxes(*street))
    assert painted_of(sample, np.array([False, True]), paint_name).known.tolist() == [False, True]


def test_cameras_colours_are_evened_out(tmp_path: Path) -> None:
    street = [car(10, 2, (120, 120, 120), "a")]
    sample = sample_of(tmp_path, [seen(street, street)], boxes(*street))
    every = np.ones(1, np.bool_)
    for gains, expected in (({"CAM_FRONT": np.array([1.1, 1.0, 0.9])}, [132, 120, 108]), ({}, [120, 120, 120])):
        (painted,) = robust_colours([sample], [bodywork_by_box(sample, every, gains)])
        assert painted.rgb[0].tolist() == expected


@BOTH
def test_all_views_count_together(tmp_path: Path, paint_name: PaintMethod) -> None:
    """Left and front camera each see an end of the car; the colour is that of the end that is seen more of."""
    street = [car(4.5, 3.2, RED, "a")]
    pictures = [seen(street, street), seen(street, street, "CAM_LEFT")]
    every = [pixels_of(image, view, view.boxes_world, 0, None) for image, view in pictures]
    assert min(len(own.rgb) for own in every) > 12
    few = int(np.argmin([len(own.rgb) * own.sample_px for own in every]))
    pictures[few] = (np.full_like(pictures[few][0], 77), pictures[few][1])
    colours, _known = painted_of(sample_of(tmp_path, pictures, boxes(*street)), np.ones(1, np.bool_), paint_name)
    assert within_bin(colours[0], RED)


def test_lidar_points_in_front_of_a_car_occlude_it() -> None:
    """A wall that nobody annotated covers the car's lower half."""
    red, wall = car(14, -1, RED, "a"), Solid((10, -4, 0), (10.2, 2, 1.0), GREEN)
    image, view = seen([red, wall], [red])
    y, z = np.meshgrid(np.linspace(-4, 2, 200), np.linspace(0.02, 1.0, 50))
    on_wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    depth = DepthImage(apply(inverse(view.world_from_cam), on_wall), view.camera)
    without = pixels_of(image, view, view.boxes_world, 0, None)
    with_depth = pixels_of(image, view, view.boxes_world, 0, depth)
    assert (without.rgb == GREEN).all(axis=1).sum() > 50
    assert (with_depth.rgb == RED).all(axis=1).mean() > 0.95
    assert len(with_depth.rgb) > 50


def swept(view: PosedImage, solids: list[Solid]) -> DepthImage:
    """What a fine LiDAR sees of a street, as a camera's depth picture."""
    points, _ = scan(np.array([0.9, -1.0, 1.84]), solids, beams(np.linspace(-30, 8, 300), 2000))
    return DepthImage(apply(inverse(view.world_from_cam), points), view.camera)


def test_a_car_is_seen_past_the_corner_of_a_box_that_is_too_large() -> None:
    """Another car fills the lower half of its own box only; LiDAR points on the car behind it tell."""
    red, low = car(16, -1, RED, "red"), Solid((8, -2, 0), (12, 0, 0.6), BLUE, "vehicle.car", "low")
    large = Solid((8, -2, 0), (12, 0, 2.0), BLUE, "vehicle.car", "low")
    image, view = seen([red, low], [red, large])
    without, found = (pixels_of(image, view, view.boxes_world, 0, own) for own in (None, swept(view, [red, low])))
    assert len(without.rgb) < 12
    assert len(found.rgb) > 100
    assert (found.rgb == RED).all(axis=1).mean() > 0.95


def test_pixels_with_lidar_depth_beyond_a_box_are_not_the_car() -> None:
    """The box is much too wide; beside the car the LiDAR sees the wall behind it."""
    red, wall = car(12, -1, RED, "a"), Solid((30, -20, 0), (31, 20, 8), GREEN)
    wide = Solid((10, -4, 0), (14, 2, 1.5), RED, "vehicle.car", "a")
    image, view = seen([red, wall], [wide])
    without, found = (pixels_of(image, view, view.boxes_world, 0, own) for own in (None, swept(view, [red, wall])))
    # The road inside the box lies in it, but low.
    before, after = ((own.rgb[own.height > 0.2] == RED).all(axis=1) for own in (without, found))
    assert before.mean() < 0.7
    assert after.mean() > 0.9
    assert after.sum() > 0.9 * before.sum()


def test_heights_are_those_of_the_box() -> None:
    red = car(10, -1, RED, "a")
    image, view = seen([red], [red])
    found = pixels_of(image, view, view.boxes_world, 0, None)
    assert found.height.min() > -1e-9
    assert found.height.max() < 1 + 1e-9
    assert found.height.min() < 0.05
    assert found.height.max() > 0.95
    assert (found.rgb == RED).all()


@pytest.mark.parametrize("distance", [8.0, 14.0, 30.0])
def test_the_area_is_that_in_the_picture(distance: float) -> None:
    red, blue = car(distance, -1.5, RED, "a"), car(distance - 2.2, 1.5, BLUE, "b")
    image, view = seen([red, blue], [red, blue])
    found = pixels_of(image, view, view.boxes_world, 0, None)
    assert len(found.rgb) * found.sample_px == pytest.approx((image == RED).all(axis=2).sum(), rel=0.12)


def test_a_turned_and_tilted_box_is_hit_where_it_is() -> None:
    """Pixels of a box in a picture in which only that box is white: all of them, and none beside it."""
    pose = transform(np.array([0.95, 0.05, 0.1, 0.3]), [12.0, 1.0, 1.0])
    box = Boxes(
        centre_m=pose[None, :3, 3].copy(),
        size_wlh_m=np.array([[2.0, 4.5, 1.6]]),
        rotation=pose[None, :3, :3].copy(),
        category=("vehicle.car",),
        instance=("a",),
        token=("a",),
        velocity_mps=np.full((1, 2), np.nan),
        lidar_points=np.full(1, -1),
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
    view = PosedImage(Path("unused"), model, inverse(cam_from_street), box, 0)
    found = pixels_of(image, view, box, 0, None)
    assert len(found.rgb) > 1000
    assert (found.rgb == 255).all()


# In datasets --------------------------------------------------------------------------------------------------------


@BOTH
def test_an_oncoming_car_is_painted_where_the_images_show_it(tmp_path: Path, paint_name: PaintMethod) -> None:
    """They are stamped 0.1 s, or 2 m, before the sweep; a green wall stands behind the car."""
    wall = Solid((19.0, -6.0, 0.0), (20.0, 8.0, 5.0), GREEN)
    plan = Plan(
        lambda t: [car(14 - 20 * t, 2, RED, "a"), wall], samples=2, cameras=("CAM_FRONT",), camera_delay_s=-0.1
    )
    dataset = make(tmp_path, plan)
    sample = gather_inputs(dataset, dataset.scenes[0]).samples[0]
    colours, known = painted_of(sample, np.ones(1, np.bool_), paint_name)
    assert known[0]
    assert within_bin(colours[0], RED)
    (view,) = sample.views
    found = pixels_of(read_image(view.path), view, view.boxes_world, 0, None)
    assert (found.rgb == RED).all(axis=1).mean() > 0.98


@BOTH
def test_a_sample_without_lidar_is_painted_by_boxes_alone(tmp_path: Path, paint_name: PaintMethod) -> None:
    dataset = make(tmp_path, Plan(lambda t: [car(10, 2, BLUE, "a")], samples=1, with_lidar=()))
    sample = gather_inputs(dataset, dataset.scenes[0]).samples[0]
    colours, known = painted_of(sample, np.ones(1, np.bool_), paint_name)
    assert known[0]
    assert within_bin(colours[0], BLUE)


@BOTH
def test_a_damaged_image(tmp_path: Path, paint_name: PaintMethod) -> None:
    dataset = make(tmp_path, Plan(lambda t: [], samples=1))
    sample = gather_inputs(dataset, dataset.scenes[0]).samples[0]
    sample.views[0].path.write_bytes(b"no image")
    with pytest.raises(DataError, match=r"CAM_BACK.*\.png: not a readable image"):
        painted_of(sample, np.zeros(0, np.bool_), paint_name)


# Over a scene -------------------------------------------------------------------------------------------------------


def shown(rgb: tuple[int, int, int], area_px: float) -> list[BodyworkSamples]:
    """A picture that shows bodywork of one colour."""
    colours = np.array([rgb] * 20, np.uint8)
    return [BodyworkSamples(colours, lab_from_rgb(colours), area_px, True)]


def over_time(*samples: dict[str, list[BodyworkSamples]]) -> list[dict[str, list[int] | None]]:
    """The colours of some objects, by name and sample; None where it is unknown."""
    inputs = []
    for objects in samples:
        every = boxes(*(car(10 * i, 0, RED, name) for i, name in enumerate(objects)))
        inputs.append(SampleInput("t", 0, np.eye(4), every, (), None))
    painted = robust_colours(inputs, [list(objects.values()) for objects in samples])
    return [
        {name: rgb.tolist() if known else None for name, rgb, known in zip(objects, *own, strict=True)}
        for objects, own in zip(samples, painted, strict=True)
    ]


def test_an_object_has_one_colour_in_all_samples() -> None:
    shade, glare = (90, 92, 95), (255, 250, 250)
    first, second, third = over_time(
        {"a": shown(shade, 100.0), "b": shown(BLUE, 10.0)},
        {"a": shown(glare, 150.0)},
        {"b": shown(BLUE, 5.0), "a": shown(shade, 90.0)},
    )
    assert first["a"] == second["a"] == third["a"] == list(shade)  # the glare is the largest, but alone
    assert first["b"] == third["b"] == list(BLUE)


def test_an_object_keeps_its_colour_where_it_is_hidden() -> None:
    assert over_time({"a": []}, {"a": shown(RED, 50.0)}) == [{"a": list(RED)}] * 2


def test_an_object_that_is_never_seen_stays_unknown() -> None:
    assert over_time({"a": []}, {}, {"a": []}) == [{"a": None}, {}, {"a": None}]


def test_without_boxes_there_is_nothing_to_paint() -> None:
    (painted,) = robust_colours([SampleInput("t", 0, np.eye(4), boxes(), (), None)], [[]])
    assert painted.rgb.shape == (0, 3)

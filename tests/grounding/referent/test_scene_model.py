from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from street import BLUE, EGO, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.boxes import Boxes
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from grounding.describe import describe_motion, describe_object
from grounding.referent.scene import SceneModel, SceneObject, scene_from_boxes, scene_from_tracks
from tracking.detections import Detections
from tracking.tracker import Tracker
from tracking.tracks import Track


def made(**values: Any) -> SceneObject:
    """Make a vehicle of 4 m x 2 m at the ego's origin; the given values replace the defaults."""
    usual: dict[str, Any] = {"id": "x", "category": "", "centre_m": np.zeros(2), "yaw_rad": 0.0, "front_known": True}
    return SceneObject(**{**usual, "length_m": 4.0, "width_m": 2.0, **values})


def test_vehicles_on_the_grid_with_colours_of_the_map() -> None:
    street = Street().car("red", 10, -3, RED, yaw_rad=0.3, speed_mps=4.0).car("far", 45, 0)
    street.car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    (item,) = street.scene().objects
    assert item.id == "red"
    assert item.class_name == "car"
    assert item.centre_m == pytest.approx([10, -3])
    assert item.yaw_rad == pytest.approx(0.3)
    assert item.front_known
    assert (item.length_m, item.width_m, item.height_m) == pytest.approx((4.4, 1.8, 1.5))
    assert item.speed_mps == pytest.approx(4.0)
    assert item.rgb == pytest.approx(RED)
    assert item.distance_m(EGO) == pytest.approx(np.hypot(8.7, 3.0))


def test_a_colour_that_the_map_lacks_is_unknown() -> None:
    scene = Street().car("dark", 10, -3, None).scene()
    assert scene.objects[0].rgb is None
    assert scene.colour_name(scene.objects[0]) is None


def test_instances_of_a_map_have_an_unknown_front() -> None:
    scene = Street().car("a", 12, -3, RED).car("b", -10, 4, WHITE).car("ego", 1.3, 0, BLUE).scene_without_boxes()
    assert len(scene.objects) == 2
    red = max(scene.objects, key=lambda item: item.centre_m[0])
    assert red.id.startswith("blob")
    assert red.centre_m == pytest.approx([12, -3], abs=0.3)
    assert red.length_m == pytest.approx(4.4, abs=0.5)
    assert not red.front_known
    assert red.speed_mps is None
    assert red.class_name == "vehicle"
    assert red.rgb == pytest.approx(RED, abs=2)


def test_annotations_without_vehicles_override_the_map() -> None:
    street = Street().car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(1.8, 1.8, 1.8))
    assert street.scene().objects == ()
    assert len(street.scene_without_boxes().objects) == 1


def test_a_scene_without_vehicles() -> None:
    assert Street().scene().objects == ()


def test_world_positions_and_headings() -> None:
    scene = Street().scene()
    assert scene.world_xy([10.0, 2.0]) == pytest.approx([98.0, 60.0])
    assert scene.world_heading(0.0) == pytest.approx(np.pi / 2)
    assert scene.world_heading(0.25) == pytest.approx(np.pi / 2 + 0.25)


def test_footprint_and_covers_agree() -> None:
    corners = np.array([[2, 1], [2, -3], [4, -3], [4, 1]])
    item = made(centre_m=np.array([3.0, -1.0]), yaw_rad=np.pi / 2, front_known=False)
    assert item.footprint() == pytest.approx(corners)
    assert item.covers(corners * 0.999 + np.array([3.0, -1.0]) * 0.001).all()
    assert not item.covers(np.array([[3.0, 1.2], [4.2, -1.0]])).any()
    assert item.covers(np.array([[3.0, 1.2], [4.2, -1.0]]), 0.3).all()


@pytest.mark.parametrize(
    ("category", "noun"),
    [
        ("vehicle.car", "car"),
        ("vehicle.bus.rigid", "bus"),
        ("vehicle.emergency.ambulance", "ambulance"),
        ("vehicle.construction", "construction vehicle"),
        ("truck", "truck"),
        ("other_vehicle", "vehicle"),
        ("vehicle.emergency", "emergency"),
        ("vehicle.construction.crane", "construction vehicle"),
        ("human.pedestrian.child", "person"),
        ("pedestrian", "person"),
        ("vehicle.bicycle", "bicycle"),
        ("", "vehicle"),
    ],
)
def test_class_names(category: str, noun: str) -> None:
    assert made(category=category).class_name == noun


def test_shapes_are_checked() -> None:
    with pytest.raises(ShapeError, match="object centre_m"):
        made(centre_m=np.zeros(3))
    with pytest.raises(ShapeError, match="object rgb"):
        made(rgb=np.zeros(4))
    with pytest.raises(ShapeError, match="world_from_ego"):
        SceneModel(Street().bev(), (), np.zeros((4, 4)))


def test_arrays_of_the_caller_are_copied() -> None:
    centre_m, rgb = np.array([3.0, -1.0]), np.array([10.0, 20.0, 30.0])
    item = made(centre_m=centre_m, rgb=rgb)
    centre_m[0], rgb[0] = 7.0, 99.0
    assert item.centre_m.tolist() == [3.0, -1.0]
    assert item.rgb is not None
    assert item.rgb.tolist() == [10.0, 20.0, 30.0]
    with pytest.raises(ValueError, match="read-only"):
        item.centre_m[0] = 5.0


def test_objects_are_equal_only_to_themselves() -> None:
    one, other = made(), made()
    assert one == one
    assert one != other
    assert {one: "a", other: "b"}[other] == "b"
    scene = Street().car("a", 12, -3, RED).scene()
    assert scene == scene
    assert len({scene, replace(scene)}) == 2


def test_a_front_grid_holds_only_what_is_ahead() -> None:
    street = Street(BEVGrid.front()).car("ahead", 10, 0).car("behind", -10, 0)
    assert [item.id for item in street.scene().objects] == ["ahead"]


# Tracks -------------------------------------------------------------------------------------------------------------


def track(number: int, x_m: float, y_m: float, **more: Any) -> Track:
    """Make a track from a position in the ego frame; the ego is at (100, 50) and heads along world +y."""
    known: dict[str, Any] = {
        "velocity_world_mps": np.zeros(2),
        "yaw_world_rad": np.pi / 2,
        "heading_known": True,
        "length_m": 4.5,
        "width_m": 1.8,
        "rgb": np.full(3, np.nan),
        "score": 0.9,
        "seen": True,
    }
    return Track(id=number, position_world_m=np.array([100.0 - y_m, 50.0 + x_m, 0.0]), **(known | more))


def test_tracks_in_the_ego_frame() -> None:
    moving = track(3, 12, -3, velocity_world_mps=np.array([0.0, 7.0]), moving=True, kind="bus", height_m=3.0)
    red = track(4, 20, 4, rgb=np.array(RED, dtype=np.float64), yaw_world_rad=-np.pi / 2)
    one, other = scene_from_tracks(None, [moving, red], WORLD_FROM_EGO).objects
    assert (one.id, one.class_name, one.front_known, one.height_m, one.rgb) == ("track 3", "bus", True, 3.0, None)
    assert one.centre_m == pytest.approx([12, -3])
    assert one.yaw_rad == pytest.approx(0)
    assert one.velocity_mps == pytest.approx([7, 0])
    assert (one.yaw_rate_radps, one.acceleration_mps2) == (None, None)
    assert other.rgb == pytest.approx(RED)
    assert other.speed_mps == 0
    assert abs(other.yaw_rad) == pytest.approx(np.pi)
    assert other.height_m is None


def test_tracks_are_limited_to_the_grid_of_the_map() -> None:
    tracks = [
        track(1, 12, -3),
        track(2, 60, 0),
        track(3, 150, 0),
        track(4, 1.5, 0),
        track(5, 9, 5, kind="pedestrian"),
    ]
    with_map = scene_from_tracks(Street().bev(), tracks, WORLD_FROM_EGO)
    assert [item.id for item in with_map.objects] == ["track 1"]
    assert [item.id for item in with_map.others] == ["track 5"]
    assert with_map.others[0].class_name == "person"
    assert [item.id for item in scene_from_tracks(None, tracks, WORLD_FROM_EGO).objects] == ["track 1", "track 2"]


def test_a_track_of_unknown_class() -> None:
    (item,) = scene_from_tracks(None, [track(1, 12, -3, kind="vehicle")], WORLD_FROM_EGO).objects
    assert (item.category, item.class_name) == ("", "vehicle")


def test_motion_gives_the_heading() -> None:
    backwards = np.array([0.0, -6.0])
    given = track(1, 12, 3, velocity_world_mps=backwards, moving=True, heading_known=False)
    (item,) = scene_from_tracks(None, [given], WORLD_FROM_EGO).objects
    assert item.front_known
    assert abs(item.yaw_rad) == pytest.approx(np.pi)


@pytest.mark.parametrize(("neighbour_deg", "known", "yaw_deg"), [(90, True, 0), (-90, True, 180), (0, False, 0)])
def test_a_row_gives_unknown_headings(neighbour_deg: float, known: bool, yaw_deg: float) -> None:
    unknown = track(1, 12, -5, heading_known=False)
    tracks = [unknown, track(2, 20, -5.3, yaw_world_rad=np.radians(neighbour_deg)), track(3, 20, 8)]
    item = scene_from_tracks(None, tracks, WORLD_FROM_EGO).objects[0]
    assert item.front_known is known
    assert abs(np.degrees(item.yaw_rad)) == pytest.approx(yaw_deg, abs=1e-6)


def test_a_row_with_both_headings_gives_none() -> None:
    tracks = [track(1, 12, -5, heading_known=False), track(2, 18, -5), track(3, 6, -5, yaw_world_rad=-np.pi / 2)]
    assert not scene_from_tracks(None, tracks, WORLD_FROM_EGO).objects[0].front_known


def test_yaw_rates_and_accelerations_from_earlier_tracks() -> None:
    before = [track(1, 10, 0, velocity_world_mps=np.array([0.0, 8.0]), moving=True, yaw_world_rad=np.pi / 2 - 0.2)]
    now = [track(1, 14, 0, velocity_world_mps=np.array([0.0, 6.0]), moving=True), track(2, 9, -5)]
    one, new = scene_from_tracks(None, now, WORLD_FROM_EGO, before, 0.5).objects
    assert one.yaw_rate_radps == pytest.approx(0.4)
    assert one.acceleration_mps2 == pytest.approx(-4)
    assert (new.yaw_rate_radps, new.acceleration_mps2) == (None, None)


def test_an_uncertain_velocity_is_unknown() -> None:
    given = track(1, 12, -3, velocity_world_mps=np.array([0.0, 2.5]), velocity_known=False)
    assert scene_from_tracks(None, [given], WORLD_FROM_EGO).objects[0].velocity_mps is None


def test_a_car_that_was_detected_once_may_stand_or_move() -> None:
    tracker, told = Tracker(), []
    street = Street().car("a", 12, -4, RED)
    for moment in range(3):
        tracks = tracker.update(Detections.from_bev(street.bev()), 500_000 * moment, WORLD_FROM_EGO)
        scene = scene_from_tracks(street.bev(), tracks, WORLD_FROM_EGO)
        told.append((scene.objects[0].is_standing, describe_motion(scene.objects[0])))
    assert told[0] == (None, "speed not known")
    assert told[-1] == (True, "standing")


def test_tracks_of_the_tracker_make_a_scene() -> None:
    tracker = Tracker()
    street = Street().car("a", 12, -4, RED).car("b", 22, 4, WHITE)
    for moment in range(4):
        tracks = tracker.update(Detections.from_bev(street.bev()), 500_000 * moment, WORLD_FROM_EGO)
    scene = scene_from_tracks(street.bev(), tracks, WORLD_FROM_EGO)
    assert len(scene.objects) == 2
    assert {item.speed_mps for item in scene.objects} == {0}
    assert sorted(round(float(item.centre_m[0])) for item in scene.objects) == [12, 22]


# Object table ------------------------------------------------------------------------------------------------------


def test_people_and_bicycles_are_separate_from_vehicles() -> None:
    street = Street().car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    scene = street.car("bike", 9, 4, category="vehicle.bicycle", size_wlh_m=(0.6, 1.7, 1.5)).car("car", 15, 0).scene()
    assert [item.id for item in scene.objects] == ["car"]
    assert [item.id for item in scene.others] == ["walker", "bike"]
    assert scene.table.class_names == ("car", "person", "bicycle")
    assert scene.table.is_vehicle.tolist() == [True, False, False]


def test_people_have_a_colour_where_the_map_has_one_for_them_and_no_vehicle_is() -> None:
    person = {"category": "human.pedestrian.adult", "size_wlh_m": (0.6, 0.6, 1.8)}
    street = Street().car("car", 15, 0, RED).car("walker", 5, 5, BLUE, **person)  # type: ignore[arg-type]
    street.car("leaning", 15, 0.5, RED, **person)  # type: ignore[arg-type]
    scene = street.scene()
    colours = {item.id: scene.colour_name(item) for item in scene.others}
    assert colours == {"walker": "blue", "leaning": None}
    walker = next(item for item in scene.others if item.id == "walker")
    assert describe_object(walker, scene).startswith("person in blue 6 m away")


def test_boxes_without_a_map() -> None:
    boxes = Street().car("a", 55, 3, RED, speed_mps=3).boxes()
    scene = scene_from_boxes(None, boxes, WORLD_FROM_EGO)
    assert scene.objects[0].rgb is None
    assert scene.objects[0].speed_mps == pytest.approx(3)
    assert scene_from_boxes(None, Boxes.empty(), WORLD_FROM_EGO).objects == ()


def test_unknown_values_are_nan() -> None:
    table = Street().car("a", 12, -3, None).scene_without_boxes().table
    assert len(table) == 1
    assert np.isnan([*table.velocity_mps[0], *table.rgb[0], table.size_m[0, 2], table.yaw_rate_radps[0]]).all()
    assert np.isnan(table.speed_mps).all()
    assert not table.front_known.any()


def test_offsets_along_and_across_the_ego_lane() -> None:
    table = Street().car("a", 12, -3, speed_mps=5).car("b", 25, 4, yaw_rad=np.pi).scene().table
    assert table.along_m == pytest.approx([12, 25], abs=0.1)
    assert table.lateral_m == pytest.approx([-3, 4], abs=0.1)
    assert np.abs(table.relative_heading_rad) == pytest.approx([0, np.pi], abs=0.02)


@pytest.mark.parametrize(
    ("hider", "share"),
    [
        (("vehicle.car", (1.8, 4.4, 1.5), 16.0, 0.0), 0.0),
        (("vehicle.car", (1.8, 4.4, 1.5), 16.0, 0.8), 0.4),
        (("vehicle.car", (1.8, 4.4, 1.5), 30.0, 0.0), 1.0),
        (("human.pedestrian.adult", (1.8, 4.4, 1.5), 16.0, 0.0), 1.0),
        (("vehicle.car", (1.8, 4.4, 0.8), 16.0, 0.0), 1.0),
    ],
)
def test_nearer_vehicles_occlude_others(
    hider: tuple[str, tuple[float, float, float], float, float], share: float
) -> None:
    category, size, x_m, y_m = hider
    street = Street().car("hidden", 24, 0).car("hider", x_m, y_m, category=category, size_wlh_m=size)
    scene = street.scene()
    row = [item.id for item in scene.table.items].index("hidden")
    assert scene.table.visible_share[row] == pytest.approx(share)


def test_an_empty_table() -> None:
    table = Street().scene().table
    assert len(table) == 0
    assert table.visible_share.shape == table.speed_mps.shape == table.distance_m.shape == (0,)
    assert table.corners_m.shape == (0, 4, 2)


def test_colours_are_those_of_neutral_light() -> None:
    street = Street().car("sun", 12, -4, (120, 120, 120)).car("shade", 12, 4, (55, 55, 55))
    # The left half of the road is in shade.
    street.appearance[:, :, 100:] = np.where(street.occupancy[1][:, 100:], street.appearance[:, :, 100:], 40)
    scene = street.scene()
    sun, shade = (scene.paint_rgb[[item.id for item in scene.objects].index(name), 0] for name in ("sun", "shade"))
    assert shade / sun > 1.3 * 55 / 120
    bare = SceneModel(None, scene.objects, WORLD_FROM_EGO)
    assert bare.paint_rgb == pytest.approx(bare.table.rgb)


def test_the_road_is_computed_once_and_only_from_a_map() -> None:
    scene = Street().car("a", 12, -4).scene()
    assert scene.road is scene.road
    assert scene.road is not None
    assert SceneModel(None, scene.objects, WORLD_FROM_EGO).road is None


def test_off_road_length_of_the_line_of_sight() -> None:
    table = Street().car("on", 20, 5).car("off", 2, 28).scene().table
    assert table.off_road_sight_m == pytest.approx([0, 20], abs=1)

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from street import BLUE, RED, WHITE, WORLD_FROM_EGO, Street

from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from grounding.referent.scene import Scene, SceneObject, scene_of, scene_of_tracks
from tracking.instances.instances import find_instances
from tracking.tracker import Tracker
from tracking.tracks import Track


def test_objects_are_the_vehicles_on_the_grid_with_colours_of_the_map() -> None:
    street = Street().car("red", 10, -3, RED, yaw_rad=0.3, speed_mps=4.0).car("far", 45, 0)
    street.car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    (item,) = street.scene().objects
    assert item.id == "red"
    assert item.noun == "car"
    assert item.centre_m == pytest.approx([10, -3])
    assert item.yaw_rad == pytest.approx(0.3)
    assert item.front_known
    assert (item.length_m, item.width_m, item.height_m) == pytest.approx((4.4, 1.8, 1.5))
    assert item.speed_mps == pytest.approx(4.0)
    assert item.rgb == pytest.approx(RED)
    assert item.distance_m == pytest.approx(np.hypot(8.7, 3.0))


def test_a_colour_the_map_does_not_know_stays_unknown() -> None:
    scene = Street().car("dark", 10, -3, None).scene()
    assert scene.objects[0].rgb is None
    assert scene.colour_name(scene.objects[0]) is None


def test_without_boxes_the_map_shows_blobs_whose_front_is_unknown() -> None:
    scene = Street().car("a", 12, -3, RED).car("b", -10, 4, WHITE).car("ego", 1.3, 0, BLUE).scene_without_boxes()
    assert len(scene.objects) == 2
    red = max(scene.objects, key=lambda item: item.centre_m[0])
    assert red.id.startswith("blob")
    assert red.centre_m == pytest.approx([12, -3], abs=0.3)
    assert red.length_m == pytest.approx(4.4, abs=0.5)
    assert not red.front_known
    assert red.speed_mps is None
    assert red.noun == "vehicle"
    assert red.rgb == pytest.approx(RED, abs=2)


def test_annotated_and_empty_is_empty_whatever_the_map_shows() -> None:
    street = Street().car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(1.8, 1.8, 1.8))
    assert street.scene().objects == ()
    assert len(street.scene_without_boxes().objects) == 1


def test_a_scene_without_vehicles_is_a_scene() -> None:
    assert Street().scene().objects == ()


def test_world_places_and_headings() -> None:
    scene = Street().scene()
    assert scene.world_xy([10.0, 2.0]) == pytest.approx([98.0, 60.0])
    assert scene.world_heading(0.0) == pytest.approx(np.pi / 2)
    assert scene.world_heading(0.25) == pytest.approx(np.pi / 2 + 0.25)


def test_footprint_and_covers_agree() -> None:
    corners = np.array([[2, 1], [2, -3], [4, -3], [4, 1]])
    item = SceneObject("x", "", np.array([3.0, -1.0]), np.pi / 2, False, 4.0, 2.0)
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
def test_nouns(category: str, noun: str) -> None:
    assert SceneObject("x", category, np.zeros(2), 0.0, True, 4.0, 2.0).noun == noun


def test_values_are_checked() -> None:
    with pytest.raises(ShapeError, match="object centre_m"):
        SceneObject("x", "", np.zeros(3), 0.0, True, 4.0, 2.0)
    with pytest.raises(ShapeError, match="object rgb"):
        SceneObject("x", "", np.zeros(2), 0.0, True, 4.0, 2.0, rgb=np.zeros(4))
    with pytest.raises(ShapeError, match="world_from_ego"):
        Scene(Street().bev(), (), np.zeros((4, 4)))


def test_a_front_grid_holds_only_what_is_ahead() -> None:
    street = Street(BEVGrid.front()).car("ahead", 10, 0).car("behind", -10, 0)
    assert [item.id for item in street.scene().objects] == ["ahead"]


# Tracks -------------------------------------------------------------------------------------------------------------


def track(number: int, x_m: float, y_m: float, **more: Any) -> Track:
    """A track by its place in the ego frame; the ego stands at (100, 50) and heads along world +y."""
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
    one, other = scene_of_tracks(None, [moving, red], WORLD_FROM_EGO).objects
    assert (one.id, one.noun, one.front_known, one.height_m, one.rgb) == ("track 3", "bus", True, 3.0, None)
    assert one.centre_m == pytest.approx([12, -3])
    assert one.yaw_rad == pytest.approx(0)
    assert one.velocity_mps == pytest.approx([7, 0])
    assert (one.yaw_rate_radps, one.acceleration_mps2) == (None, None)
    assert other.rgb == pytest.approx(RED)
    assert other.speed_mps == 0
    assert abs(other.yaw_rad) == pytest.approx(np.pi)
    assert other.height_m is None


def test_tracks_of_a_map_keep_to_its_grid() -> None:
    tracks = [
        track(1, 12, -3),
        track(2, 60, 0),
        track(3, 150, 0),
        track(4, 1.5, 0),
        track(5, 9, 5, kind="pedestrian"),
    ]
    with_map = scene_of_tracks(Street().bev(), tracks, WORLD_FROM_EGO)
    assert [item.id for item in with_map.objects] == ["track 1"]
    assert [item.id for item in with_map.others] == ["track 5"]
    assert with_map.others[0].noun == "person"
    assert [item.id for item in scene_of_tracks(None, tracks, WORLD_FROM_EGO).objects] == ["track 1", "track 2"]


def test_a_track_without_a_kind_has_only_a_shape() -> None:
    (item,) = scene_of_tracks(None, [track(1, 12, -3, kind="vehicle")], WORLD_FROM_EGO).objects
    assert (item.category, item.noun) == ("", "vehicle")


def test_motion_tells_the_front() -> None:
    backwards = np.array([0.0, -6.0])
    given = track(1, 12, 3, velocity_world_mps=backwards, moving=True, heading_known=False)
    (item,) = scene_of_tracks(None, [given], WORLD_FROM_EGO).objects
    assert item.front_known
    assert abs(item.yaw_rad) == pytest.approx(np.pi)


@pytest.mark.parametrize(("neighbour_deg", "known", "yaw_deg"), [(90, True, 0), (-90, True, 180), (0, False, 0)])
def test_a_row_tells_the_fronts_of_those_that_stand_in_it(neighbour_deg: float, known: bool, yaw_deg: float) -> None:
    unknown = track(1, 12, -5, heading_known=False)
    tracks = [unknown, track(2, 20, -5.3, yaw_world_rad=np.radians(neighbour_deg)), track(3, 20, 8)]
    item = scene_of_tracks(None, tracks, WORLD_FROM_EGO).objects[0]
    assert item.front_known is known
    assert abs(np.degrees(item.yaw_rad)) == pytest.approx(yaw_deg, abs=1e-6)


def test_a_row_that_disagrees_tells_nothing() -> None:
    tracks = [track(1, 12, -5, heading_known=False), track(2, 18, -5), track(3, 6, -5, yaw_world_rad=-np.pi / 2)]
    assert not scene_of_tracks(None, tracks, WORLD_FROM_EGO).objects[0].front_known


def test_what_changed_since_before() -> None:
    before = [track(1, 10, 0, velocity_world_mps=np.array([0.0, 8.0]), moving=True, yaw_world_rad=np.pi / 2 - 0.2)]
    now = [track(1, 14, 0, velocity_world_mps=np.array([0.0, 6.0]), moving=True), track(2, 9, -5)]
    one, new = scene_of_tracks(None, now, WORLD_FROM_EGO, before, 0.5).objects
    assert one.yaw_rate_radps == pytest.approx(0.4)
    assert one.acceleration_mps2 == pytest.approx(-4)
    # Seen for the first time: it may stand or move.
    assert new.velocity_mps is None
    assert scene_of_tracks(None, now, WORLD_FROM_EGO).objects[1].speed_mps == 0


def test_a_velocity_that_is_not_certain_is_unknown() -> None:
    given = track(1, 12, -3, velocity_world_mps=np.array([0.0, 2.5]))
    assert scene_of_tracks(None, [given], WORLD_FROM_EGO).objects[0].velocity_mps is None


def test_what_the_tracker_says_can_be_asked_about() -> None:
    tracker = Tracker()
    street = Street().car("a", 12, -4, RED).car("b", 22, 4, WHITE)
    for moment in range(4):
        tracks = tracker.update(find_instances(street.bev()).as_detections(), 500_000 * moment, WORLD_FROM_EGO)
    scene = scene_of_tracks(street.bev(), tracks, WORLD_FROM_EGO)
    assert len(scene.objects) == 2
    assert {item.speed_mps for item in scene.objects} == {0}
    assert sorted(round(float(item.centre_m[0])) for item in scene.objects) == [12, 22]


# Everything at once -------------------------------------------------------------------------------------------------


def test_people_and_bicycles_are_no_vehicles_and_yet_there() -> None:
    street = Street().car("walker", 5, 5, BLUE, category="human.pedestrian.adult", size_wlh_m=(0.6, 0.6, 1.8))
    scene = street.car("bike", 9, 4, category="vehicle.bicycle", size_wlh_m=(0.6, 1.7, 1.5)).car("car", 15, 0).scene()
    assert [item.id for item in scene.objects] == ["car"]
    assert [item.id for item in scene.others] == ["walker", "bike"]
    assert [item.rgb for item in scene.others] == [None, None]
    assert scene.crowd.kind == ("car", "person", "bicycle")
    assert scene.crowd.vehicle.tolist() == [True, False, False]


def test_boxes_without_a_map() -> None:
    boxes = Street().car("a", 55, 3, RED, speed_mps=3).boxes()
    scene = scene_of(None, boxes, WORLD_FROM_EGO)
    assert scene.objects[0].rgb is None
    assert scene.objects[0].speed_mps == pytest.approx(3)
    assert scene_of(None, None, WORLD_FROM_EGO).objects == ()


def test_unknown_values_are_nan() -> None:
    crowd = Street().car("a", 12, -3, None).scene_without_boxes().crowd
    assert len(crowd) == 1
    assert np.isnan([*crowd.velocity_mps[0], *crowd.rgb[0], crowd.size_m[0, 2], crowd.yaw_rate_radps[0]]).all()
    assert np.isnan(crowd.speed_mps).all()
    assert not crowd.front_known.any()


def test_places_along_and_beside_our_way() -> None:
    crowd = Street().car("a", 12, -3, speed_mps=5).car("b", 25, 4, yaw_rad=np.pi).scene().crowd
    assert crowd.along_m == pytest.approx([12, 25], abs=0.1)
    assert crowd.sideways_m == pytest.approx([-3, 4], abs=0.1)
    assert np.abs(crowd.turn_rad) == pytest.approx([0, np.pi], abs=0.02)


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
def test_nearer_vehicles_hide_others(
    hider: tuple[str, tuple[float, float, float], float, float], share: float
) -> None:
    category, size, x_m, y_m = hider
    street = Street().car("hidden", 24, 0).car("hider", x_m, y_m, category=category, size_wlh_m=size)
    scene = street.scene()
    row = [item.id for item in scene.crowd.items].index("hidden")
    assert scene.crowd.visible[row] == pytest.approx(share)


def test_an_empty_crowd() -> None:
    crowd = Street().scene().crowd
    assert len(crowd) == 0
    assert crowd.visible.shape == crowd.speed_mps.shape == crowd.distance_m.shape == (0,)
    assert crowd.corners_m.shape == (0, 4, 2)


def test_colours_are_those_of_neutral_light() -> None:
    street = Street().car("sun", 12, -4, (120, 120, 120)).car("shade", 12, 4, (55, 55, 55))
    # To our left the road lies in the shade.
    street.appearance[:, :, 100:] = np.where(street.occupancy[1][:, 100:], street.appearance[:, :, 100:], 40)
    scene = street.scene()
    sun, shade = (scene.paint_rgb[[item.id for item in scene.objects].index(name), 0] for name in ("sun", "shade"))
    assert shade / sun > 1.3 * 55 / 120
    bare = Scene(None, scene.objects, WORLD_FROM_EGO)
    assert bare.paint_rgb == pytest.approx(bare.crowd.rgb)


def test_the_road_is_made_once_and_only_of_a_map() -> None:
    scene = Street().car("a", 12, -4).scene()
    assert scene.road is scene.road
    assert scene.road is not None
    assert Scene(None, scene.objects, WORLD_FROM_EGO).road is None


def test_how_much_ground_beside_the_road_lies_between() -> None:
    crowd = Street().car("on", 20, 5).car("off", 2, 28).scene().crowd
    assert crowd.off_road_m == pytest.approx([0, 20], abs=1)

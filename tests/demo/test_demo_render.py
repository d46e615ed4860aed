from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.demo.bodies import Solid, painted
from appocc.demo.ground import Ground, make_ground
from appocc.demo.render import GROUND, SKY, cast, picture, sweep
from appocc.demo.scene import BEAMS_RAD, EGO_FROM_LIDAR, rig
from appocc.demo.street import CROSS_X_M, LANE_M
from appocc.geometry import apply, quaternion_from_yaw, transform

RED, BLUE = (200, 20, 20), (20, 40, 200)
EYE = np.array([0.0, 0.0, 2.0])


def block(low: tuple[float, float, float], high: tuple[float, float, float], paint: tuple[int, int, int]) -> Solid:
    return Solid(np.eye(4), np.array(low), np.array(high), partial(painted, paint=paint, patches=(), axles_m=()))


def unit(*rays: tuple[float, float, float]) -> FloatArray:
    directions = np.array(rays)
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@pytest.fixture(scope="module")
def ground() -> Ground:
    return make_ground(np.random.default_rng(0))


def test_rays_end_on_the_nearest_surface() -> None:
    near, far = block((5, -1, 0), (6, 1, 3), RED), block((8, -1, 0), (9, 1, 3), BLUE)
    hits = cast(EYE, unit((1, 0, 0), (-1, 0, -1), (0, 0, 1), (1, 0, -2)), [far, near])
    assert hits.distance_m == pytest.approx([5.0, 2 * np.sqrt(2), np.inf, np.sqrt(5)])
    assert hits.solid.tolist() == [1, GROUND, SKY, GROUND]


def test_a_turned_box_is_hit_on_its_corner() -> None:
    turned = block((-1, -1, 0), (1, 1, 4), RED)._replace(
        street_from_body=transform(quaternion_from_yaw(np.pi / 4), [10.0, 0.0, 0.0])
    )
    hits = cast(EYE, unit((1, 0, 0), (10 - np.sqrt(2), 2.0, 0)), [turned])
    assert hits.distance_m[0] == pytest.approx(10 - np.sqrt(2), abs=1e-6)
    assert hits.solid[1] == SKY


def seen_by(channel: str, solids: list[Solid], ground: Ground) -> tuple[Camera, ByteArray]:
    camera = rig(352)[channel]
    return camera, picture(camera, np.eye(4), solids, ground)


def test_a_camera_shows_a_surface_where_it_projects_to_and_not_mirrored(ground: Ground) -> None:
    left, right = block((12, 2, 0.5), (14, 5, 2.5), RED), block((12, -5, 0.5), (14, -2, 2.5), BLUE)
    camera, image = seen_by("CAM_FRONT", [left, right], ground)
    for y, channel in ((3.5, 0), (-3.5, 2)):
        uv, depth = camera.project_ego(np.array([[12.0, y, 1.5]]))
        assert camera.sees(uv, depth)[0]
        column, row = np.round(uv[0]).astype(int)
        assert image[row, column].argmax() == channel
        assert (column < 176) == (y > 0)


def test_faces_are_shaded_by_their_normals(ground: Ground) -> None:
    _, image = seen_by("CAM_FRONT", [block((6, -9, 0), (7, 9, 9), (200, 200, 200))], ground)
    _, sunny = seen_by("CAM_BACK", [block((-7, -9, 0), (-6, 9, 9), (200, 200, 200))], ground)
    # The sun stands behind the car: what it sees behind itself is turned away from the sun.
    assert 150 < sunny[99, 176, 0] < image[99, 176, 0] <= 200


def test_edges_are_smoothed(ground: Ground) -> None:
    _, image = seen_by("CAM_FRONT", [block((6, -9, 0), (7, 0.13, 9), (250, 250, 250))], ground)
    row = image[60].astype(int)[:, 0]
    step = int(np.abs(np.diff(row)).argmax())
    between = row[step - 1 : step + 3]
    assert len(set(between.tolist())) >= 3, "a pixel that is half wall and half sky has a colour between the two"


def test_the_ground_shows_its_markings(ground: Ground) -> None:
    fine = np.full(3, 0.02)
    white, asphalt, grass = ground.colour(np.array([[50.0, -LANE_M], [50.0, -1.5], [50.0, 12.0]]), fine)
    assert white.min() > 190
    assert 60 < asphalt.min() <= asphalt.max() < 125
    assert grass.argmax() == 1
    yellow, gap = ground.colour(np.array([[49.5, 0.0], [52.5, 0.0]]), fine[:2])
    assert yellow[0] > 160 > 100 > yellow[2]
    assert gap.max() < 125
    in_crossing = ground.colour(np.array([[CROSS_X_M, -LANE_M]]), fine[:1])[0]
    assert in_crossing.max() < 125


def test_far_ground_is_blurred(ground: Ground) -> None:
    places = np.column_stack([np.full(200, 50.0), np.linspace(-4, -3, 200)])
    sharp = ground.colour(places, np.full(200, 0.01))
    blurred = ground.colour(places, np.full(200, 0.8))
    assert np.ptp(sharp[:, 0]) > 2 * np.ptp(blurred[:, 0])
    # Blurring moves nothing: the line stays in the middle.
    assert places[blurred[:, 0].argmax(), 1] == pytest.approx(-LANE_M, abs=0.4)


def test_lidar_points_lie_on_what_they_hit() -> None:
    wall = block((10, -30, 0), (11, 30, 8), RED)
    points = sweep(EGO_FROM_LIDAR, BEAMS_RAD, 180, [wall], np.random.default_rng(0))
    in_ego = apply(EGO_FROM_LIDAR, points[:, :3])
    on_wall = np.abs(in_ego[:, 0] - 10) < 0.08
    on_ground = np.abs(in_ego[:, 2]) < 0.05
    assert (on_wall | on_ground).all()
    assert on_wall.sum() > 100
    assert on_ground.sum() > 1000
    # nuScenes' frame: y forward, where the wall is; x to the right.
    assert points[on_wall & ~on_ground, 1].min() > 8
    # Ring 0 looks down most, 31 up: those above the horizon meet the wall or nothing.
    assert points[:, 4].min() == 0
    assert in_ego[points[:, 4] > 24, 2].min() > 1.8


def test_lidar_scatters_by_its_seed() -> None:
    one, same, other = (sweep(EGO_FROM_LIDAR, BEAMS_RAD, 90, [], np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert (one == same).all()
    assert 0 < np.abs(one - other).max() < 0.2

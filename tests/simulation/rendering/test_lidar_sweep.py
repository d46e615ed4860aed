from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import Street, box_mesh, made_street

from appocc.checks import Float32Array, FloatArray
from appocc.geometry import apply, quaternion_from_yaw, transform
from appocc.nuscenes.writer import CATEGORIES
from appocc.simulation.mesh import Material, join_meshes
from appocc.simulation.rendering.lidar import EGO_FROM_LIDAR, LidarSweep, simulate_sweep
from appocc.simulation.truth.objects import category_indices, count_lidar_points, objects_near

CAR = ("car", "sedan", (4.6, 1.8, 1.5))
EGO = transform(quaternion_from_yaw(0.3), np.array([2.0, -1.0, 0.0]))


@pytest.fixture(scope="module")
def street() -> Street:
    return made_street([(*CAR, 12, 1, 0.5), ("bicycle", "bicycle", (1.8, 0.6, 1.7), 6, -4, 0.0), (*CAR, -15, 0, 3.0)])


@pytest.fixture(scope="module")
def exact(street: Street) -> LidarSweep:
    return run(street, None)


def run(street: Street, random: np.random.Generator | None) -> LidarSweep:
    return simulate_sweep(street.tracer, street.town, street.mesh, category_indices(street.actors), EGO, random)


def in_town(points: Float32Array) -> FloatArray:
    return np.asarray(apply(EGO @ EGO_FROM_LIDAR, points[:, :3].astype(np.float64)))


def test_points_are_on_the_surfaces_they_hit(street: Street, exact: LidarSweep) -> None:
    place = in_town(exact.points)
    flat = np.isin(exact.category, [CATEGORIES.index(name) for name in ("flat.driveable_surface", "flat.terrain")])
    assert flat.any()
    assert np.abs(place[flat, 2]).max() < 1e-3
    wall = place[exact.category == CATEGORIES.index("static.manmade")]
    assert len(wall) > 100
    assert np.abs(wall[:, 1] - 8).max() < 1e-3
    assert wall[:, 0].max() <= 20.001
    around = objects_near(street.actors, street.state, np.zeros(2), np.inf)
    for i, number in enumerate(around.number):
        cos, sin = np.cos(around.yaw_rad[i]), np.sin(around.yaw_rad[i])
        local = (place[exact.actor == number] - around.centre_m[i]) @ np.array(
            [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]
        )
        off = np.abs(local) - around.size_lwh_m[i] / 2
        assert len(local) > 20
        assert np.abs(off.max(axis=1)).max() < 1e-3


def test_rings_and_frame(exact: LidarSweep) -> None:
    x, y, z, intensity, ring = exact.points.astype(np.float64).T
    up = np.degrees(np.arctan2(z, np.hypot(x, y)))
    assert np.abs(up - np.linspace(-30.67, 10.67, 32)[ring.astype(int)]).max() < 0.01
    assert intensity.min() >= 0
    assert intensity.max() <= 255
    assert (intensity == np.round(intensity)).all()
    # The car ahead of the ego is along +y of the LiDAR.
    ahead = exact.points[exact.actor == 0]
    assert ahead[:, 1].min() > 5
    assert np.abs(ahead[:, 0]).max() < 5


def test_categories_and_counts(street: Street, exact: LidarSweep) -> None:
    names = np.array(CATEGORIES)[exact.category]
    assert set(names[exact.actor == 0]) == {"vehicle.car"}
    assert set(names[exact.actor == 1]) == {"vehicle.bicycle"}
    place = in_town(exact.points)
    road = names == "flat.driveable_surface"
    assert (np.abs(place[road, 1]) < 4.001).all()
    counts = count_lidar_points(exact.actor, np.array([2, 0, 7], np.int32))
    assert counts.tolist() == [(exact.actor == 2).sum(), (exact.actor == 0).sum(), 0]


def test_the_line_is_brighter_than_asphalt_and_a_sign_brighter_still(exact: LidarSweep) -> None:
    place, intensity = in_town(exact.points), exact.points[:, 3]
    road = np.array(CATEGORIES)[exact.category] == "flat.driveable_surface"
    line = road & (np.abs(place[:, 1]) < 0.09)
    near = road & (np.abs(place[:, 1]) > 0.11) & (np.abs(place[:, 0]) < 10)
    assert intensity[line & (np.abs(place[:, 0]) < 10)].mean() > 3 * intensity[near].mean()
    boards = join_meshes(
        [
            box_mesh((15, y, 2), (0.1, 2, 2), material=material, tint=tint)
            for y, material, tint in ((3.0, Material.SIGN, (30, 60, 160)), (-3.0, Material.PAINT, (12, 12, 12)))
        ]
    )
    made = made_street([], boards)
    found = simulate_sweep(made.tracer, made.town, made.mesh, np.zeros(0, np.uint8), np.eye(4), None)
    place = apply(EGO_FROM_LIDAR, found.points[:, :3].astype(np.float64))
    on = (np.abs(place[:, 0] - 14.95) < 0.01) & (place[:, 2] > 0.5)
    left, right = (found.points[on & side, 3] for side in (place[:, 1] > 0, place[:, 1] < 0))
    assert left.min() > 100
    assert len(right) > 0
    assert right.max() < 15


def test_noise_is_along_the_ray_and_far_points_get_lost(street: Street, exact: LidarSweep) -> None:
    noisy = run(street, np.random.default_rng([1, 2]))
    assert 0.5 * len(exact.points) < len(noisy.points) < len(exact.points)
    wall = noisy.category == CATEGORIES.index("static.manmade")
    place = in_town(noisy.points[wall])
    assert 0.003 < np.abs(place[:, 1] - 8).std() < 0.04
    far = [np.hypot(*sweep_.points[:, :2].T) > 30 for sweep_ in (exact, noisy)]
    near = [np.hypot(*sweep_.points[:, :2].T) < 15 for sweep_ in (exact, noisy)]
    assert far[1].sum() / far[0].sum() < 0.9 * near[1].sum() / near[0].sum()


def test_same_seed_same_points(street: Street) -> None:
    first, second, other = (run(street, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert first.points.tobytes() == second.points.tobytes()
    assert len(first.points) != len(other.points) or (first.points != other.points).any()


def test_nothing_beyond_the_range(street: Street, exact: LidarSweep) -> None:
    short = simulate_sweep(
        street.tracer,
        street.town,
        street.mesh,
        category_indices(street.actors),
        EGO,
        None,
        columns=1080,
        range_m=20.0,
    )
    assert 0 < np.linalg.norm(short.points[:, :3], axis=1).max() <= 20.001
    assert np.linalg.norm(exact.points[:, :3], axis=1).max() > 60

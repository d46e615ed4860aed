"""Parts of the scenery: builder, instances, rods, trees, the free ground of a site."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.network import RoadNetwork
from appocc.simulation.scenery import trees
from appocc.simulation.scenery.builder import Builder, LocalFrame, instance_mesh, tapered_rod
from appocc.simulation.scenery.houses import build_houses
from appocc.simulation.scenery.industrial import add_industrial_building
from appocc.simulation.scenery.plots import Plot, lay_plots
from appocc.simulation.scenery.site import Site
from appocc.simulation.surface import CELL_M, Ground, Surface

TURNED = LocalFrame(np.array([10.0, 5.0]), np.array([0.6, 0.8]))


def volume(mesh: Mesh) -> float:
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    return float(np.einsum("fd,fd->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def box() -> Mesh:
    builder = Builder()
    builder.add_boxes(TURNED, [0, 0, 0], [4, 2, 3], Material.BRICK, (1, 2, 3), tag=7, sides="lrfbdt")
    return builder.mesh()


def test_boxes_are_closed_and_turned_outward() -> None:
    mesh = box()
    assert len(mesh.faces) == 12
    assert volume(mesh) == pytest.approx(24.0, rel=1e-5)
    assert mesh.tag.tolist() == [7] * 12
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), [12.4, 9.4, 3.0], atol=1e-5)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), [8.4, 5.0, 0.0], atol=1e-5)


def test_the_front_of_a_frame_faces_the_street() -> None:
    builder = Builder()
    builder.add_boxes(TURNED, [0, 0, 0], [4, 2, 3], Material.BRICK, (1, 2, 3), sides="f")
    np.testing.assert_allclose(builder.mesh().normals, np.tile([0.8, -0.6, 0.0], (4, 1)), atol=1e-6)


def test_texture_runs_in_metres_up_a_wall() -> None:
    builder = Builder()
    builder.add_boxes(TURNED, [0, 0, 0], [4, 2, 3], Material.BRICK, (1, 2, 3), sides="f")
    np.testing.assert_allclose(builder.mesh().uv, [[0, 0], [4, 0], [4, 3], [0, 3]], atol=1e-5)


def test_instances_are_scaled_rotated_and_translated() -> None:
    mesh = instance_mesh(
        box(),
        np.array([[100.0, 0, 0], [0, 100, 2]]),
        np.array([0.0, np.pi / 2]),
        np.array([[1.0, 1, 1], [2, 2, 1]]),
        np.array([[9, 9, 9], [8, 8, 8]]),
        np.ones(12, np.bool_),
    )
    assert volume(mesh) == pytest.approx(24.0 * 5, rel=1e-4)
    assert mesh.tint[0].tolist() == [9, 9, 9]
    assert mesh.tint[-1].tolist() == [8, 8, 8]
    np.testing.assert_allclose(mesh.vertices_m[24:].max(axis=0), [-10.0, 124.8, 5.0], atol=1e-4)


def test_rods_are_round_and_capped() -> None:
    rod = tapered_rod(np.zeros(3), np.array([0.0, 0.0, 2.0]), (1.0, 0.5), 24, Material.METAL, (1, 1, 1), capped=True)
    assert rod.normals[:48, 2].max() == 0.0
    np.testing.assert_allclose(rod.normals[48:], np.tile([0, 0, 1], (24, 1)), atol=1e-6)
    # A truncated cone without its base, which is in the plane z = 0 and adds nothing.
    assert volume(rod) == pytest.approx(np.pi * 2 / 3 * (1 + 0.5 + 0.25), rel=0.02)


@pytest.mark.parametrize("make", [trees.broad_tree, trees.columnar_tree, trees.conifer_tree, trees.small_tree])
def test_trees_have_a_trunk_and_differ(make: object) -> None:
    assert callable(make)
    tree, sparse, other = make(1, 1.0), make(1, 0.4), make(2, 1.0)
    trunk = tree.mesh.vertices_m[tree.mesh.faces[~tree.leaves]]
    assert trunk[..., 2].min() == 0.0
    assert 50 < len(sparse.mesh.faces) < len(tree.mesh.faces) < 350
    assert tree.height_m > 3.0
    assert (
        len(tree.mesh.vertices_m) != len(other.mesh.vertices_m)
        or (tree.mesh.vertices_m != other.mesh.vertices_m).any()
    )


def test_trucks_pass_below_street_trees() -> None:
    for seed in range(4):
        tree = trees.broad_tree(seed, 2.0)
        assert tree.mesh.vertices_m[np.unique(tree.mesh.faces[tree.leaves]), 2].min() > 3.0


def plain() -> Site:
    """A meadow of 60 m with a road of 6 m and its pavements of 2 m across the middle."""
    label = np.full((600, 600), Surface.GRASS, np.uint8)
    label[250:350] = Surface.PAVEMENT
    label[270:330] = Surface.ROAD
    nothing = RoadNetwork(
        edges=(),
        inner_lanes=(),
        junctions=(),
        connections=(),
        low_m=np.zeros(2),
        high_m=np.full(2, 60.0),
        offset_m=np.zeros(2),
    )
    return Site(Ground(np.zeros(2), label, np.zeros((600, 600, 3), np.uint8)), nothing)


def square(x: float, y: float, size_m: float = 4.0) -> FloatArray:
    return np.array([[x, y], [x + size_m, y], [x + size_m, y + size_m], [x, y + size_m]])


def test_ground_is_free_until_it_is_taken() -> None:
    site = plain()
    assert site.is_free(square(10.0, 40.0))
    assert not site.is_free(square(10.0, 32.0))  # on the pavement
    assert not site.is_free(square(10.0, 34.5))  # touches it
    assert not site.is_free(square(-30.0, 40.0))  # outside
    site.occupy(square(10.0, 40.0))
    assert not site.is_free(square(13.0, 42.0))
    assert site.is_free(square(14.5, 40.0))


def test_frontages_run_along_the_pavement_and_face_the_street() -> None:
    longest = plain().frontages()[:2]
    assert sorted(float(f.frame.inward[1]) for f in longest) == pytest.approx([-1.0, 1.0])
    for frontage in longest:
        assert frontage.length_m > 55
        edge = 35.0 if frontage.frame.inward[1] > 0 else 25.0
        assert frontage.frame.origin_m[1] == pytest.approx(edge, abs=2 * CELL_M)


def test_roundabouts_have_no_buildings_in_the_middle() -> None:
    y, x = np.mgrid[0:1200, 0:1200] * CELL_M - 60.0
    label = np.full((1200, 1200), Surface.GRASS, np.uint8)
    label[(np.hypot(x, y) > 14.0) & (np.hypot(x, y) < 22.0)] = Surface.ROAD
    nothing = RoadNetwork(
        edges=(),
        inner_lanes=(),
        junctions=(),
        connections=(),
        low_m=np.full(2, -60.0),
        high_m=np.full(2, 60.0),
        offset_m=np.zeros(2),
    )
    site = Site(Ground(np.full(2, -60.0), label, np.zeros((1200, 1200, 3), np.uint8)), nothing)
    plots = lay_plots(site, "modern", np.random.default_rng(3))
    apart = np.array([np.hypot(*plot.frame.at(plot.width_m / 2, plot.depth_m / 2)) for plot in plots])
    built = np.array([plot.built for plot in plots])
    assert (apart < 14.0).any()
    assert (built == (apart > 14.0)).all()
    assert site.is_free(square(-2.0, -2.0))  # for trees
    builder = Builder()
    build_houses(builder, plots, "modern", np.random.default_rng(3))
    assert np.hypot(*builder.mesh().vertices_m[:, :2].T).min() > 20.0


def test_gates_of_industrial_buildings_reach_the_ground() -> None:
    frame = LocalFrame(np.zeros(2), np.array([1.0, 0.0]))
    found = 0
    for seed in range(4):
        builder = Builder()
        add_industrial_building(
            builder,
            Plot(
                frame=frame,
                width_m=22.0,
                depth_m=18.0,
                arterial=False,
                open_left=True,
                open_right=True,
                front_m=5.0,
                road_m=8.0,
            ),
            0,
            np.random.default_rng(seed),
        )
        mesh = builder.mesh()
        corners = mesh.vertices_m[mesh.faces]
        low, high = corners.min(axis=1), corners.max(axis=1)
        gate = (mesh.material == Material.PLAIN) & (low[:, 2] < 0.1) & (high[:, 2] > 2.0)
        found += int(gate.sum())
        plinth = (mesh.material == Material.CONCRETE) & (high[:, 2] < 0.6) & (low[:, 1] < 0.0) & (high[:, 1] < 0.1)
        for s in (low[gate, 0] + high[gate, 0]) / 2:
            assert not ((low[plinth, 0] < s) & (s < high[plinth, 0])).any()
    assert found


def test_distances_to_the_road() -> None:
    site = plain()
    near = site.distance_at(np.array([[30.0, 40.0], [30.0, 30.0]]), site.to_road_m)
    assert near == pytest.approx([7.0, 0.0], abs=0.3)

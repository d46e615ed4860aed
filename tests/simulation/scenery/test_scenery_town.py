"""Scenery of a hand-made town: a signalled crossing of an arterial and a street with parking lanes."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import ByteArray, FloatArray
from appocc.errors import NotFoundError
from appocc.simulation.ground import build_ground
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.network import Connection, Edge, Junction, Lane, RoadNetwork
from appocc.simulation.plan import CarPark, TownPlan
from appocc.simulation.scenery import build_scenery
from appocc.simulation.scenery.signals import signal_names
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Ground, Surface, surface_table

STYLES = ("old", "modern", "suburb", "industrial")
LANE_M, HALF_M, LONG_M = 3.2, 11.0, 80.0
MAIN = (("driving", 1.5 * LANE_M), ("driving", 0.5 * LANE_M))
SMALL = (("parking", 1.4 * LANE_M), ("driving", 0.5 * LANE_M))
TURNS = {0: "t", 1: "l", 2: "s", 3: "r"}
BUILT = (Material.BRICK, Material.PLASTER, Material.CONCRETE, Material.PLAIN, Material.METAL)


def street(
    name: str, start: FloatArray, end: FloatArray, ends: tuple[str, str], lanes: tuple[tuple[str, float], ...]
) -> Edge:
    """One direction of a street; lanes as (kind, distance to the right of the middle line)."""
    along = (end - start) / np.linalg.norm(end - start)
    right = np.array([along[1], -along[0]])
    lines = [np.linspace(start, end, 9) + way * right for _, way in lanes]
    made = (
        Lane(
            name=f"{name}_{k}",
            edge=name,
            index=k,
            kind=lanes[k][0],  # type: ignore[arg-type]
            width_m=LANE_M,
            speed_mps=13.9,
            centre_m=line,
        )
        for k, line in enumerate(lines)
    )
    return Edge(name, *ends, 1, tuple(made))


def crossing() -> RoadNetwork:
    """Four arms around the origin; the driving lane next to the middle of each arm connects to all others."""
    edges: list[Edge] = []
    for k in range(4):
        way = np.array([np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)])
        lanes = MAIN if k % 2 == 0 else SMALL
        edges.append(street(f"out{k}", HALF_M * way, LONG_M * way, ("c", f"n{k}"), lanes))
        edges.append(street(f"in{k}", LONG_M * way, HALF_M * way, (f"n{k}", "c"), lanes))
    links = [
        Connection(f"in{k}_1", f"out{other}_1", "", TURNS[(k - other) % 4], "lights", 3 * k + turn)
        for k in range(4)
        for turn, other in enumerate((k + step) % 4 for step in (1, 2, 3))
    ]
    square = HALF_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    junction = Junction("c", "traffic_light", np.zeros(2), square)
    bound = np.array([LONG_M, LONG_M])
    return RoadNetwork(
        edges=tuple(edges),
        inner_lanes=(),
        junctions=(junction,),
        connections=tuple(links),
        low_m=-bound,
        high_m=bound,
        offset_m=np.zeros(2),
    )


def park() -> CarPark:
    corners = [
        [40.0, -6.4],
        [46.0, -6.4],
        [46.0, -16.0],
        [60.0, -16.0],
        [60.0, -34.0],
        [34.0, -34.0],
        [34.0, -16.0],
        [40.0, -16.0],
    ]
    return CarPark(np.array(corners), np.array([[36.5 + 2.5 * k, -31.0, np.pi / 2] for k in range(6)]))


def plan_of(style: str, seed: int = 4) -> TownPlan:
    return TownPlan("Crossing", seed, style, crossing(), (park(),))


@pytest.fixture(scope="module")
def ground() -> Ground:
    return build_ground(plan_of("old"))[0]


@pytest.fixture(scope="module")
def towns(ground: Ground) -> dict[str, tuple[Mesh, FloatArray]]:
    return {style: build_scenery(plan_of(style), ground) for style in STYLES}


def labels_at(ground: Ground, xy_m: FloatArray) -> ByteArray:
    column, row = np.floor((xy_m - ground.low_m) / CELL_M).astype(int).T
    height, width = ground.label.shape
    return np.asarray(ground.label[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])


def face_points(mesh: Mesh) -> FloatArray:
    """Return (F, 7, 3) points on every triangle."""
    weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]], np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("pk,fkd->fpd", weights, mesh.vertices_m[mesh.faces]))


@pytest.mark.parametrize("style", STYLES)
def test_nothing_stands_on_the_road(towns: dict[str, tuple[Mesh, FloatArray]], ground: Ground, style: str) -> None:
    points = face_points(towns[style][0]).reshape(-1, 3)
    low = points[points[:, 2] < 3.0]
    on = surface_table(ROAD_SURFACES)[labels_at(ground, low[:, :2])]
    assert not on.any()


@pytest.mark.parametrize("style", STYLES)
def test_walls_keep_off_the_pavement(towns: dict[str, tuple[Mesh, FloatArray]], ground: Ground, style: str) -> None:
    mesh = towns[style][0]
    walls = np.isin(mesh.material, (Material.BRICK, Material.PLASTER)) & (mesh.tag >= 0)
    points = face_points(mesh)[walls].reshape(-1, 3)
    low = points[points[:, 2] < 2.0]
    labels = labels_at(ground, low[:, :2])
    assert len(low)
    assert not np.isin(labels, (Surface.PAVEMENT, Surface.KERB)).any()


@pytest.mark.parametrize("style", STYLES)
def test_faces_look_where_their_normals_point(towns: dict[str, tuple[Mesh, FloatArray]], style: str) -> None:
    mesh = towns[style][0]
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(facing, axis=1)
    assert (area > 1e-7).all()
    assert ((facing * mesh.normals[mesh.faces].mean(axis=1)).sum(axis=1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("style", STYLES)
def test_buildings_are_shells_turned_outward(towns: dict[str, tuple[Mesh, FloatArray]], style: str) -> None:
    mesh = towns[style][0]
    corners = mesh.vertices_m[mesh.faces].astype(np.float64)
    house = (mesh.tag >= 0) & (mesh.material != Material.SIGNAL)
    volumes = []
    for tag in np.unique(mesh.tag[house]):
        mine = house & (mesh.tag == tag)
        middle = corners[mine].reshape(-1, 3).mean(axis=0) * [1, 1, 0]
        part = corners[mine] - middle
        volumes.append(np.einsum("fd,fd->f", part[:, 0], np.cross(part[:, 1], part[:, 2])).sum() / 6)
    assert len(volumes) > 5
    assert min(volumes) > 50.0


@pytest.mark.parametrize("style", STYLES)
def test_nothing_floats_nor_sinks(towns: dict[str, tuple[Mesh, FloatArray]], style: str) -> None:
    mesh = towns[style][0]
    assert mesh.vertices_m[:, 2].min() >= 0.0
    for tag in np.unique(mesh.tag[(mesh.tag >= 0) & (mesh.material != Material.SIGNAL)]):
        mine = (mesh.tag == tag) & (mesh.material != Material.SIGNAL)
        assert mesh.vertices_m[mesh.faces[mine]][..., 2].min() == 0.0


@pytest.mark.parametrize("style", STYLES)
def test_a_town_has_all_kinds_of_scenery(towns: dict[str, tuple[Mesh, FloatArray]], style: str) -> None:
    mesh, _ = towns[style]
    expected = {
        Material.WINDOW,
        Material.FOLIAGE,
        Material.BARK,
        Material.METAL,
        Material.STREET_LAMP,
        Material.SIGNAL,
    }
    assert expected <= {Material(m) for m in np.unique(mesh.material)}
    assert np.isin(mesh.material, BUILT).sum() > 2000
    assert len(mesh.faces) < 120_000  # four blocks of a town's thirty-six, and all around them
    panes = mesh.uv[mesh.faces[mesh.material == Material.WINDOW]]
    assert panes.min() == 0.0
    assert panes.max() == 1.0
    assert (mesh.tag[mesh.material == Material.WINDOW] >= 0).all()


def test_styles_differ(towns: dict[str, tuple[Mesh, FloatArray]]) -> None:
    def tall(style: str) -> float:
        mesh = towns[style][0]
        walls = (mesh.tag >= 0) & (mesh.material != Material.SIGNAL)
        return float(np.quantile(mesh.vertices_m[mesh.faces[walls]][..., 2], 0.95))

    def count(style: str, material: Material) -> int:
        return int((towns[style][0].material == material).sum())

    assert tall("modern") > tall("old") > tall("suburb")
    assert count("old", Material.ROOF_TILES) > 0 == count("modern", Material.ROOF_TILES)
    assert count("suburb", Material.HEDGE) > count("old", Material.HEDGE)
    assert count("suburb", Material.FOLIAGE) > 2 * count("industrial", Material.FOLIAGE)


@pytest.mark.parametrize("style", STYLES)
def test_lamps_hang_over_the_pavement_or_street(towns: dict[str, tuple[Mesh, FloatArray]], style: str) -> None:
    mesh, lamps = towns[style]
    assert len(lamps) >= 8
    assert (lamps[:, 2] > 4.0).all()
    assert (lamps[:, 2] < 9.0).all()
    glowing = mesh.vertices_m[mesh.faces[mesh.material == Material.STREET_LAMP]].mean(axis=1)
    gap = np.linalg.norm(lamps[:, None] - glowing[None], axis=-1).min(axis=1)
    assert gap.max() < 0.6
    near = np.linalg.norm(lamps[:, None, :2] - lamps[None, :, :2], axis=-1) + 1e9 * np.eye(len(lamps))
    assert near.min() > 4.0


def test_every_link_has_three_lamps_facing_its_approach(towns: dict[str, tuple[Mesh, FloatArray]]) -> None:
    network, mesh = crossing(), towns["old"][0]
    names = signal_names(network)
    assert len(names) == 12
    assert list(names) == sorted(names)
    lamps = mesh.material == Material.SIGNAL
    assert set(mesh.tag[lamps]) == set(range(3 * len(names)))
    for connection in network.connections:
        first = 3 * names.index(f"{connection.signal}/{connection.link}")
        line = network.lane(connection.from_lane).centre_m
        heading = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
        heights = []
        for colour in range(3):
            mine = lamps & (mesh.tag == first + colour)
            normals = mesh.normals[mesh.faces[mine]][:, 0].astype(np.float64)
            places = mesh.vertices_m[mesh.faces[mine]].mean(axis=1)
            np.testing.assert_allclose(normals[:, :2], np.broadcast_to(-heading, (len(normals), 2)), atol=1e-3)
            assert np.linalg.norm(places[:, :2] - line[-1], axis=1).min() < 15.0
            heights.append(float(places[:, 2].max()))
        assert heights[0] > heights[1] > heights[2] > 2.0


def test_heads_over_arterials_hang_above_their_lane(towns: dict[str, tuple[Mesh, FloatArray]]) -> None:
    mesh = towns["old"][0]
    places = mesh.vertices_m[mesh.faces[mesh.material == Material.SIGNAL]].mean(axis=1)
    west = places[(places[:, 2] > 5.0) & (places[:, 0] < -5.0)]  # heads for traffic from the west, heading east
    assert len(west)
    assert (np.abs(west[:, 1] + 0.5 * LANE_M) < 1.2).all()


def test_the_same_plan_gives_the_same_bytes(towns: dict[str, tuple[Mesh, FloatArray]], ground: Ground) -> None:
    mesh, lamps = build_scenery(plan_of("old"), ground)
    first, first_lamps = towns["old"]
    assert lamps.tobytes() == first_lamps.tobytes()
    for name in ("vertices_m", "normals", "uv", "faces", "material", "tint", "tag"):
        assert getattr(mesh, name).tobytes() == getattr(first, name).tobytes()
    other, _ = build_scenery(plan_of("old", 5), ground)
    assert other.vertices_m.tobytes() != first.vertices_m.tobytes()


@pytest.mark.parametrize("style", STYLES)
def test_a_plain_without_streets_has_no_houses(style: str) -> None:
    nowhere = RoadNetwork(
        edges=(),
        inner_lanes=(),
        junctions=(),
        connections=(),
        low_m=np.zeros(2),
        high_m=np.full(2, 40.0),
        offset_m=np.zeros(2),
    )
    meadow = np.full((400, 400), Surface.GRASS, np.uint8)
    ground = Ground(np.zeros(2), meadow, np.zeros((400, 400, 3), np.uint8))
    mesh, lamps = build_scenery(TownPlan("Nowhere", 1, style, nowhere), ground)
    assert len(mesh.faces) == 0
    assert lamps.shape == (0, 3)


def test_an_unknown_style_is_named(ground: Ground) -> None:
    with pytest.raises(NotFoundError, match="expected a style of old, modern, suburb, industrial, got 'gothic'"):
        build_scenery(plan_of("gothic"), ground)

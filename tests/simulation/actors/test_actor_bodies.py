import cv2
import numpy as np
import pytest

from appocc.checks import BoolArray
from appocc.errors import NotFoundError, ShapeError
from appocc.simulation.actors.bodies import BODIES, POSES, VARIANTS, body_mesh, body_template
from appocc.simulation.actors.modelling import Size
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.rendering.tracing import ACTOR, Tracer

# Short, usual and long ones of each body.
SIZES: dict[str, tuple[Size, Size, Size]] = {
    "sedan": ((4.2, 1.68, 1.38), (4.7, 1.82, 1.45), (5.3, 1.98, 1.55)),
    "hatchback": ((3.4, 1.58, 1.40), (4.25, 1.79, 1.47), (4.5, 1.85, 1.6)),
    "estate": ((4.3, 1.7, 1.4), (4.75, 1.83, 1.48), (5.1, 1.95, 1.6)),
    "suv": ((4.0, 1.72, 1.55), (4.6, 1.87, 1.67), (5.3, 2.05, 2.0)),
    "pickup": ((4.8, 1.75, 1.7), (5.35, 1.9, 1.82), (6.2, 2.1, 2.0)),
    "minivan": ((4.2, 1.75, 1.6), (4.8, 1.89, 1.75), (5.3, 2.0, 2.0)),
    "van": ((4.6, 1.8, 1.9), (5.4, 2.0, 2.35), (7.2, 2.1, 2.9)),
    "box_truck": ((5.5, 2.1, 2.6), (7.2, 2.35, 3.2), (10.5, 2.6, 4.0)),
    "bus": ((8.0, 2.3, 2.8), (12.0, 2.55, 3.1), (14.0, 2.6, 3.6)),
    "motorcycle": ((1.8, 0.6, 1.4), (2.15, 0.8, 1.65), (2.6, 1.0, 1.8)),
    "bicycle": ((1.5, 0.45, 1.5), (1.75, 0.6, 1.75), (2.0, 0.75, 1.9)),
    "adult": ((0.5, 0.45, 1.5), (0.75, 0.6, 1.75), (1.0, 0.9, 2.0)),
    "child": ((0.35, 0.3, 0.9), (0.5, 0.42, 1.25), (0.7, 0.55, 1.5)),
}
USUAL = {body: sizes[1] for body, sizes in SIZES.items()}
BOXY = BODIES[:9]


def silhouette(mesh: Mesh, size: Size, axes: tuple[int, int], cells: int = 300) -> BoolArray:
    """Return (cells, cells) the silhouette of the mesh in its box along the third axis."""
    low = np.array([-size[0] / 2, -size[1] / 2, 0.0])[list(axes)]
    corners = (mesh.vertices_m[mesh.faces][..., list(axes)] - low) / np.array(size)[list(axes)] * cells
    image = np.zeros((cells, cells), np.uint8)
    for triangle in np.rint((corners - 0.5) * 16).astype(np.int32):
        cv2.fillConvexPoly(image, triangle, (1.0,), shift=4)
    return image.astype(np.bool_)


def overlap(a: BoolArray, b: BoolArray) -> float:
    return float(np.count_nonzero(a & b) / np.count_nonzero(a | b))


def seen_backs(mesh: Mesh) -> float:
    """Return the share of rays from all sides and above that hit the back of a face first."""
    rng = np.random.default_rng(0)
    yaw, up = rng.uniform(0, 2 * np.pi, 4000), np.radians(rng.uniform(2, 60, 4000))
    ways = -np.stack([np.cos(up) * np.cos(yaw), np.cos(up) * np.sin(yaw), np.sin(up)], axis=1)
    starts = rng.uniform(mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0), (4000, 3)) - 30 * ways
    tracer = Tracer(join_meshes([]))
    tracer.set_actors(mesh)
    hits = tracer.nearest(starts.astype(np.float32), ways.astype(np.float32))
    met = hits.source == ACTOR
    a, b, c = np.moveaxis(mesh.vertices_m[mesh.faces[hits.face[met]]], 1, 0)
    return float(np.mean(np.sum(np.cross(b - a, c - a) * ways[met], axis=1) > 0))


def test_every_body_has_sizes_here() -> None:
    assert set(SIZES) == set(BODIES)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("detail", [0, 1, 2])
def test_a_body_fills_its_box_at_every_size(body: str, detail: int) -> None:
    for variant, size in enumerate(SIZES[body]):
        mesh = body_mesh(body, size, variant, detail)
        length, width, height = size
        assert mesh.vertices_m.min(axis=0) == pytest.approx([-length / 2, -width / 2, 0.0], abs=0.02)
        assert mesh.vertices_m.max(axis=0) == pytest.approx([length / 2, width / 2, height], abs=0.02)
        assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0, abs=1e-3)
        a, b, c = np.moveaxis(mesh.vertices_m[mesh.faces], 1, 0)
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-9


@pytest.mark.parametrize("body", BOXY)
def test_from_above_vehicles_cover_their_rectangle(body: str) -> None:
    for variant in range(VARIANTS):
        for detail in range(3):
            assert silhouette(body_mesh(body, USUAL[body], variant, detail), USUAL[body], (0, 1)).mean() >= 0.92


@pytest.mark.parametrize("body", BODIES)
def test_levels_of_detail_look_alike_with_fewer_faces(body: str) -> None:
    meshes = [body_mesh(body, USUAL[body], 0, detail) for detail in range(3)]
    counts = [len(mesh.faces) for mesh in meshes]
    limits = (800, 230, 95) if body in BOXY else (800, 450, 180)
    assert all(count <= limit for count, limit in zip(counts, limits, strict=True))
    assert counts[0] > 1.5 * counts[1] > 2.0 * counts[2]
    for axes in ((0, 2), (1, 2), (0, 1)):
        near, middle, far = (silhouette(mesh, USUAL[body], axes) for mesh in meshes)
        # The wheels of a bicycle are rings near by and discs far away.
        thin = 0.35 if body == "bicycle" else 0.65
        assert overlap(near, middle) >= (0.9 if body in BOXY else 0.6)
        assert overlap(near, far) >= (0.88 if body in BOXY else thin)


@pytest.mark.parametrize("body", BODIES)
def test_faces_are_wound_outward(body: str) -> None:
    for detail, most in enumerate((0.006, 0.01, 0.025) if body in BOXY else (0.03, 0.04, 0.10)):
        assert seen_backs(body_mesh(body, USUAL[body], 1, detail)) < most


@pytest.mark.parametrize("body", BODIES)
def test_normals_agree_with_the_faces(body: str) -> None:
    mesh = body_mesh(body, SIZES[body][2], 0, 0)
    a, b, c = np.moveaxis(mesh.vertices_m[mesh.faces].astype(np.float64), 1, 0)
    area = np.cross(b - a, c - a)
    area /= np.linalg.norm(area, axis=1, keepdims=True)
    assert np.sum(area[:, None] * mesh.normals[mesh.faces], axis=2).min() > 0.4


@pytest.mark.parametrize("body", [*BOXY, "motorcycle"])
def test_lamps_are_at_their_ends_and_sides(body: str) -> None:
    mesh = body_mesh(body, USUAL[body], 0, 0)
    middle = mesh.vertices_m[mesh.faces].mean(axis=1)
    length, width, _ = USUAL[body]
    assert middle[mesh.material == Material.HEAD_LAMP, 0].min() > 0.25 * length
    assert middle[mesh.material == Material.TAIL_LAMP, 0].max() < -0.38 * length
    assert middle[mesh.material == Material.INDICATOR_LEFT, 1].min() > 0.15 * width
    assert middle[mesh.material == Material.INDICATOR_RIGHT, 1].max() < -0.15 * width
    assert middle[mesh.material == Material.PLATE, 0].min() < -0.4 * length
    assert {Material.PAINT, Material.RUBBER} <= {Material(m) for m in mesh.material}


@pytest.mark.parametrize("body", ["hatchback", "van"])
def test_wheels_stay_round_when_a_body_is_stretched(body: str) -> None:
    length, width, height = USUAL[body]
    mesh = body_mesh(body, (length * 1.3, width, height), 0, 0)
    rubber = mesh.vertices_m[mesh.faces[mesh.material == Material.RUBBER]].reshape(-1, 3)
    front = rubber[rubber[:, 0] > 0]
    assert np.ptp(front[:, 0]) == pytest.approx(np.ptp(front[:, 2]), rel=0.06)


def test_windows_are_glass_above_the_wheels() -> None:
    mesh = body_mesh("sedan", USUAL["sedan"], 0, 0)
    glass = mesh.vertices_m[mesh.faces[mesh.material == Material.GLASS]]
    assert glass[..., 2].min() > 0.55 * 1.45
    assert np.count_nonzero(mesh.material == Material.GLASS) > 10


def test_pedestrians_move_their_legs_and_keep_their_height() -> None:
    steps = [body_template("adult", 0, 0, pose) for pose in range(POSES)]
    assert all(step.coordinates[:, 2].max() == pytest.approx(1.0, abs=1e-3) for step in steps)
    spans = [float(np.ptp(step.coordinates[:, 0])) for step in steps]
    assert spans[0] == pytest.approx(1.0, abs=1e-3)
    assert spans[1] < 0.9 * spans[0]
    assert not np.array_equal(steps[0].coordinates, steps[2].coordinates)


def test_templates_are_the_same_every_time() -> None:
    first = body_mesh("suv", USUAL["suv"], 2, 0)
    again = body_mesh("suv", USUAL["suv"], 2 + VARIANTS, 0)
    assert np.array_equal(first.vertices_m, again.vertices_m)
    assert not np.array_equal(first.vertices_m, body_mesh("suv", USUAL["suv"], 1, 0).vertices_m)


def test_unknown_bodies_sizes_and_details_are_refused() -> None:
    with pytest.raises(NotFoundError, match="no body 'tank'"):
        body_mesh("tank", (5.0, 2.0, 2.0), 0, 0)
    with pytest.raises(ShapeError, match=r"expected 0\.\.2, got 3"):
        body_mesh("sedan", (4.5, 1.8, 1.5), 0, 3)
    with pytest.raises(ShapeError, match="three positive lengths"):
        body_mesh("sedan", (4.5, 0.0, 1.5), 0, 0)

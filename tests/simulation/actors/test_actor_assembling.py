import numpy as np
import pytest
from tolerances import assert_rounded

from appocc.checks import Float32Array
from appocc.simulation.actors.assembling import assemble, body_variant
from appocc.simulation.actors.bodies import body_mesh
from appocc.simulation.actors.modelling import Size
from appocc.simulation.actors.paint import ActorPaint, draw_paints
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.traffic import Actor, TrafficState

RED, BLUE = ActorPaint((160, 20, 30), "red"), ActorPaint((30, 60, 120), "blue")


def state(numbers: list[int], poses: list[tuple[float, float, float]], speed_mps: float = 0.0) -> TrafficState:
    x, y, yaw = (np.array(column, np.float64) for column in zip(*poses, strict=True))
    velocity = speed_mps * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    lights = np.zeros(len(numbers), np.uint8)
    return TrafficState(np.array(numbers), np.stack([x, y], axis=1), yaw, velocity, lights, np.zeros(0, np.uint8))


def actor(name: str, body: str = "sedan", size: Size = (4.6, 1.82, 1.46), kind: str = "car") -> Actor:
    return Actor(name, kind, body, size)


ORIGIN = np.zeros(2)
TERMS = 8  # of a turn and a shift


def of(mesh: Mesh, number: int) -> Float32Array:
    return np.asarray(mesh.vertices_m[mesh.faces[mesh.tag == number]]).reshape(-1, 3)


def test_a_car_fills_its_oriented_box() -> None:
    yaw = 0.7
    mesh = assemble([actor("a")], state([0], [(12.0, -5.0, yaw)]), [RED], ORIGIN, None)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    local = (of(mesh, 0)[:, :2] - [12.0, -5.0]) @ turn.T
    assert local.max(axis=0) == pytest.approx([2.3, 0.91], abs=0.02)
    assert local.min(axis=0) == pytest.approx([-2.3, -0.91], abs=0.02)
    assert (of(mesh, 0)[:, 2].min(), of(mesh, 0)[:, 2].max()) == pytest.approx((0.0, 1.46), abs=0.02)
    lamps = mesh.vertices_m[mesh.faces[mesh.material == Material.HEAD_LAMP]].reshape(-1, 3)
    assert np.all((lamps[:, :2] - [12.0, -5.0]) @ [np.cos(yaw), np.sin(yaw)] > 1.5)


def test_an_actor_is_the_mesh_of_its_body() -> None:
    car = actor("b", "suv", (4.4, 1.9, 1.7))
    mesh = assemble([car], state([0], [(0.0, 0.0, 0.0)]), [RED], ORIGIN, None)
    alone = body_mesh("suv", car.size_lwh_m, body_variant(car), 0)
    assert_rounded(mesh.vertices_m, alone.vertices_m, TERMS)
    assert_rounded(mesh.normals, alone.normals, TERMS)
    assert np.array_equal(mesh.faces, alone.faces)
    assert np.array_equal(mesh.material, alone.material)


def test_tags_and_paints_follow_the_index_in_the_log() -> None:
    actors = [actor(name) for name in "abcd"]
    where = state([1, 3], [(5.0, 0.0, 0.0), (-5.0, 3.0, 1.0)])
    mesh = assemble(actors, where, [BLUE, RED, BLUE, BLUE], ORIGIN, None)
    assert set(mesh.tag) == {1, 3}
    for number, paint in ((1, RED), (3, BLUE)):
        painted = (mesh.tag == number) & (mesh.material == Material.PAINT)
        assert np.count_nonzero(painted) > 50
        assert np.all(mesh.tint[painted] == paint.rgb)
    rubber = mesh.material == Material.RUBBER
    assert mesh.tint[rubber].max() < 60
    centre = of(mesh, 3)[:, :2].mean(axis=0)
    assert centre == pytest.approx([-5.0, 3.0], abs=0.5)


def test_every_painted_face_of_every_vehicle_has_its_paint() -> None:
    bodies = ["hatchback", "pickup", "van", "box_truck", "bus", "motorcycle", "bicycle"]
    actors = [actor(body, body) for body in bodies]
    poses = [(9.0 * k, 0.0, 0.0) for k in range(len(bodies))]
    mesh = assemble(actors, state(list(range(len(bodies))), poses), [RED] * len(bodies), ORIGIN, None)
    paint = mesh.material == Material.PAINT
    assert set(mesh.tag[paint]) == set(range(len(bodies)))
    assert np.all(mesh.tint[paint] == RED.rgb)


def test_a_pedestrian_wears_a_jacket_of_its_colour() -> None:
    walker = actor("w", "adult", (0.7, 0.6, 1.75), "pedestrian")
    mesh = assemble([walker], state([0], [(0.0, 0.0, 0.0)]), [RED], ORIGIN, None)
    jacket = np.all(mesh.tint == RED.rgb, axis=1)
    assert np.all(mesh.material[jacket] == Material.CLOTH)
    assert 0.2 < np.mean(jacket) < 0.7


def test_the_ego_and_distant_actors_are_left_out() -> None:
    actors = [actor(name) for name in "abc"]
    where = state([0, 1, 2], [(0.0, 0.0, 0.0), (40.0, 0.0, 0.0), (151.0, 0.0, 0.0)])
    assert set(assemble(actors, where, [RED] * 3, ORIGIN, 0).tag) == {1}
    assert set(assemble(actors, where, [RED] * 3, np.array([100.0, 0.0]), None, 55.0).tag) == {2}


def test_no_actor_nearby_gives_an_empty_mesh() -> None:
    mesh = assemble([actor("a")], state([0], [(0.0, 0.0, 0.0)]), [RED], np.array([1e3, 0.0]), None)
    assert mesh.vertices_m.shape == (0, 3)
    assert mesh.faces.shape == (0, 3)


def test_detail_falls_with_distance() -> None:
    counts = []
    for x in (5.0, 40.0, 100.0):
        counts.append(len(assemble([actor("a")], state([0], [(x, 0.0, 0.0)]), [RED], ORIGIN, None).faces))
    assert counts[0] > 2 * counts[1] > 4 * counts[2]


def test_pedestrians_step_while_walking_only() -> None:
    walker = [actor("w", "adult", (0.7, 0.6, 1.75), "pedestrian")]

    def shape(x: float, speed_mps: float) -> Float32Array:
        mesh = assemble(walker, state([0], [(x, 0.0, 0.0)], speed_mps), [RED], ORIGIN, None)
        return np.asarray(mesh.vertices_m - np.array([x, 0.0, 0.0], np.float32))

    standing = [shape(x, 0.0) for x in (0.0, 0.35, 0.7)]
    for step in standing[1:]:
        assert_rounded(step, standing[0], TERMS)
    walking = [shape(x, 1.3) for x in (0.05, 0.40, 0.75)]
    assert np.abs(walking[0] - walking[2]).max() > 0.1


def test_the_same_state_gives_the_same_mesh() -> None:
    actors = [actor(f"v{k}", body) for k, body in enumerate(("sedan", "van", "bus", "bicycle") * 5)]
    rng = np.random.default_rng(1)
    poses = [(float(x), float(y), float(yaw)) for x, y, yaw in rng.uniform(-60, 60, (20, 3))]
    paints = draw_paints(actors, 4)
    first, again = (assemble(actors, state(list(range(20)), poses, 2.0), paints, ORIGIN, 2) for _ in range(2))
    for name in ("vertices_m", "normals", "faces", "material", "tint", "tag"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()

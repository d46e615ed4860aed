"""A module that speaks CARLA's Python interface: a straight road with traffic, rendered by rays on boxes.

Everything is computed in CARLA's own left-handed frame (x ahead, y right, z up, degrees), independently of appocc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from fake_carla_geometry import BoundingBox, Location, Rotation, Transform, Vector3D, composed

ROAD, SIDEWALK, TERRAIN, SKY, WALKER, CAR, WALL, LINE = 1, 2, 10, 11, 12, 14, 4, 24
COLOURS = {ROAD: (80, 80, 84), SIDEWALK: (150, 150, 150), TERRAIN: (60, 120, 50), SKY: (130, 170, 220)}
COLOURS |= {WALKER: (200, 120, 40), WALL: (110, 60, 40), LINE: (250, 250, 250)}
HALF_ROAD, LANE = 6.0, 3.5
EGO_SPEED = 5.0
AXLE = -1.4  # of the ego vehicle, in its own frame


class Blueprint:
    def __init__(self, kind: str, **attributes: str) -> None:
        self.id, self.attributes = kind, dict(attributes)

    def has_attribute(self, name: str) -> bool:
        return name in self.attributes or self.id.startswith("sensor.")

    def get_attribute(self, name: str) -> Any:
        return SimpleNamespace(recommended_values=["200,20,30", "20,60,200"])

    def set_attribute(self, name: str, value: str) -> None:
        assert isinstance(value, str)
        self.attributes[name] = value


class Library:
    def filter(self, pattern: str) -> list[Blueprint]:
        known = [
            Blueprint("vehicle.tesla.model3", color="0,0,0", base_type="car", number_of_wheels="4"),
            Blueprint("vehicle.ford.ambulance", color="0,0,0", base_type="van", number_of_wheels="4"),
            Blueprint("walker.pedestrian.0001", age="adult"),
        ]
        return [each for each in known if fnmatch(each.id, pattern)]

    def find(self, kind: str) -> Blueprint:
        return Blueprint(kind)


class Actor:
    def __init__(self, world: World, blueprint: Blueprint, transform: Transform, parent: Any) -> None:
        world.count += 1
        self.id, self.type_id, self.attributes = world.count, blueprint.id, dict(blueprint.attributes)
        self.world, self.transform, self.parent, self.speed = world, transform, parent, 0.0
        self.callback: Any = None
        size = Vector3D(0.3, 0.3, 0.9) if "walker" in self.type_id else Vector3D(2.3, 0.95, 0.75)
        self.bounding_box = BoundingBox(Location(0.0, 0.0, 0.0 if "walker" in self.type_id else 0.75), size)

    def get_transform(self) -> Transform:
        return self.transform

    def set_transform(self, transform: Transform) -> None:
        self.transform = transform

    def get_velocity(self) -> Vector3D:
        return Vector3D(self.speed * math.cos(math.radians(self.transform.rotation.yaw)))

    def set_autopilot(self, enabled: bool, port: int) -> None:
        assert port == 8000
        self.speed = EGO_SPEED if self.attributes.get("role_name") == "hero" else 0.0

    def get_physics_control(self) -> Any:
        place, axes = composed(self.transform, Transform())
        wheels = []
        for x in (1.4, 1.4, AXLE, AXLE):
            at = (place + np.array([x, 0.8, 0.3]) @ axes) * 100
            wheels.append(SimpleNamespace(position=Vector3D(*at)))
        return SimpleNamespace(wheels=wheels)

    def listen(self, callback: Any) -> None:
        self.callback = callback

    def stop(self) -> None:
        self.callback = None

    def start(self) -> None:
        pass

    def go_to_location(self, location: Location) -> None:
        pass

    def set_max_speed(self, speed: float) -> None:
        pass

    def destroy(self) -> bool:
        self.world.actors.remove(self)
        return True


@dataclass
class Waypoint:
    """On lanes +1 (oncoming), -1, -2 (parking) and -3 (pavement) of a road along x from -200 to 400."""

    lane_id: int
    s: float
    road_id: int = 7
    section_id: int = 0
    is_junction: bool = False

    @property
    def transform(self) -> Transform:
        y = {1: -LANE / 2, -1: LANE / 2, -2: LANE + 1.25, -3: HALF_ROAD + 1}[self.lane_id]
        return Transform(Location(self.s - 200, y, 0), Rotation(yaw=180.0 if self.lane_id > 0 else 0.0))

    @property
    def lane_width(self) -> float:
        return {1: LANE, -1: LANE, -2: 2.5, -3: 2.0}[self.lane_id]

    @property
    def lane_type(self) -> str:
        return {1: "Driving", -1: "Driving", -2: "Parking", -3: "Sidewalk"}[self.lane_id]

    @property
    def right_lane_marking(self) -> Any:
        kind = {1: "Solid", -1: "Broken", -2: "NONE", -3: "NONE"}[self.lane_id]
        return SimpleNamespace(type=kind, color="White")

    @property
    def left_lane_marking(self) -> Any:
        if abs(self.lane_id) == 1:
            return SimpleNamespace(type="SolidSolid", color="Yellow")
        return Waypoint(self.lane_id + 1, self.s).right_lane_marking

    def get_left_lane(self) -> Waypoint | None:
        return Waypoint({1: -1, -1: 1, -2: -1, -3: -2}[self.lane_id], self.s)

    def get_right_lane(self) -> Waypoint | None:
        return Waypoint(self.lane_id - 1, self.s) if -3 < self.lane_id < 0 else None


class Map:
    name = "Carla/Maps/TownFake"

    def get_spawn_points(self) -> list[Transform]:
        return [Transform(Location(x, LANE / 2, 0.0)) for x in (0.0, 40.0, 55.0)]

    def generate_waypoints(self, distance: float) -> list[Waypoint]:
        return [Waypoint(lane, float(s)) for s in np.arange(0, 600, distance) for lane in (1, -1)]

    def get_crosswalks(self) -> list[Location]:
        corners = [(30, -6), (33, -6), (33, 6), (30, 6), (30, -6)]
        return [Location(x, y, 0) for x, y in corners]


class Snapshot:
    def __init__(self, world: World) -> None:
        self.states = {each.id: each for each in world.actors}

    def find(self, number: int) -> Any:
        return self.states.get(number)


class World:
    def __init__(self) -> None:
        self.actors: list[Actor] = []
        self.count = self.frame = 0
        self.settings = SimpleNamespace(synchronous_mode=False, fixed_delta_seconds=None)
        self.fail_at = -1
        self.silent = ""
        # A wall between the ego vehicle's start and what is left of the road, and a parked car of the map.
        self.walls = [(np.array([20.0, -14.0, 0.0]), np.array([21.0, -8.0, 3.0]))]

    def get_map(self) -> Map:
        return Map()

    def get_settings(self) -> Any:
        return SimpleNamespace(**vars(self.settings))

    def apply_settings(self, settings: Any) -> int:
        self.settings = SimpleNamespace(**vars(settings))
        return self.frame

    def get_blueprint_library(self) -> Library:
        return Library()

    def set_pedestrians_seed(self, seed: int) -> None:
        pass

    def get_random_location_from_navigation(self) -> Location:
        return Location(12.0, HALF_ROAD + 1, 0.9)

    def try_spawn_actor(self, blueprint: Blueprint, transform: Transform, attach_to: Any = None) -> Actor | None:
        here = transform.place()
        taken = [each for each in self.actors if each.type_id.startswith("vehicle")]
        if blueprint.id.startswith("vehicle") and any(
            np.linalg.norm(each.transform.place() - here) < 6 for each in taken
        ):
            return None
        actor = Actor(self, blueprint, transform, attach_to)
        self.actors.append(actor)
        return actor

    def get_actors(self) -> list[Actor]:
        return list(self.actors)

    def get_snapshot(self) -> Snapshot:
        return Snapshot(self)

    def get_environment_objects(self, label: str) -> list[Any]:
        if label != "Car":
            return []
        boxes = [((25.0, -11.0, 0.75), 0.75), ((25.0, -11.0, 0.75), 0.4)]  # the second is a part of the first
        return [
            SimpleNamespace(
                id=900 + number,
                name=f"parked {number}",
                bounding_box=BoundingBox(Location(*place), Vector3D(2.2, 0.9, height)),
            )
            for number, (place, height) in enumerate(boxes)
        ]

    def tick(self) -> int:
        self.frame += 1
        if self.frame == self.fail_at:
            raise RuntimeError("time-out of 30000ms while waiting for the simulator")
        for actor in self.actors:
            yaw = math.radians(actor.transform.rotation.yaw)
            step = actor.speed * self.settings.fixed_delta_seconds
            actor.transform = Transform(
                Location(
                    actor.transform.location.x + step * math.cos(yaw),
                    actor.transform.location.y + step * math.sin(yaw),
                    actor.transform.location.z,
                ),
                actor.transform.rotation,
            )
        for actor in [
            each for each in self.actors if each.callback is not None and self.silent not in (each.type_id,)
        ]:
            actor.callback(Sensed(self, actor))
        return self.frame

    def solids(self, without: Any) -> list[tuple[np.ndarray, np.ndarray, int, tuple[int, int, int]]]:
        """Boxes along the axes: low and high corner, tag and colour."""
        found = [(low, high, WALL, COLOURS[WALL]) for low, high in self.walls]
        found.append((np.array([22.81, -11.89, 0.01]), np.array([27.19, -10.11, 1.49]), CAR, (30, 30, 30)))
        for each in self.actors:
            if each is without or not each.type_id.startswith(("vehicle", "walker")):
                continue
            half = np.array([each.bounding_box.extent.x, each.bounding_box.extent.y, each.bounding_box.extent.z])
            centre = each.transform.place() + np.array([0, 0, each.bounding_box.location.z])
            text = each.attributes.get("color", "200,120,40")
            tag = CAR if each.type_id.startswith("vehicle") else WALKER
            red, green, blue = (int(part) for part in text.split(","))
            found.append((centre - half + 0.01, centre + half - 0.01, tag, (red, green, blue)))
        return found


Solids = list[tuple[np.ndarray, np.ndarray, int, tuple[int, int, int]]]


def cast(solids: Solids, start: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance in units of the rays (N, 3), tag and colour of what they hit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[:, 2] < 0, -start[2] / rays[:, 2], np.inf)
    y = start[1] + np.where(np.isfinite(reach), reach, 0) * rays[:, 1]
    tag = np.where((y < HALF_ROAD) & (y > -LANE), ROAD, TERRAIN)
    tag = np.where((y > HALF_ROAD) & (y < HALF_ROAD + 2), SIDEWALK, tag)
    tag = np.where(np.isfinite(reach), tag, SKY)
    colour = np.array([COLOURS.get(each, (0, 0, 0)) for each in range(256)], np.uint8)[tag]
    away = np.where(np.abs(rays) < 1e-12, 1e-12, rays)
    for low, high, kind, paint in solids:
        a, b = (low - start) / away, (high - start) / away
        near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
        hit = (near <= far) & (near > 0) & (near < reach)
        reach, tag = np.where(hit, near, reach), np.where(hit, kind, tag)
        colour[hit] = paint
    return reach, tag, colour


class Sensed:
    """Data of a sensor at a tick; rendered when they are asked for."""

    def __init__(self, world: World, sensor: Actor) -> None:
        parent = sensor.parent.transform if sensor.parent is not None else Transform()
        self.frame, self.timestamp, self.transform = world.frame, 0.0, sensor.transform
        self._kind, self._start = sensor.type_id, composed(parent, sensor.transform)
        hero = next((each for each in world.actors if each.attributes.get("role_name") == "hero"), None)
        self._solids = world.solids(hero)
        if "camera" in self._kind:
            self.width, self.height = (int(sensor.attributes[f"image_size_{axis}"]) for axis in "xy")
            self._focal = self.width / 2 / math.tan(math.radians(float(sensor.attributes["fov"])) / 2)
        else:
            self.channels = 12

    @cached_property
    def raw_data(self) -> bytes:
        return self._points[0] if self._kind == "sensor.lidar.ray_cast" else self._pixels()

    def get_point_count(self, channel: int) -> int:
        return int(self._points[1][channel])

    def _pixels(self) -> bytes:
        place, axes = self._start
        column, row = np.meshgrid(
            np.arange(self.width) - (self.width - 1) / 2, np.arange(self.height) - (self.height - 1) / 2
        )
        local = np.stack([np.ones(column.size), column.ravel() / self._focal, -row.ravel() / self._focal], axis=1)
        depth, tag, colour = cast(self._solids, place, local @ axes)
        bgra = np.zeros((column.size, 4), np.uint8)
        if self._kind.endswith("rgb"):
            bgra[:, :3] = colour[:, ::-1]
        elif self._kind.endswith("depth"):
            value = np.rint(np.minimum(depth, 1000.0) / 1000 * (256**3 - 1)).astype(np.int64)
            bgra[:, 2], bgra[:, 1], bgra[:, 0] = value & 255, value >> 8 & 255, value >> 16
        else:
            bgra[:, 2] = tag
        return bgra.tobytes()

    @cached_property
    def _points(self) -> tuple[bytes, np.ndarray]:
        place, axes = self._start
        up, around = np.radians(np.linspace(-25, 2, 12)), np.radians(np.arange(0, 360, 1.5))
        level = [np.outer(np.cos(up), turned) for turned in (np.cos(around), np.sin(around))]
        rays = np.stack([*level, np.outer(np.sin(up), np.ones(240))], axis=-1).reshape(-1, 3)
        reach, _, _ = cast(self._solids, place, rays @ axes)
        kept = np.isfinite(reach) & (reach < 80)
        rows = np.column_stack([rays[kept] * reach[kept, None], np.full(kept.sum(), 0.5)])
        return rows.astype("<f4").tobytes(), kept.reshape(12, 240).sum(axis=1)


class Traffic:
    def __init__(self) -> None:
        self.synchronous = False

    def set_synchronous_mode(self, enabled: bool) -> None:
        self.synchronous = enabled

    def set_random_device_seed(self, seed: int) -> None:
        pass

    def get_port(self) -> int:
        return 8000


class FakeCarla:
    """The module: names of classes as in `carla`."""

    Location, Rotation, Transform, Vector3D = Location, Rotation, Transform, Vector3D

    def __init__(self) -> None:
        self.world, self.traffic = World(), Traffic()
        self.reachable = True
        names = ("Car", "Truck", "Bus", "Motorcycle", "Bicycle")
        self.CityObjectLabel = SimpleNamespace(**{name: name for name in names})

    def Client(self, host: str, port: int) -> Any:  # noqa: N802 - as in carla
        return self

    def set_timeout(self, seconds: float) -> None:
        pass

    def get_world(self) -> World:
        if not self.reachable:
            raise RuntimeError("time-out of 30000ms while waiting for the simulator, make sure it is ready")
        return self.world

    def load_world(self, town: str) -> World:
        return self.get_world()

    def get_trafficmanager(self) -> Traffic:
        return self.traffic

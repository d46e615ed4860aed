"""The ego vehicle and the traffic of a drive."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from appocc.carla.frames import point_of, pose_of
from appocc.carla.server import Server
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.geometry import apply, inverse, transform

_EGO = "vehicle.tesla.model3"
_WALK_MPS = 1.4
# Share of the length behind the rear axle where the server does not tell its wheels.
_REAR_OVERHANG = 0.2


@dataclass(frozen=True, eq=False)
class Ego:
    """The vehicle that carries the sensors.

    Attributes:
        actor: the carla.Vehicle.
        vehicle_from_ego: (4, 4) pose of the ego frame (below the rear axle, on the road) in the vehicle's own frame.
        body: its dimensions.
    """

    actor: Any
    vehicle_from_ego: FloatArray
    body: EgoVehicle


def spawn_ego(server: Server, random: Random) -> Ego:
    """Spawn the ego vehicle at a spawn point of the map, driven by the traffic manager.

    Raises:
        DataError: if the server has no car or no free spawn point.
    """
    library = server.world.get_blueprint_library()
    blueprint = next(iter(library.filter(_EGO)), None)
    points = list(server.world.get_map().get_spawn_points())
    if blueprint is None or not points:
        raise DataError(f"{server.town}: expected {_EGO} and a spawn point, got none")
    blueprint.set_attribute("role_name", "hero")
    random.shuffle(points)
    actor = next((found for point in points if (found := server.spawn(blueprint, point)) is not None), None)
    if actor is None:
        raise DataError(f"{server.town}: expected a free spawn point, got {len(points)} that are not")
    server.tick()
    actor.set_autopilot(True, server.traffic.get_port())
    return _measured(actor)


def spawn_traffic(server: Server, random: Random, vehicles: int, walkers: int) -> None:
    """Spawn up to so many vehicles, driven by the traffic manager, and walkers, driven by their controllers."""
    library = server.world.get_blueprint_library()
    kinds = sorted(library.filter("vehicle.*"), key=lambda each: str(each.id))
    points = list(server.world.get_map().get_spawn_points())
    random.shuffle(points)
    count = 0
    for point in points:
        if count >= vehicles:
            break
        blueprint = random.choice(kinds)
        if blueprint.has_attribute("color"):
            colours = list(blueprint.get_attribute("color").recommended_values)
            blueprint.set_attribute("color", random.choice(colours))
        actor = server.spawn(blueprint, point)
        if actor is not None:
            actor.set_autopilot(True, server.traffic.get_port())
            count += 1
    _spawn_walkers(server, random, walkers)


def _spawn_walkers(server: Server, random: Random, count: int) -> None:
    library, world = server.world.get_blueprint_library(), server.world
    kinds = sorted(library.filter("walker.pedestrian.*"), key=lambda each: str(each.id))
    found = []
    for _ in range(count if kinds else 0):
        place = world.get_random_location_from_navigation()
        if place is None:
            continue
        actor = server.spawn(random.choice(kinds), server.carla.Transform(place, server.carla.Rotation()))
        if actor is not None:
            found.append(actor)
    server.tick()
    for actor in found:
        controller = server.spawn(library.find("controller.ai.walker"), server.carla.Transform(), actor)
        target = world.get_random_location_from_navigation()
        if controller is not None and target is not None:
            server.before_destroying(controller.stop)
            controller.start()
            controller.go_to_location(target)
            controller.set_max_speed(_WALK_MPS)


def _measured(actor: Any) -> Ego:
    """Return the ego vehicle with its rear axle, which is between its third and fourth wheel."""
    box = actor.bounding_box
    centre, length, width = point_of(box.location), 2 * box.extent.x, 2 * box.extent.y
    rear = float(centre[0]) - length / 2
    axle = rear + _REAR_OVERHANG * length
    wheels = list(actor.get_physics_control().wheels)
    if len(wheels) == 4:
        places = np.array([point_of(wheel.position) for wheel in wheels[2:]])
        for scale in (0.01, 1.0):  # centimetres in 0.9.15, metres in other versions
            along = float(apply(inverse(pose_of(actor.get_transform())), places * scale)[:, 0].mean())
            if rear < along < float(centre[0]):
                axle = along
                break
    body = EgoVehicle(length_m=length, width_m=width, rear_overhang_m=axle - rear)
    return Ego(actor, transform(np.eye(3), [axle, float(centre[1]), 0.0]), body)

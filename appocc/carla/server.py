"""Connection to a CARLA server: synchronous while it is used, and left as it was found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from appocc.errors import DataError
from appocc.extras import import_extra

_TIMEOUT_S = 30.0


@dataclass(eq=False)
class Server:
    """A CARLA server in synchronous mode.

    Attributes:
        carla: the module carla.
        world: its world.
        traffic: its traffic manager.
        delta_s: simulated time of a tick.
        town: name of the map.
    """

    carla: Any
    world: Any
    traffic: Any
    delta_s: float
    town: str
    _undo: list[Callable[[], object]] = field(default_factory=list)

    def spawn(self, blueprint: Any, transform: Any, attach_to: Any = None) -> Any:
        """Spawn an actor; None if something is in its way."""
        actor = self.world.try_spawn_actor(blueprint, transform, attach_to=attach_to)
        if actor is not None:
            self._undo.append(actor.destroy)
        return actor

    def before_destroying(self, stop: Callable[[], object]) -> None:
        """Call a function before the actors spawned so far are destroyed."""
        self._undo.append(stop)

    def tick(self) -> int:
        """Simulate a step; return the number of its frame."""
        return int(self.world.tick())

    def clear(self) -> None:
        """Destroy all actors that were spawned, the latest first."""
        while self._undo:
            with suppress(RuntimeError):  # a lost server must not keep the others
                self._undo.pop()()


@contextmanager
def connected(host: str, port: int, town: str | None, delta_s: float) -> Iterator[Server]:
    """Yield a server in synchronous mode; afterwards its settings are restored and all spawned actors destroyed.

    Args:
        host: name or address.
        port: port of the server.
        town: map to load; None: the one that is loaded.
        delta_s: simulated time of a tick.

    Raises:
        AppoccError: if the package carla is not installed.
        DataError: if the server cannot be reached or fails.
    """
    carla = import_extra("carla", "carla", "recording from CARLA")
    try:
        client = carla.Client(host, port)
        client.set_timeout(_TIMEOUT_S)
        world = client.get_world() if town is None else client.load_world(town)
        before, settings = world.get_settings(), world.get_settings()
        traffic = client.get_trafficmanager()
        server = Server(carla, world, traffic, delta_s, str(world.get_map().name).rpartition("/")[2])
        try:
            settings.synchronous_mode, settings.fixed_delta_seconds = True, delta_s
            world.apply_settings(settings)
            traffic.set_synchronous_mode(True)
            yield server
        finally:
            server.clear()
            with suppress(RuntimeError):
                traffic.set_synchronous_mode(False)
            with suppress(RuntimeError):
                world.apply_settings(before)
    except RuntimeError as error:  # what the client raises for everything, such as a time-out
        reason = " ".join(str(error).split())[:200]
        raise DataError(f"{host}:{port}: expected a CARLA server, got an error ({reason})") from error

"""The part of a traffic log that a scene shows, while road users are exchanged and added."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.simulation.traffic import Actor, Light, TrafficLog

# Gaps to the body of another road user: parked, on foot, driving, and the ego; time gap in front of a vehicle.
_PARKED_M, _ON_FOOT_M, _DRIVING_M, _EGO_M = 0.3, 0.25, 0.9, 1.5
_AHEAD_S = 1.0
# Who stays beyond this range of the ego meets none of the added road users.
_FAR_M = 90.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Excerpt:
    """S steps of the traffic of A actors.

    Attributes:
        first: step of the log.
        step_s: time between steps.
        ego: index of the actor that carries the cameras.
        actors: static properties.
        xy_m: (S, A, 2) centres, town frame; NaN while absent.
        yaw_rad: (S, A) headings.
        lights: (S, A) uint8 `Light` bits.
    """

    first: int
    step_s: float
    ego: int
    actors: tuple[Actor, ...]
    xy_m: FloatArray
    yaw_rad: FloatArray
    lights: ByteArray

    @staticmethod
    def of(log: TrafficLog, start_s: float, seconds: float, ego: int) -> Excerpt:
        """Return the steps of a log that a scene interpolates between."""
        first = min(int(start_s / log.step_s + 1e-9), len(log.xy_m) - 2)
        steps = slice(first, int(np.ceil((start_s + seconds) / log.step_s - 1e-9)) + 2)
        return Excerpt(
            first=first,
            step_s=log.step_s,
            ego=ego,
            actors=log.actors,
            xy_m=log.xy_m[steps].astype(np.float64),
            yaw_rad=log.yaw_rad[steps].astype(np.float64),
            lights=log.lights[steps],
        )

    def written_to(self, log: TrafficLog) -> TrafficLog:
        """Return the log with these steps; actors that it does not have are absent in its other steps."""
        steps, more = slice(self.first, self.first + len(self.xy_m)), (0, len(self.actors) - len(log.actors))
        xy = np.pad(log.xy_m, ((0, 0), more, (0, 0)), constant_values=np.nan)
        yaw = np.pad(log.yaw_rad, ((0, 0), more), constant_values=np.nan)
        lights = np.pad(log.lights, ((0, 0), more))
        xy[steps], yaw[steps], lights[steps] = self.xy_m, self.yaw_rad, self.lights
        return replace(log, actors=self.actors, xy_m=xy, yaw_rad=yaw, lights=lights)

    @property
    def size_m(self) -> FloatArray:
        """(A, 2) length and width of the actors."""
        return np.array([actor.size_lwh_m[:2] for actor in self.actors], np.float64).reshape(-1, 2)

    @property
    def parked(self) -> BoolArray:
        """(A,) whether an actor is parked."""
        return np.asarray((self.lights & Light.PARKED).any(axis=0))

    @property
    def seconds(self) -> FloatArray:
        """(S,) time since the first step."""
        return np.asarray(np.arange(len(self.xy_m)) * self.step_s, np.float64)

    def near_ego(self, range_m: float) -> BoolArray:
        """Return (A,) whether an actor comes within a range of the ego; the ego itself does."""
        away = np.hypot(*np.moveaxis(self.xy_m - self.xy_m[:, self.ego, None], -1, 0))
        return np.asarray((np.where(np.isfinite(away), away, np.inf) <= range_m).any(axis=0))

    def keeps_clear(self, points_m: FloatArray, radius_m: float) -> bool:
        """Return whether a body of discs of a radius around points (S, P, 2) keeps clear of all actors.

        The way of a vehicle in the next second counts as part of it: nobody steps in front of one.
        """
        rows = np.flatnonzero(self.near_ego(_FAR_M))
        on_foot = np.array([self.actors[row].kind == "pedestrian" for row in rows], np.bool_)
        speed = np.hypot(*np.moveaxis(np.gradient(self.xy_m[:, rows], self.step_s, axis=0), -1, 0))
        way_m = np.where(on_foot, 0.0, _AHEAD_S * np.nan_to_num(speed))[:, None]
        offset = points_m[:, :, None] - self.xy_m[:, None, rows]
        cos, sin = np.cos(self.yaw_rad[:, None, rows]), np.sin(self.yaw_rad[:, None, rows])
        ahead, aside = cos * offset[..., 0] + sin * offset[..., 1], cos * offset[..., 1] - sin * offset[..., 0]
        along = np.abs(ahead - way_m / 2) - way_m / 2 - self.size_m[rows, 0] / 2
        gap = np.hypot(np.maximum(along, 0), np.maximum(np.abs(aside) - self.size_m[rows, 1] / 2, 0))
        least = np.where(self.parked[rows], _PARKED_M, np.where(on_foot, _ON_FOOT_M, _DRIVING_M))
        least[rows == self.ego] = _EGO_M
        return not (gap < least + radius_m).any()  # absent actors have NaN

    def with_user(self, actor: Actor, xy_m: FloatArray, yaw_rad: FloatArray) -> Excerpt:
        """Return the excerpt with one more actor at positions (S, 2) with headings (S,)."""
        return replace(
            self,
            actors=(*self.actors, actor),
            xy_m=np.concatenate([self.xy_m, xy_m[:, None]], axis=1),
            yaw_rad=np.concatenate([self.yaw_rad, yaw_rad[:, None]], axis=1),
            lights=np.pad(self.lights, ((0, 0), (0, 1))),
        )

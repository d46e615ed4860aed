"""Places and turns of the module that speaks CARLA's interface, in its left-handed frame (x ahead, y right, z up)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Vector3D:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Location(Vector3D):
    pass


@dataclass
class Rotation:
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def axes(self) -> np.ndarray:
        """Forward, right and up as rows, by turning the axes one after the other as Unreal does."""
        p, y, r = (math.radians(a) for a in (self.pitch, self.yaw, self.roll))
        forward = np.array([math.cos(p) * math.cos(y), math.cos(p) * math.sin(y), math.sin(p)])
        level_right = np.array([-math.sin(y), math.cos(y), 0.0])
        level_up = np.array([-math.sin(p) * math.cos(y), -math.sin(p) * math.sin(y), math.cos(p)])
        right = math.cos(r) * level_right - math.sin(r) * level_up
        up = math.sin(r) * level_right + math.cos(r) * level_up
        return np.stack([forward, right, up])


@dataclass
class Transform:
    location: Vector3D = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def place(self) -> np.ndarray:
        return np.array([self.location.x, self.location.y, self.location.z])


def composed(parent: Transform, child: Transform) -> tuple[np.ndarray, np.ndarray]:
    """Place and axes (rows) in the world of a transform relative to another one."""
    axes = parent.rotation.axes()
    return parent.place() + child.place() @ axes, child.rotation.axes() @ axes


@dataclass
class BoundingBox:
    location: Location
    extent: Vector3D
    rotation: Rotation = field(default_factory=Rotation)

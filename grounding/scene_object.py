"""One thing on the street as the ego knows it: place, size, heading, motion, colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, check_shape, frozen
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import footprints

# First part of a category, where it is not the plain word itself.
_PLAIN = {
    "construction": "construction vehicle",
    "other_vehicle": "vehicle",
    "emergency_vehicle": "vehicle",
    "human": "person",
    "pedestrian": "person",
    "": "vehicle",
}


@dataclass(frozen=True)
class SceneObject:
    """A vehicle, a bicycle or a person, in the ego frame.

    Attributes:
        id: instance token of an annotated one, "track N" or "blob N".
        category: nuScenes category or tracking class, '' where only its shape is known.
        centre_m: (2,) centre of its footprint.
        yaw_rad: direction of its long axis; its heading where the front is known.
        front_known: whether `yaw_rad` points to its front.
        length_m: size along its heading.
        width_m: size across.
        height_m: size upwards, None where unknown.
        velocity_mps: (2,) over ground along the ego's axes, None where unknown.
        rgb: (3,) sRGB 0..255 of its cells in the map, None where no colour is known.
        yaw_rate_radps: how fast its heading turns, to the left positive, None where unknown.
        acceleration_mps2: change of its speed, None where unknown.
    """

    id: str
    category: str
    centre_m: FloatArray
    yaw_rad: float
    front_known: bool
    length_m: float
    width_m: float
    height_m: float | None = None
    velocity_mps: FloatArray | None = None
    rgb: FloatArray | None = None
    yaw_rate_radps: float | None = None
    acceleration_mps2: float | None = None

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        for name, array, size in (
            ("centre_m", self.centre_m, 2),
            ("velocity_mps", self.velocity_mps, 2),
            ("rgb", self.rgb, 3),
        ):
            if array is not None:
                check_shape(f"object {name}", array, (size,))
                frozen(array)

    @property
    def speed_mps(self) -> float | None:
        """Speed over ground, None where unknown."""
        return None if self.velocity_mps is None else float(np.hypot(*self.velocity_mps))

    def distance_m(self, ego: EgoVehicle) -> float:
        """Return the distance from the ego's centre to the object's centre."""
        return float(np.hypot(self.centre_m[0] - ego.centre_m, self.centre_m[1]))

    def footprint(self) -> FloatArray:
        """Corners (4, 2) in the ego frame."""
        return footprints(self.centre_m, self.yaw_rad, [self.length_m, self.width_m])

    def covers(self, xy_m: FloatArray, margin_m: float = 0.0) -> BoolArray:
        """Whether points (..., 2) lie in the footprint, grown on all sides by a margin."""
        offset = xy_m - self.centre_m
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along, across = offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin
        half = np.array([self.length_m, self.width_m]) / 2 + margin_m
        return np.asarray((np.abs(along) <= half[0]) & (np.abs(across) <= half[1]))

    @property
    def noun(self) -> str:
        """The plain word for its class."""
        first, *rest = self.category.removeprefix("vehicle.").split(".")
        return rest[-1] if first == "emergency" and rest else _PLAIN.get(first, first)

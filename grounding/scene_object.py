"""One object of a scene: class, position, size, heading, motion and colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import BoolArray, FloatArray, check_shape, frozen
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import footprints
from appocc.motion_state import MOVING_MPS, STANDING_MPS

# Plain nouns for the first part of a category that is not one itself.
_PLAIN_NOUNS = {
    "construction": "construction vehicle",
    "other_vehicle": "vehicle",
    "emergency_vehicle": "vehicle",
    "human": "person",
    "pedestrian": "person",
    "": "vehicle",
}
# A car is called a van from this height on.
_VAN_HEIGHT_M = 1.95
# A heading this far from ours is against our way. A vehicle has passed us if its centre is this far behind ours.
_FACING_RAD, _PASSED_M = np.radians(120), 3.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneObject:
    """A vehicle, a bicycle or a person in the ego frame. Two objects are equal only if they are the same one.

    Attributes:
        id: instance token of an annotation, "track N", "object N" or "blob N".
        category: nuScenes category or tracking class; '' where only the shape is known.
        centre_m: (2,) centre of the footprint.
        yaw_rad: direction of the long axis; the heading where the front is known.
        front_known: whether `yaw_rad` points to the front.
        length_m: size along the heading.
        width_m: size across the heading.
        height_m: None where unknown.
        velocity_mps: (2,) over ground along the ego's axes; None where unknown.
        rgb: (3,) sRGB 0..255, median of its cells in the map, or predicted paint; None where unknown.
        yaw_rate_radps: positive to the left; None where unknown.
        acceleration_mps2: along the heading; None where unknown.
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
        """Check shapes and keep read-only copies of the arrays.

        Raises:
            ShapeError: if a shape does not fit.
        """
        for name, array, size in (
            ("centre_m", self.centre_m, 2),
            ("velocity_mps", self.velocity_mps, 2),
            ("rgb", self.rgb, 3),
        ):
            if array is not None:
                check_shape(f"object {name}", array, (size,))
                own = array.copy()
                frozen(own)
                object.__setattr__(self, name, own)

    @property
    def speed_mps(self) -> float | None:
        """Speed over ground; None where unknown."""
        return None if self.velocity_mps is None else float(np.hypot(*self.velocity_mps))

    @property
    def is_standing(self) -> bool | None:
        """Whether it stands; None where its speed is unknown."""
        return None if self.speed_mps is None else self.speed_mps < STANDING_MPS

    @property
    def is_moving(self) -> bool:
        """Whether it is known to move."""
        return self.speed_mps is not None and self.speed_mps >= MOVING_MPS

    def distance_m(self, ego: EgoVehicle) -> float:
        """Return the distance from the ego's centre to the object's centre."""
        return float(np.hypot(self.centre_m[0] - ego.centre_m, self.centre_m[1]))

    def faces_ego(self, ego: EgoVehicle) -> bool:
        """Return whether its front is towards us: it heads against our way, and has not passed us."""
        return self.front_known and abs(self.yaw_rad) > _FACING_RAD and self.centre_m[0] > ego.centre_m - _PASSED_M

    def footprint(self) -> FloatArray:
        """Return the corners (4, 2) of the footprint in the ego frame."""
        return footprints(self.centre_m, self.yaw_rad, [self.length_m, self.width_m])

    def covers(self, xy_m: FloatArray, margin_m: float = 0.0) -> BoolArray:
        """Return whether points (..., 2) are in the footprint, grown on all sides by a margin."""
        offset = xy_m - self.centre_m
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along, across = offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin
        half = np.array([self.length_m, self.width_m]) / 2 + margin_m
        return np.asarray((np.abs(along) <= half[0]) & (np.abs(across) <= half[1]))

    @property
    def common_name(self) -> str:
        """The noun that people use: nuScenes has no class for vans, which are tall cars there."""
        tall = self.height_m is not None and self.height_m >= _VAN_HEIGHT_M
        return "van" if tall and self.class_name == "car" else self.class_name

    def coloured_name(self, colour: str) -> str:
        """Return its noun with a colour, '' for none: "red car", "person in red"."""
        if colour and self.class_name == "person":
            return f"{self.common_name} in {colour}"
        return f"{colour} {self.common_name}".strip()

    @property
    def class_name(self) -> str:
        """The class as a plain noun."""
        first, *rest = self.category.removeprefix("vehicle.").split(".")
        return rest[-1] if first == "emergency" and rest else _PLAIN_NOUNS.get(first, first)

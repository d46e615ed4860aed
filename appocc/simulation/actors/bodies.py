"""Body shapes at three levels of detail."""

from __future__ import annotations

from functools import cache

import numpy as np

from appocc.errors import NotFoundError, ShapeError
from appocc.simulation.actors.cars import car
from appocc.simulation.actors.modelling import Modeller, Size, Template
from appocc.simulation.actors.people import walker
from appocc.simulation.actors.profiles import CAR_BODIES
from appocc.simulation.actors.riders import bicycle, motorcycle
from appocc.simulation.actors.trucks_and_buses import box_truck, bus
from appocc.simulation.mesh import Mesh

DETAILS = 3
VARIANTS = 3
POSES = 4
BODIES = (
    *("sedan", "hatchback", "estate", "suv", "pickup", "minivan", "van", "box_truck", "bus"),
    *("motorcycle", "bicycle", "adult", "child"),
)


def body_mesh(body: str, size_lwh_m: Size, variant: int, detail: int) -> Mesh:
    """Build a body that fills its box: x forward, y left, z up, origin at the bottom centre; painted faces are grey.

    Args:
        body: one of `BODIES`.
        size_lwh_m: length, width, height.
        variant: any number; it selects make, wheels and clothes.
        detail: 0 near (to 25 m), 1 middle (to 60 m), 2 far.

    Raises:
        NotFoundError: if the body is unknown.
        ShapeError: if a size is not positive, or the level of detail does not exist.
    """
    if min(size_lwh_m) <= 0 or not np.isfinite(size_lwh_m).all():
        raise ShapeError(f"size of {body}: expected three positive lengths, got {size_lwh_m}")
    shape = template(body, variant, detail)
    length, width, height = size_lwh_m
    places = shape.places.astype(np.float64)
    x = places[:, 0] * length + places[:, 3] * height
    vertices = np.stack([x, places[:, 1] * width, places[:, 2] * height], axis=1)
    normals = shape.normals / (np.array(size_lwh_m) / shape.size_lwh_m)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        np.zeros((len(vertices), 2), np.float32),
        shape.faces,
        shape.material,
        shape.tint,
        np.full(len(shape.faces), -1, np.int32),
    )


def template(body: str, variant: int, detail: int, pose: int = 0) -> Template:
    """Return a body without a size; `pose` is the phase of the step of pedestrians and riders.

    Raises:
        NotFoundError: if the body is unknown.
        ShapeError: if the level of detail does not exist.
    """
    if body not in BODIES:
        raise NotFoundError(f"there is no body '{body}', only {', '.join(BODIES)}")
    if not 0 <= detail < DETAILS:
        raise ShapeError(f"detail: expected 0..{DETAILS - 1}, got {detail}")
    return _template(body, variant % VARIANTS, detail, pose % POSES)


@cache
def _template(body: str, variant: int, detail: int, pose: int) -> Template:
    # All phases of a step are scaled alike, so that nobody's size changes while walking.
    first = _model(body, variant, detail, 0)
    return first.template(first) if pose == 0 else _model(body, variant, detail, pose).template(first)


def _model(body: str, variant: int, detail: int, pose: int) -> Modeller:
    if body in ("adult", "child"):
        return walker(body == "child", variant, detail, pose)
    if body == "bicycle":
        return bicycle(variant, detail, pose)
    if body in CAR_BODIES:
        return car(body, variant, detail)
    return {"box_truck": box_truck, "bus": bus, "motorcycle": motorcycle}[body](variant, detail)

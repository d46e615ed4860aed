"""Body shapes at three levels of detail."""

from __future__ import annotations

from functools import cache

import numpy as np

from appocc.errors import NotFoundError, ShapeError
from appocc.simulation.actors.cars import model_car
from appocc.simulation.actors.modelling import BodyTemplate, Modeller, Size
from appocc.simulation.actors.people import model_pedestrian
from appocc.simulation.actors.profiles import CAR_BODIES
from appocc.simulation.actors.riders import model_bicycle, model_motorcycle
from appocc.simulation.actors.trucks_and_buses import model_box_truck, model_bus
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
    shape = body_template(body, variant, detail)
    length, width, height = size_lwh_m
    coordinates = shape.coordinates.astype(np.float64)
    x = coordinates[:, 0] * length + coordinates[:, 3] * height
    vertices = np.stack([x, coordinates[:, 1] * width, coordinates[:, 2] * height], axis=1)
    normals = shape.normals / (np.array(size_lwh_m) / shape.size_lwh_m)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(
        vertices_m=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        uv=np.zeros((len(vertices), 2), np.float32),
        faces=shape.faces,
        material=shape.material,
        tint=shape.tint,
        tag=np.full(len(shape.faces), -1, np.int32),
    )


def body_template(body: str, variant: int, detail: int, pose: int = 0) -> BodyTemplate:
    """Return a body without a size; `pose` is the phase of the step of pedestrians and riders.

    Raises:
        NotFoundError: if the body is unknown.
        ShapeError: if the level of detail does not exist.
    """
    if body not in BODIES:
        raise NotFoundError(f"there is no body '{body}', only {', '.join(BODIES)}")
    if not 0 <= detail < DETAILS:
        raise ShapeError(f"detail: expected 0..{DETAILS - 1}, got {detail}")
    return _build_template(body, variant % VARIANTS, detail, pose % POSES)


@cache
def _build_template(body: str, variant: int, detail: int, pose: int) -> BodyTemplate:
    # All phases of a step are scaled alike, so that the size does not change while walking.
    first = _model(body, variant, detail, 0)
    return first.to_template(first) if pose == 0 else _model(body, variant, detail, pose).to_template(first)


def _model(body: str, variant: int, detail: int, pose: int) -> Modeller:
    if body in ("adult", "child"):
        return model_pedestrian(body == "child", variant, detail, pose)
    if body == "bicycle":
        return model_bicycle(variant, detail, pose)
    if body in CAR_BODIES:
        return model_car(body, variant, detail)
    return {"box_truck": model_box_truck, "bus": model_bus, "motorcycle": model_motorcycle}[body](variant, detail)

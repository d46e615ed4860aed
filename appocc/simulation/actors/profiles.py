"""Side and top views of cars, in metres at their usual sizes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.simulation.actors.modelling import Size

Line = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class CarProfile:
    """The shape parameters of a car; x forward from the middle of the car, z up, metres.

    Attributes:
        size_lwh_m: usual length, width, height.
        wheel_m: radius of the wheels.
        axles_x_m: front and rear axle.
        sill_m: height of the lower edge.
        waist_m: height where the body is widest.
        shoulder: (x, z) of the line from the front wing to the tail, from the front corner to the rear corner.
        pillars: (x at the belt, x at the roof, z at the roof's edge) of the edges of the side windows, front to rear.
        panes: material between two pillars: g(lass), t(rim), p(aint).
        screens_x_m: on the centre line: bottom and top of the windscreen, top and bottom of the rear window.
        widths: half widths as shares: belt, edge of the roof.
        crown_m: rise of the middle of the bonnet and of the roof above their edges.
        front_outline: (z, setback) of the front's centre line from the bumper's lower edge to the bonnet.
        rear_outline: (z, setback) of the rear's centre line.
        bed: whether an open load bed follows the cabin.
        rails: roof rails.
        cladding: dark lower body.
    """

    size_lwh_m: Size
    wheel_m: float
    axles_x_m: tuple[float, float]
    sill_m: float
    waist_m: float
    shoulder: Line
    pillars: tuple[tuple[float, float, float], ...]
    panes: str
    screens_x_m: tuple[float, float, float, float]
    widths: tuple[float, float]
    crown_m: tuple[float, float]
    front_outline: Line
    rear_outline: Line
    bed: bool = False
    rails: bool = False
    cladding: bool = False


_FRONT: Line = ((0.19, 0.05), (0.36, 0.012), (0.50, 0.012), (0.59, 0.04), (0.70, 0.10), (0.735, 0.17))
_REAR: Line = ((0.22, 0.05), (0.42, 0.010), (0.56, 0.015), (0.70, 0.05), (0.86, 0.08), (0.965, 0.11))
_HATCH_REAR: Line = ((0.24, 0.05), (0.44, 0.010), (0.58, 0.015), (0.72, 0.06), (0.90, 0.09), (0.98, 0.12))

_SEDAN = CarProfile(
    size_lwh_m=(4.70, 1.82, 1.45),
    wheel_m=0.325,
    axles_x_m=(1.44, -1.36),
    sill_m=0.20,
    waist_m=0.72,
    shoulder=((2.23, 0.725), (1.80, 0.80), (1.00, 0.90), (-0.10, 0.93), (-1.36, 0.96), (-1.72, 0.97), (-2.24, 0.965)),
    pillars=(
        *((1.02, 0.24, 1.335), (0.88, 0.13, 1.352), (-0.06, -0.12, 1.395), (-0.14, -0.19, 1.395)),
        *((-1.12, -0.82, 1.355), (-1.74, -1.00, 1.325)),
    ),
    panes="pgtgp",
    screens_x_m=(1.26, 0.33, -1.05, -1.84),
    widths=(0.885, 0.715),
    crown_m=(0.045, 0.055),
    front_outline=_FRONT,
    rear_outline=_REAR,
)
_HATCHBACK = CarProfile(
    size_lwh_m=(4.25, 1.79, 1.47),
    wheel_m=0.32,
    axles_x_m=(1.30, -1.27),
    sill_m=0.20,
    waist_m=0.72,
    shoulder=((2.00, 0.735), (1.60, 0.81), (0.88, 0.92), (-0.20, 0.95), (-1.30, 0.985), (-1.75, 0.99), (-2.01, 0.98)),
    pillars=(
        *((0.92, 0.22, 1.36), (0.78, 0.11, 1.375), (-0.20, -0.26, 1.41), (-0.28, -0.33, 1.41)),
        *((-1.22, -1.08, 1.38), (-1.86, -1.56, 1.34)),
    ),
    panes="pgtgp",
    screens_x_m=(1.14, 0.31, -1.66, -1.98),
    widths=(0.885, 0.725),
    crown_m=(0.045, 0.055),
    front_outline=_FRONT,
    rear_outline=_HATCH_REAR,
)
_ESTATE = replace(
    _SEDAN,
    size_lwh_m=(4.75, 1.83, 1.48),
    shoulder=((2.25, 0.725), (1.82, 0.80), (1.02, 0.90), (-0.10, 0.93), (-1.36, 0.96), (-2.00, 0.985), (-2.26, 0.98)),
    pillars=(
        *((1.04, 0.26, 1.345), (0.90, 0.15, 1.36), (-0.06, -0.12, 1.41), (-0.14, -0.19, 1.41)),
        *((-1.10, -1.02, 1.405), (-1.20, -1.10, 1.40), (-1.95, -1.62, 1.38), (-2.10, -1.82, 1.36)),
    ),
    panes="pgtgtgp",
    screens_x_m=(1.28, 0.35, -1.94, -2.22),
    rear_outline=_HATCH_REAR,
    rails=True,
)
_SUV = CarProfile(
    size_lwh_m=(4.60, 1.87, 1.67),
    wheel_m=0.36,
    axles_x_m=(1.38, -1.32),
    sill_m=0.26,
    waist_m=0.82,
    shoulder=((2.17, 0.89), (1.75, 0.96), (1.00, 1.04), (-0.10, 1.07), (-1.32, 1.10), (-1.90, 1.12), (-2.19, 1.11)),
    pillars=(
        *((1.04, 0.40, 1.54), (0.90, 0.28, 1.56), (-0.04, -0.10, 1.605), (-0.12, -0.17, 1.605)),
        *((-1.02, -0.96, 1.60), (-1.12, -1.04, 1.595), (-1.70, -1.48, 1.575), (-2.00, -1.72, 1.55)),
    ),
    panes="pgtgtgp",
    screens_x_m=(1.24, 0.49, -1.84, -2.12),
    widths=(0.89, 0.74),
    crown_m=(0.05, 0.06),
    front_outline=((0.26, 0.06), (0.46, 0.012), (0.62, 0.012), (0.74, 0.03), (0.86, 0.07), (0.90, 0.13)),
    rear_outline=((0.28, 0.06), (0.52, 0.010), (0.68, 0.015), (0.80, 0.05), (1.02, 0.08), (1.11, 0.12)),
    rails=True,
    cladding=True,
)
_MINIVAN = CarProfile(
    size_lwh_m=(4.80, 1.89, 1.75),
    wheel_m=0.335,
    axles_x_m=(1.50, -1.40),
    sill_m=0.20,
    waist_m=0.76,
    shoulder=((2.27, 0.84), (1.95, 0.93), (1.42, 1.02), (0.10, 1.04), (-1.40, 1.06), (-2.10, 1.07), (-2.30, 1.06)),
    pillars=(
        *((1.46, 0.58, 1.63), (1.25, 0.42, 1.65), (0.14, 0.08, 1.69), (0.05, 0.00, 1.69)),
        *((-1.02, -1.00, 1.69), (-1.12, -1.10, 1.69), (-1.98, -1.86, 1.66), (-2.18, -2.02, 1.64)),
    ),
    panes="pgtgtgp",
    screens_x_m=(1.70, 0.68, -2.12, -2.26),
    widths=(0.90, 0.77),
    crown_m=(0.05, 0.055),
    front_outline=((0.20, 0.05), (0.40, 0.012), (0.56, 0.012), (0.66, 0.04), (0.80, 0.12), (0.86, 0.19)),
    rear_outline=((0.24, 0.05), (0.46, 0.010), (0.62, 0.010), (0.78, 0.03), (1.00, 0.05), (1.06, 0.07)),
)
_PICKUP = CarProfile(
    size_lwh_m=(5.35, 1.90, 1.82),
    wheel_m=0.39,
    axles_x_m=(1.72, -1.45),
    sill_m=0.36,
    waist_m=0.90,
    shoulder=((2.55, 0.99), (2.15, 1.06), (1.15, 1.12), (0.30, 1.14), (-0.62, 1.15), (-1.45, 1.15), (-2.59, 1.15)),
    pillars=(
        *((1.20, 0.62, 1.68), (1.06, 0.50, 1.70), (0.20, 0.16, 1.755), (0.12, 0.08, 1.755)),
        *((-0.50, -0.50, 1.745), (-0.64, -0.60, 1.735)),
    ),
    panes="pgtgp",
    screens_x_m=(1.36, 0.70, -0.63, -0.67),
    widths=(0.90, 0.76),
    crown_m=(0.05, 0.06),
    front_outline=((0.36, 0.05), (0.56, 0.012), (0.70, 0.015), (0.80, 0.03), (0.95, 0.06), (1.00, 0.11)),
    rear_outline=((0.40, 0.06), (0.60, 0.010), (0.70, 0.04), (0.80, 0.05), (1.08, 0.05), (1.15, 0.05)),
    bed=True,
    cladding=True,
)
_VAN = CarProfile(
    size_lwh_m=(5.40, 2.00, 2.35),
    wheel_m=0.345,
    axles_x_m=(1.72, -1.62),
    sill_m=0.24,
    waist_m=0.86,
    shoulder=((2.57, 0.92), (2.25, 1.04), (1.66, 1.18), (0.60, 1.22), (-0.60, 1.22), (-2.00, 1.22), (-2.64, 1.22)),
    pillars=(
        *((1.70, 0.92, 2.16), (1.48, 0.76, 2.19), (0.66, 0.62, 2.27), (0.40, 0.38, 2.28)),
        *((-1.20, -1.20, 2.29), (-2.62, -2.58, 2.26)),
    ),
    panes="pgppp",
    screens_x_m=(1.94, 1.02, -2.60, -2.66),
    widths=(0.94, 0.845),
    crown_m=(0.05, 0.06),
    front_outline=((0.24, 0.05), (0.46, 0.012), (0.62, 0.012), (0.74, 0.04), (0.90, 0.10), (0.95, 0.15)),
    rear_outline=((0.30, 0.03), (0.50, 0.010), (0.66, 0.03), (0.82, 0.03), (1.14, 0.03), (1.22, 0.035)),
)
_PROFILES = {
    **{"sedan": _SEDAN, "hatchback": _HATCHBACK, "estate": _ESTATE, "suv": _SUV},
    **{"pickup": _PICKUP, "minivan": _MINIVAN, "van": _VAN},
}
CAR_BODIES = tuple(_PROFILES)


def car_profile(body: str, variant: int) -> CarProfile:
    """Return the profile of a variant: 0 unchanged, 1 longer roof and higher belt, 2 shorter and rounder cabin."""
    profile = _PROFILES[body]
    back, belt, head = ((0.0, 0.0, 0.0), (-0.09, 0.02, -0.05), (0.05, -0.015, 0.06))[variant]
    if profile.bed or body == "van":
        back = 0.0
    middle = float(np.mean([top for _, top, _ in profile.pillars]))

    def roof_x(x: float) -> float:
        return x + (back if x < middle else head) * min(1.0, abs(x - middle) / 0.5)

    foot, top, rear_top, rear_foot = profile.screens_x_m
    rear_limit = rear_foot + 0.05
    return replace(
        profile,
        shoulder=tuple((x, z + (belt if x < 1.2 else 0.0)) for x, z in profile.shoulder),
        pillars=tuple((base, max(roof_x(x), rear_limit), z) for base, x, z in profile.pillars),
        screens_x_m=(foot, roof_x(top), max(roof_x(rear_top), rear_limit), rear_foot),
        rails=profile.rails and variant != 2,
    )

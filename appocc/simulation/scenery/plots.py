"""Building plots: rectangles along the frontages that overlap neither paved ground nor each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from appocc.simulation.scenery.builder import LocalFrame
from appocc.simulation.scenery.site import Frontage, Site

_SMALLEST_M = 5.0


@dataclass(frozen=True, kw_only=True)
class Plot:
    """A rectangle for a building; s = 0 .. width along the street, d = 0 (front) .. depth.

    Attributes:
        frame: local frame at its front left corner.
        width_m: width along the street.
        depth_m: depth away from the street.
        arterial: whether the street is an arterial.
        open_left: whether its left side is free, so that it has windows.
        open_right: whether its right side is free.
        front_m: distance from its front to the paved edge.
        road_m: distance from its front to the nearest carriageway or car park.
        backland: whether it is in a second row, visible only through gaps.
        built: whether it has a building; plots on roundabouts have none.
    """

    frame: LocalFrame
    width_m: float
    depth_m: float
    arterial: bool
    open_left: bool
    open_right: bool
    front_m: float
    road_m: float
    backland: bool = False
    built: bool = True


@dataclass(frozen=True)
class PlotSpacing:
    """Ranges of plot widths, depths, front gardens and gaps, metres."""

    width_m: tuple[float, float]
    depth_m: tuple[float, float]
    front_m: tuple[float, float]
    gap_m: tuple[float, float]
    gap_share: float
    empty_share: float


SPACINGS: dict[str, PlotSpacing] = {
    "old": PlotSpacing((6.5, 13.5), (9.5, 12.5), (0.1, 0.1), (2.0, 5.0), 0.10, 0.03),
    "modern": PlotSpacing((15.0, 30.0), (12.0, 17.0), (0.8, 4.5), (3.0, 9.0), 0.75, 0.08),
    "suburb": PlotSpacing((9.5, 14.5), (8.0, 10.5), (4.5, 7.5), (4.5, 10.0), 1.0, 0.04),
    "industrial": PlotSpacing((20.0, 46.0), (16.0, 30.0), (4.0, 10.0), (6.0, 14.0), 1.0, 0.10),
}
# Distance from the paved edge to the second row.
_BACK_M = {"old": 26.0, "modern": 34.0, "suburb": 27.0, "industrial": 44.0}


def lay_plots(site: Site, style: str, rng: np.random.Generator) -> list[Plot]:
    """Lay plots along all frontages, then a second row behind them, and reserve their ground."""
    spacing = SPACINGS[style]
    plots: list[Plot] = []
    for frontage in site.frontages():
        plots += _lay_along(site, frontage, spacing, rng)
    for frontage in site.frontages(_BACK_M[style], 10.0):
        plots += _lay_along(site, frontage, spacing, rng, backland=True)
    site.occupied[site.island] = 0
    return [plot if _is_off_islands(site, plot) else replace(plot, built=False) for plot in plots]


def _is_off_islands(site: Site, plot: Plot) -> bool:
    return not site.is_set(plot.frame.at(plot.width_m / 2, plot.depth_m / 2)[None], site.island)[0]


def _lay_along(
    site: Site, frontage: Frontage, spacing: PlotSpacing, rng: np.random.Generator, backland: bool = False
) -> list[Plot]:
    """Lay plots from one end of a frontage to the other; at its ends a building may extend around the corner."""
    plots: list[Plot] = []
    front = float(rng.uniform(*spacing.front_m))
    s, end = -2.5, frontage.length_m + 2.5
    terraced = False
    while s < end - _SMALLEST_M:
        width = min(float(rng.uniform(*spacing.width_m)), end - s)
        if end - (s + width) < _SMALLEST_M and spacing.gap_share < 0.5:
            width = min(end - s, 1.25 * spacing.width_m[1])
        depth = float(rng.uniform(*spacing.depth_m))
        skip = rng.random() < (0.5 if backland else spacing.empty_share)
        plot = (
            None if skip else _fit_plot(site, frontage, s, width, depth, front, terraced=terraced, backland=backland)
        )
        if plot is None:
            s, terraced = s + (width if skip else 1.5), False
            continue
        if terraced:
            plots[-1] = replace(plots[-1], open_right=False)
        plots.append(plot)
        s = float((plot.frame.origin_m - frontage.frame.origin_m) @ frontage.frame.along) + plot.width_m
        gap = rng.random() < (spacing.gap_share if not backland else 0.8)
        terraced = not gap
        s += float(rng.uniform(*spacing.gap_m)) if gap else 0.02
    return plots


def _fit_plot(
    site: Site,
    frontage: Frontage,
    s: float,
    width_m: float,
    depth_m: float,
    front_m: float,
    terraced: bool,
    backland: bool,
) -> Plot | None:
    """Return the plot, moved back, shortened or narrowed until it is free; None if it never is."""
    tries = [
        (share, back) for share in (1.0, 0.8, 0.62) for back in (0.2, 0.5, 0.9, 1.5) if width_m * share >= _SMALLEST_M
    ]
    frame = frontage.frame
    sizes = [(width_m * share, depth_m * (0.6 + 0.4 * share), front_m + back) for share, back in tries]
    local = [[[s, d], [s + width, d], [s + width, d + depth], [s, d + depth]] for width, depth, d in sizes]
    outlines = frame.to_town(np.array(local).reshape(-1, 4, 2))
    for number in np.flatnonzero(site.may_be_free(outlines)):
        if not site.is_free(outlines[number]):
            continue
        width, depth, d = sizes[number]
        site.occupy(frame.corners(s + 0.25, s + width - 0.25, d + 0.25, d + depth - 0.25))
        front = np.linspace(outlines[number, 0], outlines[number, 1], 5)
        road = float(site.distance_at(front, site.to_road_m).min())
        return Plot(
            frame=frame.moved(s, d),
            width_m=width,
            depth_m=depth,
            arterial=frontage.arterial,
            open_left=not terraced,
            open_right=True,
            front_m=d,
            road_m=road,
            backland=backland,
        )
    return None

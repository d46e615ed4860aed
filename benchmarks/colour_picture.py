"""Picture of the effect of colour at a crossing: trajectories of vehicles that lose their identity.

    python -m benchmarks.colour_picture [--seed 7] [--out docs/tracking_colour.png]

A synthetic scene of `benchmarks.colour_ablation`, exact maps, 20 s in one picture; both trackers get the same blobs.
Vehicles are drawn in their paints, at the moment when the ego is nearest to the middle of the crossing; those
occluded at that moment are pale. Forward is up. A vehicle that loses its identity in either panel has its whole
trajectory drawn in both, in the colour of its track, dotted while it is occluded. The counts are those of the
benchmark.

Seed 7 is a typical scene: among those of the first twenty whose gain is nearest to the mean gain (3.5 switches), its
two counts are nearest to their means.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from appocc.checks import FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from appocc.files import whole_file
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform, yaw_of
from benchmarks.colour_ablation import GREY, RANGE_M, Scene, judged, made_scene, without_colour
from benchmarks.encounters import HOUSE_M, Sight, encounters
from tracking.evaluation.frames import GATE_M
from tracking.presets import MAPS
from tracking.tracker import Tracker, TrackerConfig

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEED, OUT = 7, Path("docs/tracking_colour.png")
# The first, the second and all later tracks of a vehicle.
INKS = ("#2fd3e6", "#ff4d8d", "#ffb01f")
_BACK, _HOUSE, _DARK, _FRONT, _EGO, _PALE = "#16181d", "#3c3e44", "#0c0c0c", "#f4f4f4", "#23a455", 0.22
_DOTS = (0, (1, 1.5))
_RING: dict[str, Any] = {"marker": "o", "markersize": 14, "markeredgecolor": "white", "markeredgewidth": 3}
# In half panels: width and height of labels, tried distances from their marks, half a mark, free margin.
_LABEL, _AWAY, _MARK, _GAP = np.array([0.26, 0.085]), (0.15, 0.2, 0.25, 0.33, 0.43), 0.03, 0.01


class Followed(NamedTuple):
    """A vehicle: trajectory in the picture (K, 2), track ids (K,), 0 for none, and paint (3,) in 0..1."""

    way_m: FloatArray
    ids: IntArray
    paint: FloatArray


class Loss(NamedTuple):
    """An identity switch: the index of the frame in which a vehicle changes its track, and both tracks."""

    at: int
    before: int
    after: int


# Tracks and switches ----------------------------------------------------------------------------------------------


def tracks_of(scene: Scene, config: TrackerConfig) -> dict[int, IntArray]:
    """Return, for each vehicle number, its track id in each frame (K,); 0 without a track or if it is not evaluated.

    Pairs equal those of `tracking.evaluation.clear_id_hota` as long as no two vehicles compete for a track: the last
    track while it is within the gate, else the nearest.
    """
    tracker = Tracker(config)
    of = {int(number): np.zeros(len(scene), np.int64) for step in scene for number in step.number}
    last: dict[int, int] = {}
    for k, step in enumerate(scene):
        tracks = tracker.update(step.detections, step.timestamp_us, step.world_from_ego)
        away_m = cdist(step.xy_m, tracks.position_world_m[:, :2])
        for i in np.flatnonzero(step.demanded & (away_m < GATE_M).any(axis=1)):
            number = int(step.number[i])
            near = {int(tracks.id[j]): away_m[i, j] for j in np.flatnonzero(away_m[i] < GATE_M)}
            last[number] = last[number] if last.get(number) in near else min(near, key=lambda name: near[name])
            of[number][k] = last[number]
    return of


def losses(ids: IntArray) -> list[Loss]:
    """Return the identity switches of a vehicle with these track ids (K,), 0 for none."""
    there = np.flatnonzero(ids)
    return [Loss(int(b), int(ids[a]), int(ids[b])) for a, b in pairwise(there) if ids[a] != ids[b]]


def ways_of(sights: Sequence[Sight]) -> dict[int, FloatArray]:
    """Return the world positions (K, 2) of each vehicle, NaN where it is far away."""
    ways = {int(number): np.full((len(sights), 2), np.nan) for sight in sights for number in sight.number}
    for k, sight in enumerate(sights):
        for number, xy_m in zip(sight.number, sight.xy_m, strict=True):
            ways[int(number)][k] = xy_m
    return ways


# Drawing ----------------------------------------------------------------------------------------------------------


def draw(seed: int) -> Figure:
    """Draw both panels for the scene of a seed."""
    # pyplot would keep figures in memory and look for a display.
    from matplotlib.figure import Figure

    scene, sights = made_scene(seed, noisy=False), encounters(seed)
    now = min(sights, key=lambda sight: float(np.hypot(*sight.world_from_ego[:2, 3])))
    # The ego's heading is the picture's y axis.
    picture_from_world = transform(quaternion_from_yaw(np.pi / 2), np.zeros(3)) @ inverse(now.world_from_ego)
    ways = {number: _moved(picture_from_world, way_m) for number, way_m in ways_of(sights).items()}
    paints = {int(number): rgb / 255 for one in sights for number, rgb in zip(one.number, one.rgb, strict=True)}
    trackers = {"place alone": without_colour(MAPS), "place and colour": MAPS}
    found = [tracks_of(scene, config) for config in trackers.values()]
    lost = {number for tracks in found for number in tracks if losses(tracks[number])}
    marks_m = [ways[number][loss.at] for tracks in found for number in lost for loss in losses(tracks[number])]
    half_m = max(RANGE_M, 1.05 * float(np.abs(marks_m).max(initial=0.0)))
    figure = Figure(figsize=(13, 7.3), dpi=100, facecolor=_BACK)
    figure.subplots_adjust(left=0.008, right=0.992, top=0.925, bottom=0.065, wspace=0.02)
    for axes, tracks, (name, config) in zip(figure.subplots(1, 2), found, trackers.items(), strict=True):
        title = f"{name}: {judged(scene, config).IDS} switches"
        axes.set_title(title, color=_FRONT, fontsize=20, fontweight="bold", pad=9)
        axes.set(xlim=(-half_m, half_m), ylim=(-half_m, half_m), aspect="equal", xticks=[], yticks=[])
        _crossing(axes, now, picture_from_world)
        followed = [Followed(ways[number], tracks[number], paints[number]) for number in sorted(lost)]
        _followed(axes, followed, half_m)
    _legend(figure)
    return figure


def _moved(picture_from_world: FloatArray, xy_m: FloatArray) -> FloatArray:
    """Transform world positions (N, 2) to the picture."""
    return apply(picture_from_world, np.pad(xy_m, ((0, 0), (0, 1))))[:, :2]


def _crossing(axes: Axes, now: Sight, picture_from_world: FloatArray) -> None:
    """Draw the ground, the houses at the corners, the vehicles, and the ego."""
    axes.set_facecolor((GREY / 255,) * 3)
    turn_rad = float(yaw_of(picture_from_world))
    middles_m = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (HOUSE_M + 100.0)
    for xy_m in _moved(picture_from_world, middles_m):
        _box(axes, xy_m, turn_rad, np.full(2, 200.0), facecolor=_HOUSE, edgecolor=_DARK)
    for i, xy_m in enumerate(_moved(picture_from_world, now.xy_m)):
        look: dict[str, Any] = {
            "facecolor": now.rgb[i] / 255,
            "edgecolor": _DARK,
            "alpha": 1.0 if now.seen[i] else _PALE,
        }
        _box(axes, xy_m, now.yaw_rad[i] + turn_rad, now.size_m[i], **look)
    ego = EgoVehicle()
    _box(axes, np.zeros(2), np.pi / 2, np.array([ego.width_m, ego.length_m]), facecolor="white", edgecolor=_EGO)
    axes.plot([-0.6, 0.0, 0.6], [0.5, 1.6, 0.5], color=_EGO, linewidth=2.5)


def _followed(axes: Axes, vehicles: Sequence[Followed], half_m: float) -> None:
    """Draw the trajectories of vehicles by track, and mark the switches."""
    lost = [(vehicle, loss) for vehicle in vehicles for loss in losses(vehicle.ids)]
    marks_m = np.array([vehicle.way_m[loss.at] for vehicle, loss in lost]).reshape(-1, 2)
    crossed_m = np.concatenate([np.zeros((1, 2)), *(vehicle.way_m[vehicle.ids > 0] for vehicle in vehicles)])
    labels_m = places_of_labels(marks_m / half_m, crossed_m / half_m) * half_m
    for vehicle in vehicles:
        _way(axes, vehicle)
    for (vehicle, loss), mark_m, label_m in zip(lost, marks_m, labels_m, strict=True):
        axes.plot(*np.stack([mark_m, label_m]).T, color="white", linewidth=1.5, zorder=7)
        axes.plot(*mark_m, color="none", zorder=8, **_RING)
        axes.plot(*mark_m, "o", color=vehicle.paint, markersize=11, markeredgecolor=_DARK, zorder=8)
        _box(axes, label_m, 0.0, _LABEL[::-1] * half_m, facecolor=_BACK, edgecolor="white", zorder=9)
        x, y = label_m.tolist()
        for off, side, text, ink in (
            (-0.023, "right", str(loss.before), _ink(vehicle.ids, loss.before)),
            (0.0, "center", "\N{RIGHTWARDS ARROW}", _FRONT),
            (0.023, "left", str(loss.after), _ink(vehicle.ids, loss.after)),
        ):
            look: dict[str, Any] = {"color": ink, "fontsize": 14, "fontweight": "bold", "zorder": 10}
            axes.text(x + off * half_m, y, text, ha=side, va="center_baseline", **look)


def places_of_labels(marks: FloatArray, crossed: FloatArray) -> FloatArray:
    """Return centres (M, 2) of labels next to marks (M, 2): clear of each other and of marks, over few points (P, 2).

    All coordinates are in half panels from the middle.
    """
    places: list[FloatArray] = []
    turns = np.arange(16) * np.pi / 8
    around = np.concatenate([away * np.stack([np.cos(turns), np.sin(turns)], axis=1) for away in _AWAY])
    for mark in marks:
        tried = mark + around
        tried = tried[(np.abs(tried) + _LABEL / 2 < 1).all(axis=1)]
        covered = _within(tried, np.array(places).reshape(-1, 2), _LABEL + _GAP)
        covered += _within(tried, marks, _LABEL / 2 + _MARK)
        places.append(tried[(len(crossed) * covered + _within(tried, crossed, _LABEL / 2 + _GAP)).argmin()])
    return np.array(places).reshape(-1, 2)


def _within(places: FloatArray, points: FloatArray, reach: FloatArray) -> IntArray:
    """Return the number (N,) of points (P, 2) within `reach` (2,) of each place (N, 2) in both axes."""
    near = (np.abs(places[:, None] - points[None]) < reach).all(axis=2)
    return np.asarray(near.sum(axis=1))


def _box(axes: Axes, xy_m: FloatArray, yaw_rad: float, size_m: FloatArray, **look: Any) -> None:
    """Return the patch of a vehicle from its centre and heading in the picture, its width and length."""
    from matplotlib.patches import Rectangle

    width_m, length_m = size_m[:2].tolist()
    corner = (float(xy_m[0]) - length_m / 2, float(xy_m[1]) - width_m / 2)
    degrees = float(np.degrees(yaw_rad))
    axes.add_patch(
        Rectangle(corner, length_m, width_m, angle=degrees, rotation_point="center", linewidth=1.2, **look)
    )


def _ink(ids: IntArray, name: int) -> str:
    """Return the line colour of one of a vehicle's tracks (K,): first, second or later."""
    order = list(dict.fromkeys(ids[ids > 0].tolist()))
    return INKS[min(order.index(name), len(INKS) - 1)]


def _way(axes: Axes, vehicle: Followed) -> None:
    """Draw a trajectory from the first to the last observation; a dot for a single one."""
    there = np.flatnonzero(vehicle.ids)
    for a, b in pairwise(there):
        piece = vehicle.way_m[a : b + 1].T
        if b > a + 1:
            axes.plot(*piece, color=_FRONT, linewidth=2, linestyle=_DOTS, zorder=3)
            continue
        for width, ink, zorder in ((6, _DARK, 4), (4, _ink(vehicle.ids, vehicle.ids[a]), 6)):
            axes.plot(*piece, color=ink, linewidth=width, solid_capstyle="round", zorder=zorder)
    for a in there[~np.isin(there - 1, there) & ~np.isin(there + 1, there)]:
        ink = _ink(vehicle.ids, vehicle.ids[a])
        axes.plot(*vehicle.way_m[a], "o", color=ink, markersize=7, markeredgecolor=_DARK, zorder=6)


def _legend(figure: Figure) -> None:
    """Draw the legend of lines and marks."""
    from matplotlib.lines import Line2D

    shown = [
        (Line2D([], [], color=INKS[0], linewidth=4), "first track of a vehicle"),
        (Line2D([], [], color=INKS[1], linewidth=4), "another track"),
        (Line2D([], [], color=_FRONT, linewidth=2, linestyle=_DOTS), "out of sight"),
        (Line2D([], [], color="none", **_RING), "switch: identity lost (paint inside)"),
        (
            Line2D([], [], color="none", marker="s", markersize=11, markerfacecolor="white", markeredgecolor=_EGO),
            "ego",
        ),
    ]
    figure.legend(
        *zip(*shown, strict=True),
        loc="lower center",
        ncols=len(shown),
        frameon=False,
        labelcolor=_FRONT,
        fontsize=12.5,
    )


def main(words: Sequence[str] | None = None) -> None:
    """Draw the picture and write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args(words)
    if given.seed < 0:
        parser.error(f"--seed: expected 0 or more, got {given.seed}")
    try:
        with whole_file(given.out) as temporary:
            draw(given.seed).savefig(temporary, format="png", metadata={"Software": None})
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")


if __name__ == "__main__":
    main()

"""Roads of a CARLA map, from its waypoints: lanes as areas, painted lines, crossings and junctions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from appocc.carla.frames import point_of, pose_of
from appocc.checks import ByteArray, FloatArray
from appocc.geometry import yaw_of
from appocc.importers.maps import LogMap
from appocc.nuscenes.maps import PX_PER_M, MaskWindow
from appocc.nuscenes.writer import Writer

_STEP_M = 1.0
# Lanes where cars may drive, by the name of their carla.LaneType.
_ROAD = ("Driving", "Parking", "Bidirectional", "Entry", "Exit", "OnRamp", "OffRamp")
_UNPAINTED = ("NONE", "Curb", "Grass", "Other")
_YELLOW = "Yellow"
_MOST_LANES = 12


class Strip(NamedTuple):
    """A piece of a lane between two sections of its road.

    Attributes:
        outline: (K, 2) its area.
        is_road: whether cars may drive there.
        is_junction: whether it is within a junction.
    """

    outline: FloatArray
    is_road: bool
    is_junction: bool


@dataclass(frozen=True, eq=False)
class Roads:
    """Roads in our axes, world frame.

    Attributes:
        strips: lanes.
        lines: painted lines (K, 2), and whether each is yellow.
        crossings: outlines (K, 2).
    """

    strips: tuple[Strip, ...]
    lines: tuple[tuple[FloatArray, bool], ...]
    crossings: tuple[FloatArray, ...]

    def near(self, low_m: FloatArray, high_m: FloatArray) -> Roads:
        """Return what overlaps the rectangle between two points (2,)."""

        def overlaps(points: FloatArray) -> bool:
            return bool((points.max(axis=0) >= low_m).all() and (points.min(axis=0) <= high_m).all())

        return Roads(
            tuple(strip for strip in self.strips if overlaps(strip.outline)),
            tuple(line for line in self.lines if overlaps(line[0])),
            tuple(outline for outline in self.crossings if overlaps(outline)),
        )

    def mask(self, low_m: FloatArray, high_m: FloatArray) -> MaskWindow:
        """Return the drivable area between two points (2,) as a mask of 0.1 m."""
        size = np.ceil((high_m - low_m) * PX_PER_M).astype(int)
        grey: ByteArray = np.zeros((int(size[1]), int(size[0])), np.uint8)
        for strip in self.strips:
            if strip.is_road:
                # Places are counted in sixteenths of a pixel, and pixel centres at whole numbers.
                pixels = np.rint(((strip.outline - low_m) * PX_PER_M - 0.5) * 16).astype(np.int32)
                cv2.fillPoly(grey, [pixels], 255, shift=4)
        return MaskWindow(grey[::-1], (float(low_m[0]), float(low_m[1])), None, "")

    def write(self, name: str, writer: Writer, log: str) -> None:
        """Write the vector map and the mask of a drive; nothing without a road.

        Raises:
            DataError: if a file cannot be written.
        """
        areas = [strip for strip in self.strips if strip.is_road]
        if not areas:
            return
        made = LogMap(name, [(strip.outline, ()) for strip in areas])
        for line, is_yellow in self.lines:
            made.expansion.add_line("road_divider" if is_yellow else "lane_divider", line)
        for outline in made.merged([strip.outline for strip in areas if strip.is_junction]):
            made.expansion.add_area("road_segment", outline, is_intersection=True)
        for outline in self.crossings:
            made.expansion.add_area("ped_crossing", outline)
        made.write(writer, log)


def read_roads(carla_map: Any) -> Roads:
    """Read the roads of a carla.Map: its driving lanes every metre, and the lanes beside them.

    A lane's outer line is its right one; the line in the middle of a road is the left one of lane -1, else of lane 1.
    Broken lines are whole: the interface does not tell their dashes.
    """
    lanes: dict[tuple[int, int, int], dict[float, Any]] = {}
    for waypoint in carla_map.generate_waypoints(_STEP_M):
        for each in _across(waypoint):
            lanes.setdefault((each.road_id, each.section_id, each.lane_id), {}).setdefault(round(each.s, 2), each)
    strips: list[Strip] = []
    lines: list[tuple[FloatArray, bool]] = []
    for (road, section, lane), found in sorted(lanes.items()):
        row = [found[s] for s in sorted(found)]
        left, right = _sides(row)
        kind = _name(row[0].lane_type)
        strips.append(Strip(np.concatenate([left, right[::-1]]), kind in _ROAD, bool(row[0].is_junction)))
        lines += _painted(right, [each.right_lane_marking for each in row])
        if lane == -1 or (lane == 1 and (road, section, -1) not in lanes):
            lines += _painted(left, [each.left_lane_marking for each in row])
    return Roads(tuple(strips), tuple(lines), tuple(_outlines(carla_map.get_crosswalks())))


def _across(waypoint: Any) -> Iterable[Any]:
    """Yield a waypoint and those beside it on the lanes of its road."""
    yield waypoint
    for side in ("get_left_lane", "get_right_lane"):
        each, seen = waypoint, {waypoint.lane_id}
        for _ in range(_MOST_LANES):
            # To the left of the middle of the road, left and right are those of the other direction.
            turned = each.lane_id * waypoint.lane_id < 0
            name = side if not turned else ("get_right_lane" if side == "get_left_lane" else "get_left_lane")
            each = getattr(each, name)()
            if each is None or each.lane_id in seen or each.road_id != waypoint.road_id:
                break
            seen.add(each.lane_id)
            yield each


def _sides(row: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
    """Return the left and the right side (K, 2) of a lane, prolonged to the end of its road by a step."""
    poses = np.array([pose_of(each.transform) for each in row])
    places, yaws = poses[:, :2, 3], yaw_of(poses)
    half = np.array([each.lane_width for each in row])[:, None] / 2
    across = np.stack([-np.sin(yaws), np.cos(yaws)], axis=1) * half
    ahead = np.array([np.cos(yaws[-1]), np.sin(yaws[-1])])
    if row[-1].lane_id > 0:  # such lanes run against the road
        ahead = -ahead
    end = places[-1] + ahead * _STEP_M
    places, across = np.vstack([places, end]), np.vstack([across, across[-1:]])
    return places + across, places - across


def _painted(side: FloatArray, markings: Sequence[Any]) -> list[tuple[FloatArray, bool]]:
    """Return the pieces (K, 2) of a side with a painted line, and whether each is yellow."""
    colours = [None if _name(m.type) in _UNPAINTED else _name(m.color) == _YELLOW for m in markings]
    pieces, start = [], 0
    for end in range(1, len(colours) + 1):
        if end == len(colours) or colours[end] != colours[start]:
            if (is_yellow := colours[start]) is not None:
                pieces.append((side[start : end + 1], is_yellow))
            start = end
    return pieces


def _outlines(corners: Iterable[Any]) -> list[FloatArray]:
    """Return the outlines (K, 2) of crossings: corners in a row, the first one again at the end of each."""
    outlines: list[FloatArray] = []
    found: list[FloatArray] = []
    for corner in corners:
        point = point_of(corner)[:2]
        if len(found) > 2 and np.allclose(point, found[0], atol=1e-3):
            outlines.append(np.array(found))
            found = []
        else:
            found.append(point)
    return outlines


def _name(value: Any) -> str:
    """Return the name of a value of one of CARLA's enumerations."""
    return str(value).rpartition(".")[2]

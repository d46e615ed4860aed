"""Waymo's map features (map.proto) as roads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.checks import FloatArray
from appocc.importers.waymo.fields import Area, Lane, Line, MapFeature, Point
from appocc.importers.waymo.roads import Roads
from appocc.importers.waymo.wire import Message

# LaneCenter.LaneType
_BICYCLES = 3
# RoadLine.RoadLineType; 0 is unknown.
_LAYERS = {
    **dict.fromkeys((1, 2, 3), "lane_divider"),  # white
    **dict.fromkeys((4, 5, 6, 7, 8), "road_divider"),  # yellow
}


def roads_of(features: Sequence[Message]) -> Roads:
    """Return the roads of map features.

    Stop signs, whose stop lines are unknown, and speed bumps are left out.

    Raises:
        ValueError: if a feature is damaged.
    """
    lanes: list[FloatArray] = []
    junctions: list[FloatArray] = []
    edges: list[FloatArray] = []
    markings: list[tuple[str, FloatArray]] = []
    areas: dict[int, list[FloatArray]] = {MapFeature.CROSSWALK: [], MapFeature.DRIVEWAY: []}
    for feature in features:
        if feature.has(MapFeature.LANE):
            lane = feature.message(MapFeature.LANE)
            line = _points(lane.messages(Lane.POLYLINE))
            if lane.integer(Lane.TYPE) != _BICYCLES and len(line) > 1:
                lanes.append(line)
                junctions += [line] if lane.integer(Lane.INTERPOLATING) else []
        elif feature.has(MapFeature.ROAD_LINE):
            painted = feature.message(MapFeature.ROAD_LINE)
            line, layer = _points(painted.messages(Line.POLYLINE)), _LAYERS.get(painted.integer(Line.TYPE))
            markings += [(layer, line)] if layer is not None and len(line) > 1 else []
        elif feature.has(MapFeature.ROAD_EDGE):
            edges.append(_points(feature.message(MapFeature.ROAD_EDGE).messages(Line.POLYLINE)))
        for kind, found in areas.items():
            outline = _points(feature.message(kind).messages(Area.POLYGON))
            found += [outline] if len(outline) > 2 else []
    edges = [edge for edge in edges if len(edge) > 1]
    return Roads(lanes, junctions, edges, markings, areas[MapFeature.CROSSWALK], areas[MapFeature.DRIVEWAY])


def _points(messages: Sequence[Message]) -> FloatArray:
    """Return points (K, 2)."""
    line = np.array([(point.real(Point.X), point.real(Point.Y)) for point in messages]).reshape(-1, 2)
    if not np.isfinite(line).all():
        raise ValueError("expected finite points, got some that are not")
    return line

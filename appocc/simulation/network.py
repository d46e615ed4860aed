"""The road network of a town: lanes, junctions and signals, read from SUMO network files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from appocc.checks import FloatArray, check_finite, frozen
from appocc.errors import DataError, NotFoundError
from appocc.files import unzipped

LaneKind = Literal["driving", "parking", "cycling", "walking", "shoulder", "other"]
# SUMO's vehicle classes of driving lanes; a lane closed to all is a parking lane (see `town_generation.layout`).
_DRIVERS = frozenset({"passenger", "private", "taxi", "bus", "truck", "delivery"})
_TYPES: dict[str, LaneKind] = {
    "parking": "parking",
    "sidewalk": "walking",
    "shoulder": "shoulder",
    "biking": "cycling",
    "border": "other",
    "median": "other",
    "none": "other",
    "restricted": "other",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Lane:
    """A lane.

    Attributes:
        name: SUMO's id, such as `a_0`; inside junctions it begins with a colon.
        edge: name of the edge it belongs to.
        index: 0 is the rightmost.
        kind: permitted use.
        width_m: width.
        speed_mps: speed limit.
        centre_m: (N, 2) centre line in the direction of travel, town frame.
    """

    name: str
    edge: str
    index: int
    kind: LaneKind
    width_m: float
    speed_mps: float
    centre_m: FloatArray

    def __post_init__(self) -> None:
        """Check the centre line.

        Raises:
            ShapeError: if it is not finite.
        """
        check_finite(f"lane {self.name}", self.centre_m)
        frozen(self.centre_m)


@dataclass(frozen=True)
class Edge:
    """One direction of a street between two junctions; lanes from right to left."""

    name: str
    from_junction: str
    to_junction: str
    priority: int
    lanes: tuple[Lane, ...]


@dataclass(frozen=True, eq=False)
class Junction:
    """A junction: its outline (N, 2) in metres, and its right-of-way rule (SUMO's type)."""

    name: str
    kind: str
    centre_m: FloatArray
    outline_m: FloatArray


@dataclass(frozen=True)
class Connection:
    """A connection across a junction from lane to lane.

    Attributes:
        from_lane: name of the lane that ends at the junction.
        to_lane: name of the lane that begins there.
        via: name of the lane inside the junction, empty if there is none.
        direction: s straight, l left, r right, t turnaround, L and R partly.
        signal: name of the traffic light, empty if there is none.
        link: number of the link in the light's state, -1 if there is none.
    """

    from_lane: str
    to_lane: str
    via: str
    direction: str
    signal: str
    link: int


@dataclass(frozen=True, eq=False, kw_only=True)
class RoadNetwork:
    """All streets of a town, in the town frame: metres, x east, y north.

    Attributes:
        edges: one entry per direction of a street.
        inner_lanes: lanes inside junctions.
        junctions: junctions with an outline.
        connections: connections across the junctions.
        low_m: (2,) lower corner of the streets' bounds.
        high_m: (2,) upper corner.
        offset_m: (2,) offset added to the coordinates of the source (OpenDRIVE).
    """

    edges: tuple[Edge, ...]
    inner_lanes: tuple[Lane, ...]
    junctions: tuple[Junction, ...]
    connections: tuple[Connection, ...]
    low_m: FloatArray
    high_m: FloatArray
    offset_m: FloatArray

    @cached_property
    def lanes(self) -> Mapping[str, Lane]:
        """All lanes by name, including those inside junctions."""
        outside = (lane for edge in self.edges for lane in edge.lanes)
        return {lane.name: lane for lane in (*outside, *self.inner_lanes)}

    @cached_property
    def _edge_between(self) -> Mapping[tuple[str, str], Edge]:
        return {(edge.from_junction, edge.to_junction): edge for edge in self.edges}

    def opposite(self, edge: Edge) -> Edge | None:
        """Return the opposite direction of the same street, None for a one-way street."""
        return self._edge_between.get((edge.to_junction, edge.from_junction))

    def lane(self, name: str) -> Lane:
        """Return a lane by name.

        Raises:
            NotFoundError: if there is none.
        """
        if name not in self.lanes:
            raise NotFoundError(f"the town has no lane '{name}'")
        return self.lanes[name]


def read_network(path: Path) -> RoadNetwork:
    """Read a SUMO network (.net.xml or .net.xml.gz).

    Raises:
        DataError: if it is missing, damaged, or not a network.
    """
    text = unzipped(path)
    try:
        return _network(ElementTree.fromstring(text))
    except (ElementTree.ParseError, ValueError, TypeError) as error:
        raise DataError(f"{path}: no SUMO network ({error})") from error


def _network(root: ElementTree.Element) -> RoadNetwork:
    if root.tag != "net":
        raise ValueError(f"expected the element 'net', got '{root.tag}'")
    location = root.find("location")
    if location is None:
        raise ValueError("it has no location")
    bounds, offset = _numbers(location, "convBoundary", 4), _numbers(location, "netOffset", 2)
    inside = [e for e in root.iter("edge") if e.get("function") == "internal"]
    return RoadNetwork(
        edges=tuple(_edge(e) for e in root.iter("edge") if e.get("function", "normal") == "normal"),
        inner_lanes=tuple(_lane(lane, str(e.get("id"))) for e in inside for lane in e.iter("lane")),
        junctions=tuple(
            _junction(j) for j in root.iter("junction") if j.get("type") != "internal" and j.get("shape")
        ),
        connections=tuple(_connection(c) for c in root.iter("connection") if not str(c.get("from")).startswith(":")),
        low_m=bounds[:2],
        high_m=bounds[2:],
        offset_m=offset,
    )


def _numbers(element: ElementTree.Element, name: str, count: int) -> FloatArray:
    numbers = np.array([float(v) for v in element.get(name, "").split(",") if v])
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"expected {count} numbers in {name}, got '{element.get(name)}'")
    return numbers


def _points(text: str | None) -> FloatArray:
    """Parse `x,y x,y ...` or `x,y,z x,y,z ...` as (N, 2); heights are ignored: towns are flat."""
    return np.array([[float(v) for v in point.split(",")[:2]] for point in (text or "").split()]).reshape(-1, 2)


def _edge(element: ElementTree.Element) -> Edge:
    name = str(element.get("id"))
    return Edge(
        name,
        str(element.get("from")),
        str(element.get("to")),
        int(element.get("priority", "-1")),
        tuple(_lane(lane, name) for lane in element.iter("lane")),
    )


def _lane(element: ElementTree.Element, edge: str) -> Lane:
    return Lane(
        name=str(element.get("id")),
        edge=edge,
        index=int(element.get("index", "0")),
        kind=_kind(element, inside=edge.startswith(":")),
        width_m=float(element.get("width", "3.2")),
        speed_mps=float(element.get("speed", "13.9")),
        centre_m=_points(element.get("shape")),
    )


def _kind(element: ElementTree.Element, inside: bool) -> LaneKind:
    if element.get("type") in _TYPES:
        return _TYPES[str(element.get("type"))]
    allowed, forbidden = element.get("allow"), str(element.get("disallow", "")).split()
    if allowed is None and "all" in forbidden:
        return "other" if inside else "parking"  # on junctions these lanes connect pavements and shoulders
    if allowed is None:
        return "driving" if not set(forbidden) >= _DRIVERS else "other"
    words = set(allowed.split())
    if words & _DRIVERS:
        return "driving"
    return "cycling" if "bicycle" in words else "walking" if "pedestrian" in words else "other"


def _junction(element: ElementTree.Element) -> Junction:
    centre = np.array([float(element.get("x", "nan")), float(element.get("y", "nan"))])
    return Junction(str(element.get("id")), str(element.get("type")), centre, _points(element.get("shape")))


def _connection(element: ElementTree.Element) -> Connection:
    return Connection(
        f"{element.get('from')}_{element.get('fromLane')}",
        f"{element.get('to')}_{element.get('toLane')}",
        element.get("via", ""),
        element.get("dir", ""),
        element.get("tl", ""),
        int(element.get("linkIndex", "-1")),
    )

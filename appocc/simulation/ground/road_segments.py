"""Road segments: one direction of a street from junction to junction, with its ends and lanes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from appocc.checks import FloatArray
from appocc.polylines import clean, length_m, shifted
from appocc.simulation.network import Edge, Lane, LaneKind, RoadNetwork

# From the junction's outline: gap, zebra crossing, gap, stop line.
ZEBRA_GAP_M, ZEBRA_M, STOP_GAP_M, STOP_WIDTH_M = 0.6, 3.6, 1.0, 0.4
_LONG_ENOUGH_M = 24.0
_FAST_MPS = 15.0
_MOST_BACK_M = 6.0
# Lane kinds of the carriageway.
ROADWAY: tuple[LaneKind, ...] = ("driving", "parking", "cycling")


@dataclass(frozen=True)
class SegmentEnd:
    """One end of a road segment.

    Attributes:
        junction: whether lines end here; they continue where two streets merely meet.
        signal: whether traffic lights control it.
        zebra: whether it has a pedestrian crossing.
        yields: whether arriving traffic has to give way.
    """

    junction: bool = False
    signal: bool = False
    zebra: bool = False
    yields: bool = False

    @property
    def stop_m(self) -> float:
        """Distance from the end to the near side of the stop line."""
        return ZEBRA_GAP_M + ZEBRA_M + STOP_GAP_M if self.zebra else ZEBRA_GAP_M

    @property
    def has_stop(self) -> bool:
        """Whether arriving traffic has a stop line."""
        return self.signal or self.yields

    @property
    def clear_arriving_m(self) -> float:
        """Distance before the end without lane lines for arriving traffic."""
        return self.stop_m + STOP_WIDTH_M if self.has_stop else 0.5 if self.junction else 0.0

    @property
    def clear_leaving_m(self) -> float:
        """Distance after the junction without lane lines for leaving traffic."""
        return ZEBRA_GAP_M + ZEBRA_M + 0.5 if self.zebra else 0.5 if self.junction else 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class RoadSegment:
    """One direction of a street.

    Attributes:
        lanes: from right to left, only those with a centre line.
        left_m: (N, 2) left border of the leftmost lane, in the direction of travel.
        start: its first end.
        end: its last end.
        street: name shared by both directions of a street.
        start_back_m: distance from the start of the left border to where the shortest lane leaves the junction.
        end_back_m: distance from where the shortest lane meets the junction to the end of the left border.
    """

    lanes: tuple[Lane, ...]
    left_m: FloatArray
    start: SegmentEnd
    end: SegmentEnd
    street: str
    start_back_m: float = 0.0
    end_back_m: float = 0.0

    @property
    def width_m(self) -> float:
        """Total width of the lanes."""
        return sum(lane.width_m for lane in self.lanes)

    @property
    def driving(self) -> tuple[Lane, ...]:
        """The car lanes, from right to left."""
        return tuple(lane for lane in self.lanes if lane.kind == "driving")

    @property
    def arterial(self) -> bool:
        """Whether it is a main street: two or more car lanes, or fast."""
        return len(self.driving) > 1 or any(lane.speed_mps > _FAST_MPS for lane in self.driving)

    def section(self, at_end: bool) -> tuple[FloatArray, FloatArray]:
        """Return the left border point (2,) and the direction of travel (2,) where the segment meets a junction."""
        line = self.left_m if at_end else self.left_m[::-1]
        step = line[-1] - line[-2]
        out = step / np.hypot(*step)
        return line[-1] - out * (self.end_back_m if at_end else self.start_back_m), out if at_end else -out


def find_road_segments(network: RoadNetwork) -> list[RoadSegment]:
    """Return the segments of a network, including the short pieces inside junctions without crossing traffic."""
    ends = _junction_ends(network)
    found = [
        _segment(
            edge.lanes,
            replace(ends[edge.from_junction], yields=False),
            _arriving_end(network, edge, ends),
            street_name(edge),
        )
        for edge in network.edges
    ]
    whole = _align({s.lanes[0].edge: s for s in found if s is not None}, network)
    passages = [_segment(lanes, SegmentEnd(), SegmentEnd(), street) for lanes, street in _passages(network, ends)]
    return [*whole, *(passage for passage in passages if passage is not None)]


def junction_outlines(network: RoadNetwork) -> list[FloatArray]:
    """Return the outlines (N, 2) of the junctions where streets branch or traffic lights stand."""
    real = {name for name, end in _junction_ends(network).items() if end.junction}
    return [j.outline_m for j in network.junctions if j.name in real and len(j.outline_m) > 2]


def street_name(edge: Edge) -> str:
    """Return the name of a street, shared by both of its directions."""
    return " ".join(sorted((edge.from_junction, edge.to_junction)))


def _segment(lanes: Sequence[Lane], start: SegmentEnd, end: SegmentEnd, street: str) -> RoadSegment | None:
    lined = [replace(lane, centre_m=clean(lane.centre_m)) for lane in lanes if lane.kind in ROADWAY]
    lined = [lane for lane in lined if length_m(lane.centre_m) > 0]
    if all(lane.kind != "driving" for lane in lined):
        return None
    left = shifted(lined[-1].centre_m, lined[-1].width_m / 2)
    if length_m(left) < _LONG_ENOUGH_M:
        start, end = replace(start, zebra=False), replace(end, zebra=False)
    return RoadSegment(
        lanes=tuple(lined),
        left_m=left,
        start=start,
        end=end,
        street=street,
        start_back_m=_setback(lined, left, False),
        end_back_m=_setback(lined, left, True),
    )


def _setback(lanes: Sequence[Lane], left_m: FloatArray, at_end: bool) -> float:
    """Return how far the shortest lane stays behind the left border, at one end."""
    line = left_m if at_end else left_m[::-1]
    step = line[-2] - line[-1]
    ends = np.stack([lane.centre_m[-1 if at_end else 0] for lane in lanes])
    return min(max(0.0, float(((ends - line[-1]) @ (step / np.hypot(*step))).max())), _MOST_BACK_M)


def _align(segments: Mapping[str, RoadSegment], network: RoadNetwork) -> list[RoadSegment]:
    """Align both directions of a street at the same cross-sections, so that zebras are perpendicular to it."""
    edges = {edge.name: edge for edge in network.edges}
    aligned = []
    for name, segment in segments.items():
        back = network.opposite(edges[name])
        other = segments.get(back.name) if back is not None else None
        if other is not None and np.hypot(*(other.left_m[0] - segment.left_m[-1])) < _MOST_BACK_M:
            segment = replace(segment, end_back_m=max(segment.end_back_m, other.start_back_m))
        if other is not None and np.hypot(*(other.left_m[-1] - segment.left_m[0])) < _MOST_BACK_M:
            segment = replace(segment, start_back_m=max(segment.start_back_m, other.end_back_m))
        aligned.append(segment)
    return aligned


def _junction_ends(network: RoadNetwork) -> dict[str, SegmentEnd]:
    ways: Mapping[str, set[tuple[str, str]]] = defaultdict(set)
    signalled = set()
    to_junction = {edge.name: edge.to_junction for edge in network.edges}
    for link in network.connections:
        before, after = (name.rpartition("_")[0] for name in (link.from_lane, link.to_lane))
        if link.direction != "t" and before in to_junction:
            ways[to_junction[before]].add((before, after))
            if link.signal:
                signalled.add(to_junction[before])
    names = {edge.to_junction for edge in network.edges} | {edge.from_junction for edge in network.edges}
    ends = {}
    for name in sorted(names):
        pairs = ways.get(name, set())
        branches = len(pairs) > len({a for a, _ in pairs}) or len(pairs) > len({b for _, b in pairs})
        signal = name in signalled
        ends[name] = SegmentEnd(branches or signal, signal, signal and branches)
    return ends


def _arriving_end(network: RoadNetwork, edge: Edge, ends: Mapping[str, SegmentEnd]) -> SegmentEnd:
    """Return the end of an edge; it yields to edges of higher priority, or if it has no way straight on."""
    end = ends[edge.to_junction]
    if not end.junction or end.signal:
        return end
    kinds = {j.name: j.kind for j in network.junctions}
    if kinds.get(edge.to_junction) not in ("priority", "priority_stop"):
        return end
    best = max(other.priority for other in network.edges if other.to_junction == edge.to_junction)
    links = [c for c in network.connections if c.from_lane.rpartition("_")[0] == edge.name]
    ahead = any(c.direction == "s" for c in links)
    return replace(end, yields=edge.priority < best or not (ahead or not links))


def _passages(network: RoadNetwork, ends: Mapping[str, SegmentEnd]) -> list[tuple[list[Lane], str]]:
    """Return the lanes inside junctions without crossing traffic, by edge, and the street they continue."""
    edge_of = {edge.name: edge for edge in network.edges}
    inner = {lane.name: lane for lane in network.inner_lanes}
    groups: dict[str, dict[str, Lane]] = defaultdict(dict)
    street = {}
    for link in network.connections:
        before = edge_of.get(link.from_lane.rpartition("_")[0])
        if before and link.via in inner and link.direction != "t" and not ends[before.to_junction].junction:
            groups[inner[link.via].edge][link.via] = inner[link.via]
            street[inner[link.via].edge] = street_name(before)
    return [(sorted(lanes.values(), key=lambda lane: lane.index), street[name]) for name, lanes in groups.items()]

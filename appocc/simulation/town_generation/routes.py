"""Random routes through the strongly connected part of a network."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from appocc.simulation.network import Edge, RoadNetwork

_WEIGHT = {"s": 1.0, "r": 0.7, "l": 0.7, "R": 0.7, "L": 0.7, "t": 0.02}
_SHORTEST_M = 12.0
_TIGHT_RAD = 1.7  # buses and lorries avoid sharper turns


class Routes:
    """The largest strongly connected part of a network, and random routes through it."""

    def __init__(self, network: RoadNetwork) -> None:
        """Find the largest set of mutually reachable edges."""
        ways = _successors(network)
        edges = {edge.name: edge for edge in network.edges if _has_cars(edge)}
        names = list(edges)
        number = {name: k for k, name in enumerate(names)}
        links = [(number[a], number[b]) for a in names for b in sorted(ways[a]) if b in number]
        rows, columns = np.array(links, dtype=np.int64).reshape(-1, 2).T
        graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(names), len(names)))
        _, part = connected_components(graph, directed=True, connection="strong")
        largest = np.argmax(np.bincount(part, [edge_length_m(edges[name]) for name in names])) if names else 0
        inside = {name for name, p in zip(names, part, strict=True) if p == largest}
        self._edges = {name: edge for name, edge in edges.items() if name in inside}
        self._length_m = {name: edge_length_m(edge) for name, edge in self._edges.items()}
        self._next = {a: [(b, w) for b, w in sorted(ways[a].items()) if b in inside] for a in sorted(inside)}
        self.total_m = sum(self._length_m.values())

    def draw(self, rng: np.random.Generator, length_m: float, large: bool) -> list[str]:
        """Draw a route as names of edges, at least `length_m` in all; large vehicles prefer main streets.

        Empty if no edge of the network can be reached from itself.
        """
        starts = [name for name, length in self._length_m.items() if length > _SHORTEST_M and self._next[name]]
        if not starts:
            return []
        share = np.array([self._length_m[name] * self._weight(name, large) for name in starts])
        route = [starts[int(rng.choice(len(starts), p=share / share.sum()))]]
        driven = 0.0
        while driven < length_m and self._next[route[-1]]:
            onward = self._next[route[-1]]
            here = self._edges[route[-1]]
            tight = [1e-3 if large and _turn(here, self._edges[name]) > _TIGHT_RAD else 1.0 for name, _ in onward]
            share = np.array([w * t * self._weight(n, large) for (n, w), t in zip(onward, tight, strict=True)])
            route.append(onward[int(rng.choice(len(onward), p=share / share.sum()))][0])
            driven += self._length_m[route[-1]]
        return route

    def _weight(self, name: str, large: bool) -> float:
        lanes = sum(lane.kind == "driving" for lane in self._edges[name].lanes)
        return 8.0 if large and lanes > 1 else 1.0


def edge_length_m(edge: Edge) -> float:
    """Return the length of an edge's first lane."""
    return float(np.hypot(*np.diff(edge.lanes[0].centre_m, axis=0).T).sum())


def _turn(first: Edge, second: Edge) -> float:
    """Return the absolute angle between the end of an edge and the start of the next."""
    a, b = (np.diff(edge.lanes[-1].centre_m, axis=0)[k] for edge, k in ((first, -1), (second, 0)))
    return float(np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def _has_cars(edge: Edge) -> bool:
    return any(lane.kind == "driving" for lane in edge.lanes)


def _successors(network: RoadNetwork) -> dict[str, dict[str, float]]:
    """Return the successors of each edge with their weights."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for way in network.connections:
        first, second = network.lanes.get(way.from_lane), network.lanes.get(way.to_lane)
        weight = _WEIGHT.get(way.direction, 0.7)
        if first and second and first.kind == second.kind == "driving" and weight:
            found[first.edge][second.edge] = max(weight, found[first.edge].get(second.edge, 0.0))
    return found

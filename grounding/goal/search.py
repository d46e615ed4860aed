"""Search the goal candidates of a command for the best valid ones, and explain why a candidate is invalid."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import wrap_angle
from grounding.goal.candidates import CandidateSet, GoalCandidate
from grounding.goal.limits import BEHIND_US, JUNCTION, NO_LIMITS, OTHER_SIDE, TURNED, PlaceLimits
from grounding.referent.scene import SceneModel
from grounding.road.car_paths import CarPaths, CarRoute
from grounding.road.free_space import OFF_MAP, OFF_ROAD, TAKEN, UNKNOWN, round_heading
from grounding.road.road_map import RoadMap
from grounding.scene_object import SceneObject

# Flags in addition to those of the free space.
UNREACHABLE, EXCLUDED = 16, 32
# Candidates are checked in order of cost, this many at a time.
_CHUNK = 96
LEAVES_ROAD = "leaves the road"
_WORDS = {
    EXCLUDED: "is ruled out by the command",
    OTHER_SIDE: "is on the side of oncoming traffic",
    JUNCTION: "is in a junction or on a crossing",
    BEHIND_US: "is behind us",
    TURNED: "needs us to turn round here",
    UNREACHABLE: "cannot be reached as a car drives, with its turning circle and little reversing",
}
# Runners-up may cost this much more than the best candidate.
_MAX_EXTRA_COST = 6.0
# To explain a failure: candidates checked per set, and the extra costs of more than one violation and off the road.
_MAX_CHECKED, _SEVERAL, _BESIDE_ROAD = 1500, 50.0, 20.0
# Goals that no car reaches: this many are tried, each this far from the others or turned by this angle.
_MOST_TRIED, _SAME_PLACE_M, _SAME_HEADING_RAD = 16, 0.7, 0.2
# Backing up by more than the first costs the second.
_REVERSES_M, _REVERSING = 0.5, 0.7
# The nearest place that would do is not farther away.
_NEAREST_M = 20.0
# A vehicle farther than this from the footprint does not explain why a candidate is taken.
_MAX_TAKER_GAP_M = 1.0


class CandidateSearch:
    """Search over the candidate sets of one command on one road map."""

    def __init__(
        self,
        candidate_sets: Sequence[CandidateSet],
        scene: SceneModel,
        road: RoadMap,
        references: Sequence[SceneObject] = (),
        excluded: BoolArray | None = None,
        limits: PlaceLimits = NO_LIMITS,
    ) -> None:
        """Set up the search.

        Args:
            candidate_sets: ways to satisfy the command, with rounded headings; at equal cost the first wins.
            scene: gives the vehicles their colour names.
            road: validates poses.
            references: the vehicles of the command.
            excluded: (X, Y) cells that the command rules out.
            limits: hard limits on the goal.
        """
        self._limits = limits
        self._out_of_reach: list[tuple[FloatArray, float]] = []
        self.candidate_sets = [each for each in candidate_sets if len(each.cells)]
        self.scene, self.road, self.references, self.excluded = scene, road, references, excluded
        self._words = [each.words for each in candidate_sets]

    @cached_property
    def _cars(self) -> CarPaths:
        return self.road.cars_with(self._limits.most_back_m)

    @cached_property
    def _set_index(self) -> IntArray:
        """(M,) index of the set of each candidate."""
        return np.repeat(np.arange(len(self.candidate_sets)), [len(each.cells) for each in self.candidate_sets])

    @cached_property
    def _all(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
        """Cells (M, 2), costs (M,) and headings (M,) of all candidates, and their indices (M,) in their sets."""
        if not self.candidate_sets:
            return np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64)
        parts = [
            (each.cells, each.cost, each.heading_rad, np.arange(len(each.cells))) for each in self.candidate_sets
        ]
        cells, costs, headings, indices = (np.concatenate(column) for column in zip(*parts, strict=True))
        return cells, costs, headings, indices

    def flags(self, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """Return the violations (N,) of poses, without the margin to boxes."""
        flags = self.road.free_space.flags(cells, heading_rad)
        i, j = cells.T
        flags |= UNREACHABLE * ~self._is_in_reach(cells, heading_rad)
        flags |= self._limits.flags(self.road, cells, heading_rad)
        if self.excluded is not None:
            flags |= EXCLUDED * self.excluded[i, j]
        return flags

    def _is_in_reach(self, cells: IntArray, heading_rad: FloatArray) -> BoolArray:
        """(N,) whether a car gets near poses, and they are not among those that it was found not to get to."""
        reached = np.isfinite(self._cars.cost_to(cells, heading_rad))
        xy = self.road.grid.centre_of(cells)
        for centre, heading in self._out_of_reach:
            near = np.hypot(*(xy - centre).T) < _SAME_PLACE_M
            reached &= ~(near & (np.abs(wrap_angle(heading_rad - heading)) < _SAME_HEADING_RAD))
        return np.asarray(reached)

    def route_to(self, candidate: GoalCandidate) -> CarRoute | None:
        """Return the way to a candidate as a car drives; None if there is none."""
        return self._cars.route_to(candidate.cell, candidate.heading_rad)

    def find_reachable(self, count: int = 1) -> tuple[list[GoalCandidate], CarRoute | None]:
        """Return valid candidates as `find_best` does, and the way to the first, which a car can drive."""
        for _ in range(_MOST_TRIED):
            found = self.find_best(count)
            if not found:
                break
            route = self.route_to(found[0])
            if route is not None:
                return self._without_reversing(found, route)
            self._out_of_reach.append((self.road.grid.centre_of(found[0].cell), found[0].heading_rad))
        return [], None

    def _without_reversing(self, found: list[GoalCandidate], route: CarRoute) -> tuple[list[GoalCandidate], CarRoute]:
        """Return the candidates and the way to the first; one nearly as good that needs no reversing comes first."""
        if route.backwards_m > _REVERSES_M:
            for other in found[1:]:
                way = self.route_to(other) if other.cost < found[0].cost + _REVERSING else None
                if way is not None and way.backwards_m <= _REVERSES_M:
                    return [other, *(each for each in found if each is not other)], way
        return found, route

    def find_best(self, count: int = 1) -> list[GoalCandidate]:
        """Return valid candidates, best first, each at least an ego length from those before it."""
        cells, costs, headings, indices = self._all
        reachable = np.flatnonzero(np.isfinite(self._cars.cost_to(cells, headings))) if len(cells) else cells[:, 0]
        order = reachable[np.argsort(costs[reachable], kind="stable")]
        found: list[GoalCandidate] = []
        while len(order) and len(found) < count:
            chunk, order = order[:_CHUNK], order[_CHUNK:]
            chunk = chunk[self.flags(cells[chunk], headings[chunk]) == 0]
            while len(chunk) and len(found) < count:
                one, chunk = int(chunk[0]), chunk[1:]
                centre = self.road.grid.centre_of(cells[one])
                if self.road.free_space.is_clear(centre, float(headings[one])):
                    found.append(GoalCandidate(self.candidate_sets[self._set_index[one]], int(indices[one])))
                    chunk, order = (
                        rest[
                            self._is_apart(cells[rest], cells[one]) & (costs[rest] <= found[0].cost + _MAX_EXTRA_COST)
                        ]
                        for rest in (chunk, order)
                    )
        return found

    def _is_apart(self, cells: IntArray, other: IntArray) -> BoolArray:
        """(N,) whether cells are at least an ego length from another."""
        distance_m = np.linalg.norm(cells - other, axis=1) * self.road.grid.cell_m
        return np.asarray(distance_m >= self.road.ego.length_m)

    def unconstrained_best(self, candidates: CandidateSet | None = None) -> GoalCandidate | None:
        """Return the cheapest candidate of a set, or of all, valid or not; None without candidates."""
        sets = self.candidate_sets if candidates is None else [candidates]
        best = [GoalCandidate(each, int(np.argmin(each.cost))) for each in sets]
        return min(best, key=lambda candidate: candidate.cost, default=None)

    def cost_field(self) -> FloatArray:
        """Return the cost (X, Y) of valid cells, infinity elsewhere; the margin to boxes is not applied."""
        field = np.full(self.road.grid.shape, np.inf)
        cells, costs, headings, _ = self._all
        valid = self.flags(cells, headings) == 0
        np.minimum.at(field, tuple(cells[valid].T), costs[valid])
        return field

    def find_nearest(self, centre_m: FloatArray) -> GoalCandidate | None:
        """Return the valid pose nearest to a point (2,), ego frame, whatever is asked for; None if far away."""
        cells = np.argwhere(self.road.drivable)
        distance_m = np.linalg.norm(self.road.grid.centre_of(cells) - centre_m, axis=1)
        cells, distance_m = cells[distance_m < _NEAREST_M], distance_m[distance_m < _NEAREST_M]
        heading = round_heading(self.road.direction_rad[cells[:, 0], cells[:, 1]])
        anywhere = CandidateSet("", cells, distance_m, heading)
        search = CandidateSearch([anywhere], self.scene, self.road, (), self.excluded, self._limits)
        return next(iter(search.find_reachable()[0]), None)

    def explain_failure(self) -> tuple[GoalCandidate | None, int, list[str]]:
        """Return the best invalid candidate and its violation, in words too; None if no candidate is on the map.

        Candidates with one violation come before those with several, and those on the road before others: the kerb
        side of a vehicle at the kerb is no place that anybody thinks of.
        """
        best: tuple[float, GoalCandidate, int] | None = None
        for each in self.candidate_sets:
            few = np.argsort(each.cost, kind="stable")[:_MAX_CHECKED]
            flags = self.flags(each.cells[few], each.heading_rad[few])
            # Other violations imply that the cell is unreachable, which is reported only on its own.
            flags = np.where(flags & ~UNREACHABLE, flags & ~UNREACHABLE, flags)
            several = np.array([flag.bit_count() for flag in flags.tolist()]) > 1
            price = each.cost[few] + _SEVERAL * several + _BESIDE_ROAD * ((flags & OFF_ROAD) > 0)
            one = int(np.argmin(price))
            if best is None or price[one] < best[0]:
                best = float(price[one]), GoalCandidate(each, int(few[one])), int(flags[one])
        if best is None:
            return None, OFF_MAP, [f"no place {words} lies on the map" for words in self._words[:1]]
        _, candidate, violation = best
        words = candidate.candidates.words
        why = f"no place {words} will do: the best one {self.explain_violation(candidate, violation)}"
        return candidate, violation, [why]

    def explain_violation(self, candidate: GoalCandidate, flags: int | None = None) -> str:
        """Return why a candidate is invalid, as the end of a sentence."""
        if flags is None:
            flags = int(self.flags(np.array([candidate.cell]), np.array([candidate.heading_rad]))[0])
        if flags & OFF_MAP:
            return "leaves the map"
        if flags & TAKEN or not flags:
            centre = self.road.grid.centre_of(candidate.cell)
            item, gap_m = self.road.free_space.nearest_object(centre, candidate.heading_rad)
            is_free = not flags and self.road.free_space.is_clear(centre, candidate.heading_rad)
            return "needs more reversing" if is_free else self._explain_taken(item, gap_m)
        if flags & OFF_ROAD:
            return LEAVES_ROAD
        if flags & UNKNOWN:
            return "lies where the map knows nothing"
        for flag, words in _WORDS.items():
            if flags & flag:
                return words
        return "cannot be reached over free road"

    def _explain_taken(self, item: SceneObject | None, gap_m: float) -> str:
        if item is None or gap_m > _MAX_TAKER_GAP_M:
            return "is taken by a vehicle of the map"
        if any(one.id == item.id for one in self.references):
            return "comes too close to the vehicle itself"
        return f"is taken by the {self.scene.colour_name(item) or ''} {item.class_name}".replace("  ", " ")

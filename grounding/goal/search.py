"""Preference over cells, and the search for the best cell that nothing forbids; why a cell is forbidden, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EGO_LENGTH_M
from grounding.referent.scene import SceneModel
from grounding.road.free_space import MARGIN_M, OFF_MAP, OFF_ROAD, TAKEN, UNKNOWN, whole_steps
from grounding.road.road_map import Road
from grounding.scene_object import SceneObject

# Further flags of a place, beside those of its footing.
UNREACHED, EXCLUDED = 16, 32
# Cells are tried in order of cost, so many at once.
_CHUNK = 96
# A way round costs one for so many metres more than the straight line.
_DETOUR_M = 25.0
# Other places are told that cost no more than this beyond the best.
_AS_GOOD = 6.0
# Where nothing fits, so many places of a wish are looked at; one of which several things are wrong comes far behind.
_MOST_LOOKED_AT, _SEVERAL = 1500, 50.0


@dataclass(frozen=True)
class Wish:
    """One way to satisfy a command: N cells, how much each is disliked, and the heading there.

    Attributes:
        words: for people, without the vehicle: "behind it".
        cells: (N, 2).
        cost: (N,) zero for the very best place.
        heading_rad: (N,) ego frame.
        gap_m: (N,) distance to be told, None where there is none.
        measured: how that is measured: "bumper to bumper".
    """

    words: str
    cells: IntArray
    cost: FloatArray
    heading_rad: FloatArray
    gap_m: FloatArray | None = None
    measured: str = ""


@dataclass(frozen=True)
class Place:
    """A cell of one of the wishes."""

    wish: Wish
    index: int

    @property
    def cell(self) -> tuple[int, int]:
        """Its place on the grid."""
        i, j = self.wish.cells[self.index].tolist()
        return i, j

    @property
    def heading_rad(self) -> float:
        """Heading there, ego frame."""
        return float(self.wish.heading_rad[self.index])

    @property
    def cost(self) -> float:
        """How much it is disliked."""
        return float(self.wish.cost[self.index])


class Field:
    """All wishes of a command over one road."""

    def __init__(
        self,
        wishes: Sequence[Wish],
        scene: SceneModel,
        road: Road,
        about: Sequence[SceneObject] = (),
        excluded: BoolArray | None = None,
    ) -> None:
        """Wishes, best first where they are alike.

        Args:
            wishes: ways to satisfy the command.
            scene: names the vehicles.
            road: says where the ego may stand.
            about: the vehicles that the command is about.
            excluded: (X, Y) cells that it rules out.
        """
        self.scene, self.road, self._about, self._excluded = scene, road, about, excluded
        self.wishes = [self._prepared(wish) for wish in wishes if len(wish.cells)]
        self._hoped = [wish.words for wish in wishes]

    def _prepared(self, wish: Wish) -> Wish:
        """With headings that places can have, and the dislike of ways round."""
        length = self.road.ways.length_m[wish.cells[:, 0], wish.cells[:, 1]]
        straight = np.linalg.norm(self.road.grid.centre_of(wish.cells) - self.road.own.middle_m, axis=1)
        round_m = np.where(np.isfinite(length), length - 1.1 * straight, 0.0)
        cost = wish.cost + np.maximum(round_m, 0.0) / _DETOUR_M
        return Wish(wish.words, wish.cells, cost, whole_steps(wish.heading_rad), wish.gap_m, wish.measured)

    @cached_property
    def _number(self) -> IntArray:
        """(M,) wish of each cell of all wishes."""
        return np.repeat(np.arange(len(self.wishes)), [len(wish.cells) for wish in self.wishes])

    @cached_property
    def _all(self) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
        """Cells (M, 2), costs and headings (M,) of all wishes, and the number of each in its own."""
        if not self.wishes:
            return np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64)
        parts = [(wish.cells, wish.cost, wish.heading_rad, np.arange(len(wish.cells))) for wish in self.wishes]
        cells, costs, headings, own = (np.concatenate(column) for column in zip(*parts, strict=True))
        return cells, costs, headings, own

    def flags(self, cells: IntArray, heading_rad: FloatArray) -> IntArray:
        """(N,) what forbids places, the boxes' margin left out."""
        flags = self.road.footing.flags(cells, heading_rad)
        i, j = cells.T
        flags |= UNREACHED * ~np.isfinite(self.road.ways.length_m[i, j])
        if self._excluded is not None:
            flags |= EXCLUDED * self._excluded[i, j]
        return flags

    def best(self, count: int = 1) -> list[Place]:
        """Places that nothing forbids, best first, each at least a car's length from those before it."""
        cells, costs, headings, own = self._all
        reached = np.flatnonzero(np.isfinite(self.road.ways.length_m[cells[:, 0], cells[:, 1]]))
        order = reached[np.argsort(costs[reached], kind="stable")]
        found: list[Place] = []
        while len(order) and len(found) < count:
            chunk, order = order[:_CHUNK], order[_CHUNK:]
            chunk = chunk[self.flags(cells[chunk], headings[chunk]) == 0]
            while len(chunk) and len(found) < count:
                one, chunk = int(chunk[0]), chunk[1:]
                middle = self.road.grid.centre_of(cells[one])
                if self.road.footing.nearest(middle, float(headings[one]))[1] >= MARGIN_M:
                    found.append(Place(self.wishes[self._number[one]], int(own[one])))
                    chunk, order = (
                        rest[self._apart(cells[rest], cells[one]) & (costs[rest] <= found[0].cost + _AS_GOOD)]
                        for rest in (chunk, order)
                    )
        return found

    def _apart(self, cells: IntArray, other: IntArray) -> BoolArray:
        """(N,) which cells are at least a car's length from another."""
        return np.asarray(np.linalg.norm(cells - other, axis=1) * self.road.grid.cell_m >= EGO_LENGTH_M)

    def ideal(self, wish: Wish | None = None) -> Place | None:
        """The best place of a wish, or of all, if nothing were forbidden; None where there is none on the map."""
        wishes = self.wishes if wish is None else [wish]
        places = [Place(one, int(np.argmin(one.cost))) for one in wishes]
        return min(places, key=lambda place: place.cost, default=None)

    def picture(self) -> FloatArray:
        """(X, Y) cost of the allowed cells, infinity elsewhere; boxes' margins are left to the map's cells."""
        field = np.full(self.road.grid.shape, np.inf)
        cells, costs, headings, _ = self._all
        fine = self.flags(cells, headings) == 0
        np.minimum.at(field, tuple(cells[fine].T), costs[fine])
        return field

    def nearest(self, middle_m: FloatArray) -> Place | None:
        """The place nearest to a point (2,), ego frame, at which the ego could stand at all."""
        cells = np.stack(np.unravel_index(self.road.ways.cells, self.road.grid.shape), axis=-1)
        far = np.linalg.norm(self.road.grid.centre_of(cells) - middle_m, axis=1)
        heading = whole_steps(self.road.direction_rad[cells[:, 0], cells[:, 1]])
        anywhere = Wish("", cells, far, heading)
        search = Field([], self.scene, self.road, (), self._excluded)
        search.wishes = [anywhere]
        return next(iter(search.best()), None)

    def told(self, place: Place) -> str:
        """A place in words, with its gap."""
        wish = place.wish
        if wish.gap_m is None:
            return wish.words
        gap = float(wish.gap_m[place.index])
        return f"{wish.words}, {-gap:.1f} m back" if gap < 0 else f"{wish.words}, {gap:.1f} m {wish.measured}"

    def why_none(self) -> tuple[Place | None, list[str]]:
        """The best place but for one thing, and that in words; without one where no wish has a cell on the map.

        A place of which one thing is wrong comes before one of which several are.
        """
        best: tuple[float, Place, int] | None = None
        for wish in self.wishes:
            few = np.argsort(wish.cost, kind="stable")[:_MOST_LOOKED_AT]
            flags = self.flags(wish.cells[few], wish.heading_rad[few])
            # What keeps the ego out also keeps it from getting there: that is told only where it stands alone.
            flags = np.where(flags & ~UNREACHED, flags & ~UNREACHED, flags)
            several = np.array([flag.bit_count() for flag in flags.tolist()]) > 1
            price = wish.cost[few] + _SEVERAL * several
            one = int(np.argmin(price))
            if best is None or price[one] < best[0]:
                best = float(price[one]), Place(wish, int(few[one])), int(flags[one])
        if best is None:
            return None, [f"no place {words} lies on the map" for words in self._hoped[:1]]
        words = best[1].wish.words
        return best[1], [f"no place {words} is free: the best one {self.wrong(best[1], best[2])}"]

    def wrong(self, place: Place, flags: int | None = None) -> str:
        """What is wrong with a place, in words."""
        if flags is None:
            flags = int(self.flags(np.array([place.cell]), np.array([place.heading_rad]))[0])
        if flags & OFF_MAP:
            return "leaves the map"
        if flags & TAKEN or not flags:
            return self._taken_by(*self.road.footing.nearest(self.road.grid.centre_of(place.cell), place.heading_rad))
        if flags & OFF_ROAD:
            return "leaves the road"
        if flags & UNKNOWN:
            return "lies where the map knows nothing"
        return "is ruled out by the command" if flags & EXCLUDED else "cannot be reached over free road"

    def _taken_by(self, item: SceneObject | None, gap_m: float) -> str:
        if item is None or gap_m > 1.0:
            return "is taken by a vehicle of the map"
        if any(one.id == item.id for one in self._about):
            return "comes too close to the vehicle itself"
        return f"is taken by the {self.scene.colour_name(item) or ''} {item.class_name}".replace("  ", " ")

"""Faults of a place, by the plan of the town, the exact map and the true boxes; and whether a sentence is doable."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from appocc.checks import FloatArray
from appocc.geometry import footprints, wrap_angle
from benchmarks.grounding_truth.car_moves import Reached, reached_poses
from benchmarks.grounding_truth.key_frames import TrueFrame, Vehicle
from benchmarks.grounding_truth.places import Region
from benchmarks.grounding_truth.questions import Question
from benchmarks.grounding_truth.regions import region
from benchmarks.grounding_truth.roads import EGO
from benchmarks.grounding_truth.streets import Streets

BEHIND_M, DRIVES_MPS, BESIDE_M, LEAST_SCORE = 8.0, 2.0, 8.0, 0.1
TURNED_RAD, WITHIN_M, BACK_M, FAR_BACK_M = np.radians(100), 12.0, 10.0, 30.0
STOPS, WAITS = ("park", "stop", "pull_over"), ("park", "pull_over", "wait")
# Words that ask for a place that is otherwise a fault.
_BACK = r"behind (us|me)|\bback(wards)?\b|revers|\brear\b|just passed|we passed"
_ROUND = r"turn\w* (\w+ ){0,3}(a)?round|u-?\s?turn|other way|spin|opposite direction|go back|head back"
_OTHER_SIDE = r"opposite|across|other side|oncoming|\bleft\b|wrong side|far side"
_JUNCTION = r"junction|intersection|crossing|crosswalk|zebra|corner|\blights?\b|roundabout|stop (sign|line)"
FAULTS = (*("behind us", "wrong side", "beside moving", "score", "junction", "turns", "backwards", "unreachable"),)
# A vehicle to overtake is slower. Places of a region that are tried.
SLOW_MPS, TRIED = 6.0, 40


class Place(NamedTuple):
    """A goal in the ego frame and the world frame, and the vehicles that it is measured from, by instance."""

    xy_m: FloatArray
    yaw_rad: float
    world_m: FloatArray
    world_yaw_rad: float
    score: float
    names: tuple[str, ...]


class Auditor:
    """Judges the places of answers in one key frame."""

    def __init__(self, moment: TrueFrame, streets: Streets) -> None:
        """Take the truth of a key frame."""
        self._moment, self._streets = moment, streets
        self._reached: Reached | None = None

    def reached(self) -> Reached:
        """Return the poses that a car reaches; computed once."""
        if self._reached is None:
            bev = self._moment.bev
            free = self._moment.ground & ~self._moment.occupied
            # The ego stands where it stands, and a cell that its body touches is no obstacle.
            along, across = self._moment.local(np.array([EGO.centre_m, 0.0]), 0.0)
            grown = bev.grid.cell_m / 2
            free |= (np.abs(along) <= EGO.length_m / 2 + grown) & (np.abs(across) <= EGO.width_m / 2 + grown)
            low = bev.grid.centre_of(np.zeros(2, np.int64)) - bev.grid.cell_m / 2
            self._reached = reached_poses(free, bev.grid.cell_m, low, EGO, FAR_BACK_M)
        return self._reached

    def faults(self, question: Question, place: Place) -> tuple[tuple[str, ...], bool]:
        """Return the faults of a place, and whether one on the wrong side is beside a vehicle that stands there."""
        asked = {
            name: bool(re.search(words, question.sentence, re.IGNORECASE))
            for name, words in (("back", _BACK), ("round", _ROUND), ("side", _OTHER_SIDE), ("junction", _JUNCTION))
        }
        asked["side"] |= asked["round"]
        meant = [v for v in self._moment.vehicles if v.instance in place.names]
        against = self._streets.way(place.world_m, place.world_yaw_rad) < 0 and not asked["side"]
        beside = against and any(self._faces(place, v) for v in meant)
        found = [
            ("behind us", place.xy_m[0] < EGO.centre_m - BEHIND_M and not (asked["back"] or asked["round"])),
            ("wrong side", against and not beside),
            ("beside moving", question.ask.action in STOPS and self._is_beside_moving(place, meant)),
            ("score", place.score < LEAST_SCORE),
            ("junction", question.ask.action in WAITS and self._is_in_junction(place) and not asked["junction"]),
            ("turns", self._turns(place) and not asked["round"]),
        ]
        back_m = self.reached().least_back_m(place.xy_m, place.yaw_rad)
        found += [
            ("backwards", BACK_M < back_m < np.inf and not asked["back"]),
            ("unreachable", not np.isfinite(back_m)),
        ]
        return tuple(name for name, holds in found if holds), beside

    def doable(self, question: Question) -> Region | None:
        """Return the places that would do, if the sentence is one that a person would find doable; else None.

        The vehicle suits the action, and some place in the relation is reached by a car and has no fault.
        """
        meant = [v for v in self._moment.vehicles if v.instance == question.instance]
        if not question.relation or not all(self._suits(v, question) for v in meant):
            return None
        found = region(question.relation, self._moment, meant, question.ask)
        if found is None:
            return None
        cells = np.argwhere(found.cells)
        near = np.argsort(np.hypot(*(self._moment.bev.grid.centre_of(cells) - found.best_m).T), kind="stable")
        step = max(len(near) // TRIED, 1)
        for at in near[::step]:
            centre = self._moment.bev.grid.centre_of(cells[at])
            if any(not self.faults(question, self._place(centre, yaw, meant))[0] for yaw in found.yaws_rad):
                return found
        return None

    def _suits(self, v: Vehicle, question: Question) -> bool:
        action = question.ask.action
        state = {
            "follow": not v.parked,
            "overtake": v.speed_mps < SLOW_MPS,
            "park": v.stationary,
            "pull_over": v.stationary,
        }
        return state.get(action, True) and self._moment.is_in_street(v)

    def _place(self, xy_m: FloatArray, yaw_rad: float, meant: Sequence[Vehicle]) -> Place:
        pose = self._moment.world_from_ego
        yaw_world = yaw_rad + np.arctan2(pose[1, 0], pose[0, 0])
        world_m = pose[:2, :2] @ xy_m + pose[:2, 3]
        return Place(xy_m, yaw_rad, world_m, float(yaw_world), 1.0, tuple(v.instance for v in meant))

    @staticmethod
    def _is_beside_moving(place: Place, meant: Sequence[Vehicle]) -> bool:
        own = footprints(place.xy_m, place.yaw_rad, [EGO.length_m + 2 * BESIDE_M, EGO.width_m + 2 * BESIDE_M])
        boxes = [footprints(v.xy_m, v.yaw_rad, [v.length_m, v.width_m]) for v in meant if v.speed_mps > DRIVES_MPS]
        return any(_overlap(own, box) for box in boxes)

    def _is_in_junction(self, place: Place) -> bool:
        along, across = np.meshgrid(np.linspace(-0.5, 0.5, 7) * EGO.length_m, np.linspace(-0.5, 0.5, 3) * EGO.width_m)
        cos, sin = np.cos(place.world_yaw_rad), np.sin(place.world_yaw_rad)
        points = place.world_m + np.stack([along * cos - across * sin, along * sin + across * cos], -1).reshape(-1, 2)
        inside = self._streets.is_in(self._streets.junctions, place.world_m[None])
        return inside or self._streets.is_in(self._streets.crossings, points)

    @staticmethod
    def _turns(place: Place) -> bool:
        away = float(np.hypot(*(place.xy_m - [EGO.centre_m, 0.0])))
        return away < WITHIN_M and abs(float(wrap_angle(place.yaw_rad))) > TURNED_RAD

    @staticmethod
    def _faces(place: Place, v: Vehicle) -> bool:
        return bool(np.cos(v.yaw_rad - place.yaw_rad) < 0)


def _overlap(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two rectangles, corners (4, 2), overlap: no side of either separates them."""
    for a in (one, other):
        for side in (a[1] - a[0], a[2] - a[1]):
            p, q = one @ side, other @ side
            if p.max() < q.min() or q.max() < p.min():
                return False
    return True

"""Generation of cases from key frames: a sentence, its referent, and the region of admissible goals."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.grounding_truth.key_frames import Town, TrueFrame, Vehicle
from benchmarks.grounding_truth.places import Ask, Region, wanted_m
from benchmarks.grounding_truth.regions import region
from benchmarks.grounding_truth.roads import EGO
from benchmarks.grounding_truth.sentences import (
    CALLED,
    PAINTS,
    Description,
    certainly_fits,
    command,
    describe,
    may_fit,
)

# Relations of each group with suitable actions; "none" names no vehicle.
SUITS: dict[str, tuple[tuple[str, str], ...]] = {
    **{
        name: ((name, "park"), (name, "stop"), (name, "pull_over"), (name, "approach"))
        for name in ("behind", "in_front_of", "next_to", "near")
    },
    **{name: ((name, "park"), (name, "stop"), (name, "pull_over")) for name in ("left_of", "right_of")},
    **{
        name: ((name, "stop"), (name, "stop"), (name, "park"), (name, "pull_over")) for name in ("before", "opposite")
    },
    "past": (("past", "stop"), ("past", "park"), ("past", "pull_over"), ("drive_past", "drive_past")),
    "toward": (("toward", "approach"),),
    "at": (("at", "stop"), ("at", "park"), ("at", "approach")),
    "between": (("between", "park"), ("between", "stop")),
    "follow": (("follow", "follow"), ("follow", "follow"), ("overtake", "overtake")),
    "none": (("none", "pull_over"), ("none", "park"), ("none", "stop")),
}
AMBIGUOUS_SHARE, ABSENT_SHARE = 0.15, 0.05
# Groups with vehicles of many kinds: only these have ambiguous and absent cases.
OF_MANY = tuple(name for name in SUITS if name not in ("between", "follow", "none"))
# Region in which people refer to vehicles.
AHEAD_M, ASIDE_M = (8.0, 36.0), 20.0
LEAST_WAY_M = 4.0
# Two vehicles fit about equally: distances within this factor, and neither is more prominent by blocking our way.
EQUAL_FACTOR, OUR_WAY_M, PAIR_ASIDE_M = 1.25, 2.5, 12.0
IN_LANE_M, SLOW_MPS = 2.0, 6.0
SAID_M, SAID_SHARE = (2.0, 3.0, 4.0, 5.0, 10 * 0.3048, 15 * 0.3048), 0.25
STOPS_M = (8.0, 10.0, 12.0, 15.0, 20.0, 25.0)
# A vehicle and a relation may recur with other words in a frame, but not often.
TRIES, PASSES = 6, 6


class Case(NamedTuple):
    """A sentence in a key frame, and its truth.

    Attributes:
        token: token of the sample.
        kind: one, ambiguous or absent.
        group: group of relations, see SUITS.
        relation: as in `regions.RELATIONS`.
        ask: the action and further details.
        sentence: the command.
        said: description of each vehicle.
        vehicles: the referents; in an ambiguous case, all that fit; empty if none is named or present.
        region: admissible goals; None unless the case has one answer.
    """

    token: str
    kind: str
    group: str
    relation: str
    ask: Ask
    sentence: str
    said: tuple[Description, ...] = ()
    vehicles: tuple[Vehicle, ...] = ()
    region: Region | None = None

    @property
    def key(self) -> tuple[str, ...]:
        """Return the content without its wording, which is unique within a frame."""
        names = [v.instance for v in self.vehicles] or [self.sentence]
        return (self.group, self.relation, *names)


class GeneratedCases(NamedTuple):
    """Cases in the order of the key frames, and counts of the reasons for which none could be generated."""

    cases: list[Case]
    left_out: Counter[str]


def make_cases(town: Town, count: int, seed: int, blobs: bool, done: Callable[[int], None]) -> GeneratedCases:
    """Generate about `count` cases, as many of each group as the frames allow; the same seed gives the same cases."""
    wanted = _quotas(count)
    have: Counter[Slot] = Counter()
    cases: list[Case] = []
    left_out: Counter[str] = Counter()
    tokens = [sample.token for sample in town.samples()]
    order = np.random.default_rng(seed).permutation(len(tokens)).tolist()
    for turn in range(PASSES):
        if turn >= PASSES / 2:
            _redistribute(wanted, have)
        for number in order:
            if all(have[slot] >= wanted[slot] for slot in wanted):
                break
            moment = town.moment(tokens[number])
            random = np.random.default_rng([seed, turn, zlib.crc32(moment.token.encode())])
            known = {case.key for case in cases if case.token == moment.token}
            at_most = -(-3 * count // (2 * len(tokens)))
            # The rarest so far comes first.
            slots = sorted(
                (slot for slot in wanted if have[slot] < wanted[slot]),
                key=lambda slot: (have[slot] / wanted[slot], random.random()),
            )
            for slot in slots:
                case = _draw(moment, slot, blobs, random, left_out) if at_most else None
                if case and case.key not in known:
                    cases.append(case)
                    have[slot] += 1
                    at_most -= 1
            done(len(cases))
    place = {token: n for n, token in enumerate(tokens)}
    return GeneratedCases(sorted(cases, key=lambda case: place[case.token]), left_out)


Slot = tuple[str, str]


def _quotas(count: int) -> dict[Slot, int]:
    """Return the number of cases of each kind and group."""
    ambiguous, absent = round(count * AMBIGUOUS_SHARE), round(count * ABSENT_SHARE)
    shares = (("one", tuple(SUITS), count - ambiguous - absent), ("ambiguous", OF_MANY, ambiguous))
    return {
        (kind, group): number * (n + 1) // len(groups) - number * n // len(groups)
        for kind, groups, number in (*shares, ("absent", OF_MANY, absent))
        for n, group in enumerate(groups)
        if number * (n + 1) // len(groups) > number * n // len(groups)
    }


def _redistribute(wanted: dict[Slot, int], have: Counter[Slot]) -> None:
    """Redistribute the missing cases of a group to the complete groups of its kind."""
    for kind in {kind for kind, _ in wanted}:
        full = [slot for slot in wanted if slot[0] == kind and have[slot] >= wanted[slot]]
        lacking = sum(wanted[slot] - have[slot] for slot in wanted if slot[0] == kind)
        for n, slot in enumerate(full):
            wanted.update({slot: have[slot] for slot in wanted if slot[0] == kind and slot not in full})
            wanted[slot] += lacking * (n + 1) // len(full) - lacking * n // len(full)


def _draw(
    moment: TrueFrame, slot: Slot, blobs: bool, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return a case for a slot, None if the frame has none."""
    kind, group = slot
    relation, action = _pick(SUITS[group], random)
    said_m = None
    if action in ("park", "stop") and relation in ("behind", "in_front_of", "before", "past"):
        said_m = _pick(SAID_M, random) if random.random() < SAID_SHARE else None
    ask = Ask(action, said_m, None, blobs)
    make = {"absent": _absent, "ambiguous": _ambiguous, "one": _one_vehicle}[kind]
    if kind == "one" and group in ("between", "none"):
        make = {"between": _between, "none": _nothing}[group]
    return make(moment, group, relation, ask, random, left_out)


def _one_vehicle(
    moment: TrueFrame, group: str, relation: str, ask: Ask, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return a case with one vehicle, described without ambiguity."""
    suited = [v for v in moment.vehicles if _makes_sense(moment, v, relation, ask)]
    for i in random.permutation(len(suited))[:TRIES].tolist():
        said = describe(moment, suited[i], ask.blobs, random)
        if said is None:
            left_out["the vehicle cannot be told apart"] += 1
            continue
        found = _reachable_ahead(region(relation, moment, [suited[i]], ask), left_out)
        if found:
            sentence = command(relation, ask, [(said, suited[i].body)], random)
            return Case(moment.token, "one", group, relation, ask, sentence, (said,), (suited[i],), found)
    return None


def _between(
    moment: TrueFrame, group: str, relation: str, ask: Ask, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return a case with two vehicles and a gap, described one by one or together."""
    suited = [v for v in moment.vehicles if _makes_sense(moment, v, relation, ask)]
    pairs = [(v, w) for n, v in enumerate(suited) for w in suited[:n]]
    for i in random.permutation(len(pairs)).tolist():
        found = _reachable_ahead(region(relation, moment, pairs[i], ask), left_out)
        if found is None:
            continue
        pair = pairs[i]
        names = _both(moment, pair, ask.blobs) or [describe(moment, v, ask.blobs, random) for v in pair]
        said = [(name, v.body) for name, v in zip(names, pair, strict=True) if name]
        if len(said) < 2:
            left_out["the vehicle cannot be told apart"] += 1
            continue
        sentence = command(relation, ask, said, random)
        return Case(moment.token, "one", group, relation, ask, sentence, (said[0][0], said[1][0]), pair, found)
    return None


def _both(moment: TrueFrame, pair: tuple[Vehicle, Vehicle], blobs: bool) -> list[Description | None] | None:
    """Return a description that fits exactly these two, None if there is none."""
    v, w = pair
    its_side = "left" if moment.sideways_m(v) > 0 else "right"
    for paint, side in ((None, None), (v.paint, None), (None, its_side), (v.paint, its_side)):
        said = Description(CALLED[v.body][0], paint, side)
        might = [one for one in moment.vehicles if may_fit(moment, said, one, blobs)]
        if len(might) == 2 and certainly_fits(moment, said, v) and certainly_fits(moment, said, w):
            return [said, said]
    return None


def _nothing(
    moment: TrueFrame, group: str, relation: str, ask: Ask, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return a case without a vehicle."""
    said_m = _pick(STOPS_M, random) if ask.action == "stop" else None
    side = _pick(("left", "right", "right", None), random) if ask.action != "stop" else None
    ask = ask._replace(said_m=said_m, side=side)
    found = _reachable_ahead(region(relation, moment, [], ask), left_out)
    return found and Case(moment.token, "one", group, relation, ask, command(relation, ask, [], random), region=found)


def _ambiguous(
    moment: TrueFrame, group: str, relation: str, ask: Ask, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return an ambiguous case: two similar vehicles with goals, and a sentence that fits both."""
    suited = [v for v in moment.vehicles if _makes_sense(moment, v, relation, ask)]
    pairs = [(v, w) for n, v in enumerate(suited) for w in suited[:n] if _look_alike(moment, v, w)]
    for i in random.permutation(len(pairs))[:TRIES].tolist():
        v, w = pairs[i]
        said, fitting = _shared_description(moment, v, w, ask.blobs, random)
        if fitting and all(_reachable_ahead(region(relation, moment, [one], ask), left_out) for one in (v, w)):
            # Without a word for a body that only one of them has, and without "a", which any of them would satisfy.
            sentence = command(relation, ask, [(said, said.noun)], random, definite=True)
            return Case(moment.token, "ambiguous", group, relation, ask, sentence, (said,), fitting)
    return None


def _shared_description(
    moment: TrueFrame, v: Vehicle, w: Vehicle, blobs: bool, random: np.random.Generator
) -> tuple[Description, tuple[Vehicle, ...]]:
    """Return a description that fits two vehicles and no nearer one, and all vehicles that it may fit."""
    side = "left" if moment.sideways_m(v) > 0 else "right"
    said = Description(CALLED[v.body][0])
    for n in random.permutation(4).tolist():
        said = said._replace(paint=v.paint if n % 2 and v.paint == w.paint else None, side=(None, side)[n // 2])
        fitting = sorted(
            (one for one in moment.vehicles if certainly_fits(moment, said, one)), key=lambda one: one.distance_m
        )
        if {v.instance, w.instance} == {one.instance for one in fitting[:2]}:
            return said, tuple(one for one in moment.vehicles if may_fit(moment, said, one, blobs))
    return said, ()


def _look_alike(moment: TrueFrame, v: Vehicle, w: Vehicle) -> bool:
    """Return whether two vehicles differ only in position, and hardly in that."""
    ratio = max(v.distance_m, w.distance_m) / min(v.distance_m, w.distance_m)
    ours = {abs(moment.sideways_m(one)) < OUR_WAY_M for one in (v, w)}
    cars = CALLED[v.body][0] == CALLED[w.body][0] == "car"
    same = (v.stationary, v.parked) == (w.stationary, w.parked) and (cars or v.body == w.body)
    beside = max(abs(v.xy_m[1]), abs(w.xy_m[1])) <= PAIR_ASIDE_M
    return same and beside and ratio < EQUAL_FACTOR and len(ours) == 1


def _absent(
    moment: TrueFrame, group: str, relation: str, ask: Ask, random: np.random.Generator, left_out: Counter[str]
) -> Case | None:
    """Return a case with an absent vehicle: none has that paint, or that body."""
    bodies = tuple(CALLED)
    body = _pick(bodies, random)
    said = Description(CALLED[body][0], _pick(PAINTS, random) if random.random() < 0.7 else None)
    there = [v for v in moment.vehicles if v.on_map and v.visible and v.xy_m[0] > AHEAD_M[0]]
    # With any noun: some would accept another body with that paint.
    loose = said._replace(noun="vehicle") if said.paint else said
    if not there or any(may_fit(moment, loose, v, ask.blobs, anywhere=True) for v in moment.vehicles):
        return None
    sentence = command(relation, ask, [(said, body)], random)
    return Case(moment.token, "absent", group, relation, ask, sentence, (said,))


def _makes_sense(moment: TrueFrame, v: Vehicle, relation: str, ask: Ask) -> bool:
    """Return whether the command makes sense for a vehicle."""
    there = v.visible and v.on_map and AHEAD_M[0] <= v.xy_m[0] <= AHEAD_M[1] and abs(v.xy_m[1]) <= ASIDE_M
    aside = abs(moment.sideways_m(v))
    state = v.parked if ask.action in ("park", "pull_over") else v.stationary
    if relation == "follow":
        room = v.xy_m[0] - v.length_m / 2 - wanted_m(ask, v) - EGO.length_m / 2 > EGO.centre_m
        state = not v.parked and aside < 2 * IN_LANE_M and room
    elif relation == "overtake":
        state = aside < IN_LANE_M and v.speed_mps < SLOW_MPS
    elif relation == "drive_past":
        state = v.stationary and aside > IN_LANE_M
    elif relation == "toward":
        state = True
    return bool(there and state and moment.is_in_street(v))


def _reachable_ahead(found: Region | None, left_out: Counter[str]) -> Region | None:
    """Return the region if its best goal is far enough ahead to be reached, else None."""
    if found is None:
        left_out["no place in that relation is free"] += 1
        return None
    if found.best_m[0] < EGO.centre_m + LEAST_WAY_M:
        left_out["the place is no way ahead"] += 1
        return None
    return found


def _pick(words: Sequence[Any], random: np.random.Generator) -> Any:
    return words[int(random.integers(len(words)))]

"""Accuracy of grounding on commands in simulated scenes with known referent and goal region.

    python -m benchmarks.grounding_cases ROOT [--bev SOURCE] [--noisy | --tracked] [--cases 1000] [--seed 0]
                                              [--errors] [--pictures DIR]

ROOT is a simulated dataset. A case is a key frame, a sentence, its referent (two for "between") by true body, paint,
place and speed, with clear margins to all other vehicles, and the cells of admissible goals. Cases are generated
without any code of `grounding` (`benchmarks.grounding_truth`). In 15 % of the cases two or more vehicles fit and the
sentence does not decide between them; in 5 % there is no such vehicle.

- --bev: source of the maps; with `exact` the true boxes are given too, with any other source only the map and its
  objects. --tracked: its objects are tracked from the first frame of the scene, and the tracks are given.
  --noisy: exact maps with the noise of `benchmarks.colour_ablation`, only the map. A map without objects has
  no fronts, speeds and heights: sentences then do not mention parked or moving, car, van and truck are distinguished
  by other words, and "behind" is along our own direction.
- vehicle: the referent is right (without boxes: within 2 m), or none if none is named. place: the target is in the
  region and heads along the lane. off: distance of the target from the best goal of the region, in metres, if the
  vehicle is right. asked, none: the answer is a clarification question, or "not found". error: an exception.
- asked back: share of unambiguous cases answered by a question, and how often the referent is among its candidates.
- declared: share of ambiguous cases answered as ambiguous, with two or more of the fitting vehicles among the
  candidates; share of absent cases answered as not found.
- hard violations: targets whose footprint contains the centre of a cell that is vehicle or not road in the given map,
  or that is off the map. There must be none.
"""

from __future__ import annotations

import argparse
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from appocc.bevmap import ROAD, VEHICLE, BEVMap, load_map
from appocc.boxes import Boxes
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from appocc.files import write_image
from appocc.geometry import footprints, wrap_angle
from appocc.visualization.canvas import GREEN, RED, WHITE, YELLOW, BEVCanvas, Colour, put_text
from benchmarks.colour_ablation import _disturbed, _map_of
from benchmarks.encounters import Sight
from benchmarks.grounding_truth.case_generation import SUITS, Case, make_cases
from benchmarks.grounding_truth.key_frames import Town, TrueFrame
from benchmarks.grounding_truth.places import TURN_DEG
from benchmarks.grounding_truth.roads import EGO
from grounding.grounder import Grounder
from tracking import OBJECTS, Detections, Track, Tracker, Tracks

# Without boxes, the vehicle within this distance is the right one; tolerance of headings that come in steps.
SAME_M, YAW_SLACK_DEG = 2.0, 5.0
NO_COLOUR = np.array([128, 128, 128])
MOST_PICTURES = 60
CYAN: Colour = (60, 220, 255)


# The product ------------------------------------------------------------------------------------------------------


class Asked(NamedTuple):
    """The answer of the grounder.

    Attributes:
        status: ok, ambiguous, not_found, not_a_command; error for an exception.
        words: its reasons, or the error.
        cell: cell of the target, None without one.
        place_m: (2,) the same in metres.
        yaw_rad: heading at the target, ego frame.
        vehicles: identity and position of the vehicles that the goal is measured from.
        candidates: identity and position of possible referents.
    """

    status: str
    words: str
    cell: tuple[int, int] | None = None
    place_m: FloatArray | None = None
    yaw_rad: float = 0.0
    vehicles: tuple[tuple[str, FloatArray], ...] = ()
    candidates: tuple[tuple[str, FloatArray], ...] = ()


def ask(sentence: str, grounder: Grounder) -> Asked:
    """Ask the grounder; all calls of it are here."""
    answer = grounder.ground(sentence)
    target, referent = answer.target, answer.referent
    items = [referent.item, getattr(referent, "partner", None)] if referent else []
    return Asked(
        answer.status,
        "; ".join(answer.reasons),
        target.cell if target else None,
        target.ego_m if target else None,
        target.heading_ego_rad if target else 0.0,
        tuple((item.id, item.centre_m) for item in items if item),
        tuple((one.item.id, one.item.centre_m) for one in answer.candidates),
    )


# Judging ----------------------------------------------------------------------------------------------------------


class Verdict(NamedTuple):
    """Evaluation of an answer.

    Attributes:
        case: the case.
        asked: the answer.
        vehicle: whether the vehicle is right; in an ambiguous or absent case, whether it was declared as such.
        place: whether the target is right.
        off_m: distance from the target to the best goal, NaN without a target or if the vehicle is wrong.
        on_vehicle: number of vehicle cells below the target's footprint.
        off_road: number of cells below it that are not known road, or off the map.
        among: whether the referent is among the candidates of the question.
    """

    case: Case
    asked: Asked
    vehicle: bool
    place: bool = False
    off_m: float = np.nan
    on_vehicle: int = 0
    off_road: int = 0
    among: bool = False

    @property
    def right(self) -> bool:
        """Return whether vehicle and place are right."""
        return self.vehicle and (self.place or self.case.kind != "one") and not self.on_vehicle + self.off_road


def judge(case: Case, asked: Asked, bev: BEVMap, by_name: bool) -> Verdict:
    """Evaluate an answer on the map given to the grounder; vehicles are matched by name, or by their position."""
    on_vehicle, off_road = violations(asked, bev)
    right = case.kind == "absent" and asked.status == "not_found"
    if case.kind == "ambiguous":
        right = asked.status == "ambiguous" and len(_found(case, asked.candidates, by_name)) > 1
    if case.kind == "one":
        right = asked.status == "ok" and len(asked.vehicles) == len(case.vehicles)
        right &= len(_found(case, asked.vehicles, by_name)) == len(case.vehicles)
    if case.region is None or asked.place_m is None:
        among = asked.status == "ambiguous" and bool(_found(case, asked.candidates, by_name))
        return Verdict(case, asked, right, False, np.nan, on_vehicle, off_road, among)
    turns_deg = np.degrees(wrap_angle(np.array(case.region.yaws_rad) - asked.yaw_rad))
    along_lane = bool(np.abs(turns_deg).min() <= TURN_DEG + YAW_SLACK_DEG)
    off_m = float(np.hypot(*(asked.place_m - case.region.best_m))) if right else np.nan
    inside = bool(case.region.cells[asked.cell]) and along_lane
    return Verdict(case, asked, right, inside, off_m, on_vehicle, off_road)


def _found(case: Case, answered: Sequence[tuple[str, FloatArray]], by_name: bool) -> list[str]:
    """Return which of a case's vehicles are among those of an answer."""
    if by_name:
        return [v.instance for v in case.vehicles if v.instance in {name for name, _ in answered}]
    places = np.array([place for _, place in answered]).reshape(-1, 2)
    return [v.instance for v in case.vehicles if np.hypot(*(places - v.xy_m).T).min(initial=np.inf) <= SAME_M]


def violations(asked: Asked, bev: BEVMap) -> tuple[int, int]:
    """Count the cells with centres in the target's footprint that are vehicle, and that are not known road.

    The cells below the ego itself, which no camera sees, count as road: it stands there.
    """
    if asked.place_m is None:
        return 0, 0
    offset = bev.grid.centres() - asked.place_m
    cos, sin = np.cos(asked.yaw_rad), np.sin(asked.yaw_rad)
    inside = np.abs(offset @ [cos, sin]) <= EGO.length_m / 2
    inside &= np.abs(offset @ [-sin, cos]) <= EGO.width_m / 2
    corners = footprints(asked.place_m, asked.yaw_rad, [EGO.length_m, EGO.width_m])
    off_map = np.count_nonzero(~bev.grid.contains(bev.grid.cell_of(corners)))
    below_us = (np.abs(bev.grid.centres() - [EGO.centre_m, 0.0]) <= [EGO.length_m / 2, EGO.width_m / 2]).all(axis=-1)
    off_road = np.count_nonzero(inside & ~bev.on[ROAD] & ~below_us)
    return int(np.count_nonzero(inside & bev.on[VEHICLE])), int(off_road + off_map)


# Maps to ask on ---------------------------------------------------------------------------------------------------


def noisy_map(moment: TrueFrame, random: np.random.Generator) -> BEVMap:
    """Return the exact map with noise like a network's: displaced, missed and false vehicles, grainy colours."""
    on_map = [n for n, v in enumerate(moment.vehicles) if v.on_map]
    colours = moment.bev.appearance.transpose(1, 2, 0)
    rgb = [np.median(colours[own], axis=0) if (own := moment.owner == n).any() else NO_COLOUR for n in on_map]
    vehicles = [moment.vehicles[n] for n in on_map]
    sight = Sight(
        0,
        moment.world_from_ego,
        np.arange(len(vehicles)),
        np.array([v.xy_m for v in vehicles]).reshape(-1, 2) @ moment.world_from_ego[:2, :2].T
        + moment.world_from_ego[:2, 3],
        np.array([v.yaw_rad for v in vehicles])
        + np.arctan2(moment.world_from_ego[1, 0], moment.world_from_ego[0, 0]),
        np.array([(v.width_m, v.length_m, 1.5) for v in vehicles]).reshape(-1, 3),
        np.array(rgb, dtype=np.float64).reshape(-1, 3),
        np.ones(len(vehicles), np.bool_),
    )
    grain = random.normal(0, 12, (3, *moment.bev.grid.shape))
    seen = _map_of(_disturbed(sight, random), moment.world_from_ego, grain)
    occupancy, shown = moment.bev.occupancy.copy(), seen.occupancy[VEHICLE] > 0
    occupancy[VEHICLE] = seen.occupancy[VEHICLE]
    ground = np.clip(moment.bev.appearance + grain, 0, 255)
    appearance = np.where(shown, seen.appearance, ground).astype(np.uint8)
    return replace(moment.bev, occupancy=occupancy, appearance=appearance)


def track_all(town: Town, source: str) -> dict[str, Tracks]:
    """Return the tracks at each key frame, of the objects of the maps of its scene up to there."""
    tracked: dict[str, Tracks] = {}
    for scene in town.dataset.scenes:
        tracker = Tracker(OBJECTS)
        for sample in town.dataset.samples(scene):
            detections = Detections.from_bev(load_map(town.dataset.root, source, sample.token))
            pose = town.dataset.world_from_ego(sample)
            tracked[sample.token] = tracker.update(detections, sample.timestamp_us, pose)
    return tracked


def product_and_map(
    town: Town, moment: TrueFrame, source: str, noisy: bool, seed: int, tracked: Mapping[str, Tracks] | None = None
) -> tuple[Grounder, BEVMap]:
    """Return a grounder with a key frame as its scene, and the map that it got."""
    boxes: Boxes | Sequence[Track] | None = None if tracked is None else list(tracked[moment.token])
    if noisy:
        bev = noisy_map(moment, np.random.default_rng([seed, 7, zlib.crc32(moment.token.encode())]))
    elif source == "exact":
        bev, boxes = moment.bev, moment.boxes
    else:
        bev = load_map(town.dataset.root, source, moment.token)
    grounder = Grounder()
    grounder.set_street_map(town.street_map(moment.token))
    grounder.set_scene(bev, boxes, moment.world_from_ego)
    return grounder, bev


def verdicts(
    town: Town,
    cases: Sequence[Case],
    source: str,
    noisy: bool,
    seed: int,
    pictures: Path | None,
    tracked: Mapping[str, Tracks] | None,
) -> Iterator[Verdict]:
    """Ask and evaluate, key frame by key frame; draw some of the wrong answers."""
    drawn = 0
    for token, ours in groupby(cases, key=lambda case: case.token):
        moment = town.moment(token)
        grounder, bev = product_and_map(town, moment, source, noisy, seed, tracked)
        for case in ours:
            try:
                asked = ask(case.sentence, grounder)
            except Exception as error:  # any exception is counted and printed
                asked = Asked("error", f"{type(error).__name__}: {error}")
            verdict = judge(case, asked, bev, source == "exact" and not noisy)
            if pictures and not verdict.right and drawn < MOST_PICTURES:
                write_image(pictures / f"{drawn:03d}_{case.group}_{case.kind}.png", picture(verdict, moment, bev))
                drawn += 1
            yield verdict


# Telling ----------------------------------------------------------------------------------------------------------

HEAD = ("relation", "cases", "vehicle %", "place %", "off m: median", "p90", "asked", "none", "error")


def table(judged: Sequence[Verdict]) -> Table:
    """Return the shares of the unambiguous cases, one row per relation."""
    made = Table(*HEAD)
    ones = [one for one in judged if one.case.kind == "one"]
    for name in (*SUITS, "all"):
        rows = [one for one in ones if name in (one.case.group, "all")]
        if not rows:
            continue
        off = [one.off_m for one in rows if np.isfinite(one.off_m)]
        status = Counter(one.asked.status for one in rows)
        shares = [f"{100 * np.mean([getattr(one, key) for one in rows]):.1f}" for key in ("vehicle", "place")]
        distances = [f"{np.percentile(off, share):.2f}" if off else "" for share in (50, 90)]
        counts = [str(status[key]) for key in ("ambiguous", "not_found", "error")]
        made.add_row(name.replace("_", " "), str(len(rows)), *shares, *distances, *counts, end_section=name == "none")
    return made


def summary(judged: Sequence[Verdict], left_out: Counter[str]) -> list[str]:
    """Return the figures that are not in the table."""
    lines = []
    for kind in ("ambiguous", "absent"):
        declared = [one.vehicle for one in judged if one.case.kind == kind]
        lines.append(f"{kind}: {sum(declared)} of {len(declared)} declared")
    asked = [one for one in judged if one.case.kind == "one" and one.asked.status == "ambiguous"]
    right = sum(one.among for one in asked)
    lines.append(f"asked back though there is one answer: {len(asked)}, about the right vehicle {right}")
    places = [one for one in judged if one.asked.place_m is not None]
    hit, off = (sum(getattr(one, key) > 0 for one in places) for key in ("on_vehicle", "off_road"))
    lines.append(f"hard violations: {hit} on a vehicle, {off} off the road, of {len(places)} targets")
    errors = Counter(one.asked.words for one in judged if one.asked.status == "error")
    lines += [f"error, {count} times: {words}" for words, count in errors.most_common(10)]
    refused = sum(one.asked.status == "not_a_command" for one in judged)
    lines.append(f"not understood as a command: {refused}")
    return [*lines, *(f"no case {count} times: {why}" for why, count in left_out.most_common())]


def error_text(verdict: Verdict) -> str:
    """Return a wrong answer in two lines."""
    case, asked = verdict.case, verdict.asked
    meant = ", ".join(f"{v.paint} {v.body} at ({v.xy_m[0]:.0f}, {v.xy_m[1]:.0f})" for v in case.vehicles) or "none"
    got = ", ".join(f"{name[:8]} at ({x:.0f}, {y:.0f})" for name, (x, y) in asked.vehicles) or "none"
    wrong = [name for name in ("vehicle", "place") if not getattr(verdict, name)]
    best = f", best {np.round(case.region.best_m, 1).tolist()}" if case.region else ""
    where = f", place {np.round(asked.place_m, 1).tolist()}" if asked.place_m is not None else ""
    return (
        f"{case.token[:8]} {case.kind} {case.relation}: {case.sentence}\n"
        f"    wrong {' and '.join(wrong) or 'footprint'}; {asked.status}: {got}{where}; "
        f"right: {meant}{best}; {asked.words}"
    )


def picture(verdict: Verdict, moment: TrueFrame, bev: BEVMap) -> ByteArray:
    """Draw the region and its best goal, the true vehicles (red), those of the answer, and the target (cyan)."""
    case, asked = verdict.case, verdict.asked
    canvas = BEVCanvas(bev.grid, 4)
    canvas.occupancy(bev)
    canvas.appearance(bev)
    canvas.ego(EgoVehicle())
    if case.region:
        plain = canvas.picture.copy()
        canvas.cells(np.broadcast_to(np.array(GREEN, np.uint8), (*bev.grid.shape, 3)), case.region.cells)
        canvas.picture[:] = (0.5 * plain + 0.5 * canvas.picture).astype(np.uint8)
        canvas.dot(case.region.best_m, GREEN, 4)
    for v in moment.vehicles:
        if v.on_map:
            meant = v.instance in {one.instance for one in case.vehicles}
            corners = footprints(v.xy_m, v.yaw_rad, [v.length_m, v.width_m])
            canvas.line(corners, RED if meant else WHITE, 2 if meant else 1, closed=True)
            canvas.line([(corners[0] + corners[3]) / 2, v.xy_m], RED if meant else WHITE)
            canvas.label(v.xy_m, f"{v.paint} {v.body}{'' if v.visible else ' hidden'}")
    for _, place in asked.vehicles or asked.candidates:
        canvas.dot(place, CYAN if asked.vehicles else YELLOW, 5)
    if asked.place_m is not None:
        corners = footprints(asked.place_m, asked.yaw_rad, [EGO.length_m, EGO.width_m])
        canvas.line(corners, CYAN, 2, closed=True)
        canvas.line([asked.place_m, (corners[0] + corners[3]) / 2], CYAN, 2)
    band = np.full((78, canvas.picture.shape[1], 3), 24, np.uint8)
    put_text(band, case.sentence, (8, 20), WHITE, 0.55)
    put_text(band, f"{case.kind} {case.relation}, {case.ask.action}; {asked.status}", (8, 44), YELLOW, 0.5)
    put_text(band, asked.words, (8, 66), WHITE, 0.4)
    return np.ascontiguousarray(np.vstack([band, canvas.picture]))


def _has_objects(town: Town, source: str) -> bool:
    """Return whether the maps of a source have objects, by the first one."""
    first = town.dataset.samples(town.dataset.scenes[0])[0]
    return load_map(town.dataset.root, source, first.token).objects is not None


def main(words: Sequence[str] | None = None) -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="exact")
    given_maps = parser.add_mutually_exclusive_group()
    given_maps.add_argument("--noisy", action="store_true")
    given_maps.add_argument("--tracked", action="store_true")
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--errors", action="store_true")
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args(words)
    if given.tracked and given.bev == "exact":
        parser.error("--tracked: expected --bev SOURCE of predicted maps, got exact, which gives the true boxes")
    console = Console(width=120)
    try:
        town = Town(given.root)
        with Progress(console=Console(stderr=True)) as progress:
            task = progress.add_task("making cases", total=given.cases)
            blobs = given.noisy or (given.bev != "exact" and not _has_objects(town, given.bev))
            made = make_cases(town, given.cases, given.seed, blobs, lambda n: progress.update(task, completed=n))
            tracked = track_all(town, given.bev) if given.tracked else None
            asking = verdicts(town, made.cases, given.bev, given.noisy, given.seed, given.pictures, tracked)
            judged = list(progress.track(asking, total=len(made.cases), description="asking"))
    except AppoccError as error:
        parser.exit(2, f"{error}\n")
    if given.errors:
        for one in judged:
            if not one.right:
                console.print(error_text(one), highlight=False, markup=False)
    console.print(table(judged))
    for line in summary(judged, made.left_out):
        console.print(line, highlight=False, markup=False)


if __name__ == "__main__":
    main()

"""Conversations over made scenes: each turn has an expected answer.

    python -m benchmarks.grounding_sessions [FILE ...] [--unread] [--errors]

Without a FILE, the project's own conversations (`benchmarks/grounding_truth/conversations.yaml`); its header
describes the format, `--unread` selects the half that was kept unread during development, `--seen` the other one. A
FILE with one JSON record a line has `scene` (vehicles with id, class, colour, x_m, y_m, heading_deg, speed_mps) and
`turns`, each with `say` and `expect`: status (or "refused", which is "not_found" with `refused`), referent and
relation, with alternatives in status_alt, referent_alt and relation_alt.

A conversation is right if every turn is. Places are judged by plain geometry on the made scene.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.console import Console

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.errors import AppoccError, DataError
from appocc.files import read_text
from appocc.geometry import footprints, quaternion_from_yaw, transform, wrap_angle
from appocc.grid import BEVGrid
from appocc.rasterise import VEHICLE_SHARE, polygon_owner
from grounding import Grounder
from grounding.answer import Answer

OWN = Path(__file__).parent / "grounding_truth" / "conversations.yaml"
MAX_BYTES = 5_000_000
# Edges of the road to the right and to the left, its middle line, and the crossing road.
ROAD_M, MIDDLE_M, CROSSING_M = (-4.4, 7.9), 1.75, (22.0, 32.0)
# Grid beyond which no vehicle of the files lies.
GRID = BEVGrid(x_min_m=-40.0, x_max_m=64.0, y_min_m=-40.0, y_max_m=40.0, cell_m=0.4)
EGO_LENGTH_M = 4.6
PAINTS = {
    **{"white": (240, 240, 240), "silver": (190, 191, 192), "grey": (110, 110, 112), "black": (20, 20, 22)},
    **{"red": (190, 25, 30), "blue": (30, 60, 170), "green": (30, 130, 50), "yellow": (235, 200, 40)},
    **{"brown": (100, 60, 35), "orange": (240, 130, 30), "beige": (215, 200, 170), "gold": (200, 160, 60)},
}
# Width, length, height and category of each class.
BODIES: dict[str, tuple[tuple[float, float, float], str]] = {
    "car": ((1.8, 4.4, 1.5), "vehicle.car"),
    "van": ((2.0, 5.4, 2.2), "vehicle.car"),
    "truck": ((2.4, 7.5, 3.2), "vehicle.truck"),
    "bus": ((2.5, 11.0, 3.2), "vehicle.bus.rigid"),
    "trailer": ((2.4, 6.0, 2.6), "vehicle.trailer"),
    "construction_vehicle": ((2.4, 6.5, 3.0), "vehicle.construction"),
    "motorcycle": ((0.8, 2.2, 1.5), "vehicle.motorcycle"),
    "bicycle": ((0.6, 1.8, 1.6), "vehicle.bicycle"),
    "person": ((0.6, 0.6, 1.7), "human.pedestrian.adult"),
}


# What the files' relations are for those that they lack: who stops before a car stands behind it.
_ALSO = {
    "between": {"behind", "in_front_of"},
    "before": {"behind"},
    "at": {"near", "next_to"},
    "toward": {"near", "next_to"},
}
# Relations that an action implies where none is said.
_IMPLIED = {"follow": "behind", "overtake": "past", "drive_past": "past"}


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of a made scene: place and heading in the ego frame of the first moment."""

    name: str
    kind: str
    colour: str
    x_m: float
    y_m: float
    yaw_deg: float = 0.0
    speed_mps: float = 0.0

    @classmethod
    def from_text(cls, name: str, text: str) -> Vehicle:
        """Read "class colour x_m y_m [yaw_deg [speed_mps]]"."""
        kind, colour, *numbers = text.split()
        return cls(name, kind, colour, *map(float, numbers))

    def moved(self, text: str) -> Vehicle:
        """Return the vehicle at "x_m y_m [speed_mps]"."""
        x_m, y_m, *speed = map(float, text.split())
        return Vehicle(self.name, self.kind, self.colour, x_m, y_m, self.yaw_deg, *(speed or [self.speed_mps]))


@dataclass(frozen=True)
class Conversation:
    """A scene and the turns of a conversation about it."""

    name: str
    vehicles: tuple[Vehicle, ...]
    turns: tuple[Mapping[str, Any], ...]
    crossing: bool = False
    unread: bool = False


class Stage:
    """The made scene of a conversation as it moves on."""

    def __init__(self, talk: Conversation) -> None:
        """Begin with the first moment."""
        self.vehicles = {one.name: one for one in talk.vehicles}
        self.crossing, self.driven_m = talk.crossing, 0.0

    def move_on(self, turn: Mapping[str, Any]) -> None:
        """Apply what happens in a turn."""
        self.driven_m = float(turn["drive"])
        for name, text in turn.get("moved", {}).items():
            self.vehicles[name] = self.vehicles[name].moved(text)
        for name in turn.get("gone", []):
            del self.vehicles[name]

    def world_from_ego(self) -> np.ndarray:
        """Return the pose of the ego; the world is the ego frame of the first moment."""
        return transform(quaternion_from_yaw(0.0), [self.driven_m, 0.0, 0.0])

    def boxes(self) -> Boxes:
        """Return the vehicles in the present ego frame."""
        every = list(self.vehicles.values())
        if not every:
            return Boxes.empty()
        yaw = np.radians([one.yaw_deg for one in every])
        size = np.array([BODIES[one.kind][0] for one in every])
        centre = np.array([[one.x_m - self.driven_m, one.y_m, 0.0] for one in every])
        centre[:, 2] = size[:, 2] / 2
        speed = np.array([one.speed_mps for one in every])
        names = tuple(one.name for one in every)
        return Boxes(
            centre_m=centre,
            size_wlh_m=size,
            rotation=np.stack([transform(quaternion_from_yaw(one), [0, 0, 0])[:3, :3] for one in yaw]),
            category=tuple(BODIES[one.kind][1] for one in every),
            instance=names,
            token=names,
            velocity_mps=speed[:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1),
            lidar_points=np.full(len(every), 5),
        )

    def bev(self) -> BEVMap:
        """Return the exact map around the ego."""
        boxes = self.boxes()
        x, y = np.moveaxis(GRID.centres(), -1, 0)
        road = (y > ROAD_M[0]) & (y < ROAD_M[1])
        if self.crossing:
            road |= (x + self.driven_m > CROSSING_M[0]) & (x + self.driven_m < CROSSING_M[1])
        occupancy, appearance = np.zeros((3, *GRID.shape), np.float32), np.full((3, *GRID.shape), 90, np.uint8)
        occupancy[ROAD] = road
        occupancy[LANE] = road & (np.abs(y - MIDDLE_M) < 0.2) & (np.mod(x + self.driven_m, 6.0) < 3.0)
        if len(boxes):
            outlines = footprints(boxes.centre_m[:, :2], boxes.yaw_rad, boxes.size_wlh_m[:, [1, 0]])
            owner = polygon_owner(GRID, outlines, VEHICLE_SHARE)
            occupancy[VEHICLE] = owner >= 0
            paints = np.array([PAINTS[one.colour] for one in self.vehicles.values()], dtype=np.uint8)
            appearance[:, owner >= 0] = paints[owner[owner >= 0]].T
        known = np.ones(GRID.shape, np.bool_)
        return BEVMap(GRID, occupancy, np.stack([known] * 3), appearance, known.copy())


@dataclass(frozen=True)
class TurnResult:
    """An answer in words, what is wrong with it ('' if nothing is), and the processor time that it took."""

    turn: Mapping[str, Any]
    told: str
    wrong: str
    took_ms: float


def run(talk: Conversation) -> list[TurnResult]:
    """Hold a conversation and judge each answer."""
    stage, grounder = Stage(talk), Grounder()
    grounder.set_scene(stage.bev(), stage.boxes(), stage.world_from_ego())
    session = grounder.session()
    results: list[TurnResult] = []
    last: Answer | None = None
    for turn in talk.turns:
        began_s = time.process_time()
        if "drive" in turn:
            stage.move_on(turn)
            answer = session.update(stage.bev(), stage.boxes(), stage.world_from_ego())
        elif "choose" in turn:
            answer = session.choose(int(turn["choose"]))
        else:
            answer = session.say(turn["say"])
        took_ms = 1000 * (time.process_time() - began_s)
        if answer is None:
            results.append(TurnResult(turn, "", "no answer", took_ms))
            continue
        if "expect" in turn:
            wrong = judge_strangers(turn, answer, session.goal, last)
        else:
            wrong = judge(turn, answer, last, stage)
        results.append(TurnResult(turn, answer.text(), wrong, took_ms))
        last = answer if answer.target or answer.candidates else last
    return results


# Judging ----------------------------------------------------------------------------------------------------------


def judge(turn: Mapping[str, Any], answer: Answer, last: Answer | None, stage: Stage) -> str:
    """Return what is wrong with an answer to a turn of the project's own file; '' if it is right."""
    wrong = []
    if answer.status not in _several(turn["is"]):
        return f"status {answer.status}"
    referent = answer.referent.item.id if answer.referent else None
    if "car" in turn and referent != turn["car"]:
        wrong.append(f"car {referent}")
    if "among" in turn and {one.item.id for one in answer.candidates} != set(turn["among"]):
        wrong.append(f"candidates {[one.item.id for one in answer.candidates]}")
    if "steps" in turn and len(answer.steps) != turn["steps"]:
        wrong.append(f"{len(answer.steps)} steps")
    if "says" in turn and not any(word in answer.text().casefold() for word in turn["says"]):
        wrong.append("words")
    wrong += _judge_place(turn, answer, last, stage) if answer.status == "ok" else []
    return ", ".join(wrong)


def _judge_place(turn: Mapping[str, Any], answer: Answer, last: Answer | None, stage: Stage) -> list[str]:
    """Return what is wrong with the place of an answer."""
    target = answer.target
    before = last.target if last else None
    wanted = [key for key in ("place", "along", "across", "turned", "shift") if key in turn]
    if target is None:
        return ["no place"] if wanted else []
    wrong = []
    if "place" in turn:
        relation, *names = turn["place"].split()
        if not any(_is_at(relation, stage.vehicles[name], target.world_m) for name in names):
            wrong.append(f"not {turn['place']}: {np.round(target.ego_m, 1).tolist()}")
    for key, value in (("along", target.ego_m[0]), ("across", target.ego_m[1])):
        if key in turn and not turn[key][0] <= value <= turn[key][1]:
            wrong.append(f"{key} {value:.1f}")
    if "turned" in turn:
        wanted_rad = {"left": np.pi / 2, "right": -np.pi / 2, "around": np.pi}[turn["turned"]]
        if abs(float(wrap_angle(target.heading_ego_rad - wanted_rad))) > np.radians(35):
            wrong.append(f"heading {np.degrees(target.heading_ego_rad):.0f}")
    if "shift" in turn:
        shift = float("nan") if before is None else float(target.world_m[0] - before.world_m[0])
        if not turn["shift"][0] <= shift <= turn["shift"][1]:
            wrong.append(f"shift {shift:.1f}")
    if turn.get("kept") and (before is None or np.linalg.norm(target.world_m - before.world_m) > 0.5):
        wrong.append("goal changed")
    return wrong


def _is_at(relation: str, vehicle: Vehicle, place_m: np.ndarray) -> bool:
    """Return whether a place (2,), world frame, has a relation to a vehicle; gaps up to 16 m."""
    yaw = np.radians(vehicle.yaw_deg)
    offset = place_m - [vehicle.x_m, vehicle.y_m]
    along = float(offset @ [np.cos(yaw), np.sin(yaw)])
    across = abs(float(offset @ [-np.sin(yaw), np.cos(yaw)]))
    (width, length, _), _ = BODIES[vehicle.kind]
    least = (length + EGO_LENGTH_M) / 2
    lateral = 4.2
    tests = {
        "behind": -least - 16 <= along <= 0.4 - least and across < lateral,
        "in_front_of": least - 0.4 <= along <= least + 16 and across < lateral,
        "next_to": abs(along) < least - 0.5 and width / 2 < across < 5.0,
        "near": float(np.linalg.norm(offset)) < 14,
        "past": place_m[0] - vehicle.x_m > least - 0.6,
    }
    return bool(tests[relation])


def judge_strangers(turn: Mapping[str, Any], answer: Answer, goal: Answer | None, last: Answer | None) -> str:
    """Return what is wrong with an answer to a turn of a file of records; '' if it is right.

    The referent is that of the goal in force, where the answer is in words only.
    """
    expected = turn["expect"]
    statuses = {expected["status"], *expected.get("status_alt", [])}
    told = {answer.status, "refused"} if answer.plan.refused else {answer.status}
    if not told & statuses:
        return f"status {answer.status}"
    if answer.status != "ok" or expected["status"] != "ok":
        return ""
    wrong = []
    about = answer if answer.target is not None or goal is None else goal
    # "Go past the bus, then pull over": of the steps, the last one that has a vehicle.
    about = next((one for one in reversed(about.steps) if one.referent), about) if about.referent is None else about
    referent = about.referent.item.id if about.referent else None
    # "candidates[1] of the previous answer"
    if rule := expected.get("referent_rule"):
        number = int(rule.split("[")[1].split("]")[0])
        meant = {last.candidates[number].item.id if last and len(last.candidates) > number else None}
    else:
        meant = {expected["referent"], *expected.get("referent_alt", [])}
    if referent not in meant:
        wrong.append(f"referent {referent}")
    relations = {expected["relation"], *expected.get("relation_alt", [])}
    query = about.query if answer.referent is None else answer.query
    relation: str = query.relation
    if relation == "none":  # whoever follows is behind, who overtakes in front, who collects someone is beside them
        person = query.referent is not None and query.referent.noun == "person"
        relation = "at" if person else _IMPLIED.get(query.action or "", relation)
    given = {relation, query.relation, *_ALSO.get(relation, ())}
    if expected["relation"] is not None and not given & relations:
        wrong.append(f"relation {answer.query.relation}")
    if expected["relation"] is not None and answer.target is None:
        wrong.append("no place")
    return ", ".join(wrong)


def _several(value: str | Sequence[str]) -> Sequence[str]:
    return [value] if isinstance(value, str) else value


# Files ------------------------------------------------------------------------------------------------------------


def read_conversations(path: Path) -> list[Conversation]:
    """Read a file of conversations.

    Raises:
        DataError: if it cannot be read.
    """
    text = read_text(path, MAX_BYTES)
    try:
        if path.suffix == ".yaml":
            return _from_yaml(yaml.safe_load(text))
        return [_from_record(json.loads(line)) for line in text.splitlines() if line.strip()]
    except (yaml.YAMLError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{path}: expected conversations ({type(error).__name__}: {error})") from error


def _from_yaml(value: Mapping[str, Any]) -> list[Conversation]:
    scenes = value["scenes"]
    talks = []
    for one in value["conversations"]:
        scene = scenes[one["scene"]]
        vehicles = tuple(Vehicle.from_text(name, text) for name, text in scene["vehicles"].items())
        crossing, unread = scene.get("crossing", False), one.get("unread", False)
        talks.append(Conversation(one["name"], vehicles, tuple(one["turns"]), crossing, unread))
    return talks


def _from_record(value: Mapping[str, Any]) -> Conversation:
    keys = ("id", "class", "colour", "x_m", "y_m", "heading_deg", "speed_mps")
    vehicles = tuple(Vehicle(*(one[key] for key in keys)) for one in value["scene"])
    return Conversation(value["id"], vehicles, tuple(value["turns"]))


def main(words: Sequence[str] | None = None) -> None:
    """Hold all conversations and print how many are right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="*", default=[OWN])
    parser.add_argument("--unread", action="store_true", help="only the half that was kept unread, of the own file")
    parser.add_argument("--seen", action="store_true", help="only the other half")
    parser.add_argument("--errors", action="store_true", help="print the conversations that are wrong")
    given = parser.parse_args(words)
    console = Console(width=140, highlight=False, markup=False)
    for path in given.files:
        try:
            talks = read_conversations(path)
        except AppoccError as error:
            parser.exit(error.exit_code, f"error: {error}\n")
        if given.unread or given.seen:
            talks = [talk for talk in talks if talk.unread == given.unread]
        results = [(talk, run(talk)) for talk in talks]
        right = sum(not any(turn.wrong for turn in turns) for _, turns in results)
        turns = [turn for _, every in results for turn in every]
        good = sum(not turn.wrong for turn in turns)
        median_ms, most_ms = np.percentile([turn.took_ms for turn in turns if "say" in turn.turn] or [0.0], [50, 95])
        console.print(
            f"{path.name}: {right} of {len(results)} conversations, {good} of {len(turns)} turns right; "
            f"a turn takes {median_ms:.0f} ms in the median, {most_ms:.0f} at 95 %"
        )
        for talk, every in results if given.errors else ():
            if any(turn.wrong for turn in every):
                console.print(f"\n{talk.name}")
                for turn in every:
                    said = turn.turn.get("say") or turn.turn.get("choose") or f"drives to {turn.turn.get('drive')} m"
                    console.print(f"  > {said}    {'WRONG: ' + turn.wrong if turn.wrong else 'right'}")
                    if turn.told and turn.wrong:
                        console.print("    " + turn.told.replace("\n", "\n    "))


if __name__ == "__main__":
    main()

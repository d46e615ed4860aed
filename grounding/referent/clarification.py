"""What tells vehicles apart that all may be meant, and the one question that decides between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.ego_vehicle import EgoVehicle
from appocc.motion_state import STANDING_MPS
from grounding.referent.scene import Scene
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject

# So many are named in a question.
_MOST_NAMED = 4
_ASIDE_M, _BEHIND_M, _FACING_RAD = 1.5, 2.5, np.radians(120)
# What people look at, most telling first; distances come last and always.
_TRAITS = ("colour", "noun", "behind", "side", "motion", "lane")
# One thing, or two that are meant together.
Group = tuple[SceneObject, ...]


def tell_apart(groups: Sequence[Group], scene: Scene) -> tuple[str, ...]:
    """Each of several candidates in words: what it has and others do not, and its distance."""
    known = [_traits(group[0], scene) for group in groups]
    digits = 0 if len({round(group[0].distance_m(scene.ego)) for group in groups}) == len(groups) else 1
    named = []
    for number, group in enumerate(groups):
        telling = _telling(known[number], [other for k, other in enumerate(known) if k != number])
        words = _in_words(group[0], scene.ego, known[number], telling, number == 0, digits)
        if len(group) > 1:
            words += f", and {_in_words(group[1], scene.ego, _traits(group[1], scene), {*_TRAITS[:2]}, True, digits)}"
        named.append(words)
    return tuple(named)


def ask(differences: Sequence[str]) -> str:
    """One question that names candidates by what tells them apart."""
    several = [*differences[:_MOST_NAMED], *(["another one"] if len(differences) > _MOST_NAMED else [])]
    mark = "; " if any(" and " in words for words in several) or len(several) > 2 else ", "
    return f"{mark.join(several[:-1])}{mark}or {several[-1]}?"


def _traits(item: SceneObject, scene: Scene) -> dict[str, str]:
    """What can be said of a thing, by what it is about; empty where there is nothing to say."""
    _, sideways_m = scene.lanes.project(item.centre_m[None])
    x, y = item.centre_m[0] - scene.ego.centre_m, item.centre_m[1]
    motion = ""
    if item.speed_mps is not None:
        facing = item.front_known and abs(item.yaw_rad) > _FACING_RAD
        moves = "coming towards us" if facing else "moving"
        motion = "standing" if item.speed_mps < STANDING_MPS else moves
    return {
        "colour": scene.colour_name(item) or "",
        "noun": item.noun,
        "behind": "behind us" if x < -_BEHIND_M else "",
        "side": "on the left" if y > _ASIDE_M else "on the right" if y < -_ASIDE_M else "straight on",
        "motion": motion,
        "lane": "in our lane" if abs(float(sideways_m[0])) < LANE_M / 2 else "",
    }


def _telling(own: dict[str, str], others: list[dict[str, str]]) -> set[str]:
    """The first traits that no other has all of."""
    chosen: set[str] = set()
    for trait in _TRAITS:
        alike = [other for other in others if not _differ(trait, own[trait], other[trait])]
        if own[trait] and len(alike) < len(others):
            chosen.add(trait)
            others = alike
    return chosen


def _differ(trait: str, one: str, other: str) -> bool:
    """Whether two traits tell two things apart; a silver one and one that is silver or grey may be alike."""
    if trait == "colour":
        return bool(one and other) and not {*one.split(" or ")} & {*other.split(" or ")}
    return one != other


def _in_words(
    item: SceneObject, ego: EgoVehicle, own: dict[str, str], telling: set[str], named: bool, digits: int
) -> str:
    colour = own["colour"] if named or "colour" in telling else ""
    head = f"the {colour} {item.noun}" if named or telling & {"colour", "noun"} else "the one"
    place = " ".join(own[trait] for trait in ("side", "behind", "lane") if trait in telling)
    where = "" if "behind" in telling else " ahead" if item.centre_m[0] - ego.centre_m > _BEHIND_M else " away"
    parts = [" ".join(f"{head} {place}".split()), *([own["motion"]] if "motion" in telling else [])]
    return ", ".join([*parts, f"{item.distance_m(ego):.{digits}f} m{where}"])

"""Clarification: describe how the remaining candidates differ, and ask which one is meant."""

from __future__ import annotations

from collections.abc import Sequence

from appocc.ego_vehicle import EgoVehicle
from grounding.referent.scene import SceneModel
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject

_MAX_NAMED = 4
_ASIDE_M, _BEHIND_M = 1.5, 2.5
# Most distinctive first; the distance always follows.
_TRAITS = ("colour", "class", "behind", "side", "motion", "lane")
# One object, or a pair.
CandidateGroup = tuple[SceneObject, ...]


def describe_differences(groups: Sequence[CandidateGroup], scene: SceneModel) -> tuple[str, ...]:
    """Describe each candidate by the traits that distinguish it from the others, and by its distance."""
    known = [_traits(group[0], scene) for group in groups]
    digits = 0 if len({round(group[0].distance_m(scene.ego)) for group in groups}) == len(groups) else 1
    described = []
    for number, group in enumerate(groups):
        distinctive = _distinctive_traits(known[number], [other for k, other in enumerate(known) if k != number])
        words = _describe(group[0], scene.ego, known[number], distinctive, full=number == 0, digits=digits)
        if len(group) > 1:
            partner = _describe(
                group[1], scene.ego, _traits(group[1], scene), {*_TRAITS[:2]}, full=True, digits=digits
            )
            words += f", and {partner}"
        described.append(words)
    return tuple(described)


def describe_one(item: SceneObject, scene: SceneModel) -> str:
    """Describe an object that is asked about on its own: "the green car on the right, 12 m behind us"."""
    own = _traits(item, scene)
    return _describe(item, scene.ego, own, {"side"} if not own["lane"] else set(), full=True, digits=0)


def compose_question(differences: Sequence[str]) -> str:
    """Compose the question that asks which of the described candidates is meant."""
    options = [*differences[:_MAX_NAMED], *(["another one"] if len(differences) > _MAX_NAMED else [])]
    separator = "; " if any(" and " in words for words in options) or len(options) > 2 else ", "
    return f"{separator.join(options[:-1])}{separator}or {options[-1]}?"


def _traits(item: SceneObject, scene: SceneModel) -> dict[str, str]:
    """Return the words for each trait of an object; '' for a trait that it does not have."""
    _, lateral_m = scene.lanes.project(item.centre_m[None])
    x, y = item.centre_m[0] - scene.ego.centre_m, item.centre_m[1]
    moves = "coming towards us" if item.faces_ego(scene.ego) else "moving"
    return {
        "colour": scene.colour_name(item) or "",
        "class": item.common_name,
        "behind": "behind us" if x < -_BEHIND_M else "",
        "side": "on the left" if y > _ASIDE_M else "on the right" if y < -_ASIDE_M else "straight on",
        "motion": {True: "standing", False: moves, None: ""}[item.is_standing],
        "lane": "in our lane" if abs(float(lateral_m[0])) < LANE_M / 2 else "",
    }


def _distinctive_traits(own: dict[str, str], others: list[dict[str, str]]) -> set[str]:
    """Return the first traits that no other candidate shares completely."""
    chosen: set[str] = set()
    for trait in _TRAITS:
        alike = [other for other in others if not _differ(trait, own[trait], other[trait])]
        if own[trait] and len(alike) < len(others):
            chosen.add(trait)
            others = alike
    return chosen


def _differ(trait: str, one: str, other: str) -> bool:
    """Return whether two values of a trait differ for certain.

    "silver" and "silver or grey" may be the same, and unknown motion may be that of the other.
    """
    if trait == "colour":
        return bool(one and other) and not {*one.split(" or ")} & {*other.split(" or ")}
    if trait == "motion":
        return bool(one and other) and one != other
    return one != other


def _describe(
    item: SceneObject, ego: EgoVehicle, own: dict[str, str], distinctive: set[str], *, full: bool, digits: int
) -> str:
    """Describe an object by its distinctive traits; `full`: with colour and class in any case."""
    colour = own["colour"] if full or "colour" in distinctive else ""
    head = f"the {item.coloured_name(colour)}" if full or distinctive & {"colour", "class"} else "the one"
    place = " ".join(own[trait] for trait in ("side", "behind", "lane") if trait in distinctive)
    where = "" if "behind" in distinctive else f" {_direction(item, ego, 'side' in distinctive)}"
    parts = [" ".join(f"{head} {place}".split()), *([own["motion"]] if "motion" in distinctive else [])]
    return ", ".join([*parts, f"{item.distance_m(ego):.{digits}f} m{where}"])


def _direction(item: SceneObject, ego: EgoVehicle, side_is_told: bool) -> str:
    """Return where an object is from the ego."""
    x, y = item.centre_m[0] - ego.centre_m, item.centre_m[1]
    if abs(x) <= _BEHIND_M:
        return "away" if side_is_told else "to the left" if y > 0 else "to the right"
    return "ahead" if x > 0 else "behind us"

"""Objects, steps, candidates and targets as English phrases and as JSON values."""

from __future__ import annotations

from typing import Any

from appocc.boxes import is_person_or_bicycle
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.motion_state import MOVING_MPS
from grounding.goal.planner import Target
from grounding.query import Query
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel
from grounding.scene_object import SceneObject
from grounding.vocabulary import verb_of

_AHEAD_M, _ASIDE_M = 3.0, 1.5


def with_article(noun: str) -> str:
    """Return a noun with "a" or "an", by its first letter."""
    return f"{'an' if noun[:1].lower() in ('a', 'e', 'i', 'o') else 'a'} {noun}"


def describe_side(item: SceneObject, ego: EgoVehicle) -> str:
    """Return where an object is as seen from the ego, in one or two words."""
    x, y = item.centre_m[0] - ego.centre_m, item.centre_m[1]
    along = "ahead" if x > _AHEAD_M else "behind" if x < -_AHEAD_M else ""
    across = "left" if y > _ASIDE_M else "right" if y < -_ASIDE_M else ""
    return " ".join(word for word in (along, across) if word) or "here"


def describe_motion(item: SceneObject) -> str:
    """Return "standing", "hardly moving", the speed, or "speed not known"."""
    if item.speed_mps is None:
        return "speed not known"
    if item.is_standing:
        return "standing"
    return "hardly moving" if item.speed_mps < MOVING_MPS else f"moving at {item.speed_mps:.0f} m/s"


def describe_object(item: SceneObject, scene: SceneModel) -> str:
    """Describe an object by colour, class, distance, side and motion, and whether it faces the ego."""
    colour = scene.colour_name(item)
    named = item.coloured_name(colour or "")
    if colour is None and not is_person_or_bicycle(item.category):
        named = f"{named} of unknown colour"
    where = f"{named} {item.distance_m(scene.ego):.0f} m away", describe_side(item, scene.ego)
    parts = [*where, describe_motion(item)]
    if item.faces_ego(scene.ego):
        parts.append("facing us")
    return ", ".join(parts)


def describe_candidate(candidate: Candidate, scene: SceneModel) -> str:
    """Describe the vehicle of a candidate, or both of a pair."""
    both = (candidate.item, candidate.partner)
    return ", and the ".join(describe_object(item, scene) for item in both if item is not None)


def describe_step(query: Query, referent: Candidate | None, scene: SceneModel) -> str:
    """Describe a step by action, relation, vehicle and side: "park behind the red car 12 m away, ahead right"."""
    relation = "" if query.relation == "none" else query.relation
    sides = {"kerb": "at the kerb", "opposite": "on the other side"}
    side = f"on the {query.goal_side}" if query.goal_side else sides.get(query.road_side or "", query.direction or "")
    named = "" if query.referent is None else f"the {query.referent.phrase()}"
    if referent is not None:
        named = f"the {describe_candidate(referent, scene)}"
    verb = verb_of(query.action, query.relation)
    words = (verb, "" if verb.endswith(relation) else relation, named, side)  # "drive past", not "drive past past"
    if query.action == "other" and not any(words[1:]):
        return "carry on"
    return " ".join(word.replace("_", " ") for word in words if word)


def candidate_to_dict(candidate: Candidate, scene: SceneModel) -> dict[str, Any]:
    """Return a candidate as JSON values."""
    item = candidate.item
    return {
        "id": item.id,
        "class": item.class_name,
        "category": item.category or None,
        "colour": scene.colour_name(item),
        "rgb": None if item.rgb is None else [round(float(v)) for v in item.rgb],
        "distance_m": round(item.distance_m(scene.ego), 2),
        "side": describe_side(item, scene.ego),
        "cell": None if scene.bev is None else scene.bev.grid.cell_of(item.centre_m).tolist(),
        "ego_m": round_to_mm(item.centre_m),
        "world_m": round_to_mm(scene.world_xy(item.centre_m)),
        "heading_rad": round(scene.world_heading(item.yaw_rad), 4),
        "heading_ego_rad": round(item.yaw_rad, 4),
        "front_known": item.front_known,
        "size_m": [round(item.length_m, 2), round(item.width_m, 2)],
        "speed_mps": None if item.speed_mps is None else round(item.speed_mps, 2),
        "partner": None if candidate.partner is None else candidate.partner.id,
        "score": round(candidate.score, 3),
        "fits": {word: round(value, 3) for word, value in candidate.fits.items()},
    }


def target_to_dict(target: Target) -> dict[str, Any]:
    """Return a target as JSON values: centre of the ego's footprint, heading in the world and ego frames."""
    return {
        "cell": list(target.cell),
        "ego_m": round_to_mm(target.ego_m),
        "world_m": round_to_mm(target.world_m),
        "heading_rad": round(target.heading_rad, 4),
        "heading_ego_rad": round(target.heading_ego_rad, 4),
        "score": round(target.score, 4),
    }


def round_to_mm(xy_m: FloatArray) -> list[float]:
    """Round coordinates to millimetres."""
    return [round(float(v), 3) for v in xy_m]

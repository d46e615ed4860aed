"""Vehicles and places in words for people and in keys for machines."""

from __future__ import annotations

from typing import Any

import numpy as np

from appocc.ego_vehicle import EgoVehicle
from appocc.motion_state import STANDING_MPS
from grounding.goal.planner import Target
from grounding.referent.resolver import Candidate
from grounding.referent.scene import Scene
from grounding.scene_object import SceneObject


def side(item: SceneObject, ego: EgoVehicle) -> str:
    """Where a vehicle is seen from the ego, in one or two words."""
    x, y = item.centre_m[0] - ego.centre_m, item.centre_m[1]
    along = "ahead" if x > 3 else "behind" if x < -3 else ""
    across = "left" if y > 1.5 else "right" if y < -1.5 else ""
    return " ".join(word for word in (along, across) if word) or "here"


def phrase(item: SceneObject, scene: Scene) -> str:
    """A vehicle in words: colour, class, distance, side, and whether it moves or faces us."""
    colour = scene.colour_name(item)
    named = f"{colour} {item.noun}" if colour else f"{item.noun} of unknown colour"
    parts = [f"{named} {item.distance_m(scene.ego):.0f} m away", side(item, scene.ego)]
    if item.speed_mps is not None:
        parts.append("standing" if item.speed_mps < STANDING_MPS else f"moving at {item.speed_mps:.0f} m/s")
    if item.front_known and abs(item.yaw_rad) > np.radians(120):
        parts.append("facing us")
    return ", ".join(parts)


def candidate_dict(candidate: Candidate, scene: Scene) -> dict[str, Any]:
    """A candidate with what tells it apart."""
    item = candidate.item
    return {
        "id": item.id,
        "class": item.noun,
        "category": item.category or None,
        "colour": scene.colour_name(item),
        "rgb": None if item.rgb is None else [round(float(v)) for v in item.rgb],
        "distance_m": round(item.distance_m(scene.ego), 2),
        "side": side(item, scene.ego),
        "cell": None if scene.bev is None else scene.bev.grid.cell_of(item.centre_m).tolist(),
        "ego_m": rounded(item.centre_m),
        "world_m": rounded(scene.world_xy(item.centre_m)),
        "heading_rad": round(scene.world_heading(item.yaw_rad), 4),
        "heading_ego_rad": round(item.yaw_rad, 4),
        "front_known": item.front_known,
        "size_m": [round(item.length_m, 2), round(item.width_m, 2)],
        "speed_mps": None if item.speed_mps is None else round(item.speed_mps, 2),
        "partner": None if candidate.partner is None else candidate.partner.id,
        "score": round(candidate.score, 3),
        "fits": {word: round(value, 3) for word, value in candidate.fits.items()},
    }


def target_dict(target: Target) -> dict[str, Any]:
    """A target: the middle of the ego's footprint; `heading_rad` in the world, `heading_ego_rad` relative to ours."""
    return {
        "cell": list(target.cell),
        "ego_m": rounded(target.ego_m),
        "world_m": rounded(target.world_m),
        "heading_rad": round(target.heading_rad, 4),
        "heading_ego_rad": round(target.heading_ego_rad, 4),
        "score": round(target.score, 4),
    }


def rounded(xy_m: np.ndarray[Any, np.dtype[np.float64]]) -> list[float]:
    """Millimetres are enough."""
    return [round(float(v), 3) for v in xy_m]

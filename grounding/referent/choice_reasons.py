"""Reasons for the vehicle that is chosen among those that fit a description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from grounding.query import Referent
from grounding.referent.ordinals import find_ordinals
from grounding.referent.priors import includes_behind, is_behind
from grounding.referent.scene import SceneModel
from grounding.referent.scoring import ReferentScores
from grounding.scene_object import SceneObject
from grounding.vocabulary import PERSON_NOUNS

# Below this an object fits a word doubtfully.
DOUBTFUL_FIT = 0.35


def explain_too_few(referent: Referent, num_matches: int) -> str:
    """Explain that fewer vehicles fit than the position of the one sought."""
    words = find_ordinals(referent.qualifiers)
    return f"no vehicle is the '{' '.join(words)}' one: {num_matches} fit the rest of '{referent.phrase()}'"


def explain_nearer(referent: Referent, chosen: int, scores: ReferentScores, scene: SceneModel) -> list[str]:
    """Explain why the nearest one is not one that is nearer, behind us or in doubt; nothing if there is none."""
    if "nearest" not in referent.qualifiers:
        return []
    distance_m = scene.table.distance_m
    nearer = scores.matches & (distance_m < distance_m[chosen])
    behind = nearer & is_behind(scene.table) & (not includes_behind(referent))
    whys = (
        (nearer & ~behind, "fits the other words less well"),
        (behind, "behind us: that is meant only if the command says so"),
    )
    return [f"one {distance_m[which].min():.0f} m away is nearer, but {why}" for which, why in whys if which.any()]


def explain_choice(
    referent: Referent, num_matches: int, item: SceneObject, fits: Mapping[str, float], scene: SceneModel
) -> list[str]:
    """Explain why the best candidate was chosen, and whether its colour is doubtful."""
    one, several = ("person", "people") if referent.noun in PERSON_NOUNS else ("vehicle", "vehicles")
    reasons = [f"it fits '{referent.phrase()}' best of {num_matches} {several}"]
    if ordinals := find_ordinals(referent.qualifiers):
        rest = replace(referent, qualifiers=tuple(word for word in referent.qualifiers if word not in ordinals))
        reasons = [f"it is the {' '.join(ordinals)} of {num_matches} {several} that fit '{rest.phrase()}'"]
    if num_matches == 1:
        reasons = [f"it is the only {one} that fits '{referent.phrase()}'"]
    elif not referent.definite:
        reasons = [f"any of {num_matches} {several} would do: the one that fits best and lies near was taken"]
    if referent.colour and item.rgb is None:
        reasons.append(f"its colour is not known: '{referent.colour}' could not be checked")
    elif referent.colour and fits[referent.colour] < DOUBTFUL_FIT:
        reasons.append(f"its colour looks {scene.colour_name(item)} rather than {referent.colour}")
    return reasons

"""Self-repairs: "no, the blue one", "sorry, in front of it", "I mean right"."""

from __future__ import annotations

from grounding.language.semantics.discourse.command_frames import CommandFrame
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.mentions import add_mention, attach_distance
from grounding.language.syntax.noun_phrases import NounPhrase

_TARGET_KINDS = ("vehicle", "person", "one", "traffic", "adjective")


def replace_target(state: DiscourseState, phrase: NounPhrase) -> bool:
    """Replace the target of the last frame by a noun phrase; return whether it was replaced."""
    frame = state.previous_frame
    if frame is None:
        return False
    relation, before = state.open_relation, frame.target
    if relation is not None and phrase.kind == "pronoun" and before is not None:
        frame.relation, state.open_relation = relation, None  # "in front of it"
        return True
    if phrase.kind not in _TARGET_KINDS or (before is None and relation is None):
        return False
    if relation is not None or before is None:
        frame.relation = relation or frame.relation
    if phrase.kind == "adjective":
        phrase.kind = "one"
    if before is not None:
        _discard(state, before, phrase)
    frame.target, frame.inverse_relation = phrase, None
    add_mention(state, phrase, "target")
    attach_distance(state, "gap")
    return True


def _discard(state: DiscourseState, before: NounPhrase, phrase: NounPhrase) -> None:
    """Discard a repaired target; exclude it as the referent if the new one may have the same noun."""
    mentions = state.discourse.mentions
    mentions[:] = [(other, "excluded" if other is before else role) for other, role in mentions]
    if before.noun and phrase.noun in ("", before.noun) and (before.colour or before.qualifiers):
        state.discourse.excluded.append((None, before))
    elif before.kind in ("one", "adjective") and not before.noun:
        before.kind = "adjective"


def replace_frame(state: DiscourseState, frame: CommandFrame) -> None:
    """Remove the last frame, which a new one repairs: "no, follow the bus"."""
    before = state.previous_frame
    if before is not None and before in state.discourse.frames and not frame.negated:
        state.discourse.frames.remove(before)


def replace_direction(state: DiscourseState, direction: str) -> bool:
    """Replace the direction of the last frame ("I mean right"); return whether it had one or needs one."""
    frame = state.previous_frame
    if frame is None or (frame.direction is None and frame.verb_class != "turn"):
        return False
    frame.direction = direction
    return True


def replace_side(state: DiscourseState, side: str) -> bool:
    """Replace the last side, of the target or of the road; return whether there was one."""
    frame = state.previous_frame
    if frame is None:
        return False
    qualifiers = frame.target.qualifiers if frame.target is not None else []
    for i, qualifier in enumerate(qualifiers):
        if qualifier in ("left_side", "right_side"):
            qualifiers[i] = side
            return True
    if frame.side is None:
        return False
    frame.side = side.removesuffix("_side")
    return True

"""Basic updates of the discourse state: mention, exclude or refine a noun phrase, attach a distance."""

from __future__ import annotations

from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.syntax.noun_phrases import NounPhrase


def add_mention(state: DiscourseState, phrase: NounPhrase, role: str) -> None:
    """Add a noun phrase to the discourse and open it for qualifiers."""
    state.discourse.mentions.append((phrase, role))
    if phrase.kind != "part" or state.open_phrase is None:  # "the van with the open door on the left"
        state.open_phrase = phrase
    state.last_relation, state.open_relation = state.open_relation, None


def exclude(state: DiscourseState, relation: str | None, phrase: NounPhrase, role: str = "excluded") -> None:
    """Exclude a noun phrase, as the referent or in a relation to the goal."""
    phrase.distance_m, state.open_distance_m = state.open_distance_m, None  # "not within 10 m of the crossing"
    state.discourse.excluded.append((relation, phrase))
    add_mention(state, phrase, role)
    state.negated = False


def refine(state: DiscourseState, host: NounPhrase, phrase: NounPhrase) -> None:
    """Add colour, qualifiers and attributes of one noun phrase to another: "..., the yellow one"."""
    host.colour = host.colour or phrase.colour
    for value in phrase.qualifiers:
        host.add_qualifier(value)
    host.extra += phrase.extra
    state.open_phrase = host


def attach_distance(state: DiscourseState, kind: str) -> None:
    """Attach the open distance, if there is one, to its frame; for `kind` see `CommandFrame.distances`."""
    if state.open_distance_m is not None:
        state.host_frame.distances.append((state.open_distance_m, kind))
    state.open_distance_m = None

"""Attachment of noun phrases that follow a relation: target of the frame, landmark, or modifier of a noun."""

from __future__ import annotations

from grounding.language.semantics.discourse.command_frames import CommandFrame
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.mentions import add_mention, attach_distance, exclude
from grounding.language.syntax.noun_phrases import PLACE_KINDS, NounPhrase

# Edges of the road, relations of a place along them, and verbs that end there.
_KERBS = ("kerb", "curb", "roadside", "kerbside", "curbside")
_AT_KERB, _STANDING = ("toward", "near", "next_to", "at"), ("park", "stop", "pull_over")
# Kinds of noun phrases that a frame may be about.
TARGET_KINDS = ("vehicle", "traffic", "pronoun", "one", "person")
GROUPS = ("row", "line", "queue", "group", "string", "bunch", "series", "pair", "set", "cluster", "first", "rest")
_OBJECT_VERBS = ("avoid", "approach", "overtake", "follow", "wait", "stop")
# Relations of a sign or a person to the vehicle that is named after it.
_INVERTIBLE = ("near", "next_to", "behind", "in_front_of", "opposite", "toward")


def attach_related(state: DiscourseState, relation: str, phrase: NounPhrase) -> None:
    """Attach a noun phrase after a relation."""
    state.open_relation = None
    noun, frame = state.open_phrase, state.host_frame
    lane = noun is not None and noun.noun == "lane"
    whole = noun if relation == "of" or (relation == "with" and lane) else None
    if phrase.kind == "vehicle" and frame.target is None and _in_clause_of_place(state):
        state.in_relative_clause = False
        attach_target(state, relation, phrase)  # "in the spot that is behind the van"
    elif whole is not None and phrase.head in GROUPS and _is_last_landmark(frame, whole):
        if whole.head == "end":
            phrase.add_qualifier("last")
        frame.landmarks.append((frame.landmarks.pop()[0], phrase))  # "at the end of the row of vans"
        add_mention(state, phrase, "landmark")
    elif whole is not None and whole.kind == "one" and phrase.noun:
        phrase.merge_into(whole)  # "the first of the three cars"
    elif _in_statement(state):
        if noun is not None and not state.event_stated:
            noun.related.append((relation, phrase))
        add_mention(state, phrase, "landmark")
    elif whole is not None and whole.head in GROUPS and phrase.kind == "vehicle" and _is_target_group(frame, whole):
        phrase.qualifiers += [one for one in whole.qualifiers if one not in phrase.qualifiers]
        attach_target(state, frame.landmarks.pop()[0], phrase)  # "past the row of parked cars"
    elif whole is not None and whole.kind in PLACE_KINDS and phrase.kind == "vehicle":
        if whole.noun != "side":  # "the spot of the van"
            attach_target(state, "same_as" if whole.noun == "lane" else "at", phrase)
    elif whole is not None and whole.kind == "part" and phrase.kind == "vehicle" and _is_last_landmark(frame, whole):
        attach_target(state, frame.landmarks.pop()[0], phrase)  # "level with the doors of the van"
    elif relation == "with" and phrase.kind == "vehicle" and _follows_landmark(state):
        attach_target(state, relation, phrase)  # "in front of the house with the van"
    elif phrase.kind in TARGET_KINDS and relation not in ("of", "with"):
        attach_target(state, relation, phrase)
    else:
        _attach_landmark(state, relation, phrase)
    state.last_relation = relation


def _in_clause_of_place(state: DiscourseState) -> bool:
    """Return whether a relative clause about a place of this frame is open."""
    noun = state.open_phrase
    return state.in_relative_clause and noun is not None and noun.kind in PLACE_KINDS and state.frame is not None


def _in_statement(state: DiscourseState) -> bool:
    """Return whether the relation belongs to a statement, not to a command."""
    statement = state.frame is None and bool(state.subject or state.off_topic or state.existential)
    return statement or state.in_relative_clause or state.event_stated


def _is_last_landmark(frame: CommandFrame, phrase: NounPhrase) -> bool:
    return bool(frame.landmarks) and frame.landmarks[-1][1] is phrase


def _is_target_group(frame: CommandFrame, group: NounPhrase) -> bool:
    """Return whether a group stands for the vehicles in it: "past the row of parked cars"."""
    return _is_last_landmark(frame, group) and frame.landmarks[-1][0] not in ("of", "in", "into", "on", "along")


def _follows_landmark(state: DiscourseState) -> bool:
    """Return whether the frame has no target and its last landmark, a thing or a person, was just named."""
    frame = state.host_frame
    if not frame.landmarks or frame.target is not None:
        return False
    thing = frame.landmarks[-1][1]
    # A sidewalk runs along the whole road.
    return thing is state.open_phrase and thing.kind in ("thing", "person") and thing.noun != "sidewalk"


def attach_target(state: DiscourseState, relation: str, phrase: NounPhrase) -> None:
    """Attach a vehicle or person in a relation: the frame's target, or a modifier of it."""
    frame = state.host_frame
    if frame.negated and relation == "into":  # "don't drive into the truck"
        frame.verb_class, frame.negated = "avoid", False
    if frame.negated and frame.goes_around:
        add_mention(state, phrase, "excluded")  # "don't go around it" excludes no place
    elif frame.negated:
        exclude(state, relation, phrase)
    elif frame.target is None:
        last = frame.landmarks[-1][0] if frame.landmarks else ""
        invertible = last in _INVERTIBLE or (last == "object" and frame.verb_class in _OBJECT_VERBS)
        inverse = (invertible or relation == "with") and _follows_landmark(state)
        frame.inverse_relation = relation if inverse else None  # "by the sign in front of the bus"
        frame.relation = last if inverse else relation
        frame.target = phrase
        add_mention(state, phrase, "target")
        attach_distance(state, "gap")
    elif frame.target.kind == "person" and phrase.kind != "person" and not frame.target_is_object:
        frame.landmarks.append((frame.relation, frame.target))  # "next to the man beside the car"
        frame.target, frame.inverse_relation = phrase, relation
        add_mention(state, phrase, "target")
    else:
        noun = state.open_phrase
        host = noun if noun is not None and noun.kind == "vehicle" else frame.target
        if relation in (*_INVERTIBLE, "before", "past") and phrase.kind != "pronoun":
            _name_alike(state, host, phrase)
        host.related.append((relation, phrase))
        add_mention(state, phrase, "landmark")
        attach_distance(state, "gap" if phrase.kind == "pronoun" else "descriptor")  # "two metres from it"


def _name_alike(state: DiscourseState, host: NounPhrase, phrase: NounPhrase) -> None:
    """Give "one" the noun of the vehicle beside it: "the blue car after the yellow one", "the one behind the van"."""
    if phrase.kind == "one" and host.kind == "vehicle":
        phrase.take_noun(host)
    elif host.kind == "one" and all(one.kind != "vehicle" for one, _ in state.discourse.mentions):
        host.kind = host.noun = "vehicle"


def attach_kerb(state: DiscourseState, relation: str, phrase: NounPhrase) -> bool:
    """Put the goal at our kerb, at the open distance: "1 m from the kerb"; return whether the phrase is the kerb."""
    frame = state.host_frame
    reached = relation == "toward" and frame.verb_class == "stop" and state.open_distance_m is None
    if phrase.head not in _KERBS or reached:  # "pull up to the kerb" names a place, "nose in to the kerb" a manner
        return False
    attach_distance(state, "kerb")
    if frame.target is None and frame.verb_class in _STANDING:
        frame.side = frame.side or "kerb"
    add_mention(state, phrase, "landmark")
    return True


def _attach_landmark(state: DiscourseState, relation: str, phrase: NounPhrase) -> None:
    """Attach a thing in a relation to the goal, or to the vehicle just named."""
    frame, noun = state.host_frame, state.open_phrase
    if frame.negated:
        exclude(state, relation, phrase)
        return
    if relation in _AT_KERB and attach_kerb(state, relation, phrase):
        return
    if frame.target is not None and noun is not None and noun.kind in ("vehicle", "person"):
        noun.related.append((relation, phrase))
    else:
        frame.landmarks.append((relation, phrase))
    add_mention(state, phrase, "landmark")
    attach_distance(state, "gap")

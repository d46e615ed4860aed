"""Rules for spatial words: relations, sides, places relative to the ego, lanes and distances."""

from __future__ import annotations

from grounding.language.semantics.discourse.command_frames import ENTERABLE, CommandFrame
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.mentions import attach_distance
from grounding.language.semantics.discourse.relation_attachment import attach_target
from grounding.language.semantics.discourse.repairs import replace_side
from grounding.language.semantics.discourse.verb_rules import AWAITING
from grounding.language.syntax.noun_phrases import VEHICLE_KINDS, NounPhrase
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory

# Of two consecutive relations the later counts ("over by", "up to behind"), unless it is weak.
_WEAK = ("at", "toward", "in", "into", "along", "on", "with", "of")
# States of a vehicle that moves away from "in front of us".
_DEPARTING = ("leaving", "turning", "turning_left", "turning_right", "passing")
_STANDING = ("park", "stop", "pull_over")
_MOVING = ("go", "drive", "move", "get")
_STEERING = ("turn", "change_lane", "go", "drive", "move", "overtake")
# Ends of phrases for the next vehicle in our lane ("in front of us"); "up ahead" may be any vehicle.
_IN_LINE = (
    "of us",
    "of me",
    "of our car",
    "of my car",
    "behind us",
    "behind me",
    "front",
    "our tail",
    "my tail",
    "before us",
)
# Beginnings of such phrases: "straight ahead".
_STRAIGHT = ("straight ", "dead ", "directly ")
# Sides that are named by their traffic, as sides of a goal.
_SIDES_BY_TRAFFIC = {"opposite": "opposite", "own": "kerb"}
# Places of vehicles that say nothing of a goal: "stop next to us".
_OF_VEHICLES = ("beside_ego", "at_end", "in_row")
# Things across our lane.
_ACROSS = ("crosswalk", "stop_line")
# Kinds of words between a distance and its reference.
_BEFORE_REFERENCE = ("relation", "between", "away", "where")
# A distance below it after a place at a vehicle is the gap, and not how far away the vehicle is.
_NEAR_M = 10.0


def handle_relation(state: DiscourseState, token: Token) -> None:
    """Open a relation ("behind", "next to") until its noun phrase follows."""
    following = state.remaining[0] if state.remaining else None
    if token.text == "by" and isinstance(following, Token) and following.form == "ing":
        state.open_phrase = None  # "by moving over"
        return
    frame = state.frame
    if frame is not None:
        frame.moves_away = frame.moves_away or token.text.startswith(("away", "from"))
        frame.goes_around = frame.goes_around or (token.text in ("around", "round") and frame.target is None)
    if state.open_relation is None or state.open_relation in _WEAK or token.value not in _WEAK:
        turns = token.text == "from" and frame is not None and frame.direction is not None
        state.open_relation = "at" if turns else token.value  # "turn right from the lights"
    if not isinstance(following, NounPhrase):
        _handle_without_noun(state, token)
    elif frame is not None and token.state == "touching" and _is_touched(state, frame, following):
        frame.manoeuvre = "push"  # "drive into the van", "park on top of it"


def _is_touched(state: DiscourseState, frame: CommandFrame, phrase: NounPhrase) -> bool:
    """Return whether a command asks for a place that another vehicle or a person takes up."""
    told = state.event_stated or state.in_relative_clause or state.negated or frame.negated
    solid = phrase.kind == "person" or (phrase.kind == "vehicle" and phrase.number == 1)
    moves = frame.verb_class not in ("avoid", "follow", *AWAITING)
    owns = len(state.remaining) > 1 and isinstance(state.remaining[1], NounPhrase)  # "into the van's space"
    return solid and moves and not told and not owns


def _handle_without_noun(state: DiscourseState, token: Token) -> None:
    """Apply a relation that no noun phrase follows."""
    frame = state.frame
    if state.negated and state.next_kind == "" and _exclude_place(state, token.value):
        return
    if token.value in ("left_of", "right_of") and state.host_frame.target is not None:
        state.host_frame.relation = token.value  # "on its left"
        if state.host_frame.verb_class == "overtake":
            state.host_frame.direction = token.value.removesuffix("_of")
    if state.next_kind in ("relation", "distance", "between", "except"):
        return
    if frame is not None and frame.verb_class in AWAITING and frame.target is not None and frame.event is None:
        if token.value in ("in", "into", "near", "on", "past") or token.text == "through":
            frame.event = "merge" if token.value == "in" else "pass"  # "let it in", "let it by"
    elif token.value == "past" and frame is not None and frame.relation == "none":
        frame.relation = "past"
    elliptic = token.value in ("behind", "next_to", "opposite") and token.text != "next"
    elliptic = elliptic or (token.text in ("around", "round") and state.next_kind == "")
    no_target = frame is not None and frame.target is None
    if elliptic and no_target and state.open_relation and _has_vehicle(state):
        # "That is his bus, pull alongside".
        attach_target(state, token.value, NounPhrase(kind="pronoun", head="it", start=token.start))
    if state.next_kind != "lane":
        state.open_relation = None


def _exclude_place(state: DiscourseState, relation: str) -> bool:
    """Exclude a relation to the target ("behind the van, not in front"); return whether there is a target."""
    target = state.host_frame.target
    if target is None:
        return False
    state.discourse.excluded.append((relation, target))
    state.negated, state.open_relation = False, None
    return True


def _has_vehicle(state: DiscourseState) -> bool:
    return any(phrase.kind == "vehicle" for phrase, _ in state.discourse.mentions)


def handle_between(state: DiscourseState, token: Token) -> None:
    """Open "between": its first noun phrase is the target, the second a landmark."""
    if state.next_kind == "ego" and state.open_distance_m is not None:
        attach_distance(state, "gap")  # "leave 2 metres between us and the van"
    state.open_relation = "between"


def handle_of(state: DiscourseState, token: Token) -> None:
    """Open "of" if a noun phrase precedes it."""
    state.open_relation = state.open_relation if state.open_phrase is None else "of"


def handle_side(state: DiscourseState, token: Token) -> None:
    """Add a side ("on the left") to the last vehicle, to the goal, or as a steering direction."""
    noun = state.open_phrase
    frame = state.frame
    passes = frame is not None and (frame.verb_class == "overtake" or frame.goes_around or frame.relation == "past")
    if noun is not None and noun.kind == "pronoun" and passes:
        state.open_phrase = None  # "pass it on the left"
    related = frame is not None and any(one.kind == "pronoun" for _, end in frame.landmarks for _, one in end.related)
    if noun is not None and noun.kind == "pronoun" and related:
        state.open_phrase = noun = state.host_frame.target  # "between the van and the car behind it on the right"
    value = token.value.removesuffix("_side").removeprefix("from_")
    at = state.clause.tokens.index(token)
    possessive = at > 0 and state.clause.tokens[at - 1].form == "own"
    if possessive and state.host_frame.target is noun and value not in _SIDES_BY_TRAFFIC:
        state.host_frame.relation = f"{value}_of"  # "to the white car's left side"
        return
    if noun is not None and noun.noun == "lane":
        return  # "the third lane from the right": the map counts no lanes, and so the side is told as left out
    if noun is not None and noun.noun in ENTERABLE and value not in _SIDES_BY_TRAFFIC:
        if frame is None:
            noun.add_qualifier(token.value)  # "the next road on the left, turn in there"
            return
        frame.direction = frame.direction or value  # "the turning on the left"
        return
    if state.is_repair and state.frame is None and noun is None and replace_side(state, token.value):
        return
    stands = frame is not None and frame.verb_class in _STANDING and frame.target is None and not state.negated
    if stands and noun is not None and noun.kind == "thing" and value not in _SIDES_BY_TRAFFIC:
        state.open_phrase = None  # "past the crossing on the left"
    if value == "opposite" and noun is not None and noun.noun in _ACROSS:
        noun.add_qualifier(token.value)  # "the crossing on the far side" of a junction
        return
    if value == "own" and state.host_frame.relation == "opposite" and not state.negated:
        state.host_frame.side = state.host_frame.side or "kerb"  # "opposite the van, on our side"
        return
    if _qualify_open_phrase(state, token):
        return
    if value in _SIDES_BY_TRAFFIC:
        verbs = (*_STANDING, "take", *((*_MOVING, "other") if value == "opposite" else ()))
        if state.frame is not None and state.frame.verb_class in verbs and not state.negated:
            state.frame.side = state.frame.side or _SIDES_BY_TRAFFIC[value]
        return
    if state.negated:
        value = "right" if value == "left" else "left"  # "pull over, but not on the left"
        state.negated = False
    if state.frame is None and state.other_subject is not None:
        return
    frame = state.frame or (state.leading_frame if state.clause.starts_sentence else state.host_frame)
    if frame.verb_class in _STEERING:
        frame.direction = frame.direction or value
    else:
        frame.side = value


def handle_here(state: DiscourseState, token: Token) -> None:
    """Put the goal at our kerb: "stop by the kerb"; other words for here add nothing."""
    noun, frame = state.open_phrase, state.frame
    at_kerb = token.value == "kerb" and (noun is None or noun.kind not in VEHICLE_KINDS)
    if at_kerb and frame is not None and frame.verb_class in _STANDING and not state.negated:
        frame.side = frame.side or "kerb"


def handle_ego_place(state: DiscourseState, token: Token) -> None:
    """Add a place relative to the ego ("ahead", "behind us") to the last vehicle or to the goal."""
    if state.negated and "front" in token.text and _exclude_place(state, "in_front_of"):
        return
    front = token.text == "in front" and state.frame is not None and state.frame.target is None
    if front and _has_vehicle(state) and state.frame is not None and state.frame.verb_class in _STANDING:
        # "The second van on the right: park in front".
        attach_target(state, "in_front_of", NounPhrase(kind="pronoun", head="it", start=token.start))
        return
    if token.value == "at_end" and state.next_kind == "of":
        state.remaining.pop(0)
        state.open_relation = "at"  # "at the end of the line of parked cars"
        return
    if _qualify_open_phrase(state, token) or token.value in _OF_VEHICLES:
        return
    attach_distance(state, "travel_or_gap")
    if token.value not in state.host_frame.goal_qualifiers:
        state.host_frame.goal_qualifiers.append(token.value)


def _qualify_open_phrase(state: DiscourseState, token: Token) -> bool:
    """Add a place to the open noun phrase if it is a vehicle or a person; return whether the place is used up."""
    noun = state.open_phrase
    departing = noun is not None and any(word in _DEPARTING for word in noun.postmodifiers[-1:])
    if state.event_stated or (departing and token.category is WordCategory.WHERE):
        return True
    if noun is not None and noun.kind == "thing" and token.value == "ahead":
        noun.add_qualifier(token.value)
    if noun is None or noun.kind in ("thing", "region", "spot", "part"):
        return noun is not None and noun.kind == "thing"
    attach_distance(state, "descriptor")
    if state.negated:
        noun.excluded.append((None, (token.value,)))  # "the truck which isn't on the right"
        state.negated = False
        return True
    if state.negated_predicate and noun.excluded:
        colour, qualifiers = noun.excluded[-1]
        noun.excluded[-1] = colour, (*qualifiers, token.value)
        return True
    for value in filter(None, (token.state, token.value)):  # "driving ahead of us"
        noun.add_qualifier(value)
    noun.in_line = noun.in_line or token.text.endswith(_IN_LINE) or token.text.startswith(_STRAIGHT)
    return True


def handle_lane(state: DiscourseState, token: Token) -> None:
    """Add a lane to the last vehicle or to the goal."""
    lane = NounPhrase(kind="region", noun="lane", head="lane")
    if state.next_kind == "of" and token.value in ("left_lane", "right_lane"):
        state.remaining.pop(0)  # "the lane to the left of the bus"
        state.open_relation = token.value.replace("lane", "of")
        state.host_frame.landmarks.append(("in", lane))
    elif state.frame is None and state.other_subject is None and state.next_kind in ("be", "aux"):
        state.subject = state.open_phrase = lane  # "the left lane is closed"
    else:
        # Of a vehicle, one lane to the right is the right lane.
        if not _qualify_open_phrase(state, token.with_category(WordCategory.LANE, token.value.removeprefix("next_"))):
            state.host_frame.lane = token.value
        state.open_relation = None


def handle_distance(state: DiscourseState, token: Token) -> None:
    """Open a distance: a gap before a relation, a travel distance alone, a descriptor after a noun."""
    frame = state.host_frame
    follows = frame.verb_class == "follow" or (frame.verb_class == "stay" and frame.relation == "behind")
    if token.form != "counted" and follows:
        return  # "at a safe distance": a follower keeps one
    state.open_distance_m = float(token.value)
    continues = state.next_kind in _BEFORE_REFERENCE
    noun_follows = bool(state.remaining) and isinstance(state.remaining[0], NounPhrase)
    if state.next_kind == "here" or (state.frame is None and state.subject is not None):
        attach_distance(state, "descriptor")  # "the van 20 metres up the road"
    elif state.open_relation and not noun_follows:
        relation, state.open_relation = state.open_relation, None
        if relation == "of" or (relation == "at" and state.open_phrase is not None):
            attach_distance(state, "gap")  # "at a distance of 5 metres"
        elif relation == "near" and state.next_kind in ("of", "relation"):
            state.open_relation = relation  # "within 5 metres of the van"
            state.remaining.pop(0)
        elif not continues:
            attach_distance(state, "travel")  # "in 20 metres"
    elif not continues and (state.open_phrase is not None or _ends_place(state)):
        attach_distance(state, "gap")


def _ends_place(state: DiscourseState) -> bool:
    """Return whether a distance ends a command with a place at a vehicle: "behind the van, not too close"."""
    frame = state.host_frame
    placed = frame.target is not None and frame.relation != "none" and frame.verb_class in _STANDING
    return placed and state.next_kind == ""


def handle_away(state: DiscourseState, token: Token) -> None:
    """Attach a distance to the noun phrase before it, a short one after a place to that: "behind it, 3 m away"."""
    short = state.open_distance_m is not None and state.open_distance_m < _NEAR_M
    if short and _ends_place(state):
        attach_distance(state, "gap")
    elif state.open_phrase is not None:
        attach_distance(state, "descriptor")

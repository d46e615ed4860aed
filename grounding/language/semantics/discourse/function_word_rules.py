"""Rules for function words: negations, relative pronouns, auxiliaries, existentials, questions and particles."""

from __future__ import annotations

from grounding.language.semantics.discourse.command_frames import ENTERABLE
from grounding.language.semantics.discourse.coreference import resolve_anaphor
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.relation_attachment import attach_target
from grounding.language.semantics.discourse.verb_rules import AWAITING, await_event
from grounding.language.syntax.clauses import TEMPORAL
from grounding.language.syntax.noun_phrases import NounPhrase
from grounding.language.syntax.tokenizer import Token

_ENTERING = ("turn", "go", "drive")
_POSSESSIVE = ("its", "his", "her", "their", "in its", "in his", "in her", "in their", "into its", "to its", "at its")


def handle_negation(state: DiscourseState, token: Token) -> None:
    """Open a negation; the words after "without" are off topic."""
    state.negated = token.text != "without"
    if state.existential or not state.negated:
        state.off_topic = state.event_stated = True  # "there is no room to pass"


def handle_exception(state: DiscourseState, token: Token) -> None:
    """Open an exclusion: "except", "instead of"."""
    state.negated = True
    state.open_phrase = state.open_phrase or NounPhrase(kind="")


def handle_relative_pronoun(state: DiscourseState, token: Token) -> None:
    """Open a relative clause about the noun phrase before it."""
    if state.open_phrase is None and not state.clause.starts_sentence and state.discourse.mentions:
        state.open_phrase = state.discourse.mentions[-1][0]  # "the white car, which is parked"
    if state.open_phrase is not None:
        state.in_relative_clause = True
        words = token.text.split()
        state.auxiliary = words[-1] if len(words) > 1 else token.text if "'s" in token.text else ""
        state.subject = state.open_phrase
        if token.value == "ego":  # "the van we passed"
            state.subject, state.event_stated = "ego", True


def handle_auxiliary(state: DiscourseState, token: Token) -> None:
    """Keep the auxiliary: the next verb belongs to the subject."""
    state.auxiliary = token.text


def handle_existential(state: DiscourseState, token: Token) -> None:
    """Start an existential statement; places before it qualify its subject: "on the left there is a van"."""
    state.subject, state.frame, state.existential = None, None, True
    leading = state.leading_frame
    state.fronted_qualifiers = [*([f"{leading.side}_side"] if leading.side else []), *leading.goal_qualifiers]
    leading.side, leading.goal_qualifiers = None, []


def handle_question(state: DiscourseState, token: Token) -> None:
    """Mark the rest of a question as off topic."""
    state.off_topic = True


def handle_there(state: DiscourseState, token: Token) -> None:
    """Refer to an earlier place: "there", "in its spot"."""
    if token.text.startswith(("where", "is", "that")):  # "that is where I want to stop"
        state.clear()
    if token.text.startswith(_POSSESSIVE):
        attach_target(state, "at", NounPhrase(kind="pronoun", head=token.text, start=token.start))
        state.host_frame.landmarks.append(("in", NounPhrase(kind="spot", noun="parking_spot")))
    elif state.open_phrase is None and not _enter_named_road(state):
        state.host_frame.refers_to_place = True


def _enter_named_road(state: DiscourseState) -> bool:
    """Turn into the road named before ("the next one on the left, turn in there"); return whether there is one."""
    frame = state.frame
    if frame is None or frame.verb_class not in _ENTERING or frame.direction is not None:
        return False
    for phrase, role in reversed(state.discourse.mentions):
        road = resolve_anaphor(state.discourse, phrase)
        side = next((word for word in phrase.qualifiers if word in ("left_side", "right_side")), None)
        if role == "stated" and side is not None and road is not None and road.noun in ENTERABLE:
            frame.direction = side.removesuffix("_side")
            frame.landmarks.append(("into", road))
            return True
    return False


def handle_infinitive(state: DiscourseState, token: Token) -> None:
    """Open an infinitive: "to" before a verb."""
    state.infinitive = True


def handle_particle(state: DiscourseState, token: Token) -> None:
    """Set the event of a frame that waits for its target: "let it out", "let it go first", "until it is out"."""
    frame, subject = state.frame, state.other_subject
    if subject is not None and state.auxiliary and state.clause.connective in TEMPORAL and not state.event_stated:
        await_event(state, subject, "clear")
        return
    if frame is not None and frame.verb_class in AWAITING and frame.target is not None and frame.event is None:
        frame.event = "leave" if token.text == "out" else "pass"


def handle_unknown(state: DiscourseState, token: Token) -> None:
    """Close a negation that applies to an unknown word."""
    state.negated = False

"""Rules for verbs: a command, a statement about another vehicle, or an event that the command waits for."""

from __future__ import annotations

from grounding.language.semantics.discourse.command_frames import CommandFrame
from grounding.language.semantics.discourse.discourse_state import DiscourseState
from grounding.language.semantics.discourse.repairs import replace_direction, replace_frame
from grounding.language.syntax.clauses import TEMPORAL
from grounding.language.syntax.noun_phrases import VEHICLE_KINDS, NounPhrase
from grounding.language.syntax.tokenizer import Token
from grounding.language.syntax.word_categories import WordCategory
from grounding.vocabulary import MANOEUVRES, ORDINALS

# Verb classes whose object does something in turn: "let it pass", "wait for it to turn".
AWAITING = ("give_way", "wait")
LETTING = ("let", "allow", "permit", "letting", "allowing")
_DRIVEN = ("moving", "passing")
_DIRECTIONS = ("left", "right", "straight", "around")


def handle_verb(state: DiscourseState, token: Token) -> None:
    """Start a command frame, or add an event or state of another vehicle."""
    state.open_relation = None
    infinitive, state.infinitive = state.infinitive, False
    if token.text.startswith("using"):
        state.open_phrase = None  # "overtake it using the left lane"
    if _completes_awaited_event(state, token, infinitive):
        return
    subject = state.other_subject
    if infinitive and state.auxiliary and subject is not None and subject.kind == "pronoun":
        state.subject, state.auxiliary = None, ""  # "it would be nice to park here"
    conditional = state.clause.connective == "if" and state.subject == "ego"  # "if you parked here"
    conditional = conditional or state.auxiliary.endswith("rather you")  # "I'd rather you parked here"
    command_form = token.form in ("", "ing") or (conditional and token.form == "past")
    stated = _is_danger(token) and not state.negated and not _is_wished(state, token)
    may_command = command_form and not stated and token.value != "none" and not state.off_topic
    if may_command and (_is_participle_command(state) if token.form == "ing" else _is_base_command(state)):
        start_frame(state, token, "to" if infinitive and state.frame is not None else state.clause.connective)
    else:
        _add_statement(state, token)
    state.auxiliary = ""


def _completes_awaited_event(state: DiscourseState, token: Token, infinitive: bool) -> bool:
    """Set the event of a frame that waits for its object ("let it pass"); return whether the verb is that event."""
    frame = state.frame
    awaits = frame is not None and (frame.verb_class in AWAITING or (frame.verb_class == "give" and infinitive))
    if frame is None or not awaits or frame.target is None:
        return False
    if state.in_relative_clause and (token.form or state.auxiliary):
        return False
    bare = not token.form and not state.auxiliary
    finished = token.form not in ("", "s") and not state.auxiliary
    if finished or (not infinitive and (frame.event or (bare and frame.verb not in LETTING))):
        return False
    frame.event = token.event or "other"
    state.event_stated = True
    return True


def _is_danger(token: Token) -> bool:
    return token.value.split()[0] == "danger"


def _is_wished(state: DiscourseState, token: Token) -> bool:
    """Return whether harm is commanded: "hit the van", but not "it hit my bike", "mind you hit nothing"."""
    alone = state.subject is None and not state.auxiliary and state.frame is None
    main = state.clause.connective not in (*TEMPORAL, "if", "because", "while", "or", "so")
    named = bool(state.remaining) and isinstance(state.remaining[0], NounPhrase)
    return " " in token.value and not token.form and alone and main and named


def _is_base_command(state: DiscourseState) -> bool:
    """Return whether a verb in its base form is a command."""
    subject = state.other_subject or state.open_phrase
    singular = subject is None or subject.number == 1
    if state.in_relative_clause and state.subject != "ego":
        # "The car that is parked | turn left".
        return not state.auxiliary and state.open_phrase is not None and singular
    if state.other_subject is not None:
        subordinate = state.clause.connective in (*TEMPORAL, "if", "because", "while")
        return not state.auxiliary and not subordinate and singular
    noun = state.open_phrase
    if state.auxiliary and state.subject is None and noun is not None and noun.kind == "vehicle":
        return False  # "where the van is about to leave"
    return not state.in_relative_clause


def _is_participle_command(state: DiscourseState) -> bool:
    """Return whether a verb in -ing is a command: "we are turning", "before turning", "continue following it"."""
    if state.subject == "ego":
        return bool(state.auxiliary) and not state.in_relative_clause
    if state.other_subject is not None or state.in_relative_clause:
        return False
    continues = state.frame is not None and state.frame.verb_class == "other"
    return state.open_phrase is None or state.negated or continues


def start_frame(state: DiscourseState, token: Token, connective: str) -> None:
    """Start a command frame with the arguments that precede its verb."""
    verb_class, *implied = token.value.split()
    # "Don't hit it" means the same as "avoid it".
    danger = verb_class == "danger"
    kept, implied = danger and state.negated, [] if state.negated and danger else implied
    frame = CommandFrame(
        verb_class="avoid" if kept else "other" if danger else verb_class,
        verb=token.text,
        connective=connective,
        start=token.start,
        negated=state.negated and not danger,
    )
    # "When you turn" and "after turning" give a time; "before turning" and "..., before you turn" are commands.
    follows = connective == "before" and bool(state.discourse.frames)
    finite = state.subject == "ego" and not token.form and not follows
    participle = token.form == "ing" and connective != "before"
    frame.is_temporal = connective in TEMPORAL and (finite or participle)
    for value in implied:
        if value in _DIRECTIONS:
            frame.direction = value
        elif value in ORDINALS:
            frame.count = ORDINALS[value]  # "second left, please"
        elif value in MANOEUVRES:
            frame.manoeuvre = value
        else:
            frame.relation = value
    _move_arguments(state.leading_frame, frame)
    for phrase, event, connective_of_event in state.pending_events:
        frame.event, frame.event_subject, frame.event_connective = event, phrase, connective_of_event
    if state.is_repair and state.frame is None:
        replace_frame(state, frame)
    state.frame, state.leading_frame, state.pending_events = frame, CommandFrame(), []
    state.discourse.frames.append(frame)
    state.open_phrase, state.subject = None, None
    state.negated = state.in_relative_clause = state.event_stated = False


def _move_arguments(leading: CommandFrame, frame: CommandFrame) -> None:
    """Move the arguments before the verb to its frame."""
    frame.target, frame.landmarks = leading.target, leading.landmarks
    frame.side, frame.lane = leading.side, leading.lane
    frame.goal_qualifiers, frame.distances = leading.goal_qualifiers, leading.distances
    frame.refers_to_place, frame.count = leading.refers_to_place, leading.count or frame.count
    if leading.relation != "none":
        frame.relation = leading.relation


def _add_statement(state: DiscourseState, token: Token) -> None:
    """Add an event or a state of another vehicle."""
    if state.clause.connective == "unless":
        return  # what is not so
    subject = state.other_subject if not state.in_relative_clause else None
    finite_past = token.form == "past" and token.event not in ("", "stop")
    finite = bool(state.auxiliary) or token.form in ("s", "") or finite_past
    host = subject if subject is not None and finite else state.open_phrase or subject
    if host is None:
        return
    awaited = state.clause.connective in (*TEMPORAL, "so") or (
        state.clause.connective == "if" and token.event == "leave"
    )
    if subject is not None and finite and awaited:
        if not state.event_stated:
            await_event(state, subject, token.event or "other")
    elif state.negated:
        if token.state and (state.auxiliary or state.in_relative_clause):
            host.excluded.append((None, (token.state,)))
            state.open_phrase, state.negated_predicate = host, True
        state.negated = False
    elif not state.event_stated:
        if token.state and host.kind not in ("thing", "region", "spot") and not _is_transient(state, token, host):
            host.add_qualifier(token.state)
        state.open_phrase = host


def _is_transient(state: DiscourseState, token: Token, host: NounPhrase) -> bool:
    """Return whether the verb describes no lasting state: "where the van came from", "he is driving badly"."""
    if state.last_relation == "at" and token.form == "past":
        return token.state not in ("parked", "stopped")
    passive = token.form == "past" and state.auxiliary in ("is", "are", "was", "were", "being")
    if passive and token.state in _DRIVEN:
        return True  # "it is driven by my uncle"
    if token.state == "turning" and state.next_kind in ("part", "thing", "spot", "relation"):
        return True  # "it turned its lights on"
    if not token.form and token.state in ("parked", "stopped", "passing"):
        return True  # "it wants to park"
    if token.state != "moving":
        return False
    vague = token.value == "go" or host.kind == "pronoun"
    origin = token.text.endswith(" from") and state.next_kind != "side"
    return vague or origin or token.form == "past"


def await_event(state: DiscourseState, subject: NounPhrase, event: str) -> None:
    """Add an event that the last frame waits for, or else the next frame."""
    state.event_stated = True
    state.open_phrase = None
    event = event if subject.kind in (*VEHICLE_KINDS, "person", "one", "pronoun") or event == "clear" else "other"
    frame = state.previous_frame if not state.clause.starts_sentence else None
    if frame is not None and frame.event is None:
        frame.event, frame.event_subject, frame.event_connective = event, subject, state.clause.connective
    else:
        state.pending_events.append((subject, event, state.clause.connective))


def handle_other_verb(state: DiscourseState, token: Token) -> None:
    """Mark the rest of the clause as off topic or as the manner of an event."""
    has_subject = state.other_subject is not None or state.in_relative_clause
    if (state.infinitive and state.frame is not None) or has_subject:
        state.infinitive, state.event_stated = False, True
    else:
        state.off_topic, state.frame, state.open_phrase, state.subject = True, None, None, None


def handle_meanwhile(state: DiscourseState, token: Token) -> None:
    """Start a frame for an action at the same time: "while passing"."""
    start_frame(state, token, "while")


def handle_branch(state: DiscourseState, token: Token) -> None:
    """Set the ordinal of the branch that a frame turns into: "take the second left"."""
    (state.frame or state.leading_frame).count = ORDINALS.get(token.value)


def handle_direction(state: DiscourseState, token: Token) -> None:
    """Add a direction to a turning vehicle or a frame, or start a frame: "turn left, then right"."""
    host, frame, before = state.open_phrase, state.frame, state.previous_frame
    if state.negated:  # "not left", "instead of right"
        state.negated = False
        state.open_phrase = host if host is not None and host.kind else None
    elif host is not None and host.kind == "vehicle" and host.postmodifiers[-1:] in (["turning"], ["moving"]):
        if token.value in ("left", "right") and host.postmodifiers[-1] in host.qualifiers:  # not a second direction
            host.qualifiers[host.qualifiers.index(host.postmodifiers[-1])] = f"turning_{token.value}"
    elif state.event_stated or state.in_relative_clause:
        return  # "the van that is indicating left"
    elif frame is None:
        if state.is_repair and replace_direction(state, token.value):
            return
        if state.clause.connective in ("then", "and") and before is not None and before.direction:
            turn = token.with_category(WordCategory.VERB, f"turn {token.value}")
            start_frame(state, turn, state.clause.connective)
    elif frame.verb_class in ("park", "stop", "pull_over") and token.value != "straight":
        frame.side = frame.side or token.value
    elif frame.direction in (None, "straight"):
        frame.direction = token.value

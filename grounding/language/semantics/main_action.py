"""Main action: commanded actions of a discourse, the one that counts, and the vehicle that it is about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grounding.language.semantics.action_rules import classify_action
from grounding.language.semantics.discourse.command_frames import CommandFrame, Discourse
from grounding.language.semantics.discourse.coreference import resolve_anaphor
from grounding.language.syntax.noun_phrases import NounPhrase

# Connectives of purpose clauses and of simultaneous actions: "so that ...", "while passing ...".
SIDE_CONNECTIVES = ("so", "while")
# "Don't turn until it has passed" is a turn; "don't turn after it has passed" is none.
_ENDING_NEGATION = ("until", "before")
_FINAL_ACTIONS = ("park", "stop", "pull_over", "turn")
# Actions for the sake of people who are only mentioned.
_CAUTIOUS_ACTIONS = ("stop", "slow_down", "wait", "avoid", "give_way")


@dataclass(frozen=True, eq=False)
class Intent:
    """A commanded frame.

    Attributes:
        frame: the command frame.
        action: its action.
        target: its vehicle or person with anaphors resolved, None if there is none.
        anaphora: whether the target is named by a pronoun or "one".
    """

    frame: CommandFrame
    action: str
    target: NounPhrase | None
    anaphora: bool = False


@dataclass(frozen=True, eq=False)
class MainIntent:
    """The intent that counts, and the vehicle or person that the command refers to."""

    intent: Intent
    referent: NounPhrase | None
    anaphora: bool = False


def find_intents(discourse: Discourse) -> list[Intent]:
    """Return the commanded frames in order, temporal ones ("when you turn") included."""
    for frame in discourse.frames:
        if frame.negated and frame.event_subject is not None and frame.event_connective in _ENDING_NEGATION:
            # "Don't go until it has passed" is a wait; "don't turn until it has passed" is a later turn.
            going = frame.verb_class in ("go", "drive", "move", "other")
            frame.negated, frame.verb_class = False, "wait" if going else frame.verb_class
            if frame.forbidden_target is not None and frame.target is None:
                frame.target = frame.forbidden_target
                excluded = discourse.excluded
                discourse.excluded = [(relation, one) for relation, one in excluded if one is not frame.target]
    _join_purposes(discourse)
    _join_gaps(discourse)
    _join_clearances(discourse)
    classified = [(frame, classify_action(frame)) for frame in discourse.frames if not frame.negated]
    # Targets of other actions than driving are only mentioned: "fetch my bag from that van".
    idle = [frame.target for frame, action in classified if action is None]
    discourse.mentions = [(phrase, "stated" if phrase in idle else role) for phrase, role in discourse.mentions]
    intents = [_intent(discourse, frame, action) for frame, action in classified if action]
    return [one for before, one in zip([None, *intents], intents, strict=False) if not _keeps_lane(before, one)]


def _keeps_lane(before: Intent | None, intent: Intent) -> bool:
    """Return whether an intent asks to stay in the lane that the one before it changes to: "and stay there"."""
    changes = before is not None and before.action == "change_lane"
    stays = intent.frame.verb.split()[0] in ("stay", "keep", "remain") and intent.target is None
    return changes and stays and intent.action in ("wait", "other")


def _join_gaps(discourse: Discourse) -> None:
    """Move a gap to the stop that it is for: "leave two metres to the truck when you stop"."""
    for frame in discourse.frames:
        stop = next((one for one in discourse.frames if one.is_temporal and one.verb_class in _FINAL_ACTIONS), None)
        if stop is None or frame.negated or not frame.distances or frame.target is None:
            continue
        if classify_action(frame) in ("avoid", "follow", "other"):
            stop.is_temporal, stop.connective = False, ""
            if stop.relation == "none":
                stop.relation = "behind" if frame.relation in ("none", "between", "toward") else frame.relation
            stop.target, stop.distances = frame.target, [(metres, "gap") for metres, _ in frame.distances]
            discourse.frames.remove(frame)
            return


def _join_clearances(discourse: Discourse) -> None:
    """Move what is to be kept clear of to the stop that it is for, the kerb or a thing on the road."""
    for frame in [one for one in discourse.frames if not one.negated and one.verb_class not in _FINAL_ACTIONS]:
        stop = next((one for one in reversed(discourse.frames) if one.verb_class in _FINAL_ACTIONS), None)
        if stop is None or stop.negated or frame.target is not None or not frame.distances:
            continue
        metres, kind = frame.distances[0]
        things = [thing for _, thing in frame.landmarks if thing.kind == "thing"]
        if kind == "kerb":  # "leave 1 m to the kerb when you stop"
            stop.distances.append((metres, kind))
            stop.side = stop.side or (None if stop.target is not None else "kerb")
        elif things and classify_action(frame) == "avoid":  # "pull over, but keep 10 m away from the crossing"
            things[0].distance_m = metres
            discourse.excluded.append(("near", things[0]))
        else:
            continue
        stop.is_temporal, stop.connective = False, ""
        discourse.frames.remove(frame)


def _join_purposes(discourse: Discourse) -> None:
    """Move the place of a "take" frame to its purpose: "use the gap to change lanes", "find somewhere to pull in"."""
    for frame, purpose in zip(discourse.frames[:-1], discourse.frames[1:], strict=True):
        somewhere = frame.target is None and frame.direct_object is None
        takes_place = purpose.connective == "to" and frame.verb_class == "take" and (frame.has_spot or somewhere)
        action = classify_action(purpose) if takes_place else None
        if action is None or frame.negated:
            continue
        if action != "park" or somewhere:
            discourse.frames.remove(frame)
            purpose.side = purpose.side or frame.side
        if purpose.target is None and not purpose.refers_to_place:
            purpose.target, purpose.relation = frame.target, frame.relation
            purpose.inverse_relation = frame.inverse_relation
            kept = [(relation, thing) for relation, thing in frame.landmarks if thing.kind != "spot"]
            purpose.landmarks = kept + purpose.landmarks


def _intent(discourse: Discourse, frame: CommandFrame, action: str) -> Intent:
    target = frame.target
    if target is None:
        return Intent(frame, action, None)
    other = next((thing for relation, thing in frame.landmarks if relation == frame.relation == "between"), None)
    if target.kind == "one" and other is not None and other.kind == "vehicle":
        target.take_noun(other)  # "between the second and third car"
        target.colour = target.colour or other.colour
    anaphora = target.kind in ("pronoun", "one")
    return Intent(frame, action, resolve_anaphor(discourse, target), anaphora)


def select_main_intent(discourse: Discourse, intents: Sequence[Intent]) -> MainIntent:
    """Return the last intent that takes the vehicle; else the one that waits for the vehicle; else the last one."""
    commands = [one for one in intents if not one.frame.is_temporal]
    temporal = [one for one in intents if one.frame.is_temporal]
    main = [one for one in commands if one.frame.connective not in SIDE_CONNECTIVES]
    for kind in ("vehicle", "traffic", "person"):
        if found := _main_of_kind(discourse, kind, main, commands):
            return found
        for intent in temporal:
            if referent := _referent_of_kind(intent.target, kind):
                return MainIntent(_last(main or commands), referent)
        if kind == "vehicle" and (stated := _stated_vehicle(discourse)):
            return MainIntent(_last(main or commands), stated)
    for intent in main:
        if intent.frame.direct_object is not None and intent.frame.direct_object.kind == "person":
            return MainIntent(intent, intent.frame.direct_object)  # "pick up the woman"
    last = _last(main or commands)
    placed = last.frame.landmarks or (last.target is not None and last.target.kind == "thing")
    if last.action in _CAUTIOUS_ACTIONS and not placed and (person := _stated_person(discourse)):
        return MainIntent(last, person)  # "slow down, there are children about"
    return MainIntent(_last(main or commands), None)


def _main_of_kind(
    discourse: Discourse, kind: str, main: Sequence[Intent], commands: Sequence[Intent]
) -> MainIntent | None:
    """Return the main intent whose target, purpose or awaited event has a referent of this kind."""
    if takers := [one for one in main if _referent_of_kind(one.target, kind)]:
        intent = _last_taker(takers, main)
        return MainIntent(intent, _referent_of_kind(intent.target, kind), intent.anaphora)
    for intent in commands:
        if intent.frame.connective in SIDE_CONNECTIVES and (referent := _referent_of_kind(intent.target, kind)):
            earlier = [one for one in main if one.frame.start < intent.frame.start] or [*main, intent]
            return MainIntent(earlier[-1], referent, intent.anaphora)
    for intent in main:
        subject = intent.frame.event_subject
        awaited = resolve_anaphor(discourse, subject) if subject else None
        if awaited is not None and awaited.kind == kind:
            return MainIntent(_final_intent(intent, awaited, main) or intent, awaited)
    return None


def _referent_of_kind(phrase: NounPhrase | None, kind: str) -> NounPhrase | None:
    """Return the noun phrase if it is of this kind, else the vehicle that defines it: "the man behind the bus"."""
    if phrase is None:
        return None
    if phrase.kind == kind:
        # "To beat the traffic" refers to no vehicle, "the oncoming traffic" to some vehicle.
        return phrase if kind != "traffic" or phrase.qualifiers else None
    return next((other for _, other in phrase.related if kind == other.kind == "vehicle"), None)


def _last_taker(takers: Sequence[Intent], intents: Sequence[Intent]) -> Intent:
    """Return the last intent that takes the vehicle, or the one that completes it."""
    last = takers[-1]
    if last.action in ("approach", "other") and (final := _final_intent(last, last.frame.target, intents)):
        return replace(final, target=last.target, anaphora=last.anaphora)
    later = [one for one in intents if one.frame.start > last.frame.start and one.action in _FINAL_ACTIONS]
    if last.action == "other" and last.frame.relation in ("at", "past", "before") and later:
        # "Continue until you see the van, then stop" is a stop at the van.
        final = later[-1]
        final.frame.target, final.frame.relation = last.frame.target, last.frame.relation
        return replace(final, target=last.target, anaphora=last.anaphora)
    # "Follow it and keep a distance" is a follow.
    follows = [one for one in takers[:-1] if one.action == "follow"]
    keeps = last.action == "avoid" and last.frame.verb.split()[0] in ("keep", "maintain", "leave", "stay", "have")
    return follows[-1] if follows and keeps else last


def _final_intent(intent: Intent, target: NounPhrase | None, intents: Sequence[Intent]) -> Intent | None:
    """Return the later intent that ends at the vehicle of this intent: "wait until it leaves and park there"."""
    start = intent.frame.start
    later = [one for one in intents if one.frame.start > start and one.frame.refers_to_place and one.target is None]
    if not later or target is None:
        return None
    frame = later[-1].frame
    loose = intent.frame.target is None or intent.frame.relation in ("toward", "none")
    frame.target, frame.relation = target, "at" if loose else intent.frame.relation
    return replace(later[-1], target=target)


def _last(intents: Sequence[Intent]) -> Intent:
    """Return the last intent with an action other than "other", else the last one."""
    return ([one for one in intents if one.action != "other"] or list(intents))[-1]


def find_hazard(discourse: Discourse) -> NounPhrase | None:
    """Return the vehicle or person of a statement, for a text that only forbids."""
    stated = (phrase for phrase, role in reversed(discourse.mentions) if role == "stated")
    return next((phrase for phrase in stated if phrase.kind in ("vehicle", "person")), None)


def _stated_person(discourse: Discourse) -> NounPhrase | None:
    """Return the person or the people stated last."""
    stated = (phrase for phrase, role in reversed(discourse.mentions) if role in ("stated", "landmark"))
    return next((phrase for phrase in stated if phrase.kind == "person"), None)


def _stated_vehicle(discourse: Discourse) -> NounPhrase | None:
    """Return the vehicle of the last statement, else the last one that defines a thing or a person."""
    for wanted in ("stated", "landmark"):
        for kind in ("vehicle", "traffic"):
            for phrase, role in reversed(discourse.mentions):
                if phrase.kind == kind and role == wanted and (kind == "vehicle" or phrase.qualifiers):
                    return phrase
    return None

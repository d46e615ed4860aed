"""Verbs in a clause: what is commanded, what another vehicle does, what is awaited."""

from __future__ import annotations

from grounding.language import repairs
from grounding.language.attachment import TEMPORAL, VEHICLES, Telling
from grounding.language.command_frames import Deed
from grounding.language.noun_phrases import Phrase
from grounding.language.tokenizer import Token
from grounding.language.word_categories import Kind

# Verbs whose object does something in turn: "let it pass", "wait for it to turn".
AWAITING = ("give_way", "wait")
_LETTING = ("let", "allow", "permit", "letting", "allowing")
_DRIVEN = ("moving", "passing")
_DIRECTIONS = ("left", "right", "straight", "around")


def verb(told: Telling, token: Token) -> None:
    """A verb begins a deed, or says what somebody else does."""
    told.relation = None
    purpose, told.purpose = told.purpose, False
    if token.meant.startswith("using"):
        told.noun = None  # "overtake it using the left lane"
    if _awaited(told, token, purpose):
        return
    third = told.third
    if purpose and told.helped and third is not None and third.kind == "pronoun":
        told.subject, told.helped = None, ""  # "it would be nice to park here"
    wished = token.form == "past" and told.clause.link == "if" and told.subject == "ego"  # "if you parked here"
    # "It hit my bike" commands nothing; "don't hit it" does.
    harm = token.value == "danger" and not told.negative
    may_command = not harm and (token.form in ("", "ing") or wished) and token.value != "none" and not told.idle
    if may_command and (_going_on(told) if token.form == "ing" else _base(told)):
        begin(told, token, "to" if purpose and told.deed is not None else told.clause.link)
    else:
        _say(told, token)
    told.helped = ""


def _awaited(told: Telling, token: Token, purpose: bool) -> bool:
    """Whether the verb is what the object of another is to do: "let it pass"."""
    deed = told.deed
    awaits = deed is not None and (deed.meaning in AWAITING or (deed.meaning == "give" and purpose))
    if deed is None or not awaits or deed.target is None or (told.within and (token.form or told.helped)):
        return False
    bare = not token.form and not told.helped
    finished = token.form not in ("", "s") and not told.helped
    if finished or (not purpose and (deed.event or (bare and deed.word not in _LETTING))):
        return False
    deed.event = token.event or "other"
    told.happened = True
    return True


def _base(told: Telling) -> bool:
    """Whether a verb in its base form is a command."""
    subject = told.third or told.noun
    singular = subject is None or subject.number == 1
    if told.within and told.subject != "ego":
        # "The car that is parked | turn left".
        return not told.helped and told.noun is not None and singular
    if told.third is not None:
        hanging = told.clause.link in (*TEMPORAL, "if", "because", "while")
        return not told.helped and not hanging and singular
    if told.helped and told.subject is None and told.noun is not None and told.noun.kind == "vehicle":
        return False  # "where the van is about to leave"
    return not told.within


def _going_on(told: Telling) -> bool:
    """Whether a verb in -ing is a command: "we are turning", "before turning", "continue following the bus"."""
    if told.subject == "ego":
        return bool(told.helped) and not told.within
    if told.third is not None or told.within:
        return False
    return told.noun is None or told.negative or (told.deed is not None and told.deed.meaning == "other")


def begin(told: Telling, token: Token, link: str) -> None:
    """A new deed."""
    meaning, *carried = token.value.split()
    # What may not be hit is to be avoided, and "don't hit it" says no less.
    danger = meaning == "danger"
    deed = Deed("avoid" if danger else meaning, token.meant, link, token.start, told.negative and not danger)
    # "When you turn", "after turning" tell when, and command nothing; "before turning" does.
    finite = told.subject == "ego" and not token.form
    deed.aside = link in TEMPORAL and (finite or (token.form == "ing" and link != "before"))
    for value in carried:
        if value in _DIRECTIONS:
            deed.direction = value
        else:
            deed.relation = value
    _take_over(told.leading, deed)
    for phrase, event in told.awaited:
        deed.event, deed.waits_for = event, phrase
    if told.correcting and told.deed is None:
        repairs.cancel(told, deed)
    told.deed, told.leading, told.awaited = deed, Deed(), []
    told.story.deeds.append(deed)
    told.noun, told.subject = None, None
    told.negative = told.within = told.happened = False


def _take_over(lead: Deed, deed: Deed) -> None:
    """What was said before the first verb."""
    deed.target, deed.marks, deed.side, deed.lane = lead.target, lead.marks, lead.side, lead.lane
    deed.optional, deed.distances, deed.there = lead.optional, lead.distances, lead.there
    if lead.relation != "none":
        deed.relation = lead.relation


def _say(told: Telling, token: Token) -> None:
    """What a verb says of another vehicle: an event that is awaited, or its state."""
    subject = told.third if not told.within else None
    finite = (
        bool(told.helped) or token.form in ("s", "") or (token.form == "past" and token.event not in ("", "stop"))
    )
    host = subject if subject is not None and finite else told.noun or subject
    if host is None:
        return
    if subject is not None and finite and told.clause.link in (*TEMPORAL, "so"):
        if not told.happened:
            _await(told, subject, token.event or "other")
    elif told.negative:
        if token.state and (told.helped or told.within):
            host.excluded.append((None, (token.state,)))
        told.negative = False
    elif not told.happened:
        if token.state and host.kind not in ("thing", "region", "spot") and not _passing_by(told, token, host):
            host.qualify(token.state)
        told.noun = host


def _passing_by(told: Telling, token: Token, host: Phrase) -> bool:
    """Whether the verb tells no lasting state: "where the van came from", "he is driving badly"."""
    if told.used == "at" and token.form == "past":
        return token.state not in ("parked", "stopped")
    if token.form == "past" and told.helped in ("is", "are", "was", "were", "being") and token.state in _DRIVEN:
        return True  # "it is driven by my uncle"
    if token.state == "turning" and told.next_kind in ("part", "thing", "spot", "relation"):
        return True  # "it turned its lights on"
    if not token.form and token.state in ("parked", "stopped", "passing"):
        return True  # "it wants to park"
    if token.state != "moving":
        return False
    vague = token.value == "go" or host.kind == "pronoun"
    whence = token.meant.endswith(" from") and told.next_kind != "side"
    return vague or whence or token.form == "past"


def _await(told: Telling, subject: Phrase, event: str) -> None:
    """An event that the last deed waits for, or the next."""
    told.happened = True
    told.noun = None
    event = event if subject.kind in (*VEHICLES, "person", "one", "pronoun") or event == "clear" else "other"
    deed = told.before if not told.clause.new else None
    if deed is not None and deed.event is None:
        deed.event, deed.waits_for = event, subject
    else:
        told.awaited.append((subject, event))


def other_verb(told: Telling, token: Token) -> None:
    """A verb of anything but driving: nothing after it is commanded."""
    if (told.purpose and told.deed is not None) or told.third is not None or told.within:
        told.purpose, told.happened = False, True
    else:
        told.idle, told.deed, told.noun, told.subject = True, None, None, None


def meanwhile(told: Telling, token: Token) -> None:
    """While passing: stands beside the main verb as a deed of its own."""
    begin(told, token, "while")


def turned(told: Telling, token: Token) -> None:
    """Left, right, straight: of a turning vehicle, of a deed, or a deed of its own ("turn left, then right")."""
    host, deed, before = told.noun, told.deed, told.before
    if told.negative:  # "not left", "instead of right"
        told.negative, told.noun = False, told.noun if told.noun is not None and told.noun.kind else None
        return
    if host is not None and host.kind == "vehicle" and host.late[-1:] in (["turning"], ["moving"]):
        if token.value in ("left", "right"):
            host.qualifiers[host.qualifiers.index(host.late[-1])] = f"turning_{token.value}"
    elif told.happened:
        return
    elif deed is None:
        if told.correcting and repairs.steer(told, token.value):
            return
        if told.clause.link in ("then", "and") and before is not None and before.direction:
            said = token.text, token.meant, token.start, token.end
            begin(told, Token(Kind.VERB, f"turn {token.value}", *said), told.clause.link)
    elif deed.meaning in ("park", "stop", "pull_over") and token.value != "straight":
        deed.side = deed.side or token.value
    elif deed.direction in (None, "straight"):
        deed.direction = token.value

"""Which deeds are commanded, which of them counts, and which vehicle it is about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grounding.language.action_rules import settle
from grounding.language.command_frames import Deed, Story
from grounding.language.coreference import resolved
from grounding.language.noun_phrases import Phrase

# Clauses that stand beside the main one: "so that ...", "while passing ...".
BESIDE = ("so", "while")
_ENDS = ("park", "stop", "pull_over", "turn")


@dataclass(frozen=True)
class Act:
    """A deed that is commanded.

    Attributes:
        deed: the deed.
        action: what it commands.
        target: the vehicle (or person) that it is about, pronouns resolved; None for none.
        anaphora: whether a pronoun or "one" names the target.
    """

    deed: Deed
    action: str
    target: Phrase | None
    anaphora: bool = False


@dataclass(frozen=True)
class Choice:
    """The act that counts, and the vehicle (or person) that the command is about."""

    act: Act
    referent: Phrase | None
    anaphora: bool = False


def acts_of(story: Story) -> list[Act]:
    """The commanded deeds in order; those that only tell when are among them, marked `aside`."""
    for deed in story.deeds:
        if deed.negated and deed.waits_for is not None:
            # "Don't go until it has passed" is to wait; "don't turn until it has" is to turn then.
            going = deed.meaning in ("go", "drive", "move", "other")
            deed.negated, deed.meaning = False, "wait" if going else deed.meaning
            if deed.forbidden is not None and deed.target is None:
                deed.target = deed.forbidden
                story.excluded = [(said, phrase) for said, phrase in story.excluded if phrase is not deed.target]
    _join_purposes(story)
    settled = [(deed, settle(deed)) for deed in story.deeds if not deed.negated]
    # What a deed is about that is no driving is only mentioned: "fetch my bag from that van".
    idle = [deed.target for deed, action in settled if action is None]
    story.mentions = [(phrase, "said" if phrase in idle else role) for phrase, role in story.mentions]
    return [_act(story, deed, action) for deed, action in settled if action]


def _join_purposes(story: Story) -> None:
    """Where a place is taken for something else, that counts: "use the gap to change lanes"."""
    for deed, purpose in zip(story.deeds[:-1], story.deeds[1:], strict=True):
        aim = settle(purpose) if purpose.link == "to" and deed.meaning == "take" and deed.spot else None
        if aim is None or deed.negated:
            continue
        if aim != "park":
            story.deeds.remove(deed)
        if purpose.target is None and not purpose.there:
            purpose.target, purpose.relation, purpose.inverse = deed.target, deed.relation, deed.inverse
            purpose.marks = [(said, thing) for said, thing in deed.marks if thing.kind != "spot"] + purpose.marks


def _act(story: Story, deed: Deed, action: str) -> Act:
    target = deed.target
    if target is None:
        return Act(deed, action, None)
    other = next((thing for relation, thing in deed.marks if relation == deed.relation == "between"), None)
    if target.kind == "one" and other is not None and other.kind == "vehicle":
        target.become(other)  # "between the second and third car"
        target.colour = target.colour or other.colour
    anaphora = target.kind in ("pronoun", "one")
    return Act(deed, action, resolved(story, target), anaphora)


def choose(story: Story, told: Sequence[Act]) -> Choice:
    """The act that takes the vehicle, the last one if several do; else that of an awaited vehicle; else the last."""
    acts, asides = [act for act in told if not act.deed.aside], [act for act in told if act.deed.aside]
    main = [act for act in acts if act.deed.link not in BESIDE]
    for kind in ("vehicle", "traffic", "person"):
        if takers := [act for act in main if _of_kind(act.target, kind)]:
            act = _counting(takers, main)
            return Choice(act, _of_kind(act.target, kind), act.anaphora)
        for act in acts:
            if act.deed.link in BESIDE and (referent := _of_kind(act.target, kind)):
                earlier = [one for one in main if one.deed.start < act.deed.start] or [*main, act]
                return Choice(earlier[-1], referent, act.anaphora)
        for act in main:
            waited = resolved(story, act.deed.waits_for) if act.deed.waits_for else None
            if waited is not None and waited.kind == kind:
                return Choice(_ends_there(act, waited, main) or act, waited)
        for act in asides:
            if referent := _of_kind(act.target, kind):
                return Choice(_last(main or acts), referent)
        if kind == "vehicle" and (said := _told(story)):
            return Choice(_last(main or acts), said)
    for act in main:
        if act.deed.object is not None and act.deed.object.kind == "person":
            return Choice(act, act.deed.object)  # "pick up the woman"
    return Choice(_last(main or acts), None)


def _of_kind(phrase: Phrase | None, kind: str) -> Phrase | None:
    """The phrase if it is of this kind, else the vehicle by which it is told: "the man behind the bus"."""
    if phrase is None:
        return None
    if phrase.kind == kind:
        # "To beat the traffic" is about nobody, "the oncoming traffic" about some vehicle.
        return phrase if kind != "traffic" or phrase.qualifiers else None
    return next((other for _, other in phrase.links if kind == other.kind == "vehicle"), None)


def _counting(takers: Sequence[Act], acts: Sequence[Act]) -> Act:
    """The last of the acts that take the vehicle, with two exceptions."""
    last = takers[-1]
    if last.action in ("approach", "other") and (end := _ends_there(last, last.deed.target, acts)):
        return replace(end, target=last.target, anaphora=last.anaphora)
    later = [act for act in acts if act.deed.start > last.deed.start and act.action in _ENDS]
    if last.action == "other" and last.deed.relation in ("at", "past", "before") and later:
        # "Continue until you see the van, then stop" is to stop there.
        end = later[-1]
        end.deed.target, end.deed.relation = last.deed.target, last.deed.relation
        return replace(end, target=last.target, anaphora=last.anaphora)
    # "Follow it and keep a distance" is to follow.
    follows = [act for act in takers[:-1] if act.action == "follow"]
    keeps = last.action == "avoid" and last.deed.word.split()[0] in ("keep", "maintain", "leave", "stay", "have")
    return follows[-1] if follows and keeps else last


def _ends_there(act: Act, target: Phrase | None, acts: Sequence[Act]) -> Act | None:
    """The later act that ends where this one's vehicle is: "wait until it leaves and park there"."""
    later = [one for one in acts if one.deed.start > act.deed.start and one.deed.there and one.target is None]
    if not later or target is None:
        return None
    deed = later[-1].deed
    loose = act.deed.target is None or act.deed.relation in ("toward", "none")
    deed.target, deed.relation = target, "at" if loose else act.deed.relation
    return replace(later[-1], target=target)


def _last(acts: Sequence[Act]) -> Act:
    """The last act, one that says more than to go on if there is one."""
    return ([act for act in acts if act.action != "other"] or list(acts))[-1]


def _told(story: Story) -> Phrase | None:
    """The vehicle of a statement, else one that a thing or a person is told by."""
    for wanted in ("said", "landmark"):
        for kind in ("vehicle", "traffic"):
            for phrase, role in reversed(story.mentions):
                if phrase.kind == kind and role == wanted and (kind == "vehicle" or phrase.qualifiers):
                    return phrase
    return None

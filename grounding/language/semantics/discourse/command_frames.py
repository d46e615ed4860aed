"""Command frames (a verb with its arguments) and the discourse that holds all frames of a text."""

from __future__ import annotations

from dataclasses import dataclass, field

from grounding.language.syntax.noun_phrases import NounPhrase

# Places that a turn enters: "turn into the driveway", "take the exit".
ENTERABLE = ("driveway", "parking_lot", "entrance", "road", "turn", "exit", "corner", "intersection", "roundabout")


@dataclass(eq=False, kw_only=True)
class CommandFrame:
    """One verb that may be commanded, with its arguments.

    Attributes:
        verb_class: an action, or a family of light verbs whose action depends on the arguments.
        verb: the verb as written, after spelling correction.
        connective: connective of its clause, see `Clause`; "to" for a purpose ("slow down to let it pass").
        start: first character in the normalised sentence.
        negated: whether "don't" precedes the verb.
        forbidden_target: target of a negated frame: "don't overtake the van".
        is_temporal: whether the frame gives a time and no command: "when you turn".
        target: the vehicle or person that the frame is about, None if there is none.
        relation: relation of the goal to the target, 'none' if none is named.
        target_is_object: whether the target is the verb's object, without a relation.
        inverse_relation: relation of the last landmark to the target ("by the sign in front of the bus").
        landmarks: other things with their relation ("object" for the verb's object), in order.
        direction: left, right, straight or around.
        side: side of the road for the goal: left, right, kerb (ours) or opposite.
        lane: lane of the goal.
        goal_qualifiers: places named before the target.
        distances: metres, each with its kind: gap (to the target), travel, travel_or_gap (depends on the action),
            kerb (to the edge of the road) or descriptor (distance of the target from the ego).
        refers_to_place: whether "there" refers to a place named earlier.
        goes_around: whether "around" follows the verb.
        moves_away: whether "away" or "from" follows the verb.
        event: the trigger that the command waits for.
        event_subject: subject of the event, if it is not the target.
        event_connective: connective of the event's clause.
        count: as in `Query`.
        manoeuvre: as in `Query`.
    """

    verb_class: str = ""
    verb: str = ""
    connective: str = ""
    start: int = 0
    negated: bool = False
    forbidden_target: NounPhrase | None = None
    is_temporal: bool = False
    target: NounPhrase | None = None
    relation: str = "none"
    target_is_object: bool = False
    inverse_relation: str | None = None
    landmarks: list[tuple[str, NounPhrase]] = field(default_factory=list)
    direction: str | None = None
    side: str | None = None
    lane: str | None = None
    goal_qualifiers: list[str] = field(default_factory=list)
    distances: list[tuple[float, str]] = field(default_factory=list)
    refers_to_place: bool = False
    goes_around: bool = False
    moves_away: bool = False
    event: str | None = None
    event_subject: NounPhrase | None = None
    event_connective: str = ""
    count: int | None = None
    manoeuvre: str | None = None

    @property
    def direct_object(self) -> NounPhrase | None:
        """The verb's object, if it is not the target."""
        return next((thing for relation, thing in self.landmarks if relation == "object"), None)

    def has_landmark(self, *nouns: str) -> bool:
        """Return whether a landmark has one of these nouns."""
        return any(thing.noun in nouns for _, thing in self.landmarks)

    @property
    def has_spot(self) -> bool:
        """Whether a landmark is a parking spot."""
        return any(thing.kind == "spot" for _, thing in self.landmarks)


@dataclass(eq=False)
class Discourse:
    """Everything that a text states.

    Attributes:
        frames: command frames in order.
        mentions: every noun phrase in order with its role: target (of a frame), stated (subject of a statement),
            event (subject of an awaited event), landmark, excluded, denied ("it is not the red car"), context (named
            before the text).
        excluded: excluded noun phrases, each with the relation that the goal may not have to it; with None, the
            referent may not be one.
    """

    frames: list[CommandFrame] = field(default_factory=list)
    mentions: list[tuple[NounPhrase, str]] = field(default_factory=list)
    excluded: list[tuple[str | None, NounPhrase]] = field(default_factory=list)

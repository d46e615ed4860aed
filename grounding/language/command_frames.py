"""What a text tells: deeds that may be commanded, things mentioned, things ruled out."""

from __future__ import annotations

from dataclasses import dataclass, field

from grounding.language.noun_phrases import Phrase


@dataclass(eq=False)
class Deed:
    """One verb that may be commanded, and what stands beside it.

    Attributes:
        meaning: an action, or a family of light verbs that what stands beside it decides.
        word: the verb as said.
        link: of its clause, as in `Clause`; "to" in a purpose ("slow down to let it pass").
        start: first character in the normalised sentence.
        negated: "don't".
        forbidden: what may not be its object: "don't overtake the van".
        aside: tells when ("when you turn"), and commands nothing.
        target: the vehicle (or whoever) it is about, None for none.
        relation: to the target, 'none' where nothing is said.
        direct: whether the target is the verb's object, without a relation.
        inverse: the last of `marks` stands in this relation to the target ("by the sign in front of the bus").
        marks: other things with their relation ("object" for the verb's object), in order.
        direction: left, right, straight, around.
        side: left or right side of the road for the goal.
        lane: lane for the goal.
        optional: places said before the target.
        distances: metres, each with what it is: gap, way, along (surely the way), descriptor.
        there: "there", for a place said before.
        round: "around".
        away: "away".
        event: what is awaited.
        waits_for: whose event it is, where that is not the target.
    """

    meaning: str = ""
    word: str = ""
    link: str = ""
    start: int = 0
    negated: bool = False
    forbidden: Phrase | None = None
    aside: bool = False
    target: Phrase | None = None
    relation: str = "none"
    direct: bool = False
    inverse: str | None = None
    marks: list[tuple[str, Phrase]] = field(default_factory=list)
    direction: str | None = None
    side: str | None = None
    lane: str | None = None
    optional: list[str] = field(default_factory=list)
    distances: list[tuple[float, str]] = field(default_factory=list)
    there: bool = False
    round: bool = False
    away: bool = False
    event: str | None = None
    waits_for: Phrase | None = None

    @property
    def object(self) -> Phrase | None:
        """What the verb takes without a relation, if that is no vehicle."""
        return next((thing for relation, thing in self.marks if relation == "object"), None)

    def names(self, *nouns: str) -> bool:
        """Whether one of these things stands beside it."""
        return any(thing.noun in nouns for _, thing in self.marks)

    @property
    def spot(self) -> bool:
        """Whether a parking spot stands beside it."""
        return any(thing.kind == "spot" for _, thing in self.marks)


@dataclass(eq=False)
class Story:
    """What a whole text tells.

    Attributes:
        deeds: in order.
        mentions: every noun phrase in order with its role: target (of a deed), said (of which something is stated),
            event (what is awaited is its doing), landmark, excluded.
        excluded: relation (None: it may not be the referent itself) and what is ruled out.
    """

    deeds: list[Deed] = field(default_factory=list)
    mentions: list[tuple[Phrase, str]] = field(default_factory=list)
    excluded: list[tuple[str | None, Phrase]] = field(default_factory=list)

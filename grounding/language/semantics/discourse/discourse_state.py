"""State of the interpreter while it reads a text clause by clause."""

from __future__ import annotations

from dataclasses import dataclass, field

from grounding.language.semantics.discourse.command_frames import CommandFrame, Discourse
from grounding.language.syntax.clauses import Clause
from grounding.language.syntax.noun_phrases import Chunk, NounPhrase


@dataclass(eq=False, kw_only=True)
class DiscourseState:
    """Open arguments and flags while clauses are read in order.

    Attributes:
        discourse: everything interpreted so far.
        frame: command frame of this clause, None before its verb.
        previous_frame: last frame of the earlier clauses.
        leading_frame: arguments before their verb: "on the left, behind the bus, park".
        pending_events: subjects, events and connectives named before the frame that waits for them.
        clause: current clause.
        remaining: chunks of the clause that are not read yet.
        open_phrase: noun phrase that the next words may qualify.
        subject: subject of the next verb: a noun phrase, "ego", or None if none is named.
        open_relation: relation whose noun phrase is still to come.
        last_relation: relation of the last noun phrase.
        auxiliary: "is", "may": auxiliary of the subject's verb, '' if there is none.
        negated: whether a negation waits for the words that it negates.
        negated_predicate: whether the next words belong to the last exclusion: "that is not parked on the left".
        in_relative_clause: after "that is".
        event_stated: whether the event is read; the rest of the clause is its manner.
        off_topic: whether the rest of the clause is not about driving.
        existential: after "there is".
        infinitive: after "to".
        open_distance_m: distance whose reference is still to come.
        fronted_qualifiers: places before "there is", to qualify its subject.
    """

    discourse: Discourse = field(default_factory=Discourse)
    frame: CommandFrame | None = None
    previous_frame: CommandFrame | None = None
    leading_frame: CommandFrame = field(default_factory=CommandFrame)
    pending_events: list[tuple[NounPhrase, str, str]] = field(default_factory=list)
    clause: Clause = field(default_factory=lambda: Clause("", ()))
    remaining: list[Chunk] = field(default_factory=list)
    open_phrase: NounPhrase | None = None
    subject: NounPhrase | str | None = None
    open_relation: str | None = None
    last_relation: str | None = None
    auxiliary: str = ""
    negated: bool = False
    negated_predicate: bool = False
    in_relative_clause: bool = False
    event_stated: bool = False
    off_topic: bool = False
    existential: bool = False
    infinitive: bool = False
    open_distance_m: float | None = None
    fronted_qualifiers: list[str] = field(default_factory=list)

    def clear(self) -> None:
        """Close all open arguments and flags, as at the start of a clause."""
        self.open_phrase = self.subject = self.open_relation = self.last_relation = None
        self.auxiliary = ""
        self.negated = self.negated_predicate = self.in_relative_clause = self.event_stated = False
        self.off_topic = self.existential = self.infinitive = False
        self.open_distance_m = None
        self.fronted_qualifiers = []

    @property
    def next_kind(self) -> str:
        """Kind or category of the next chunk, '' at the end of the clause."""
        chunk = self.remaining[0] if self.remaining else None
        return "" if chunk is None else chunk.kind if isinstance(chunk, NounPhrase) else chunk.category.value

    @property
    def is_repair(self) -> bool:
        """Whether the clause is a self-repair: "no, the blue one"."""
        return self.clause.connective == "correct"

    @property
    def host_frame(self) -> CommandFrame:
        """The frame that a place or a landmark belongs to."""
        return self.frame or self.previous_frame or self.leading_frame

    @property
    def other_subject(self) -> NounPhrase | None:
        """The subject, if it is a noun phrase and not the ego."""
        return self.subject if isinstance(self.subject, NounPhrase) else None

"""A story in the telling: what is open while a clause is read, and where noun phrases go."""

from __future__ import annotations

from grounding.language import appositions, repairs
from grounding.language.clauses import Clause
from grounding.language.command_frames import Deed, Story
from grounding.language.noun_phrases import Part, Phrase

TEMPORAL = ("when", "after", "before", "until")
VEHICLES = ("vehicle", "traffic")
_PLACES = ("spot", "region")
_AM = ("i'm", "im", "we're", "you're")
_GROUPS = ("row", "line", "queue", "group", "string", "bunch", "series", "pair", "set", "cluster", "first", "rest")
_ABOUT_THINGS = ("avoid", "approach", "overtake", "follow", "wait", "stop")
# What a deed may be about.
_AIMS = (*VEHICLES, "pronoun", "one", "person")
# Verbs that take people as things: "pick up my friend next to the car".
_TAKES_PEOPLE = ("stop", "take", "leave", "get")
# Relations in which a sign or a person stands to a vehicle that is told after it.
_BESIDE = ("near", "next_to", "behind", "in_front_of", "opposite", "toward")


class Telling:
    """What is open while clauses are read, one after the other.

    Attributes:
        story: what was told so far.
        deed: of this clause.
        before: the last deed of the clauses before.
        leading: what is said before its deed: "on the left, behind the bus, park".
        awaited: whose event was told before its deed, and which.
        clause: the clause that is read.
        rest: its parts still to come.
        noun: what may still be qualified.
        subject: who does what follows: a noun phrase, "ego", None where nobody is named.
        relation: said, and its noun still to come.
        used: the relation of the last noun.
        negative: "not", and what it denies still to come.
        helped: "is", "may": the word that makes a verb the subject's, '' for none.
        within: in "that is ...".
        happened: the event is told; what follows says how.
        idle: nothing in this clause is about driving.
        stating: after "there is".
        purpose: after "to".
        place: said before "there is", of what is there.
        gap_m: a distance, and what it is of still to come.
    """

    def __init__(self) -> None:
        """Nothing is told."""
        self.story = Story()
        self.deed: Deed | None = None
        self.before: Deed | None = None
        self.leading = Deed()
        self.awaited: list[tuple[Phrase, str]] = []
        self.clause = Clause("", ())
        self.rest: list[Part] = []
        self.clear()

    def clear(self) -> None:
        """Nothing is open, as at the beginning of a clause."""
        self.noun: Phrase | None = None
        self.subject: Phrase | str | None = None
        self.relation: str | None = None
        self.used: str | None = None
        self.helped = ""
        self.negative = self.within = self.happened = False
        self.idle = self.stating = self.purpose = False
        self.gap_m: float | None = None
        self.place: list[str] = []

    def forget_place(self) -> None:
        """What was said before a verb that did not come is only mentioned: "there he is, in the van. stop"."""
        target = self.leading.target
        self.leading.lane = None
        if self.leading.relation not in ("in", "on", "with"):
            return
        self.story.mentions = [(one, "said" if one is target else role) for one, role in self.story.mentions]
        self.leading = Deed()

    @property
    def next_kind(self) -> str:
        """What kind of part comes next, '' at the end of the clause."""
        part = self.rest[0] if self.rest else None
        return "" if part is None else part.kind if isinstance(part, Phrase) else part.kind.value

    @property
    def correcting(self) -> bool:
        """Whether the clause takes back something said before."""
        return self.clause.link == "correct"

    @property
    def host(self) -> Deed:
        """The deed that a place or a landmark belongs to."""
        return self.deed or self.before or self.leading

    @property
    def third(self) -> Phrase | None:
        """The subject, if it is somebody else."""
        return self.subject if isinstance(self.subject, Phrase) else None

    # ------------------------------------------------------------ what becomes of a noun phrase

    def phrase(self, phrase: Phrase) -> None:
        """Take in a noun phrase."""
        own_car = phrase.kind == "ego" and " " in phrase.head and self.helped and not self.relation
        if own_car:  # "that is our car"
            phrase = Phrase("vehicle", phrase.head.split()[-1], phrase.head.split()[-1], phrase.start)
        if phrase.kind == "ego":
            self._ego(phrase)
        elif self.correcting and self.deed is None and repairs.instead(self, phrase):
            pass
        elif phrase.kind == "adjective":
            self._adjective(phrase)
        elif self.negative and self.stating:  # "there is no traffic"
            self.negative = False
            self.mention(phrase, "landmark")
        elif self.negative and self._denied(phrase):
            self._rule_out(phrase)
        elif self.relation:
            self._related(self.relation, phrase)
        elif self.deed is None:
            self._begin_with(phrase)
        elif self.happened or self.idle:
            self.mention(phrase, "landmark")
        else:
            self._object(self.deed, phrase)

    def mention(self, phrase: Phrase, role: str) -> None:
        """A noun phrase enters the story, and may be qualified."""
        self.story.mentions.append((phrase, role))
        if phrase.kind != "part" or self.noun is None:  # "the van with the open door on the left"
            self.noun = phrase
        self.used, self.relation = self.relation, None

    def _rule_out(self, phrase: Phrase) -> None:
        """What "not" denies: a thing that somebody has not, a place told by what follows, or just this."""
        told_by = phrase.kind in _PLACES or (phrase.kind == "one" and not self._any_vehicle())
        if self.within and phrase.kind not in VEHICLES:
            self.negative = False  # "who has no lights"
            self.mention(phrase, "landmark")
        elif told_by and self.relation is None and self.next_kind in ("relation", "between"):
            self.noun = phrase  # "except the place behind the bus"
        else:
            self.exclude(self.relation, phrase, "denied")

    def _any_vehicle(self) -> bool:
        return any(phrase.kind in VEHICLES for phrase, _ in self.story.mentions)

    def exclude(self, relation: str | None, phrase: Phrase, role: str = "excluded") -> None:
        """A noun phrase is ruled out."""
        self.story.excluded.append((relation, phrase))
        self.mention(phrase, role)
        self.negative = False

    def refine(self, host: Phrase, phrase: Phrase) -> None:
        """What is said of a phrase by another: "..., the yellow one"."""
        host.colour = host.colour or phrase.colour
        for value in phrase.qualifiers:
            host.qualify(value)
        host.extra += phrase.extra
        self.noun = host

    def _ego(self, phrase: Phrase) -> None:
        """We drive; "next to us" tells nothing new."""
        beside, self.relation = self.relation not in (None, "at", "same_as"), None
        if beside:
            self.gap_m = None
        elif self.within:
            self.subject, self.happened = "ego", True  # "the van that we passed"
        else:
            self.subject = "ego"
            self.helped = phrase.head if phrase.head in _AM else ""

    def _adjective(self, phrase: Phrase) -> None:
        """Said of what was named: "that is red", "which is closest to us"."""
        host = (self.third if self.helped and not self.within else None) or self.noun or self.third
        dressed = self.relation in ("in", "with") and host is not None and host.kind == "person"
        if host is None or self.happened or dressed or host.kind in ("thing", *_PLACES):
            self.relation = None if dressed else self.relation  # "the man in black"
            return
        if self.negative:
            host.excluded.append((phrase.colour, tuple(phrase.qualifiers)))
            self.negative = False
        else:
            self.refine(host, phrase)

    def _denied(self, phrase: Phrase) -> bool:
        """Whether "not" is said of a noun phrase, and not of a verb to come."""
        if self.deed is None and (self.relation or phrase.kind != "pronoun"):
            return True
        return self.noun is not None and phrase.head not in ("he", "she", "they")

    def _begin_with(self, phrase: Phrase) -> None:
        """Neither verb nor relation before it: the subject of a statement, or an afterthought."""
        if appositions.tells_more(self, phrase):
            return
        subject = self.third
        if subject is not None and self.helped and phrase.kind == "one" and appositions.is_the_other(self, phrase):
            self.mention(phrase, "said")  # "it is not the red car, it is the blue one"
        elif subject is not None and self.helped and phrase.kind == "one":
            self.refine(subject, phrase)  # "his car is the black one"
        elif subject is not None and self.helped and subject.kind == "one" and phrase.kind == "vehicle":
            subject.become(phrase)  # "the blue one is my car"
        elif subject is not None and not (subject.kind == "pronoun" and self.helped):
            self.mention(phrase, "landmark")
        else:
            self.mention(phrase, "event" if self.clause.link in TEMPORAL else "said")
            self.subject = phrase
            self.helped = "is" if phrase.kind == "pronoun" and phrase.head.endswith("'s") else self.helped
            for value in self.place:
                phrase.qualify(value)
            self.place = []

    def _object(self, deed: Deed, phrase: Phrase) -> None:
        """After a verb, without a relation."""
        at_place = self.noun is not None and self.noun.kind in _PLACES
        taken = deed.meaning == "take" and phrase.kind == "pronoun" and self.noun is None
        first = deed.target is None and self.used == "between" and deed.marks and deed.marks[-1][0] == "between"
        if first and phrase.kind in VEHICLES:  # "between the lamp post and the van"
            self.aim("between", phrase)
        elif deed.meaning in ("give", "leave") and (
            phrase.kind in _PLACES or (deed.target and phrase.kind == "thing")
        ):
            deed.marks.append(("object", phrase))
            self.mention(phrase, "landmark")
        elif deed.target is None and phrase.kind == "vehicle" and at_place:
            # "The road the van came from", "the direction the van goes".
            self.within, self.subject = False, None
            self.aim("same_as" if self.noun and self.noun.head in ("direction", "way") else "at", phrase)
        elif (deed.target is None and deed.object is None) or taken:
            self._take(deed, phrase)
        elif self.used == "between" and not any(relation == "between" for relation, _ in deed.marks):
            deed.marks.append(("between", phrase))
            self.mention(phrase, "landmark")
        elif phrase.kind == "one" and deed.target is not None:
            self.refine(deed.target, phrase)
        else:
            self.mention(phrase, "said")
            self.subject = phrase

    def _take(self, deed: Deed, phrase: Phrase) -> None:
        """The object of a verb."""
        spot = self._place_before() if deed.meaning == "take" and phrase.kind == "pronoun" else None
        if deed.negated and deed.meaning not in ("give_way", "wait"):
            deed.forbidden = phrase
            self.exclude(None, phrase)
        elif spot is not None:  # "take it"
            deed.marks.append(("object", spot))
        elif phrase.kind in _AIMS and not (phrase.kind == "person" and deed.meaning in _TAKES_PEOPLE):
            deed.target, deed.direct = phrase, True
            self.mention(phrase, "target")
        else:
            deed.marks.append(("object", phrase))
            self.mention(phrase, "landmark")
        self.spend_gap("gap")

    def _place_before(self) -> Phrase | None:
        places = [(phrase, role) for phrase, role in reversed(self.story.mentions) if phrase.kind in _PLACES]
        said = [phrase for phrase, role in places if role == "said"]  # not the lot in "there is an entrance to a lot"
        return next(iter([*said, *(phrase for phrase, _ in places)]), None)

    # ------------------------------------------------------------ with a relation

    def _related(self, relation: str, phrase: Phrase) -> None:
        """The target of a deed, a landmark, or what says which vehicle is meant."""
        self.relation = None
        noun = self.noun
        lane = noun is not None and noun.noun == "lane"
        of = noun if relation == "of" or (relation == "with" and lane) else None
        place_told = self.within and noun is not None and noun.kind in _PLACES and self.deed is not None
        if place_told and phrase.kind == "vehicle" and self.host.target is None:
            self.within = False
            self.aim(relation, phrase)  # "in the spot that is behind the van"
        elif of is not None and phrase.head in _GROUPS and self.host.marks and self.host.marks[-1][1] is of:
            self.host.marks.append((self.host.marks.pop()[0], phrase))  # "at the end of the row of vans"
            self.mention(phrase, "landmark")
        elif of is not None and of.kind == "one" and phrase.noun:
            phrase.refine_into(of)  # "the first of the three cars"
        elif (self.deed is None and (self.subject or self.idle or self.stating)) or self.within or self.happened:
            if noun is not None and not self.happened:
                noun.links.append((relation, phrase))
            self.mention(phrase, "landmark")
        elif of is not None and of.head in _GROUPS and phrase.kind == "vehicle" and self._group_is_aim(of):
            self.aim(self.host.marks.pop()[0], phrase)  # "past the row of parked cars"
        elif of is not None and of.kind in _PLACES and phrase.kind == "vehicle":
            if of.noun != "side":  # "the spot of the van"
                self.aim("same_as" if of.noun == "lane" else "at", phrase)
        elif relation == "with" and phrase.kind == "vehicle" and self._at_solid():
            self.aim(relation, phrase)  # "in front of the house with the van"
        elif phrase.kind in _AIMS and relation not in ("of", "with"):
            self.aim(relation, phrase)
        else:
            self._mark(relation, phrase)
        self.used = relation

    def _at_solid(self) -> bool:
        """Whether the deed is at a thing or a person, just named."""
        marks = self.host.marks
        at = bool(marks) and marks[-1][1] is self.noun and marks[-1][1].kind in ("thing", "person")
        at = at and marks[-1][1].noun != "sidewalk"  # it runs along the whole road
        return at and self.host.target is None

    def _group_is_aim(self, group: Phrase) -> bool:
        marks = self.host.marks
        return bool(marks) and marks[-1][1] is group and marks[-1][0] not in ("of", "in", "into", "on", "along")

    def aim(self, relation: str, phrase: Phrase) -> None:
        """A vehicle (or person) in a relation: what the deed is about, or what tells more of that."""
        deed = self.host
        if deed.negated and relation == "into":  # "don't drive into the truck"
            deed.meaning, deed.negated = "avoid", False
        if deed.negated and deed.round:
            self.mention(phrase, "excluded")  # "don't go around it" rules out no place
        elif deed.negated:
            self.exclude(relation, phrase)
        elif deed.target is None:
            last = deed.marks[-1][0] if deed.marks else ""
            beside = last in _BESIDE or (last == "object" and deed.meaning in _ABOUT_THINGS) or relation == "with"
            apart = beside and self._at_solid()
            deed.inverse = relation if apart else None  # "by the sign in front of the bus"
            deed.relation = last if apart else relation
            deed.target = phrase
            self.mention(phrase, "target")
            self.spend_gap("gap")
        elif deed.target.kind == "person" and phrase.kind != "person" and not deed.direct:
            deed.marks.append((deed.relation, deed.target))  # "next to the man beside the car"
            deed.target, deed.inverse = phrase, relation
            self.mention(phrase, "target")
        else:
            host = self.noun if self.noun is not None and self.noun.kind == "vehicle" else deed.target
            host.links.append((relation, phrase))
            self.mention(phrase, "landmark")
            self.spend_gap("descriptor")

    def _mark(self, relation: str, phrase: Phrase) -> None:
        """A thing in a relation to the goal, or to the vehicle just named."""
        deed = self.host
        if deed.negated:
            self.exclude(relation, phrase)
            return
        if deed.target is not None and self.noun is not None and self.noun.kind in ("vehicle", "person"):
            self.noun.links.append((relation, phrase))
        else:
            deed.marks.append((relation, phrase))
        self.mention(phrase, "landmark")
        self.spend_gap("gap")

    def spend_gap(self, of: str) -> None:
        """The open distance, if there is one, is the gap, the way, or how far the target is."""
        if self.gap_m is not None:
            self.host.distances.append((self.gap_m, of))
        self.gap_m = None

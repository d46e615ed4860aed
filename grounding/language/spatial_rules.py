"""Small words in a clause: relations, sides, lanes, distances, negations and what joins them."""

from __future__ import annotations

from grounding.language import repairs
from grounding.language.attachment import Telling
from grounding.language.noun_phrases import Phrase
from grounding.language.tokenizer import Token
from grounding.language.verb_rules import AWAITING
from grounding.language.word_categories import Kind

# Of two relations in a row the later counts ("over by", "up to behind"), unless it is one of these.
_WEAK = ("at", "toward", "in", "into", "along", "on", "with", "of")
# Who does this goes away from "in front of us".
_GOING = ("leaving", "turning", "turning_left", "turning_right", "passing")
_STEERING = ("turn", "change_lane", "go", "drive", "move", "overtake")
_ITS = ("its", "his", "her", "their", "in its", "in his", "in her", "in their", "into its", "to its", "at its")
# Said of the next one in our lane: "in front of us"; "up ahead" may be any.
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
# What may still come between a distance and what it is of.
_MORE = ("relation", "between", "away", "where")


def relation(told: Telling, token: Token) -> None:
    """Behind, next to and their like: open until their noun comes."""
    following = told.rest[0] if told.rest else None
    if token.text == "by" and isinstance(following, Token) and following.form == "ing":
        told.noun = None  # "by moving over"
        return
    deed = told.deed
    if deed is not None:
        deed.away = deed.away or token.text.startswith(("away", "from"))
        deed.round = deed.round or (token.text in ("around", "round") and deed.target is None)
    if told.relation is None or told.relation in _WEAK or token.value not in _WEAK:
        told.relation = token.value
    if not isinstance(following, Phrase):
        _without_noun(told, token)


def _without_noun(told: Telling, token: Token) -> None:
    """A relation that no noun follows."""
    deed = told.deed
    if told.negative and told.next_kind == "" and _ruled_out(told, token.value):
        return
    if token.value in ("left_of", "right_of") and told.host.target is not None:
        told.host.relation = token.value  # "on its left"
    if told.next_kind in ("relation", "distance", "between", "except"):
        return
    if deed is not None and deed.meaning in AWAITING and deed.target is not None and deed.event is None:
        if token.value in ("in", "into", "near", "on", "past") or token.text == "through":
            deed.event = "merge" if token.value == "in" else "pass"  # "let it in", "let it by"
    elif token.value == "past" and deed is not None and deed.relation == "none":
        deed.relation = "past"
    beside = token.value in ("behind", "next_to", "opposite") and token.text != "next"
    beside = beside or (token.text in ("around", "round") and told.next_kind == "")
    if beside and deed is not None and deed.target is None and told.relation and _vehicle_before(told):
        told.aim(token.value, Phrase("pronoun", head="it", start=token.start))  # "that is his bus, pull alongside"
    if told.next_kind != "lane":
        told.relation = None


def _ruled_out(told: Telling, relation: str) -> bool:
    """Whether a place beside what was named is ruled out: "behind the van, not in front"."""
    target = told.host.target
    if target is None:
        return False
    told.story.excluded.append((relation, target))
    told.negative, told.relation = False, None
    return True


def _vehicle_before(told: Telling) -> bool:
    return any(phrase.kind == "vehicle" for phrase, _ in told.story.mentions)


def between(told: Telling, token: Token) -> None:
    """Between: its first noun is the target, its second a landmark."""
    if told.next_kind == "ego" and told.gap_m is not None:
        told.spend_gap("gap")  # "leave 2 metres between us and the van"
    told.relation = "between"


def of(told: Telling, token: Token) -> None:
    """Of: joins two nouns."""
    told.relation = told.relation if told.noun is None else "of"


def side(told: Telling, token: Token) -> None:
    """On the left: of the vehicle just named; else of the goal, or where to steer."""
    noun = told.noun
    deed = told.deed
    passed = deed is not None and (deed.meaning == "overtake" or deed.round or deed.relation == "past")
    if noun is not None and noun.kind == "pronoun" and passed:
        told.noun = None  # "pass it on the left"
    value = token.value.removesuffix("_side").removeprefix("from_")
    at = told.clause.tokens.index(token)
    if at and told.clause.tokens[at - 1].form == "own" and told.host.target is noun and value != "opposite":
        told.host.relation = f"{value}_of"  # "to the white car's left side"
        return
    if told.correcting and told.deed is None and noun is None and repairs.move(told, token.value):
        return
    if _qualifies(told, token) or value == "opposite":
        return
    if told.deed is None and told.third is not None:
        return
    deed = told.deed or (told.leading if told.clause.new else told.host)
    if deed.meaning in _STEERING:
        deed.direction = deed.direction or value
    else:
        deed.side = value


def where(told: Telling, token: Token) -> None:
    """Ahead, behind us, in our lane: of the vehicle just named; else said of the place."""
    if told.negative and "front" in token.text and _ruled_out(told, "in_front_of"):
        return
    if token.value == "beside_ego" or _qualifies(told, token):
        return
    told.spend_gap("way")
    if token.value not in told.host.optional:
        told.host.optional.append(token.value)


def _qualifies(told: Telling, token: Token) -> bool:
    """Whether a place says where the last named thing is; it does if that is a vehicle or a person."""
    noun = told.noun
    if told.happened or (
        token.kind is Kind.WHERE and noun is not None and noun.late[-1:] and noun.late[-1] in _GOING
    ):
        return True
    if noun is None or noun.kind in ("thing", "region", "spot", "part"):
        return noun is not None and noun.kind == "thing"
    told.spend_gap("descriptor")
    noun.qualify(token.value)
    noun.in_line = noun.in_line or token.text.endswith(_IN_LINE)
    return True


def lane(told: Telling, token: Token) -> None:
    """A lane: of the vehicle just named; else where to go."""
    if told.next_kind == "of" and token.value in ("left_lane", "right_lane"):
        told.rest.pop(0)  # "the lane to the left of the bus"
        told.relation = token.value.replace("lane", "of")
        told.host.marks.append(("in", Phrase("region", "lane", "lane")))
    elif told.deed is None and told.third is None and told.next_kind in ("be", "aux"):
        told.subject = told.noun = Phrase("region", "lane", "lane")  # "the left lane is closed"
    else:
        if not _qualifies(told, token):
            told.host.lane = token.value
        told.relation = None


def distance(told: Telling, token: Token) -> None:
    """Metres: before a relation the gap, alone the way to go, after a noun how far that is."""
    told.gap_m = float(token.value)
    more = told.next_kind in _MORE
    if told.next_kind == "here" or (told.deed is None and told.subject is not None):
        told.spend_gap("descriptor")  # "the van 20 metres up the road"
    elif told.relation and not (told.rest and isinstance(told.rest[0], Phrase)):
        said, told.relation = told.relation, None
        if said == "of" or (said == "at" and told.noun is not None):
            told.spend_gap("gap")  # "at a distance of 5 metres"
        elif said == "near" and told.next_kind in ("of", "relation"):
            told.relation = said  # "within 5 metres of the van"
            told.rest.pop(0)
        elif not more:
            told.spend_gap("along")  # "in 20 metres"
    elif told.noun is not None and not more:
        told.spend_gap("gap")


def away(told: Telling, token: Token) -> None:
    """Away, after a distance: "the car 20 metres away"."""
    if told.noun is not None:
        told.spend_gap("descriptor")


def negation(told: Telling, token: Token) -> None:
    """Not; what follows "without" is left out."""
    told.negative = token.text != "without"
    if told.stating or not told.negative:
        told.idle = told.happened = True  # "there is no room to pass"


def exception(told: Telling, token: Token) -> None:
    """Except, instead of."""
    told.negative = True
    told.noun = told.noun or Phrase("")


def which(told: Telling, token: Token) -> None:
    """That is, who has: what follows is said of the noun before."""
    if told.noun is None and not told.clause.new and told.story.mentions:
        told.noun = told.story.mentions[-1][0]  # "the white car, which is parked"
    if told.noun is not None:
        told.within = True
        told.helped = token.text.split()[-1] if " " in token.text else token.text if "'s" in token.text else ""
        told.subject = told.noun
        if token.value == "ego":  # "the van we passed"
            told.subject, told.happened = "ego", True


def helper(told: Telling, token: Token) -> None:
    """Is, may: the verb to come is the subject's."""
    told.helped = token.text


def exists(told: Telling, token: Token) -> None:
    """There is: a statement."""
    told.subject, told.deed, told.stating = None, None, True
    lead = told.leading
    told.place = [*([f"{lead.side}_side"] if lead.side else []), *lead.optional]  # "on the left there is a van"
    lead.side, lead.optional = None, []


def question(told: Telling, token: Token) -> None:
    """What begins a question commands nothing."""
    told.idle = True


def there(told: Telling, token: Token) -> None:
    """There, its spot: a place told before."""
    if token.text.startswith(("where", "is", "that")):  # "that is where I want to stop"
        told.clear()
    if token.text.startswith(_ITS):
        told.aim("at", Phrase("pronoun", head=token.text, start=token.start))
        told.host.marks.append(("in", Phrase("spot", "parking_spot")))
    elif told.noun is None:
        told.host.there = True


def purpose(told: Telling, token: Token) -> None:
    """To, before a verb."""
    told.purpose = True


def out(told: Telling, token: Token) -> None:
    """Out, first: what is let happen."""
    deed = told.deed
    if deed is not None and deed.meaning in AWAITING and deed.target is not None and deed.event is None:
        deed.event = "leave" if token.text == "out" else "pass"


def unknown(told: Telling, token: Token) -> None:
    """What "not" denies may be a word that is not known."""
    told.negative = False

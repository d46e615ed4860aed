"""Categories of words and phrases, and the groups of categories that the grammar uses."""

from __future__ import annotations

from enum import StrEnum

from grounding.vocabulary import ACTIONS, COLOURS


class WordCategory(StrEnum):
    """Grammatical category of a word or phrase; the values are the section names of lexicon files."""

    VERB = "verb"
    MEANWHILE = "meanwhile"  # verb phrase of a simultaneous action: "while passing"
    NONDRIVE = "nondrive"  # verb that is not about driving: "tell", "wash"
    RELATION = "relation"  # spatial preposition: "behind", "next to"
    BETWEEN = "between"
    WHERE = "where"  # place relative to the ego: "up ahead", "behind us"
    HERE = "here"
    THERE = "there"
    SIDE = "side"
    LANE = "lane"
    DIRECTION = "direction"
    NOUN = "noun"  # noun of a vehicle
    MAKE = "make"
    MODEL = "model"
    PERSON = "person"
    THING = "thing"
    REGION = "region"
    SPOT = "spot"  # parking spot
    PART = "part"  # part of a vehicle
    COLOUR = "colour"
    SHADE = "shade"  # "dark", "light"
    ORDINAL = "ordinal"
    SUPERLATIVE = "superlative"
    STATE = "state"
    SIZE = "size"
    EXTRA = "extra"  # attribute that the map cannot show: "shiny"
    THE = "the"  # definite determiner
    THAT = "that"
    ANY = "any"  # indefinite determiner
    POSSESSIVE = "possessive"
    WHICH = "which"  # relative pronoun
    PRONOUN = "pronoun"
    ONE = "one"
    EGO = "ego"  # "we", "us", "our car"
    BE = "be"
    AUX = "aux"  # auxiliary verb
    NOT = "not"
    EXCEPT = "except"
    EXISTS = "exists"  # existential: "there is"
    NUMBER = "number"
    UNIT = "unit"  # unit of length
    TIME = "time"  # unit of time
    AWAY = "away"
    ABOUT = "about"  # approximator: "about 5 metres"
    AND = "and"
    OR = "or"
    BUT = "but"
    THEN = "then"
    SUB = "sub"  # subordinating conjunction: "when", "until"
    TO = "to"
    OF = "of"
    OUT = "out"  # end of an awaited event: "let it out", "let it go first"
    CORRECT = "correct"  # start of a self-repair: "no, I mean"
    QUESTION = "question"  # question word
    FILLER = "filler"
    GREETING = "greeting"  # a form of address may follow: "hey car"
    HESITATION = "hesitation"  # no part of the sentence: "you know"
    RESPELLING = "respelling"  # another way to write the words of its value: "b4"
    # Assigned by the tokenizer only, not sections of lexicon files.
    COMMA = "comma"
    BREAK = "break"  # end of a sentence
    DISTANCE = "distance"
    BRANCH = "branch"  # ordinal of a branch: "the second left"
    UNKNOWN = "unknown"


NOUNS = frozenset(
    (
        WordCategory.NOUN,
        WordCategory.PERSON,
        WordCategory.THING,
        WordCategory.REGION,
        WordCategory.SPOT,
        WordCategory.PART,
    )
)
DETERMINERS = frozenset((WordCategory.THE, WordCategory.ANY, WordCategory.POSSESSIVE))
MODIFIERS = frozenset(
    (
        WordCategory.COLOUR,
        WordCategory.SHADE,
        WordCategory.ORDINAL,
        WordCategory.SUPERLATIVE,
        WordCategory.STATE,
        WordCategory.SIZE,
        WordCategory.EXTRA,
        WordCategory.MAKE,
    )
)
# Categories that may be the head of a noun phrase.
HEADS = NOUNS | {WordCategory.MAKE, WordCategory.MODEL, WordCategory.ONE}
# Categories with inflected forms.
INFLECTED = NOUNS | {WordCategory.VERB}
# Words that negate, except or correct something.
POLARITY = frozenset((WordCategory.NOT, WordCategory.EXCEPT, WordCategory.CORRECT))
LIGHT_VERBS = ("go", "drive", "move", "get", "pull", "stay", "take", "bring", "leave", "give")
# Allowed values of a lexicon section, for categories with a closed list.
SECTION_VALUES: dict[WordCategory, tuple[str, ...]] = {
    WordCategory.COLOUR: tuple(COLOURS),
    WordCategory.VERB: (*ACTIONS, *LIGHT_VERBS, "danger", "none"),
    WordCategory.NOUN: (
        *("car", "van", "truck", "bus", "trailer", "motorcycle", "bicycle", "construction_vehicle"),
        *("vehicle", "traffic"),
    ),
    WordCategory.RELATION: (
        *("behind", "in_front_of", "next_to", "near", "left_of", "right_of", "toward", "before", "past"),
        *("opposite", "same_as", "at", "in", "into", "on", "along", "with", "for"),
    ),
    WordCategory.SIDE: ("left_side", "right_side", "opposite_side", "own_side", "from_left", "from_right"),
    WordCategory.DIRECTION: ("left", "right", "straight"),
    WordCategory.LANE: ("left_lane", "right_lane", "next_left_lane", "next_right_lane", "middle_lane", "other_lane"),
    WordCategory.WHERE: ("ahead", "behind_ego", "own_lane", "beside_ego", "at_end", "in_row"),
}

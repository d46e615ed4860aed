"""Replies: turns of a conversation that are no whole commands: "no, the other one", "a bit further"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import get_args

from grounding.language.problems import check_type
from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.phrase_patterns import WORD, LexicalEntry, PhrasePattern
from grounding.language.syntax.quantities import merge_quantities
from grounding.language.syntax.sections import section_lines
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, normalise, tokenise
from grounding.language.syntax.word_categories import WordCategory
from grounding.vocabulary import POSITIONS, ShiftDirection

_FILE = "replies.txt"
# Kinds that ask for another place, and the direction of the change.
SHIFTS: tuple[ShiftDirection, ...] = get_args(ShiftDirection)
# Kinds that are words of a description and no replies: comparatives, by the superlative that they are among
# candidates.
_COMPARATIVES = ("nearest", "farthest", "largest", "smallest")
_PLAN_KINDS = (
    *("dropping", "rejecting", "dropped", "keeping", "rest", "stop", "step", "being", "swapping", "both", "visiting"),
    *("untilword", "telling", "awaited", "till", "supposed", "passed", "return", "beforehand", "beforethat"),
    *("starting", "aboard", "forroom", "retelling"),
    *("atedge", "ourside", "otherside", "ourlane", "someplace", "anyplace", "upahead", "notback"),
    *("leaving", "leavingmore", "sufficing", "apart", "tooclose"),
    *("hindering", "particle", "elsewherethan", "limit", "nextgap", "thatgap", "tous", "afterall"),
    *(
        "letting",
        "going",
        "unfollowing",
        "longer",
        "usualpace",
        "usualway",
        "enoughpace",
        "followed",
        "remainder",
        "nothingelse",
    ),
)
_WORD_KINDS = ("skip", "tail", *_COMPARATIVES, *_PLAN_KINDS)
# Replies that only open a sentence about a plan: "no wait, forget the stop", "ok and go on then".
_OPENING = ("yes", "no", "pause", "thanks", "aside", "then", "meant")
# Kinds that the rest of the sentence may follow: "no, the red one".
_LEADING = (
    *(
        "yes",
        "no",
        "other",
        "meant",
        "then",
        "cancel",
        "neither",
        "thanks",
        "why",
        "seek",
        "elsewhere",
        "pause",
        "room",
    ),
    *("count", "aside", "without", "any"),
)
# Kinds that ask about what follows.
_ASKING = ("seek", "count", "room")
# Kinds that are replies only where a comma and further words follow.
_BEFORE_COMMA = ("aside",)
# Least letters of a word in another spelling.
_LEAST_RESPELLED = 3
# Words that begin a question for somebody.
_ANYBODY = ("any", "anyone", "anybody", "someone", "somebody")
# Prepositions before what a shift names: "closer to the van", "too close to it". They begin the rest of the reply.
_TO_NAMED = {"near": ("to", "from"), "away": ("from", "to")}
# Comparatives that what a shift names may follow at once: "nearer the van".
_NEAR_NAMED, _THE = ("nearer", "closer"), "the"
_SKIPPED = (WordCategory.FILLER, WordCategory.COMMA, WordCategory.BREAK, WordCategory.CORRECT)
# Categories of words in an epithet, besides unknown words, and the most words.
_EPITHETS = (WordCategory.EXTRA, WordCategory.PERSON, WordCategory.THING, WordCategory.SIZE, WordCategory.NOT)
_MAX_EPITHET = 4
# Words to which a last "around" belongs; after others it closes a question: "any vans around?"
_TURNING = ("turn", "spin", "swing", "loop", "go", "come", "drive", "it", "us")
# Kinds that a number may follow: "no, 4", "make it 5".
_BEFORE_NUMBERS = ("yes", "no", "meant", "pause")
# A number as the whole answer.
_NUMBER_WORDS = ("option", "number", "candidate", "the", "one", "no", "please", "car", "vehicle")


@dataclass(frozen=True)
class Reply:
    """A sentence of a conversation, split into what it does and the words that remain.

    Attributes:
        kinds: sections of the file of replies that its beginning matches, in order; the last one matches the whole
            rest of the sentence if `rest` is empty.
        rest: the remaining words, such as a command or a noun phrase.
        number: the number, if the sentence is only that ("2", "number two"), or an ordinal ("the second one", which
            is also the rest).
        distance_m: how far to move the goal; None if no distance is named.
    """

    kinds: tuple[str, ...] = ()
    rest: str = ""
    number: int | None = None
    distance_m: float | None = None

    @property
    def leading_shift(self) -> ShiftDirection | None:
        """The direction of a shift that further words follow: "further on, behind it"; None without one."""
        return next((one for one in SHIFTS if self.kinds[-1:] == (one,) and self.rest), None)

    @property
    def shift(self) -> ShiftDirection | None:
        """The direction in which the goal is to be moved; None if the sentence asks for something else."""
        return next((one for one in SHIFTS if self.kinds[-1:] == (one,) and not self.rest), None)


def read_reply(text: str, lexicon: Lexicon | None = None) -> Reply:
    """Split a sentence of a conversation into replies and the words that remain.

    Raises:
        CommandError: if the text is no string.
    """
    check_type(text)
    if len(text) > MAX_CHARACTERS:
        return Reply(rest=text)
    lexicon = lexicon or default_lexicon()
    normalised = normalise(text)
    words = tuple(respelled(WORD.findall(normalised), lexicon))
    number = _number(words, lexicon)
    if number is not None:
        return Reply(number=number)
    kinds, rest = _split(words, lexicon)
    asks = text.rstrip().endswith("?")
    if kinds[-1:] == ("any",) and rest and asks:
        kinds = (*kinds[:-1], "seek")  # "any trucks about?" asks whether there is one
    if not kinds and rest and rest[0] in _ANYBODY and asks:
        kinds = ("seek",)  # "anyone waiting there?"
    if kinds and kinds[-1] in _BEFORE_NUMBERS and (number := _number(rest, lexicon)) is not None:
        return Reply(kinds, "", number)
    if (number := _ordinal(rest, lexicon)) is not None:
        return Reply(kinds, " ".join(rest), number)
    if rest:
        distance_m, others = split_distance(rest, lexicon)
        more, left = _split(others, lexicon)
        if distance_m is not None and not left and more and more[-1] in (*SHIFTS, "more", "less"):
            return Reply((*kinds, *more), "", None, distance_m)
        if distance_m is not None and left and more and left[0] in _TO_NAMED.get(more[-1], ()):
            return Reply((*kinds, *more), " ".join(left), None, distance_m)  # "half a metre closer to the van"
    return Reply(kinds, " ".join(rest))


def says_no(text: str, lexicon: Lexicon | None = None) -> bool:
    """Return whether a sentence begins with a no, after other openings: "ok no, ..."."""
    kinds = read_reply(text, lexicon).kinds
    return "no" in kinds and all(one in _OPENING for one in kinds[: kinds.index("no")])


def words_after_opening(text: str, lexicon: Lexicon | None = None, *, tail: bool = False) -> tuple[str, ...]:
    """Return the words of a sentence without those that only open it: "no wait, skip the truck".

    `tail`: whether those stay that only close it: "please".
    """
    lexicon = lexicon or default_lexicon()
    words = tuple(respelled(WORD.findall(normalise(text)), lexicon))
    start = _skip(words, 0, lexicon)
    while start < len(words):
        end, kind = _longest_match(words, start)
        a_verb = kind in _BEFORE_COMMA and words[end : end + 1] != (",",)  # "wait for it"
        if kind not in _OPENING or a_verb or any(words_end(one, words, start) > end for one in _PLAN_KINDS):
            break
        start = _skip(words, end, lexicon)
    return words[start:] if tail else _without_tail(words[start:])


def words_end(kind: str, words: tuple[str, ...], start: int) -> int:
    """Return the end of the longest phrase of a kind of words from a word on; `start` if there is none."""
    matched = _replies(kind).longest_match(words, start) if words[start:] else None
    return matched[0] if matched else start


def respelled(words: Sequence[str], lexicon: Lexicon) -> Iterator[str]:
    """Yield words in their usual spelling: "sry", "2nd", "nvm"; short ones may be others ("4", "ta")."""
    for word in words:
        usual = lexicon.respelled.get(word, ()) if len(word) >= _LEAST_RESPELLED else ()
        yield from usual[0].split() if usual else (word,)


def named_distance(text: str, lexicon: Lexicon | None = None) -> float | None:
    """Return the only distance that a sentence names, in metres; None without one."""
    return split_distance(tuple(WORD.findall(normalise(text))), lexicon or default_lexicon())[0]


def with_superlatives(text: str) -> str:
    """Return a description with comparatives as superlatives: the closer of some candidates is the nearest."""
    words, found, start = tuple(WORD.findall(normalise(text))), list[str](), 0
    while start < len(words):
        matches = [(_replies(kind).longest_match(words, start), kind) for kind in _COMPARATIVES]
        end, word = max(((match[0], kind) for match, kind in matches if match), default=(start + 1, words[start]))
        if words[end : end + 1] == ("end",):  # "the far end" is a place
            end, word = start + 1, words[start]
        found.append(word)
        start = end
    return " ".join(found)


def _split(words: tuple[str, ...], lexicon: Lexicon) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the kinds of reply at the beginning, and the words after them without what closes a sentence."""
    start, kinds = _skip(words, 0, lexicon), list[str]()
    while start < len(words):
        end, kind = _longest_match(words, start)
        after = _skip(words, end, lexicon) if kind else start
        whole = after == len(words) or not _without_tail(words[after:])
        known = lexicon.longest_match(words, start) if kind else None
        if known is not None and known[0] > end and known[1].category is WordCategory.RELATION:
            break  # "next to it" does not begin with "next"
        if kind in _BEFORE_COMMA and (whole or words[end] != ","):
            break
        to_named = bool(kind) and not whole and words[end - 1] in _TO_NAMED.get(kind, ())
        near_named = kind == "near" and not whole and words[end - 1] in _NEAR_NAMED and words[end] == _THE
        second_thought = kind in SHIFTS and not whole and words[end] in ",.;"  # "further on, behind it"
        if not kind or not (whole or to_named or near_named or second_thought or kind in _LEADING):
            break
        kinds.append(kind)
        if kind in _ASKING and not whole:
            return tuple(kinds), _without_tail(words[after:])  # "is there any van?" is no "any"
        if to_named:
            return tuple(kinds), _without_tail(words[end - 1 :])
        if near_named:
            return tuple(kinds), _without_tail(("to", *words[end:]))
        start = len(words) if whole else after
    return tuple(kinds), _without_tail(words[start:])


def _longest_match(words: tuple[str, ...], start: int) -> tuple[int, str]:
    """Return the end and the kind of the longest reply from a word on; the kind is '' if there is none."""
    matched = _replies().longest_match(words, start)
    # "No faster than 25" begins with no "no", nor does "actually no further than the van".
    if matched is None or any(words_end("limit", words, i) > matched[0] for i in (start, matched[0] - 1)):
        return start, ""
    return matched[0], matched[1].value


def _skip(words: tuple[str, ...], start: int, lexicon: Lexicon) -> int:
    """Return the next word that is no filler; a filler that is a reply is not skipped."""
    while start < len(words) and not _longest_match(words, start)[1]:
        if end := _epithet_end(words, start, lexicon):
            start = end
            continue
        matched = _replies("skip").longest_match(words, start) or lexicon.longest_match(words, start)
        if words[start] not in ",.;!?" and (matched is None or matched[1].category not in _SKIPPED):
            break
        end = matched[0] if matched else start + 1
        limits = end - 1 > start and words_end("limit", words, end - 1) > end  # "actually no further than the van"
        start = end - limits
    return start


def _epithet_end(words: tuple[str, ...], start: int, lexicon: Lexicon) -> int:
    """Return the end of what the ego is called ("you silly sausage"), which a mark or the end follows; 0 if none."""
    if words[start] not in ("you", "ya", "ye"):
        return 0
    end = start + 1
    while end < len(words) and end - start <= _MAX_EPITHET and words[end] not in ",.;!?":
        matched = lexicon.longest_match((words[end],), 0)
        if matched is not None and matched[1].category not in _EPITHETS:
            return 0
        end += 1
    return end if end > start + 1 else 0


def _without_tail(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return the words without those that only close a sentence: "..., please", "... instead"."""
    for length in (4, 3, 2, 1):
        last = words[-length:]
        if last == ("around",) and words[-2:-1] and words[-2] in _TURNING:
            break  # "turn around"
        if len(last) == length and (_is_tail(last) if last[0] not in ",.;!?" else length == 1):
            return _without_tail(words[:-length])
    return words


def _is_tail(words: tuple[str, ...]) -> bool:
    return any(pattern.match_end(words, 0) == len(words) for pattern in _replies("tail").by_word.get(words[0], ()))


def split_distance(words: tuple[str, ...], lexicon: Lexicon) -> tuple[float | None, tuple[str, ...]]:
    """Return the only distance that some words name, None without one, and the other words."""
    tokens = merge_quantities(tokenise(" ".join(words), lexicon))
    named = [token for token in tokens if token.category is WordCategory.DISTANCE]
    others = " ".join(_beyond_distance(token.text) if token in named else token.text for token in tokens)
    return (float(named[0].value) if len(named) == 1 else None), tuple(WORD.findall(others))


def _beyond_distance(text: str) -> str:
    """Return the words of a distance that ask for more of it: "more" of "two metres more"."""
    changes = (*SHIFTS, "more")
    return " ".join(word for word in text.split()[-2:] if _longest_match((word,), 0)[1] in changes)


def _number(words: Sequence[str], lexicon: Lexicon) -> int | None:
    """Return the number that a sentence consists of; None if it says more."""
    tokens = [token for token in tokenise(" ".join(words), lexicon) if token.text not in ",.;!?"]
    named = [token for token in tokens if token.category is WordCategory.NUMBER]
    if len(named) == 1 and all(token in named or token.text in _NUMBER_WORDS for token in tokens):
        value = float(named[0].value)
        return int(value) if value.is_integer() else None
    return None if named or list(words) not in (["one"], ["number", "one"], ["option", "one"]) else 1


def _ordinal(words: Sequence[str], lexicon: Lexicon) -> int | None:
    """Return the number of an ordinal that a phrase consists of; None if it says more."""
    tokens = tokenise(" ".join(words), lexicon)
    named = [token for token in tokens if token.category is WordCategory.ORDINAL and token.value in POSITIONS]
    others = [token for token in tokens if token not in named]
    allowed = (WordCategory.THE, WordCategory.ONE)
    if len(named) != 1 or not all(token.category in allowed for token in others):
        return None
    return POSITIONS[named[0].value]


def reply_patterns() -> list[PhrasePattern]:
    """Return the patterns of all replies, each with its kind as the value of its entry."""
    return [*{id(one): one for patterns in _replies().by_word.values() for one in patterns}.values()]


@cache
def _replies(only: str = "") -> Lexicon:
    """Return the patterns of all replies, or of one kind of words, each with its kind as value."""
    lexicon = Lexicon()
    for kind, line in section_lines(_FILE):
        if kind == only if only else kind not in _WORD_KINDS:
            lexicon.add(line, LexicalEntry(WordCategory.FILLER, kind))
    return lexicon

"""Questions to the car: what is asked, and the words that tell about which thing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from grounding.language.alternatives import as_condition
from grounding.language.problems import check_type
from grounding.language.replies import respelled
from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.phrase_patterns import WORD
from grounding.language.syntax.sections import longest_end, read_sections
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, normalise, tokenise
from grounding.language.syntax.word_categories import MODIFIERS, NOUNS, WordCategory

_FILE = "questions.txt"
_LIMIT = "limit: "
# Comparatives: kinds of their own where things to compare are named.
_MORE = "more: "
# Sections that tell how a question begins, and words that name no thing; the others are kinds.
_FRAME = (
    "lead",
    "indirect",
    "listed",
    "follow",
    "mean",
    "further",
    "every",
    "asking",
    "marked",
    "wish",
    "clause",
    "elsewhere",
    "empty",
    "edge",
    "end",
)
# Kinds that only tell more of another one.
_FURTHER = (
    "slow",
    "who",
    "together",
    "people",
    "there",
    "kerb",
    "future",
    "others",
    "out",
    "else",
    "beside",
    "turning",
    "wrong",
    "sideways",
    "upto",
    "both",
    "among",
    "than",
)
# Kinds whose words describe a thing if its noun follows: "the moving van", "the light green car".
_MOTION = ("moving", "standing")
_ATTRIBUTES = (*_MOTION, _LIMIT)
# Kinds after which a verb begins a command ("do you see the van stop behind it"), unless the past is asked about.
_BEFORE_COMMANDS, _PAST = ("exists", "place", "what", "which", *_MOTION), ("did", "have")
# Words after which a verb begins none.
_SUBJECTS = (WordCategory.EGO, WordCategory.AUX, WordCategory.PRONOUN, WordCategory.NOT, WordCategory.TO)
# What begins a relative clause where no question mark ends it.
_WHICH = (("which", "is"), ("which", "was"))
# "We're" is no "were".
_ARE = re.compile(r"(?<=\w)'re\b|(?<=\byou)re\b|(?<=\bthey)re\b")
# "How far's the van?"
_HOW_IS = re.compile(r"\b(how \w+)'s\b")
# A mark that is said several times at the end.
_AND_HOW = re.compile(
    r",? and (?:how far(?: away)?|where|what colou?r|how fast) (?:is|are)"
    r" (?:it|he|she|they|that)(?: going)?(?= ?\??$)"
)
_MARKS_AGAIN = re.compile(r"([?!.])(?: ?[?!.])+$")
# A thing that is named before the question about it: "what about the yellow one, is it parked?"
_TOPIC = re.compile(
    r"^((?:and |but |so |ok(?:ay)?,? |well,? )*)(?:(?:what|how) about )?((?:the|that|this|those) [^,.;!?]{2,60}?),? "
    r"((?:how \w+ (?:away )?|where |what colou?r |which way )?(?:is|are|was|were|does|do|did|can|will))"
    r" (?:it|he|she|they)\b"
)
_TOPIC_LATER = re.compile(
    r"^((?:and |but |so |ok(?:ay)?,? |well,? )*)(?:(?:what|how) about )?((?:the|that|this|those) [^,.;!?]{2,60}), "
    r"((?:have|can|could|did|do|does|will|would|are|is) [^,.;!?]*?\b)(?:it|him|her|them)\b"
)
_US = frozenset(("we", "us", "you", "u", "i", "our", "your"))
_MARKS = ".;!?,"
# Kinds that are told of each of several things, how a question begins that only gives a choice, and most words of a
# choice after a comma.
_OF_OPTIONS = (
    *(
        "choice",
        "distance",
        "measured",
        "size",
        "description",
        "facing",
        *_MOTION,
        "place",
        "exists",
        "what",
        "which",
    ),
)
_OURS = frozenset(("us", "me", "ours"))
_CHOICE, _MAX_OFFERED = ("is", "are", "was", "were"), 14
# What closes a correction of a question, and most words of what follows one up.
_ONLY = frozenset(("just", "only"))
_I_MEAN, _MAX_FURTHER = (("i", "mean"), ("i", "meant")), 9
# Most words before a question that is told by another one: "my daughter wants to know"; its own first words, before
# which a statement's order of words is a question: "tell me what we are doing".
_MAX_BEFORE = 3
_EMBEDDED = ("if", "whether", "where", "when", "what", "which", "who", "how", "why")


@dataclass(frozen=True)
class Question:
    """A question to the car.

    Attributes:
        kinds: what is asked, as the sections of the file of questions that match, the main one first; none where
            nothing is asked that can be answered.
        words: the words that tell about which thing, '' for none.
        of_us: whether it names the car or us, though perhaps besides a thing.
        event: whether it asks what a thing did: "did you see the van stop?"
        options: the words about each of the things that it asks to choose from: "which is longer, the van or the
            bus?"; empty for other questions.
    """

    kinds: tuple[str, ...]
    words: str
    of_us: bool = False
    event: bool = False
    options: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """What is mainly asked; '' for what cannot be answered."""
        return self.kinds[0] if self.kinds else ""

    @property
    def comparative(self) -> str:
        """The comparative of a comparison: "nearer"; '' for other questions."""
        return self.kind.removeprefix(_MORE) if self.kind.startswith(_MORE) else ""

    @property
    def limit(self) -> str:
        """What is asked and never known; '' for other questions."""
        return self.kind.removeprefix(_LIMIT) if self.kind.startswith(_LIMIT) else ""


def read_question(text: str, lexicon: Lexicon | None = None) -> Question | None:
    """Read a sentence as a question to the car; None if it is none, or asks for something to be done.

    Raises:
        CommandError: if the text is no string.
    """
    check_type(text)
    if len(text) > MAX_CHARACTERS or as_condition(normalise(text)):
        return None
    lexicon = lexicon or default_lexicon()
    full = _HOW_IS.sub(r"\1 is", _ARE.sub(" are", _MARKS_AGAIN.sub(r"\1", normalise(text))))
    full = _AND_HOW.sub("", full)  # that is told with what there is
    full = _TOPIC_LATER.sub(r"\1\3\2", _TOPIC.sub(r"\1\3 \2", full))
    written = tuple(respelled(WORD.findall(full), lexicon))
    words = tuple(word.replace("'", "") for word in written)
    comma = _comma_before_options(words)
    start = _start(words, marked=words[-1:] == ("?",) or comma < len(words))
    words, written, offered = words[:comma], written[:comma], written[comma + 1 :]
    if start is None or _says_more(words[start:]):
        return None
    kinds = (kind for kind in read_sections(_FILE) if kind not in _FRAME)
    spans = {kind: span for kind in kinds if (span := _find(kind, words, start, lexicon))}
    # "Is it wider than us?" is about one thing.
    than = "than" in spans and _OURS.isdisjoint(words[spans["than"][1] :])
    several = bool(offered) or "or" in words or "among" in spans or than
    compared = next((kind for kind in spans if kind.startswith(_MORE) and several), "")
    if not compared and _find("elsewhere", words, max(start, _end("asking", words, start)), lexicon):
        return None
    spans = {kind: span for kind, span in spans.items() if kind == compared or not kind.startswith(_MORE)}
    main = compared or next((kind for kind in spans if kind not in _FURTHER), "")
    telling = (*_MOTION,) if main in _MOTION and "or" in words else (main,)  # "is it parked or moving?"
    gone = {i for kind in telling if kind in spans for i in range(*spans[kind])}
    kept = [i for i in range(start, len(words)) if i not in gone]
    until = _verb_after_thing([written[i] for i in kept], lexicon) if main in _BEFORE_COMMANDS else None
    if until is not None and words[start] not in _PAST:
        return None
    kept = kept[:until]
    about = _about(tuple(words[i] for i in kept), tuple(written[i] for i in kept))
    event = until is not None or (main in _MOTION and words[start] in _PAST)
    options = _split_options(offered or about.split(), "than" if compared and "than" in spans else "or")
    if options and not main and words[start] in _CHOICE:
        main = "which"  # "is the van nearer or the bus?"
    others = (kind for kind in spans if kind != main)
    about = "" if options and (compared or (not offered and main in _OF_OPTIONS)) else about
    return Question((main, *others) if main else (), about, not _US.isdisjoint(words[start:]), event, options)


@dataclass(frozen=True)
class FurtherWords:
    """Words that follow up a question, without one of their own: "and behind us?", "I mean the red ones".

    Attributes:
        words: the words about other things.
        corrects: whether they correct the question before.
        proposes: whether they may be a proposal: "what about the red one?"
        instead: whether they surely are one: "what about the red one instead?"
        bare: whether no other word tells that they follow up a question: "on the right".
    """

    words: str
    corrects: bool
    proposes: bool
    instead: bool = False
    bare: bool = False


def read_further_words(text: str, lexicon: Lexicon | None = None) -> FurtherWords | None:
    """Read a sentence as words that may follow up a question; None for a question and for other sentences."""
    check_type(text)
    if len(text) > MAX_CHARACTERS:
        return None
    written = tuple(respelled(WORD.findall(normalise(text)), lexicon or default_lexicon()))
    words = tuple(word.replace("'", "") for word in written)
    start, end = _skip_lead(words, 0), len(words)
    while end > start and words[end - 1] in _MARKS:
        end -= 1
    corrects = words[end - 2 : end] in _I_MEAN
    end = end - 2 if corrects else end
    only = not _ONLY.isdisjoint(words[:start])
    about, meant = _end("follow", words, start), _end("mean", words, start)
    corrects, begin = corrects or bool(meant), about or meant or start
    while end > begin and _end("further", words, end - 1) == end:
        end -= 1
    begin = _end("every", words, begin) or begin
    kept = words[begin:end]
    adds = "and" in words[:start] or words[-1:] == ("?",) or corrects or bool(about)
    asks = _end("asking", words, begin) or _end("indirect", words, begin)
    if not 0 < len(kept) <= _MAX_FURTHER or asks or any(word in _MARKS for word in kept):
        return None
    rest = " ".join(written[begin:end])
    return FurtherWords(rest, corrects or only, bool(about), "instead" in words[end:], not adds)


def asks_car(text: str, lexicon: Lexicon | None = None) -> bool:
    """Return whether a sentence asks the car something that can be answered, or told to be not known."""
    question = read_question(text, lexicon)
    return question is not None and bool(question.kind)


def _comma_before_options(words: tuple[str, ...]) -> int:
    """Return the index of the comma after which things to choose from follow; the end without one."""
    comma = words.index(",") if "," in words else len(words)
    after = words[comma + 1 :]
    offers = "or" in after[:-1] and len(after) <= _MAX_OFFERED and _US.isdisjoint(after)
    return comma if offers and not any(word in ".;!," for word in after) else len(words)


def _split_options(written: Sequence[str], parting: str) -> tuple[str, ...]:
    """Return the words about each of two things that a word parts; nothing if there are none."""
    if parting not in written:
        return ()
    at = written.index(parting)
    halves = (tuple(written[:at]), tuple(written[at + 1 :]))
    options = tuple(_about(tuple(word.replace("'", "") for word in half), half) for half in halves)
    return options if all(options) else ()


def _start(words: tuple[str, ...], marked: bool) -> int | None:
    """Return where a question begins; None without one. `marked`: whether its end marks it, or a choice."""
    start = _skip_lead(words, 0)
    for at in range(start, min(start + _MAX_BEFORE + 1, len(words))):
        if (told := _end("indirect", words, at)) and (begun := _skip_lead(words, told)) < len(words):
            if _end("listed", words, begun):
                return at
            embedded = words[begun] in _EMBEDDED
            return begun if embedded and not _end("wish", words, begun) else _start_here(words, begun, marked)
    return _start_here(words, start, marked)


def _start_here(words: tuple[str, ...], start: int, marked: bool) -> int | None:
    """Return the start if a question begins there; "why, ..." is an interjection."""
    asks = _end("asking", words, start) or (marked and _end("marked", words, start))
    clause = _end("clause", words, start) and not (marked and words[start : start + 2] in _WHICH)
    asks = 0 if clause or _end("wish", words, start) >= asks else asks
    return start if asks and words[asks : asks + 1] != (",",) else None


def _says_more(words: tuple[str, ...]) -> bool:
    """Return whether another sentence follows a question, or words after a comma that are not empty."""
    if any(word in ".;!?" for word in words[:-1]):
        return True
    after = words[words.index(",") :] if "," in words else ()
    at = 0
    while at < len(after) and (after[at] in _MARKS or _end("empty", after, at) or _end("lead", after, at)):
        at = _end("empty", after, at) or _end("lead", after, at) or at + 1
    return at < len(after)


def _skip_lead(words: tuple[str, ...], start: int) -> int:
    while start < len(words) and (words[start] in _MARKS or _end("lead", words, start)):
        start = _end("lead", words, start) or start + 1
    return start


def _find(kind: str, words: tuple[str, ...], start: int, lexicon: Lexicon) -> tuple[int, int] | None:
    """Return the first words of a section: (start, end)."""
    for at in range(start, len(words)):
        end = _end(kind, words, at)
        if end and not (kind.startswith(_ATTRIBUTES) and _noun_follows(words, end, lexicon)):
            return at, end
    return None


def _noun_follows(words: tuple[str, ...], at: int, lexicon: Lexicon) -> bool:
    """Return whether a noun follows, with or without adjectives."""
    while at < len(words) and (matched := lexicon.longest_match(words, at)):
        if matched[1].category in NOUNS:
            return True
        if matched[1].category not in MODIFIERS:
            return False
        at = matched[0]
    return False


def _verb_after_thing(words: Sequence[str], lexicon: Lexicon) -> int | None:
    """Return the index of the word at which a verb in its base form follows a thing: "the van stop behind it"."""
    text = " ".join(words)
    for before, one in pairwise(tokenise(text, lexicon)):
        named = before.category not in _SUBJECTS and before.text not in _US
        if one.category is WordCategory.VERB and not one.form and named:
            return len(text[: one.start].split())
    return None


def _about(words: tuple[str, ...], written: tuple[str, ...]) -> str:
    """Return the words about a thing: without empty ones, marks and those at the ends."""
    kept, at = list[int](), 0
    while at < len(words):
        end = _end("empty", words, at)
        if not end and words[at] not in _MARKS:
            kept.append(at)
        at = end or at + 1
    while kept and _end("edge", (words[kept[0]],), 0):
        kept.pop(0)
    while kept and any(_end(one, (words[kept[-1]],), 0) for one in ("edge", "end")):
        kept.pop()
    return " ".join(written[i] for i in kept)


def _end(section: str, words: tuple[str, ...], start: int) -> int:
    """Return the end of the longest phrase of a section from a word on; 0 if there is none."""
    return longest_end(read_sections(_FILE), section, words, start)

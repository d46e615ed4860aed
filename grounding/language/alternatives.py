"""Alternatives of a command: a wish, and what to do if it cannot be ("behind the van, otherwise at the kerb").

Each half is read as a command of its own; the second counts where the scene has no place for the first.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from grounding.language.syntax.lexicon import Lexicon
from grounding.language.syntax.phrase_patterns import WORD
from grounding.language.syntax.sections import longest_end, read_sections
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token, normalise, tokenise
from grounding.language.syntax.word_categories import DETERMINERS, POLARITY, WordCategory

_FILE = "alternatives.txt"
_MARKS = (",", ".", ";", "!", "?")
# Words that join two halves, and are part of neither.
_JOINING = frozenset((*_MARKS, "and", "or", "but", "then", "so", "either", "please", "just", "only"))
_PLACES = (WordCategory.RELATION, WordCategory.HERE, WordCategory.BETWEEN, WordCategory.SIDE)
# Words before the object of a question, and determiners that "no" replaces.
_ASKED_AFTER = ("there", "see", "have")
_COPULAS = ("is", "are")
_UNDETERMINED = re.compile(r"^(?:a|an|any|some|enough|still)\s+")
# Most words that may join alternatives: halves are read again in halves, and so the time doubles with each.
MAX_JOINTS = 3
# Categories after which "or" does not tell a fallback.
_UNSPLIT = POLARITY | {WordCategory.SUB}


class Alternatives(NamedTuple):
    """A wish and what to do if it cannot be.

    Attributes:
        wish: text of the wish.
        fallback: text of the fallback, perhaps without a verb.
        certain: whether the text cannot be read in another way.
        nearer: whether the nearer one of both places is asked for: "whichever is closer".
    """

    wish: str
    fallback: str
    certain: bool
    nearer: bool = False


@dataclass(frozen=True)
class Words:
    """The words of a normalised text, without apostrophes, and where they are in it."""

    text: str
    words: tuple[str, ...]
    spans: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, text: str) -> Words:
        """Return the words of a normalised text."""
        found = list(WORD.finditer(text))
        return cls(text, tuple(one.group().replace("'", "") for one in found), tuple(one.span() for one in found))

    def part(self, start: int, end: int | None = None) -> str:
        """Return the text from one word to another, without marks and words that join at its ends."""
        end = len(self.words) if end is None else end
        while start < end and self.words[start] in _JOINING:
            start += 1
        while start < end and self.words[end - 1] in _JOINING:
            end -= 1
        return self.text[self.spans[start][0] : self.spans[end - 1][1]] if start < end else ""

    def rest(self, start: int) -> str:
        """Return the text from a word on, without a lead ("in that case") and praise at its end ("is fine too")."""
        while start < len(self.words) and (self.words[start] in _JOINING or self.end_of("lead", start)):
            start = self.end_of("lead", start) or start + 1
        praise = (k for k in range(start, len(self.words)) if self.end_of("praise", k) == len(self.words))
        return self.part(start, next(praise, None))

    def clause_end(self, tokens: Sequence[Token], start: int) -> int:
        """Return the end of a clause that begins at a word: at a mark, or where a command begins."""
        marked = next((k for k in range(start, len(self.words)) if self.words[k] in _MARKS), len(self.words))
        return min(marked, _main_clause(self, tokens, start + 1))

    def after_marks(self, start: int) -> int:
        """Return the first word from a word on that is no mark."""
        return next((k for k in range(start, len(self.words)) if self.words[k] not in _MARKS), len(self.words))

    def tokens_of(self, tokens: Sequence[Token], start: int, end: int) -> list[Token]:
        """Return the tokens of the words from one to another; none if there are no words between."""
        if start >= end:
            return []
        first, last = self.spans[start][0], self.spans[end - 1][1]
        return [token for token in tokens if first <= token.start < last]

    def is_case(self, begin: int, end: int) -> bool:
        """Return whether what follows a clause is for the case that it tells: "but if X, Y", "X, in which case Y"."""
        after = self.after_marks(end)
        contrasts = begin > 0 and self.words[begin - 1] in (*_MARKS, "but", "and")
        return bool(self.end_of("case", after)) or (contrasts and self.words[begin] != "unless")

    def count_joints(self) -> int:
        """Return the number of words that may join two halves."""
        return sum(
            word == "or" or bool(self.end_of("otherwise", k) or self.end_of("if", k) or self.end_of("between", k))
            for k, word in enumerate(self.words)
        )

    def end_of(self, section: str, start: int) -> int:
        """Return the end of the longest phrase of a section from a word on; 0 if there is none."""
        return longest_end(read_sections(_FILE), section, self.words, start)


def split_alternatives(text: str, tokens: Sequence[Token]) -> Iterator[Alternatives]:
    """Yield the ways to split a text into a wish and its fallback; the likeliest first.

    Args:
        text: the normalised text; a text with many alternatives is not split.
        tokens: its tagged tokens.
    """
    words = Words.of(text)
    if words.count_joints() > MAX_JOINTS:
        return
    # "If it moves, follow it, otherwise go past": what is the case there decides, not whether there is a place.
    states = words.end_of("if", 0) and not tells_room(words, tokens)
    for wish, fallback in (*(() if states else _at_otherwise(words)), *_at_condition(words, tokens)):
        if wish and fallback:
            yield Alternatives(wish, fallback, True)
    until = _end_of_choice(words)
    end = words.spans[until - 1][1] if until else 0
    nearer = any(words.end_of("nearer", k) for k in range(until, len(words.words)))
    for wish, fallback in _at_or(text[:end].rstrip(" ,"), [token for token in tokens if token.end <= end]):
        yield Alternatives(wish, fallback, False, nearer)


def _end_of_choice(words: Words) -> int:
    """Return the end of the alternatives around an "or": before "whichever is closer", and "if there's no room"."""
    for k, word in enumerate(words.words):
        begin = words.end_of("if", k) if "or" in words.words[:k] else 0
        hindered = begin and any(words.end_of("hindered", i) for i in range(begin, len(words.words)))
        if words.end_of("whichever", k) or (hindered and word not in _MARKS):
            return k
    return len(words.words)


def as_condition(text: str) -> str:
    """Return a question and the command that hangs on its answer as one condition; '' for other texts.

    "Is there a gap behind the van? If so park there, otherwise drive on" is "if there is a gap behind the van, ...".

    Args:
        text: the normalised text.
    """
    words = Words.of(text)
    end = next((k for k, word in enumerate(words.words) if word in _MARKS), 0)
    rest = words.after_marks(end)
    so, not_so = words.end_of("so", rest), words.end_of("notso", rest)
    if not (so or not_so):
        return ""
    state = next((k for k in range(2, end) if words.end_of("being", k) == end), 0)
    if not 0 < words.end_of("asked", 0) <= end and not (state and words.words[0] in _COPULAS):
        return ""
    first = next((k for k in range(end) if words.words[k] in _ASKED_AFTER), -1) + 1
    what, command = words.part(first, end), words.part(max(so, not_so))
    if not what or not command:
        return ""
    if not first and state:  # "is the bus moving"
        be = f"{words.words[0]} not" if not_so else words.words[0]
        return f"if {words.part(1, state)} {be} {words.part(state, end)}, {command}"
    if not_so:
        return f"if there is no {_UNDETERMINED.sub('', what)}, {command}"
    return f"if there is {what}, {command}"


def tells_room(words: Words, tokens: Sequence[Token]) -> bool:
    """Return whether a text names a free space, or has a condition on room: "if there's room behind the van"."""
    if any(token.category is WordCategory.SPOT for token in tokens):
        return True
    begun = (end for k, _ in enumerate(words.words) if (end := words.end_of("if", k)))
    return any(words.end_of("room", end) for end in begun)


def lone_fallback(text: str, lexicon: Lexicon | None = None) -> str:
    """Return the fallback that a text tells without its wish, '' for none: "if there's no room, park here"."""
    normalised = normalise(text[:MAX_CHARACTERS])
    words, tokens = Words.of(normalised), tag(tokenise(normalised, lexicon))
    found = (*_at_otherwise(words), *_at_condition(words, tokens))
    return next((fallback for wish, fallback in found if fallback and not wish), "")


def _at_otherwise(words: Words) -> Iterator[tuple[str, str]]:
    for i, _ in enumerate(words.words):
        end = words.end_of("otherwise", i)
        if not end and (alone := words.end_of("between", i)):
            beside = (*words.words[max(i - 1, 0) : i], *words.words[alone : alone + 1])
            end = alone if i == 0 or not set(beside).isdisjoint(_MARKS) else 0
        if end and end < len(words.words):
            yield words.part(0, i), words.rest(end)
            return


def _at_condition(words: Words, tokens: Sequence[Token]) -> Iterator[tuple[str, str]]:
    """Yield the halves around a condition under which the wish is impossible: "if there's no room behind it"."""
    for i, _ in enumerate(words.words):
        begin = words.end_of("if", i)
        for kind in ("unable", "hindered") if begin else ():
            limit = next((k for k in range(begin, len(words.words)) if words.words[k] in _MARKS), len(words.words))
            matched = ((k, words.end_of(kind, k)) for k in range(begin, limit))
            start, end = next(((k, end) for k, end in matched if end), (0, 0))
            if not end or (kind == "unable" and not _verb_at(tokens, words.spans, end)):
                continue
            end = min(end, limit)
            until = min(limit, _main_clause(words, tokens, end + (kind == "unable")))
            place = " ".join(filter(None, (words.part(begin, start), words.part(end, until))))
            before, after = words.part(0, i), words.rest(until)
            if before and after:
                yield before, after
            elif not place or kind == "unable" or _tells_place(words, tokens, (begin, start), (end, until)):
                yield place, after or before
            return


def _tells_place(words: Words, tokens: Sequence[Token], *parts: tuple[int, int]) -> bool:
    """Return whether a part of a condition begins with a place, or names a gap: not "if the road is blocked"."""
    told = [words.tokens_of(tokens, start, end) for start, end in parts if start < end]
    named = any(token.category is WordCategory.SPOT for part in told for token in part)
    return named or (bool(told) and bool(told[-1]) and told[-1][0].category in _PLACES)


def _verb_at(tokens: Sequence[Token], spans: Sequence[tuple[int, int]], at: int) -> bool:
    """Return whether a verb begins at a word."""
    begins = spans[at][0] if at < len(spans) else -1
    return any(token.start == begins and token.category is WordCategory.VERB for token in tokens)


def _main_clause(words: Words, tokens: Sequence[Token], start: int) -> int:
    """Return the word at which a command begins after a condition without a comma: "if it's full | park ahead"."""
    verbs = {token.start for token in tokens if token.category is WordCategory.VERB and not token.form}
    later = (k for k in range(start, len(words.words)) if words.spans[k][0] in verbs or words.words[k] == "then")
    return next(later, len(words.words))


def _at_or(text: str, tokens: Sequence[Token]) -> Iterator[tuple[str, str]]:
    """Yield the halves of "behind the van or at the kerb", "in front of or behind it", "at the van or the bus"."""
    for i, token in enumerate(tokens):
        if token.category is not WordCategory.OR or not 0 < i < len(tokens) - 1:
            continue
        before, first, last = tokens[:i], tokens[i + 1], tokens[i - 1]
        if any(one.category in _UNSPLIT for one in before):
            continue  # "not behind the bus or the truck", "until the bus leaves or the light changes"
        wish, fallback = text[: token.start], text[first.start :]
        if first.category in _PLACES and last.category is WordCategory.RELATION:
            yield f"{wish}{text[first.end :]}", fallback
        elif first.category in _PLACES and _names_place(before, first.category):
            yield Words.of(wish).part(0), fallback
        elif first.category in DETERMINERS and (named := [one for one in before if one.category in DETERMINERS]):
            yield wish, f"{text[: named[-1].start]}{fallback}"


def _names_place(tokens: Sequence[Token], like: WordCategory) -> bool:
    """Return whether tokens name a place as another one does: a side beside a side, else any."""
    kinds = (like,) if like is WordCategory.SIDE else _PLACES
    return any(token.category in kinds for token in tokens)

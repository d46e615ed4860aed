"""Parser: a sentence to typed queries, best reading first, or the reason why it is not a driving command."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import islice

from grounding.language.alternatives import Alternatives, as_condition, split_alternatives
from grounding.language.ambiguity import MAX_READINGS, list_alternatives
from grounding.language.between import with_both_ends
from grounding.language.cabin import NOT_CONTROLLED, without_cabin
from grounding.language.conditions import Condition, motion_of, split_condition, until_then, with_reaction
from grounding.language.people import with_people
from grounding.language.problems import ParseProblem, check_type, find_problem
from grounding.language.reading import Reading, compose_doubt
from grounding.language.revised_readings import revise_readings
from grounding.language.semantics.accounting import Account, account_for
from grounding.language.semantics.contrasts.rules import has_partial_repair, resolve_contrasts
from grounding.language.semantics.discourse.interpreter import interpret
from grounding.language.semantics.query_builder import BuiltQuery, build_query
from grounding.language.side_clauses import (
    Split,
    asks_for_place,
    said_whole,
    split_purpose,
    split_reasons,
    split_warning,
)
from grounding.language.syntax.clauses import split_clauses
from grounding.language.syntax.fragments import complete_fragment, complete_last_sentence, drop_opinion, split_run_ons
from grounding.language.syntax.lexicon import Lexicon, default_lexicon
from grounding.language.syntax.quantities import more_words, named_manners, unheld_amounts
from grounding.language.syntax.tagging.tagger import tag
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token, Tokenised, normalise, tokenise_all
from grounding.language.syntax.unitless import guessed_distances, name_units
from grounding.language.syntax.word_categories import WordCategory
from grounding.language.syntax.word_model import common_words, homophones
from grounding.query import Query, Referent
from grounding.vocabulary import STATES

# Most ways to read the words of a sentence, and how much less likely (nats) than the best one they may be.
_MAX_WAYS, _MAX_LOSS = 6, 4.0
# Most ways to read a text as two sentences.
_MAX_SPLITS = 8
# Characters read in all ways together, which bounds the time of long texts.
_MAX_CHARACTERS_READ = 2000


def parse(
    text: str, lexicon: Lexicon | None = None, antecedent: Referent | None = None, *, revised: bool = True
) -> Reading:
    """Return the best reading of a sentence; any text is accepted. Arguments as in `parse_all`."""
    return parse_all(text, lexicon, antecedent, revised=revised)[0]


def parse_all(
    text: str,
    lexicon: Lexicon | None = None,
    antecedent: Referent | None = None,
    verb: str = "",
    *,
    revised: bool = True,
) -> tuple[Reading, ...]:
    """Return all readings of a sentence, best first: between 1 and `MAX_READINGS`; any text is accepted.

    Args:
        text: the sentence.
        lexicon: None: the package's own.
        antecedent: what a pronoun or "one" refers to if the sentence does not name it, such as the referent of the
            command before.
        verb: verb class of the command before, which completes a sentence without a verb; '': none.
        revised: whether the reader network revises the grammar's reading. It reads sentences that stand alone, and
            so none with an antecedent or a verb.

    Raises:
        CommandError: if the text is no string.
        DataError: if the weights of the reader network are missing or damaged.
    """
    check_type(text)
    if len(text) > MAX_CHARACTERS:
        too_long = ParseProblem(f"expected at most {MAX_CHARACTERS} characters, got {len(text)}")
        return (Reading(Query(command=text[:MAX_CHARACTERS]), problem=too_long),)
    normalised, words = normalise(text), lexicon or default_lexicon()
    if (cabin := without_cabin(normalised)) is not None:
        kept, left_out = cabin
        told = parse_all(kept, lexicon, antecedent, verb, revised=revised)
        if told[0].problem:
            return (Reading(Query(command=text), problem=ParseProblem(NOT_CONTROLLED)),)
        note = f"'{left_out}' is left out: {NOT_CONTROLLED}"
        return tuple(replace(said_whole(one, text), notes=(*one.notes, note)) for one in told)
    if condition := as_condition(normalised):
        asked = parse_all(condition, lexicon, antecedent, verb, revised=revised)
        return tuple(said_whole(one, text) for one in asked)
    most = max(1, min(_MAX_WAYS, _MAX_CHARACTERS_READ // (len(normalised) + 1)))
    ways = tokenise_all(normalised, words, most)
    tagged = tag(ways[0].tokens)

    def read_without(side: Split) -> tuple[Reading, ...]:
        rest = parse_all(side.command, lexicon, antecedent, verb, revised=revised)
        return tuple(said_whole(one, text) for one in rest)

    if (warning := split_warning(normalised, tagged)) is not None:
        rest = read_without(warning)
        if asks_for_place(rest[0].query):
            heeded = f"'{warning.beside}' is heeded on the way, and tells no place"
            return tuple(replace(one, notes=(*one.notes, heeded)) for one in rest)
    if (purpose := split_purpose(normalised, tagged)) is not None:
        rest = read_without(purpose)
        plain = rest[0].is_plain or (
            rest[0].query.referent is None and not (rest[0].doubt or rest[0].query.unresolved)
        )
        if rest[0].query.action is not None and plain:
            return tuple(replace(one, dropped=(*one.dropped, purpose.beside)) for one in rest)
    if cases := _read_condition(text, split_condition(normalised, tagged), words, antecedent, revised):
        return cases
    if wishes := _read_alternatives(text, split_alternatives(normalised, tagged), words, antecedent, revised):
        return wishes
    likely = [_Analysis(text, way, antecedent, verb) for way in ways if way.cost <= ways[0].cost + _MAX_LOSS]
    # Words that are all known as they are written are not corrected into a command.
    likely = likely[:1] if _is_clean(ways[0]) else likely
    commands = [one for one in likely if one.built.query.action is not None]
    if not commands:

        def is_command(other: str) -> bool:
            return _Analysis(text, tokenise_all(other, words, 1)[0], antecedent, verb).built.query.action is not None

        problem = find_problem(normalised, ways[0].tokens, words, is_command)
        readings: tuple[Reading, ...] = (likely[0].reading(likely[0].built.query, 0.0, problem),)
    else:
        first, *others = _best_readings(commands)
        plainly = partial(parse, lexicon=words, revised=False)
        first = with_reaction(first, normalised, tagged, plainly)
        readings = (first,) if first.condition else (first, *others)
    alone = antecedent is None and not verb
    if not (revised and alone) or readings[0].condition:
        return readings
    first, *others = revise_readings(readings, name_units(ways[0].tokens))
    if not first.problem and (first.doubt or first.revised):
        for side in split_reasons(normalised, tagged):
            first_of_rest, *_ = rest = read_without(side)
            if first_of_rest.query.action == first.query.action and first_of_rest.is_plain:
                return tuple(replace(one, dropped=(*one.dropped, side.beside)) for one in rest)
    read = partial(parse, lexicon=words, revised=False)
    return (with_people(with_both_ends(first, normalised, read)), *others)


def _read_condition(
    text: str, condition: Condition | None, lexicon: Lexicon, antecedent: Referent | None, revised: bool
) -> tuple[Reading, ...]:
    """Return the reading of a condition with a command for either case, if both are plain; () for none."""
    if condition is None:
        return ()
    named = parse(f"wait until {condition.clause}", lexicon, antecedent, revised=False)
    halves = (parse(half, lexicon, antecedent, revised=False) for half in (condition.other, condition.then))
    about = next((one.query.referent for one in (named, *halves) if one.query.referent), None)
    about = about and replace(about, qualifiers=tuple(one for one in about.qualifiers if one not in STATES))
    first, second = (
        parse_all(half, lexicon, about or antecedent, revised=revised)[0]
        for half in (condition.then, condition.other)
    )
    if not (first.is_plain and second.is_plain):
        return ()
    both = (said_whole(one, text) for one in (first, second))
    then, other = both
    motion = motion_of(named.tokens[2:])
    if not motion and (plan := until_then(named.query, then, other)):
        return (plan,)
    return (replace(then, otherwise=other, condition=condition.clause, motion=motion),)


def _read_alternatives(
    text: str, splits: Iterable[Alternatives], lexicon: Lexicon, antecedent: Referent | None, revised: bool
) -> tuple[Reading, ...]:
    """Return the readings of a wish with its fallback, of the first split whose wish is plain; () for none.

    A fallback that is not understood is told as dropped, unless it may be a part of the wish.
    """
    for wish, fallback, certain, nearer in splits:
        first = parse_all(wish, lexicon, antecedent, revised=revised)
        if first[0].problem:  # "if there's no space behind it, go on": a place with the verb of the other half
            verb = parse(fallback, lexicon, revised=False).query.action or ""
            first = parse_all(wish, lexicon, antecedent, verb, revised=False)
        if not first[0].is_plain:
            continue
        second = _read_in_context(fallback, lexicon, first[0].query, antecedent, revised)
        if second is not None:
            second = said_whole(second, text)
            return tuple(replace(said_whole(one, text), otherwise=second, prefers_nearer=nearer) for one in first)
        if certain:
            return tuple(replace(said_whole(one, text), dropped=(fallback,)) for one in first)
    return ()


def _read_in_context(
    text: str, lexicon: Lexicon, before: Query, antecedent: Referent | None, revised: bool
) -> Reading | None:
    """Return the plain reading of a text after a command, whose verb and vehicle it may share; None without one."""
    alone = parse(text, lexicon, revised=revised)
    if alone.is_plain and any(token.category is WordCategory.VERB for token in alone.tokens):
        return alone
    referent = before.referent or antecedent
    verbs = (before.action or "", "")
    shared = (parse_all(text, lexicon, referent, verb, revised=False)[0] for verb in verbs)
    return next((one for one in (*shared, alone) if one.is_plain), None)


def _is_clean(way: Tokenised) -> bool:
    """Return whether a way to read a sentence changes no word, and understands all."""
    return not way.corrections and all(token.category is not WordCategory.UNKNOWN for token in way.tokens)


class _Analysis:
    """The analysis of one way to read the words of a sentence."""

    def __init__(self, text: str, way: Tokenised, antecedent: Referent | None, verb: str) -> None:
        self._text, self._antecedent, self.way = text, antecedent, way
        self._written = tag(way.tokens)
        self._tagged = complete_fragment(resolve_contrasts(self._written), verb)
        self.built = self._build(self._tagged)
        if self.built.query.action is None:
            self._read_again()

    def _build(self, tagged: Sequence[Token]) -> BuiltQuery:
        return build_query(self._text, interpret(split_clauses(tagged), self._antecedent))

    def _read_again(self) -> None:
        """Take the reading with the fewest unused words of those with other sentences in it that are commands."""
        whole = (self._written, self._tagged, self.built)
        best, fewest = whole, len(self._written) + 1
        for written in islice(_second_readings(self._written), _MAX_SPLITS):
            self._written, self._tagged = written, resolve_contrasts(written)
            self.built = self._build(self._tagged)
            if self.built.query.action is None:
                continue
            unused = len(account_for(self._tagged, self._build).dropped)
            if unused < fewest:
                best, fewest = (self._written, self._tagged, self.built), unused
        self._written, self._tagged, self.built = best

    @cached_property
    def _account(self) -> Account:
        # Where words were guessed, no clause is mere context.
        strict = has_partial_repair(self._written) or bool(self.way.corrections)
        return account_for(self._tagged, self._build, strict)

    def _doubt_noun(self) -> str:
        """Return the question about an English word that was read as the name of a vehicle: "bust"."""
        guessed = _guessed_name(self.way)
        return f"'{guessed[0]}' was read as '{guessed[1]}': is that what you mean?" if guessed else ""

    def reading(self, query: Query, score: float, problem: ParseProblem | None = None) -> Reading:
        """Return the reading with a query of this analysis."""
        account = Account() if problem else self._account
        doubtful = [*account.doubtful, *_opposites(self.way.corrections)]
        return Reading(
            query,
            score,
            self.way.tokens,
            tuple(_notes(self.way, query)),
            problem,
            steps=_steps_of(query, self.built),
            dropped=account.dropped,
            doubt=compose_doubt(doubtful) or self._doubt_noun(),
            doubtful=tuple(doubtful),
            doubts_strange=bool(doubtful) and doubtful == [*account.strange],
            corrections=self.way.corrections,
        )


def _second_readings(tagged: Sequence[Token]) -> Iterator[list[Token]]:
    """Yield the tokens of a text that is no command with a sentence begun, completed or left out."""
    for change in (split_run_ons, complete_last_sentence, drop_opinion):
        yield from change(tagged)


def _guessed_name(way: Tokenised) -> tuple[str, str] | None:
    """Return the first English word, as written and as read, that was read as the name or colour of a vehicle."""
    names = (WordCategory.NOUN, WordCategory.COLOUR, WordCategory.MAKE, WordCategory.MODEL)
    read = {token.text for token in way.tokens if token.category in names}
    guessed = ((old, new) for old, new in way.corrections if new in read and old in common_words())
    return next((pair for pair in guessed if pair[0] not in homophones()), None)


def _best_readings(analyses: Sequence[_Analysis]) -> tuple[Reading, ...]:
    """Return the likeliest readings of all analyses, one for each query, the best with score 0."""
    found = [
        (score - one.way.cost, query, one)
        for one in analyses
        for query, score in list_alternatives(one.built.query, one.built.postmodifiers)
    ]
    best = max(score for score, _, _ in found)
    unique: dict[Query, tuple[float, _Analysis]] = {}
    for score, query, one in sorted(found, key=lambda each: -each[0]):
        unique.setdefault(query, (score - best, one))
    return tuple(one.reading(query, score) for query, (score, one) in list(unique.items())[:MAX_READINGS])


def _steps_of(query: Query, built: BuiltQuery) -> tuple[Query, ...]:
    """Return the steps of a reading: the main one changes as its query does."""
    if built.steps == (built.query,):
        return (query,)
    main = built.steps[built.main_step]
    changed = {
        name: getattr(query, name)
        for name in ("referent", "secondary", "goal_side")
        if getattr(query, name) != getattr(built.query, name)
    }
    return (*built.steps[: built.main_step], replace(main, **changed), *built.steps[built.main_step + 1 :])


def _opposites(corrections: Sequence[tuple[str, str]]) -> list[str]:
    """Return the written words that a correction turned into their opposite: "unparked" read as "parked"."""
    return [written for written, read in corrections if written in (f"un{read}", f"non{read}", f"in{read}")]


def _notes(way: Tokenised, query: Query) -> list[str]:
    """Return notes on corrected and on ignored words."""
    notes = [f"'{written}' was read as '{read}'" for written, read in way.corrections]
    more = more_words(way.tokens)
    unknown = [one.written for one in way.tokens if one.category is WordCategory.UNKNOWN and one not in more]
    if unknown:
        notes.append("not understood and left out: " + ", ".join(f"'{word}'" for word in unknown[:8]))
    if query.action is not None:
        notes += guessed_distances(way.tokens)
    paced = query.action == "slow_down" or query.pace is not None
    untold = [*unheld_amounts(way.tokens), *([] if paced else named_manners(way.tokens))]
    if query.action is not None and untold:
        notes.append(f"a time, a speed, a limit or a manner is not planned: {', '.join(map(repr, untold))}")
    return notes

"""Words as people type and speak them: misspelt, misheard, doubled, with hesitations and forms of address."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from asking import parse_summary

from grounding.language import CommandError, parse, parse_all, read_lexicon
from grounding.language.syntax.lexicon import default_lexicon
from grounding.language.syntax.spelling import SpellingCandidates, suggest_word
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, tokenise, tokenise_all
from grounding.language.syntax.word_categories import WordCategory

# A sentence as it is typed -> the sentence that is meant.
TYPOS = {
    "prak behind teh silver cra": "park behind the silver car",
    "stop nxt to the rde van": "stop next to the red van",
    "pakr in frnt of the balck bus": "park in front of the black bus",
    "fallow the white trcuk": "follow the white truck",
    "stop behind the bsu": "stop behind the bus",
    "park behindthe blue car": "park behind the blue car",
    "turn lfet at the lihgts": "turn left at the lights",
    "dont stop by the van": "don't stop by the van",
    "go 2 the van b4 the bus": "go to the van before the bus",
}
HOMOPHONES = {
    "park bye the read van": "park by the red van",
    "weight behind the blew truck": "wait behind the blue truck",
    "park bee hind the wight car": "park behind the white car",
    "turn write into the rode": "turn right into the road",
    "stop in fronts of the bus": "stop in front of the bus",
    "stop four metres behind the van": "stop 4 metres behind the van",
    "park there for the buss": "park there for the bus",
    "brake behind the bus": "brake behind the bus",
}
SPOKEN = {
    "hey car, park behind the silver car": "park behind the silver car",
    "okay appo stop by the van": "stop by the van",
    "follow that truck thanks mate": "follow that truck",
    "turn left, Zebedee": "turn left",
    "park um behind the er red errr van": "park behind the red van",
    "stop in, uhm, front of the bus": "stop in front of the bus",
    "park park behind the the van": "park behind the van",
    "PARK BEHIND THE SILVER CAR": "park behind the silver car",
    "overtake the bus please and thank you": "overtake the bus",
}


@pytest.mark.parametrize(("written", "meant"), [*TYPOS.items(), *HOMOPHONES.items(), *SPOKEN.items()])
def test_noisy_sentences_are_read_as_meant(written: str, meant: str) -> None:
    assert parse_summary(written) == parse_summary(meant)


@pytest.mark.parametrize(("written", "meant"), TYPOS.items())
def test_corrections_are_reported(written: str, meant: str) -> None:
    corrections = parse(written).corrections
    text = written
    for wrong, right in corrections:
        assert wrong in text
        text = text.replace(wrong, right)
    # A missing apostrophe is no correction.
    assert text.replace("dont", "don't") == meant
    assert parse(meant).corrections == ()


def test_notes_name_corrected_and_unknown_words() -> None:
    reading = parse("stop behind the fluffy sliver trcuk")
    assert reading.query.referent is not None
    assert (reading.query.referent.colour, reading.query.referent.head) == ("silver", "truck")
    assert reading.notes == (
        "'sliver' was read as 'silver'",
        "'trcuk' was read as 'truck'",
        "not understood and left out: 'fluffy'",
    )
    assert reading.corrections == (("sliver", "silver"), ("trcuk", "truck"))
    assert "".join(token.written for token in reading.tokens) == "stopbehindthefluffyslivertrcuk"


def test_several_corrections_are_several_readings() -> None:
    readings = parse_all("park behind the gren van")
    colours = [one.query.referent.colour for one in readings if one.query.referent]
    assert {"green", "grey"} <= set(colours)
    assert readings[0].score == 0
    assert all(one.corrections for one in readings)


@pytest.mark.parametrize(
    "text",
    [
        "park behind the bin",
        "stop next to the cab",
        "park behind the tank",
        "stop by the canal",
        "park near the market",
        "follow the man",
        "stop at the bank",
        "park near the gold mine",
        "park by the tram",
        "pull over near the red tent",
        "drop me at the barn",
    ],
)
def test_english_words_stay_what_they_are(text: str) -> None:
    reading = parse(text)
    assert reading.corrections == ()


# A sentence that holds a word of each category.
SENTENCES = {
    WordCategory.NOUN: "park behind the {}",
    WordCategory.MAKE: "follow the {}",
    WordCategory.PERSON: "stop next to the {}",
    WordCategory.THING: "park near the {}",
    WordCategory.COLOUR: "stop behind the {} van",
    WordCategory.EXTRA: "stop behind the {} van",
    WordCategory.SUPERLATIVE: "stop behind the {} van",
    WordCategory.REGION: "turn into the {}",
    WordCategory.VERB: "{} the van",
}


@pytest.mark.parametrize("category", SENTENCES)
def test_words_of_the_lexicon_are_not_corrected(category: WordCategory) -> None:
    words = default_lexicon().written_words(category)
    assert [word for word in words if parse(SENTENCES[category].format(word)).corrections] == []


def test_words_that_mean_the_same_are_not_corrections() -> None:
    for word in ("gray", "okay", "metres"):
        assert next(iter(SpellingCandidates(default_lexicon()).of(word))) == (word,)
    assert parse("park behind the gray van").corrections == ()


def test_a_homophone_of_a_command_verb_is_no_command_elsewhere() -> None:
    assert parse("read me the news").query.action is None
    assert parse("buy some milk").query.action is None


def test_words_of_a_lexicon_file_are_corrected_too(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("[noun van]\nhovercraft\n")
    reading = parse("park behind the hovrecraft", read_lexicon(path))
    assert reading.corrections == (("hovrecraft", "hovercraft"),)
    assert reading.query.referent is not None
    assert reading.query.referent.noun == "van"


def test_suggestions_are_words() -> None:
    verbs = default_lexicon().written_words(WordCategory.VERB)
    assert suggest_word("prrk", verbs) == "park"
    assert suggest_word("xyzzy", verbs) is None


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("prak", "park"),
        ("stpo", "stop"),
        ("tunr", "turn"),
        ("behing", "behind"),
        ("vehical", "vehicle"),
        ("teh", "the"),
    ],
)
def test_misspellings_are_no_words_of_the_lexicon(written: str, meant: str) -> None:
    assert written not in default_lexicon().words
    assert (meant,) in SpellingCandidates(default_lexicon()).of(written)


def test_readings_are_ordered_by_cost() -> None:
    ways = tokenise_all("park behind the gren van", most=4)
    assert 1 < len(ways) <= 4
    assert [way.cost for way in ways] == sorted(way.cost for way in ways)


@pytest.mark.parametrize(
    "text", ["a" * (MAX_CHARACTERS - 10), "a " * 990, "park " * 390, "erm " * 490, "prak " * 390]
)
def test_long_texts_are_read(text: str) -> None:
    assert len(tokenise(text.strip())) >= 1


FRAGMENTS = {
    "right": "turn none right",
    "left please": "turn none left",
    "beside the blue car": "park next_to [car blue]",
    "opposite the red estate, if you would": "park opposite [car red]",
    "after that truck pls": "park past [truck]",
    "between the two vans": "park between [van]",
    "any gap on the left is fine": "park none",
    "a space near the bus would be great": "park near [bus]",
}


@pytest.mark.parametrize("text", FRAGMENTS)
def test_fragments_are_commands(text: str) -> None:
    assert parse_summary(text).removesuffix(" left" if "gap" in text else "") == FRAGMENTS[text]


@pytest.mark.parametrize("text", ["the blue van", "the one on the left", "two", "it is next to the van", "straight"])
def test_other_phrases_are_asked_about_at_most(text: str) -> None:
    reading = parse(text)
    assert reading.query.action is None or reading.doubt


@pytest.mark.parametrize("command", [None, b"park", 3, ["park"]])
def test_a_command_is_text(command: Any) -> None:
    with pytest.raises(CommandError, match="expected a command as text"):
        parse(command)

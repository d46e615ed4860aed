"""Spoken language: self-repairs, appositions, ellipses, people and their clothes."""

from __future__ import annotations

import pytest
from asking import parse_summary

from grounding.language import parse, parse_all

SENTENCES = {
    # Self-repairs.
    "park behind the red car. no, the blue one": "park behind [car blue]",
    "stop behind the bus, sorry, i meant the truck": "stop behind [truck]",
    "park behind the bus - no, actually in front of it": "park in_front_of [bus]",
    "turn left, i mean right, at the truck": "turn at [truck] right",
    "follow that car, no wait, follow the bus": "follow none [bus]",
    "park behind the van on the left, no, on the right": "park behind [van right_side]",
    "stop on the left, sorry, on the right": "stop none right",
    "scratch that, park behind the taxi": "park behind [car]",
    "never mind the bus, follow the taxi": "follow none [car]",
    "there is actually no space, stop behind the van": "stop behind [van]",
    "it is not the red car, it's the blue one. stop behind it": "stop behind [car blue]",
    "turn left instead of right after the truck": "turn past [truck] left",
    # Appositions.
    "that is the car, the blue one. get closer": "approach toward [car blue]",
    "park in front of the silver one, the hatchback": "park in_front_of [car silver]",
    "take the exit, the one where the red truck is turning": "turn at [truck red turning]",
    # Ellipses.
    "stop behind the first truck we come to": "stop behind [truck first]",
    "park after the second van you pass": "park past [van second]",
    "i know the driver of that bus, pull alongside": "stop next_to [bus]",
    "the van is double parked, drive round": "overtake none [van parked]",
    "next left, please": "turn none left",
    "left at the lights": "turn at left",
    "park behind the bus everyone is boarding": "park behind [bus]",
    # Wishes and prohibitions.
    "can't we go around that truck": "overtake none [truck]",
    "do you mind parking after the red van": "park past [van red]",
    "what i want is for you to overtake the bus": "overtake none [bus]",
    "let's go after that car, it hit my bike": "follow none [car]",
    "don't let that van merge": "other none [van] merge",
    "don't pass the cyclist until it is clear": "overtake none [bicycle] clear",
    "you are too close to the bus": "None none",
    "my legs hurt": "None none",
    # Purposes of places, gaps.
    "use the gap between the bus and the truck to change lanes": "change_lane between [bus]",
    "look for a place to turn around near the truck": "turn near [truck] around",
    "give the truck room to turn": "give_way none [truck] turn",
    "give the truck a wide berth": "avoid none [truck]",
    "leave 2 metres between us and the van": "avoid none [van] 2 m referent",
    "drive past it": "drive_past past",
    # Ordinals from the end, lengths, colour words.
    "park behind the second to last car on the right": "park behind [car second last right_side]",
    "stop next to the last but one van": "stop next_to [van second last]",
    "park two car lengths behind the red mini": "park behind [car red] 9 m referent",
    "stop a hundred and fifty feet from here": "stop none 45.72 m ego",
    "in a quarter of a mile turn left": "turn none left 402.336 m ego",
    "go another 100 metres and pull over": "pull_over none 100 m ego",
    "park behind the burgundy saloon": "park behind [car burgundy]",
    # People and their things.
    "stop next to the two men with umbrellas": "stop next_to [person]",
    "pick up the woman with the bag on the left": "stop none [person left_side]",
    "stop in front of the man in the yellow jacket on the right": "stop in_front_of [person right_side]",
    "the lady in green is my aunt, stop next to her": "stop next_to [person green]",
    "there's an old man crossing. wait for him": "wait none [person]",
    "that man wants to cross, stop behind the bus and let them": "stop behind [bus]",
    # One of two, between.
    "let the bus pass first": "give_way none [bus] pass",
    "pass the first truck and park behind the second": "park behind [truck second]",
    "park between the two vans": "park between [van]",
    "park between the silver car and the black one": "park between [car silver]",
    "Park behind the red car. No, wait. The blue one.": "park behind [car blue]",
    "park between the lamp post and the red car": "park between [car red]",
    "go left around the stopped taxi": "overtake none [car stopped] left",
}


@pytest.mark.parametrize("text", SENTENCES)
def test_spoken_language(text: str) -> None:
    assert parse_summary(text) == SENTENCES[text]


def test_exclusions_of_self_repairs() -> None:
    (excluded,) = parse("park behind the red car. no, the blue one").query.excluded
    assert (excluded.relation, excluded.noun, excluded.colour) == (None, "car", "red")
    assert parse("do not overtake the lorry, stay behind it").query.excluded == ()
    (place,) = parse("park behind the black car, not in front").query.excluded
    assert (place.relation, place.noun, place.colour) == ("in_front_of", "car", "black")
    (spot,) = parse("take any place except the one next to the truck").query.excluded
    assert (spot.relation, spot.noun) == ("next_to", "truck")


@pytest.mark.parametrize(
    ("text", "in_line"),
    [
        ("follow the car in front of us", True),
        ("pass the car ahead of me", True),
        ("avoid the truck in front", True),
        ("let the van behind us pass", True),
        ("there is a car in front of us. follow it", True),
        ("follow the car up ahead", False),
        ("stop behind the car ahead", False),
    ],
)
def test_phrases_for_the_next_vehicle_in_our_lane(text: str, in_line: bool) -> None:
    referent = parse(text).query.referent
    assert referent is not None
    assert referent.in_line is in_line


@pytest.mark.parametrize(
    "text", ["CJR0MANING0LFT0LEF", "stop behind the car turning left left", "car moving left right"]
)
def test_a_second_direction_of_a_turning_vehicle_is_ignored(text: str) -> None:
    assert parse_all(text)

"""Sentences of many speakers by class, and everyday sentences that are no commands."""

from __future__ import annotations

from pathlib import Path

import pytest
from asking import parse_summary

from grounding.language import parse
from grounding.language.evaluation import read_labelled_commands, score_parser
from grounding.query import Query

SPEAKERS = Path(__file__).parents[3] / "benchmarks" / "grounding_truth" / "speakers"
EVERYDAY = (Path(__file__).parent / "everyday.txt").read_text().splitlines()
# Written class by class beside sentences that had been misread, before the classes were mended.
COMMANDS = {
    # H-dropping, contracted perfect.
    "'Ang on until that fella's walked past": "wait none [person] pass",
    "'Alf a mo, 'old it behind the blue 'atchback": "wait behind [car blue]",
    "Pull over once the bus's gone": "pull_over none [bus] leave",
    "Turn left when that van's cleared the junction": "turn none [van] left clear",
    # Units as nouns.
    "pull into the yard and stop next to the horsebox": "stop next_to [trailer]",
    "turn into the farm yard after the silo": "turn past",
    "reverse into the yard behind the pub": "other behind",
    "stop in the school yard by the red bus": "stop near [bus red]",
    # Refused things with words after.
    "Run the red, come on, keep going": "other none",
    "Drive on the pavement, carry on, it's fine": "other none",
    "Skip the light, just go": "other none",
    "Mount the kerb, keep moving": "other none",
    # Interjections.
    "argh stop behind that van": "stop behind [van]",
    "pfft overtake the tractor already": "overtake none [construction_vehicle]",
    "ooh turn right here": "turn none right",
    "tsk just follow the white car": "follow none [car white]",
    # Side after from without article.
    "Slow down, a car is coming from left": "slow_down none [car moving left_side]",
    "Brake, there is a motorbike approaching from right": "slow_down none [motorcycle oncoming right_side]",
    "Wait for the truck coming from left side": "wait none [truck moving left_side]",
    "Let the bus coming from the right go first": "give_way none [bus moving right_side] pass",
    # Learners' English.
    "Search a parking near the white bus": "park near [bus white]",
    "Search for a place to park in the near of the blue car": "park near [car blue]",
    "Seek a parking place behind the black van": "park behind [van black]",
    "Make parking at the backside of the red truck": "park behind [truck red]",
    # Lane described after its noun.
    "Take the lane in the middle": "change_lane none",
    "Move to the lane on the left": "change_lane none left",
    "Get in the lane on the far right": "change_lane none right",
    "Change to the lane to the left of us": "change_lane none left",
    # Three point turn words.
    "Do a K turn here": "turn none around",
    "Make a three point turn behind the skip lorry": "turn behind [truck] around",
    "Perform a turn in the road after the bus stop": "turn past around",
    "Do a Y turn please": "turn none around",
    # Unless.
    "Go straight on unless I say otherwise": "other none straight",
    "Follow that taxi unless it stops": "follow none [car]",
    "Park behind the van unless there's no room": "park behind [van]",
    "Keep following the bus unless told otherwise": "follow none [bus]",
    # A turn named by the order of streets.
    "Don't take this street, take the next one on the right": "turn none right",
    "skip this turning and take the following one on the left": "turn none left",
    "the next road on the right, turn in there": "turn none right",
    # Spelled letters.
    "follow the b m w": "follow none [car]",
    "park next to the white s u v": "park next_to [car white]",
    "stop behind the u p s van": "stop behind [van]",
    "go past the r v": "drive_past past [van]",
    # Pull into a spot between.
    "slide into the gap between the two cars": "park between [car]",
    "get into the space between the lorry and the taxi": "park between [truck]",
    "move into the spot between the bus and the van": "park between [bus]",
    "pull into the bay between the red car and the tree": "park between [car red]",
    # From behind.
    "Let the ambulance coming from behind pass": "give_way none [vehicle behind_ego] pass",
    "Give way to the fire engine approaching from behind": "give_way none [truck oncoming behind_ego] pass",
    "Make room for the car coming up behind us": "give_way none [car behind_ego]",
    "Let the motorbike from behind overtake": "give_way none [motorcycle behind_ego] pass",
    # Our own car as an object.
    "Bring the car to a stop behind the green bus": "stop behind [bus green]",
    "Stop the car just past the zebra crossing": "stop past",
    "Leave the car in front of the white truck": "park in_front_of [truck white]",
    # Texting.
    "stop @ the bus stop": "stop at",
    "turn lt @ the junction": "turn at left",
    "prk b/w the van & the lorry": "park between [van]",
    "go rt after the truck": "turn past [truck] right",
    # Quantities of room.
    "Give the cyclist loads of room": "avoid none [bicycle]",
    "Leave plenty of space between us and the lorry": "avoid none [truck]",
    "Give that bus lots of space": "avoid none [bus]",
    "Leave heaps of room behind the horse trailer": "avoid none [trailer]",
    # Take position.
    "Take up position behind the red van": "approach behind [van red]",
    "Assume position next to the bus": "approach next_to [bus]",
    "Take your place behind the white car": "approach behind [car white]",
    "Take station astern of the black truck": "approach behind [truck black]",
    # Statement about a pronoun.
    "there's my dad's van, it's the white one, stop beside it": "stop next_to [van white]",
    "I can see her car, it is the blue one, follow it": "follow none [car blue]",
    "That's my taxi, it's the black one, stop behind it": "stop behind [car black]",
    "Mum's car is the green one, park next to it": "park next_to [car green]",
    # Aviation, radio.
    "Request left turn at the junction": "turn at left",
    "Requesting stop behind the white van": "stop behind [van white]",
    "Request overtake of the slow truck": "overtake none [truck]",
    "Proceed to park behind the blue sedan, over": "park behind [car blue]",
    # Contrasts.
    "stop not in front of but behind the blue van": "stop behind [van blue]",
    "pull up not beside but past the truck": "stop past [truck]",
    "park not next to the bus but behind it": "park behind [bus]",
    "you mustn't park before the junction but after it": "park past",
    # Other side of the street.
    "Park on the other side of the street": "park none",
    "Stop on the far side of the road": "stop none",
    "pull over on the opposite side": "pull_over none",
    "Park behind the white car on the other side of the street": "park behind [car white opposite_side]",
    # Lanes.
    "Move to the second lane": "change_lane none",
    "Switch to the middle lane": "change_lane none",
    "Stay in the nearside lane": "other none",
    # Kerb.
    "Stop by the kerb": "stop none",
    "Park at the kerb": "park none",
    "Pull in by the kerb behind the van": "pull_over behind [van]",
    "Halt at the curb": "stop none",
    # Stop line.
    "Creep up to the stop line": "approach toward",
    "Roll up to the line": "stop toward",
    "Edge forward to the stop line": "approach toward",
    "Inch up to the white line": "approach toward",
    # Landmark describing a vehicle.
    "Park behind the van by the crossing": "park behind [van]",
    "Stop next to the car at the lights": "stop next_to [car]",
    "Follow the bus at the junction": "follow none [bus]",
    "Go past the truck by the bus stop": "drive_past past [truck]",
    # One letter away from a lexicon word.
    "stop next to the wharf": "stop next_to",
    "turn left at the vat": "turn at left",
    "park by the cart": "park near",
    "stop behind the cab": "stop behind [car]",
    # Overtake of oncoming.
    "Overtake the oncoming car": "overtake none [car oncoming]",
    "Overtake the car coming towards us": "overtake none [car oncoming]",
}

# Written and labelled before they were read: every second one that is read right, to keep it so.
KEPT = {
    "yo pull in back of that amazon van real quick": "stop behind [van]",
    "dump me at the corner past the taco place": "stop at",
    "At the end of the road turn left": "turn at left",
    "When it's safe, move off and follow the bus": "follow none [bus]",
    "I'd like you to reverse into the bay next to the blue hatchback": "park next_to [car blue]",
    "Give the horse plenty of room when you pass": "avoid none",
    "Keep well back from the lorry in front": "avoid none [truck ahead]",
    "Don't go so close to that van, young man": "avoid none [van]",
    "Would you kindly wait for that gentleman to cross": "wait none [person] pass",
    "go vroom past the slow bus": "drive_past past [bus]",
    "can we park next to the car that looks like lightning mcqueen": "park next_to [car]",
    "i wanna go behind the big yellow digger": "approach behind [construction_vehicle yellow large]",
    "You can put you behind the white car": "approach behind [car white]",
    "Turn yourself at the left after the van": "turn past [van] left",
    "Park in the side of the street near to the black auto": "park near [vehicle black]",
    "behind blue van": "park behind [van blue]",
    "overtake truck left": "overtake none [truck] left",
    "Park behind the red, sorry, the maroon car": "park behind [car maroon]",
    "Anything but behind the bin lorry, park somewhere else": "park none",
    "I didn't say overtake it, I said follow it": "follow none",
    "Take the left lane, wait no, stay in this one": "other none",
    "It's not the black car I want, it's the black van, pull up by it": "stop near [van black]",
    "we don't want the first taxi, we want the second, stop by that one": "stop near [car second]",
    "park behind the why van": "park behind [van]",
    "pull over buy the petrol station": "pull_over near",
    "Hang back until the tram has gone by": "slow_down none [vehicle] pass",
    "When the guy in front finally moves, park where he was": "park at [person ahead] leave",
    "Can you squeeze in between the van and the skip?": "park between [van]",
    "Would it kill you to overtake that thing?": "overtake none",
    "Pull in behind that ute, mate": "park behind [truck]",
    "Reckon you could park near the white ute over there": "park near [truck white]",
    "Make a right at the light and pull up to the curb": "stop toward right",
    "Park catty-corner from the red pickup": "park near [truck red]",
    "Let's go around this garbage truck": "overtake none [truck]",
    "bruh just overtake that slow ahh van": "overtake none [van]",
    "follow that tesla no cap": "follow none [car]",
    "Fall in behind the second truck": "approach behind [truck second]",
    "Come to a halt abreast of the white van": "stop next_to [van white]",
    "Hang on, Dave. Driver, pull over behind that cab.": "pull_over behind [car]",
    "Can we get a move on": "other none",
    "Excuse me, is possible to stop near of the church?": "stop near",
    "Turn on the left after the second car": "turn past [car second] left",
    "Pull up outside number 42": "stop near",
    "Take me round the back of the supermarket": "approach behind",
    "Stop next to the smallest of the three vans": "stop next_to [van smallest]",
    "Get behind the vehicle that's indicating right": "approach behind [vehicle]",
    "Stop behind the car with its boot open": "stop behind [car]",
    "Park behind the car behind the bus": "park behind [car]",
    "Stop about three car lengths behind the bus": "stop behind [bus] 13.5 m referent",
    "Leave a two metre gap to the van in front and stop": "avoid none [van ahead] 2 m referent",
    "Go forward ten feet": "other none 3.048 m ego",
    "Put your foot down a bit": "other none",
    "Take it steady past the school": "slow_down past",
    "Park behind the bus but not the red one": "park behind [bus]",
    "Overtake the bus, not the truck": "overtake none [bus]",
    "Stop next to the van, no sorry, the truck": "stop next_to [truck]",
    "Left, no wait, right": "turn none right",
    "Don't turn left, turn right": "turn none right",
    "Never mind the van, follow the truck": "follow none [truck]",
    "Park near the taxi, but not next to it": "park near [car]",
    "Stop before the bus instead of after it": "stop before [bus]",
    "Park beside any car that isn't white": "park next_to [car]",
    "The red van, not the red car, go behind that": "approach behind [van red]",
    "You needn't stop for the bus, overtake it": "overtake none [bus]",
    "Not so fast": "slow_down none",
    "Don't let that car in": "other none [car] merge",
    "Why don't you park behind the van": "park behind [van]",
    "Park behind, oh no, in front of the jeep": "park in_front_of [car]",
    "Follow the van no the bus": "follow none [bus]",
    "The lorry on the right... no, left. Park behind it.": "park behind [truck left_side]",
    "Drive past the van without stopping": "drive_past past [van]",
    "It isn't the bus but the coach I mean, stop behind it": "stop behind [bus]",
    "Go around the left, not the right, of the truck": "overtake none [truck]",
    "Park behind that truck, the one that's not moving": "park behind [truck stopped]",
    "Stop beside not in front of the shop": "stop next_to",
    "Turn left, scratch that, turn right": "turn none right",
    "Pull over... no, keep going": "other none",
    "The bus or rather the coach in front, follow it": "follow none [bus ahead]",
    "You can stop anywhere as long as it's not behind the bus": "stop none",
    "Never park beside a lorry, park beside that car": "park next_to [car]",
    "Behind the silver, no grey, hatchback": "park behind [car grey]",
    "Park behind the first, sorry, second van": "park behind [van second]",
    "Turn around, on second thoughts carry on": "other none",
    "Wait for me here, don't go away": "wait none",
    "left lane. no wait right lane": "change_lane none right",
    "not the left lane, the right lane": "change_lane none right",
    "The first street left, ah no, sorry, the second street left please": "turn none left",
    "See the grey jeep with the roof box? Behind that": "park behind [car grey]",
    "It is better when we park not beside the bus but behind": "park behind [bus]",
    "go behind the blue car no the other blue car the far one": "approach behind [car blue farthest]",
    "Negative on the red van, pull in behind the red car": "park behind [car red]",
    "hold at the crossing": "stop at",
    "drive up a couple metres": "other none 2 m ego",
    "slow down to 20 km/h": "slow_down none",
    "Ease off, there's a lad stepping out": "slow_down none [person]",
    "Unit four, follow the white van": "follow none [van white]",
    "let her cross, the woman there": "give_way none [person] pass",
    "park behind the red car, not the first one, the other red one": "park behind [car red]",
    "move out around that parked van": "overtake none [van parked]",
}


# Read right, but no more likely so than wrong.
ASKED = ("Take me round the back of the supermarket",)


@pytest.mark.parametrize(("text", "expected"), (COMMANDS | KEPT).items())
def test_classes_of_sentences(text: str, expected: str) -> None:
    assert parse_summary(text) == expected
    assert bool(parse(text).doubt) == (text in ASKED)


@pytest.mark.parametrize("text", EVERYDAY)
def test_everyday_sentences_are_no_commands(text: str) -> None:
    assert parse(text).query.action is None


@pytest.mark.parametrize(
    ("name", "least"),
    [("seen", 0.97), ("unread", 0.97), ("later", 0.88), ("latest_seen", 0.85), ("latest_unread", 0.73)],
)
def test_other_speakers(name: str, least: float) -> None:
    records = read_labelled_commands(SPEAKERS / f"sentences_{name}.jsonl")
    answer = score_parser(records, lambda text: parse(text).query.to_dict()).as_json()
    assert answer["core_parse_right"] >= least


@pytest.mark.parametrize(
    ("text", "goal_side", "road_side"),
    [
        ("park on the left side of the road", "left", None),
        ("park on the other side of the street", None, "opposite"),
        ("stop by the kerb", None, "kerb"),
        ("pull over at the curb", None, "kerb"),
        ("park behind the van at the kerb", None, None),
        ("don't stop on the other side of the road", None, None),
    ],
)
def test_the_side_of_the_road(text: str, goal_side: str | None, road_side: str | None) -> None:
    query = parse(text).query
    assert (query.goal_side, query.road_side) == (goal_side, road_side)


def test_a_side_by_the_traffic_is_left_or_right() -> None:
    kerb, opposite = (Query("", "park", road_side=side) for side in ("kerb", "opposite"))
    assert [kerb.on_side(traffic).goal_side for traffic in (1, -1)] == ["right", "left"]
    assert [opposite.on_side(traffic).goal_side for traffic in (1, -1)] == ["left", "right"]
    assert Query("", "park", goal_side="right", road_side="opposite").on_side(1).goal_side == "right"


def test_what_is_refused_is_refused_whatever_follows() -> None:
    for text, manoeuvre in (
        ("jump the light, go on", "red_light"),
        ("mount the kerb, keep moving", "pavement"),
        ("go on", "onward"),
    ):
        assert parse(text).query.manoeuvre == manoeuvre


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("there are two trucks ahead park behind the red one", "park behind [truck red ahead]"),
        ("do you see the yellow truck stop next to it", "stop next_to [truck yellow]"),
        ("I want to look at that bike pull over", "pull_over none [motorcycle]"),
        ("I can see the car park behind it", "park behind [car]"),
    ],
)
def test_sentences_that_run_on(text: str, expected: str) -> None:
    assert parse_summary(text) == expected


@pytest.mark.parametrize(
    "text", ["why did the car in front stop", "did the van park behind us", "the bus will stop here"]
)
def test_questions_and_statements_are_not_split(text: str) -> None:
    reading = parse(text)
    assert reading.query.action is None or reading.doubt


def test_an_english_word_that_is_read_as_a_vehicle_is_asked_about() -> None:
    reading = parse("park behind the bust")
    assert reading.query.referent is not None
    assert reading.query.referent.noun == "bus"
    assert "'bust' was read as 'bus'" in reading.doubt
    assert parse("park behind the bux").doubt == ""


def test_known_words_are_not_corrected_into_a_command() -> None:
    assert parse("very nice driving, thank you so much").query.action is None
    assert parse("weight behind the van").query.action == "wait"

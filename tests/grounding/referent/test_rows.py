"""Rows and queues: from which of several vehicles a place is measured."""

import numpy as np
import pytest
from asking import VAN_WLH_M
from street import BLUE, RED, WHITE, Street

from grounding import Answer


def street() -> Street:
    """Three cars at our kerb, one farther on, and one across the road that faces us."""
    cars = Street().car("a", 10, -6).car("b", 16, -6, BLUE).car("c", 22, -6, RED)
    return cars.car("far", 46, -6).car("across", 14, 6, WHITE, np.pi)


def ask(text: str, scene: Street | None = None) -> Answer:
    return (scene or street()).grounder().ground(text)


def meant(answer: Answer) -> str:
    assert answer.referent is not None, answer.text()
    return answer.referent.item.id


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("stop past the parked cars", "c"),
        ("park in front of the row of cars on the right", "c"),
        ("drive past the parked cars on the right", "c"),
        ("stop before the row of parked cars", "a"),
        ("park behind the line of cars on the right", "a"),
    ],
)
def test_a_place_at_a_row_is_at_its_end(text: str, end: str) -> None:
    answer = ask(text)
    assert meant(answer) == end
    assert "at the end of a row of 3" in answer.text()
    assert "left out" not in answer.text()


def test_one_vehicle_alone_is_no_row() -> None:
    answer = ask("stop past the vans", Street().car("v", 14, -6, size_wlh_m=VAN_WLH_M))
    assert "row" not in answer.text()


@pytest.mark.parametrize("text", ["overtake the queue", "stop behind the queue", "join the back of the queue"])
def test_a_queue_is_ahead_of_us_in_our_lane(text: str) -> None:
    empty = ask(text)
    assert empty.status == "not_found"
    assert "no queue is seen" in empty.text()
    queue = street().car("q1", 14, 0).car("q2", 20, 0)
    assert meant(ask(text, queue)) == ("q2" if text.startswith("overtake") else "q1")

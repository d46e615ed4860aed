"""Conversations with the page, without a browser."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from starlette.testclient import TestClient

from cli.server.moments import Moments

pytest_plugins = ["page_fixtures"]

FRAMES = 4


def talk(client: TestClient, at: str, **more: Any) -> dict[str, Any]:
    key = at.split("/")[3]
    answer = client.post("/api/talk", json={"recording": key, "scene": 0, "source": "predicted", "frame": 1, **more})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_an_ambiguous_sentence_asks_and_a_choice_answers(client: TestClient, at: str) -> None:
    asked = talk(client, at, say="stop behind the white car")
    assert asked["turns"][0]["status"] == "ambiguous"
    assert asked["turns"][0]["question"].endswith("?")
    left = next(one for one in asked["candidates"] if "left" in one["words"])
    chosen = talk(client, at, talk=asked["talk"], choose=left["key"])
    assert [turn["status"] for turn in chosen["turns"]] == ["ambiguous", "ok"]
    assert chosen["shown"]["referents"] == left["ids"]
    assert len(chosen["shown"]["target"]["footprint"]) == 4
    assert len(chosen["shown"]["route"]) > 1
    assert client.get(f"/api/talk/{asked['talk']}").json() == chosen, "a page that is loaded again gets the same"


def test_a_sentence_that_finds_nothing_does_not_offer_the_vehicles_of_the_goal_before(
    client: TestClient, at: str
) -> None:
    first = talk(client, at, say="stop next to the nearest car")
    assert first["candidates"]
    lost = talk(client, at, talk=first["talk"], say="turn left at the next junction")
    assert lost["turns"][-1]["status"] == "not_found"
    assert lost["candidates"] == []


def test_an_aside_does_not_offer_the_vehicles_of_a_sentence_that_found_nothing(client: TestClient, at: str) -> None:
    goal = talk(client, at, say="stop behind the red car")
    lost = talk(client, at, talk=goal["talk"], say="stop behind the bus")
    assert lost["turns"][-1]["status"] == "not_found"
    told = talk(client, at, talk=goal["talk"], say="where are you heading?")
    assert told["turns"][-1]["goal"] == goal["turns"][-1]["goal"]
    assert (told["question"], told["candidates"], told["replies"]) == ("", [], [])


def test_a_question_stays_open_over_an_aside_and_is_told_with_its_buttons(client: TestClient, at: str) -> None:
    goal = talk(client, at, say="stop behind the red car")
    asked = talk(client, at, talk=goal["talk"], say="park behind the white car")
    aside = talk(client, at, talk=goal["talk"], say="where are you heading?")
    assert aside["turns"][-1]["question"] == "", "the aside is about the goal"
    assert aside["question"] == asked["turns"][-1]["question"] != ""
    assert aside["candidates"] == asked["candidates"]


def test_a_proposal_is_answered_by_yes_or_no_at_the_next_frame_too(client: TestClient, at: str) -> None:
    asked = talk(client, at, source="exact", say="park behind the black car")
    assert asked["question"].endswith("shall we follow it?")
    later = talk(client, at, source="exact", talk=asked["talk"], frame=2)
    assert (later["question"], later["replies"]) == (asked["question"], ["yes", "no"])
    agreed = talk(client, at, source="exact", talk=asked["talk"], frame=2, say="yes")
    assert agreed["turns"][-1]["status"] == "ok"


def test_pairs_are_told_apart_and_chosen_as_pairs(client: TestClient, at: str) -> None:
    asked = talk(client, at, say="park between two cars")
    offered = asked["candidates"]
    assert len(offered) > 1
    assert len({one["words"] for one in offered}) == len({one["key"] for one in offered}) == len(offered)
    assert all(len(one["ids"]) == 2 for one in offered)
    same_first = [one for one in offered if one["ids"][0] == offered[0]["ids"][0]]
    assert len(same_first) > 1, "pairs that share a vehicle"
    chosen = talk(client, at, talk=asked["talk"], choose=same_first[-1]["key"])
    assert chosen["turns"][-1]["said"] == f"the {same_first[-1]['words']}"
    assert same_first[-1]["key"] not in {one["key"] for one in chosen["candidates"]}


def test_the_goal_follows_the_scene(client: TestClient, at: str) -> None:
    first = talk(client, at, frame=1, say="stop behind the red car")
    later = talk(client, at, frame=3, talk=first["talk"])
    assert later["about"]["frame"] == 3
    assert later["shown"]["referents"] == first["shown"]["referents"]
    before, after = (one["shown"]["target"] for one in (first, later))
    assert after["ego_m"][0] == pytest.approx(before["ego_m"][0] - 2.0, abs=1.0)
    assert after["world_m"] == pytest.approx(before["world_m"], abs=1.0)


@pytest.mark.parametrize("text", ["which cars do you see?", "hello there"])
def test_an_answer_in_words_leaves_the_goal_in_view(text: str, client: TestClient, at: str) -> None:
    goal = talk(client, at, say="stop behind the red car")
    told = talk(client, at, talk=goal["talk"], say=text)
    assert told["turns"][-1]["goal"] is None, "the plan is not repeated"
    assert told["shown"]["target"] == goal["shown"]["target"]
    assert told["candidates"] == []
    assert talk(client, at, talk=goal["talk"], say="never mind")["shown"]["target"] is None


@pytest.mark.parametrize(
    ("text", "status"), [("stop behind the purple bus", "not_found"), ("stop behind the white car", "ambiguous")]
)
def test_the_goal_in_force_is_shown_at_once_after_nothing_was_found_or_a_question(
    text: str, status: str, client: TestClient, at: str
) -> None:
    goal = talk(client, at, say="stop behind the red car")
    told = talk(client, at, talk=goal["talk"], say=text)
    assert told["turns"][-1]["status"] == status
    assert told["shown"]["target"] == goal["shown"]["target"]
    assert told["shown"]["referents"] == goal["shown"]["referents"]
    later = talk(client, at, talk=goal["talk"], frame=2)
    assert later["shown"]["referents"] == goal["shown"]["referents"]
    same = [{key: one[key] for key in ("number", "key")} for one in told["candidates"]]
    assert [{key: one[key] for key in ("number", "key")} for one in later["candidates"]] == same


def test_a_goal_whose_vehicle_is_lost_is_told(client: TestClient, at: str, monkeypatch: pytest.MonkeyPatch) -> None:
    goal = talk(client, at, say="stop behind the red car")
    assert goal["lost"] == ""
    monkeypatch.setattr(Moments, "vehicles", lambda *_: (None, ()))
    later = talk(client, at, talk=goal["talk"], frame=2)
    assert "lost" in later["lost"]
    assert later["shown"] is None
    assert talk(client, at, talk=goal["talk"], frame=2, say="never mind")["lost"] == ""


def test_another_source_begins_another_conversation(client: TestClient, at: str) -> None:
    first = talk(client, at, say="stop behind the red car")
    other = talk(client, at, talk=first["talk"], source="exact", say="where are you heading?")
    assert len(other["turns"]) == 1
    assert other["turns"][0]["goal"] is None


def test_a_forgotten_conversation_begins_anew(client: TestClient, at: str) -> None:
    fresh = talk(client, at, talk="long ago", say="stop behind the red car")
    assert fresh["talk"] != "long ago"
    assert len(fresh["turns"]) == 1


def test_a_vehicle_that_was_not_offered_cannot_be_chosen(client: TestClient, at: str) -> None:
    asked = talk(client, at, say="stop behind the white car")
    body = {"recording": at.split("/")[3], "source": "predicted", "frame": 1, "talk": asked["talk"], "choose": "x"}
    answer = client.post("/api/talk", json=body)
    assert answer.status_code == 404
    assert "say it again" in answer.json()["error"]


@pytest.mark.parametrize("source", ["", "../..", "/etc", "none"])
def test_a_conversation_needs_a_source_of_the_recording(source: str, client: TestClient, at: str) -> None:
    body = {"recording": at.split("/")[3], "source": source, "say": "stop"}
    assert client.post("/api/talk", json=body).status_code in (400, 404)


@pytest.mark.parametrize("text", ["", "   ", "\u202e\x00\x07", "park " * 200])
def test_what_is_no_sentence_is_refused(text: str, client: TestClient, at: str) -> None:
    body = {"recording": at.split("/")[3], "source": "predicted", "say": text}
    answer = client.post("/api/talk", json=body)
    assert answer.status_code == 400
    assert "expected a sentence" in answer.json()["error"]


@pytest.mark.parametrize(
    "text", ["<img src=x onerror=alert(1)>", "'; DROP TABLE sample; --", "\u4f60\u597d", "🚗" * 50]
)
def test_strange_sentences_are_answered(text: str, client: TestClient, at: str) -> None:
    assert talk(client, at, say=text)["turns"][0]["said"] == text


def test_ten_clients_talk_and_look_at_once(client: TestClient, at: str) -> None:
    outcomes: list[tuple[int, int]] = []

    def use(number: int) -> None:
        found = talk(client, at, frame=number % FRAMES, say="stop behind the red car")
        again = talk(client, at, frame=(number + 1) % FRAMES, talk=found["talk"])
        picture = client.get(f"{at}/{number % FRAMES}/map.png?source=predicted")
        outcomes.append((len(again["turns"]), picture.status_code))

    threads = [threading.Thread(target=use, args=(number,)) for number in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes == [(1, 200)] * 10

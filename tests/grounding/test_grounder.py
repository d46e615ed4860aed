"""The face of the package, and the settings of a grounder."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from street import RED, WHITE, Street

import grounding
from appocc.bevmap import BEVMap
from appocc.errors import AppoccError, DataError
from grounding import Answer, Grounder, GrounderConfig, Query, Target
from grounding.language.llm import ChatEndpoint
from grounding.language.syntax.lexicon import read_lexicon

LEXICON = "[noun car]\nwagonette\n"


def test_the_face_of_the_package() -> None:
    assert sorted(grounding.__all__) == [
        *("Answer", "DrivingStyle", "Grounder", "GrounderConfig", "Query", "Session", "Target")
    ]
    assert set(grounding.__all__) <= set(dir(grounding))
    with pytest.raises(AttributeError, match="has no attribute 'Sessions'"):
        getattr(grounding, "Sessions")  # noqa: B009 - not in the type


def test_an_answer_by_the_face() -> None:
    grounder = Grounder()
    street = Street().car("red", 14, -3, RED).car("white", 22, -3, WHITE)
    grounder.set_scene(street.bev(), street.boxes())
    answer = grounder.ground("park behind the red car")
    assert isinstance(answer, Answer)
    assert isinstance(answer.query, Query)
    assert isinstance(answer.target, Target)


def test_the_language_starts_without_scenes_and_goals() -> None:
    program = (
        "import sys, grounding.language.parser; print(*sorted(m for m in sys.modules if m.startswith('grounding')))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = run.stdout.split()
    assert "grounding.language.parser" in loaded
    assert not [name for name in loaded if name.split(".")[1:2] in (["referent"], ["goal"], ["road"], ["grounder"])]


@pytest.mark.parametrize("kind", [Path, str, read_lexicon])
def test_a_lexicon_of_ones_own(tmp_path: Path, kind: type) -> None:
    (tmp_path / "words.txt").write_text(LEXICON)
    street = Street().car("red", 14, -3, RED)
    grounder = Grounder(lexicon=kind(tmp_path / "words.txt"))
    grounder.set_scene(street.bev(), street.boxes())
    assert grounder.ground("park behind the wagonette").status == "ok"


def test_a_lexicon_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.txt"):
        Grounder(lexicon=tmp_path / "none.txt")


def test_the_lexicon_holds_beside_a_language_model(tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text(LEXICON)
    street = Street().car("red", 14, -3, RED)
    # Nothing answers at this port.
    grounder = Grounder(lexicon=tmp_path / "words.txt", llm=ChatEndpoint("http://127.0.0.1:9", "m", timeout_s=2.0))
    grounder.set_scene(street.bev(), street.boxes())
    assert grounder.ground("park behind the wagonette").status == "ok"
    answer = grounder.ground("glorp behind the wagonette")
    assert answer.status == "ambiguous"  # only the reader network takes it for a command, and asks
    assert any("language model was not used" in reason for reason in answer.reasons)


def test_tracks_need_the_pose_of_the_ego() -> None:
    with pytest.raises(AppoccError, match="expected world_from_ego with tracks"):
        Grounder().set_scene(Street().bev(), [])


def test_an_answer_fits_a_line() -> None:
    grounder = Street().car("red", 14, -3, RED).grounder()
    shown = repr(grounder.ground("park behind the red car"))
    assert shown.startswith("Answer(status='ok', command='park behind the red car', referent='red', target=(")
    assert len(repr(grounder.ground("park " * 300))) < 160


def test_the_number_of_candidates_is_set() -> None:
    street = Street()
    for i in range(5):
        street.car(str(i), 8 + 6 * i, -5, WHITE)
    grounder = Grounder(config=GrounderConfig(max_candidates=3))
    grounder.set_scene(street.bev(), street.boxes())
    assert len(grounder.ground("park behind the white car").candidates) == 3


def test_guesses_are_trusted_if_set() -> None:
    street = Street().car("behind", -12.0, -3.0, RED)
    bev = street.bev()
    ahead = np.broadcast_to(bev.grid.centres()[..., 0] > -5, bev.occupancy.shape).copy()
    predicted: BEVMap = replace(
        bev,
        occupancy_valid=ahead,
        appearance_valid=ahead[0].copy(),
        meta={"thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}},
    )
    statuses = []
    for trust in (False, True):
        grounder = Grounder(config=GrounderConfig(trust_unseen=trust))
        grounder.set_scene(predicted)
        statuses.append(grounder.ground("park behind the red car behind us").status)
    assert statuses == ["not_found", "ok"]

"""Cases with known answers: are they made and judged right? On a made street whose vehicles are known by heart."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from appocc.bevmap import VEHICLE
from appocc.boxes import Boxes
from appocc.geometry import footprints
from appocc.rasterise import polygon_cover
from benchmarks.grounding_cases import Asked, judge, main, noisy_map, summary, table, violations
from benchmarks.grounding_truth.case_generation import OF_MANY, SUITS, Case, GeneratedCases, make_cases
from benchmarks.grounding_truth.key_frames import Town, TrueFrame, Vehicle
from benchmarks.grounding_truth.sentences import CALLED, Description

pytest_plugins = ["town_fixtures"]

TURNS = np.radians(np.arange(-10, 11, 5))

# Cases ------------------------------------------------------------------------------------------------------------


def test_cases_of_every_kind_and_relation_are_made(made: GeneratedCases) -> None:
    groups = {
        kind: {case.group for case in made.cases if case.kind == kind} for kind in ("one", "ambiguous", "absent")
    }
    assert groups["one"] == set(SUITS)
    assert len(groups["absent"]) > 5
    assert groups["absent"] <= set(OF_MANY)
    assert {"near", "next_to", "toward"} <= groups["ambiguous"] <= set(OF_MANY)
    assert {case.relation for case in made.cases} >= {"follow", "overtake", "drive_past"}
    assert len({case.sentence for case in made.cases}) > 0.8 * len(made.cases)


def test_the_best_place_lies_in_its_region_and_is_free(made: GeneratedCases, town: Town) -> None:
    """Judged by the exact cover of the footprint's polygon, which the regions do not use."""
    ones = [case for case in made.cases if case.kind == "one"]
    assert len(ones) > 40
    for case in ones:
        moment = town.moment(case.token)
        assert case.region is not None
        assert case.region.cells[tuple(moment.bev.grid.cell_of(case.region.best_m))]
        corners = [
            footprints(case.region.best_m, yaw + turn, [4.6, 1.9]) for yaw in case.region.yaws_rad for turn in TURNS
        ]
        taken = [polygon_cover(moment.bev.grid, one)[moment.occupied].max(initial=0.0) for one in corners]
        assert min(taken) == 0.0


def test_whom_a_case_means_is_the_only_one(made: GeneratedCases, town: Town) -> None:
    """By brute force over true attributes, margins left out."""
    for case in made.cases:
        everybody = town.moment(case.token).vehicles
        for said, v in zip(case.said, case.vehicles if case.kind == "one" else [None] * 2, strict=False):
            fitting = sorted((one for one in everybody if fits(said, one)), key=lambda one: one.xy_m[0])
            count = {"one": 1, "absent": 0}.get(case.kind, 2)
            if case.relation == "between" and case.said[0] == case.said[1]:
                count = 2
            if said.order is None:
                assert len(fitting) == count or (case.kind == "ambiguous" and len(fitting) > 2)
            if v is not None:
                assert v.instance in [one.instance for one in chosen(said, fitting)]


def fits(said: Description, v: Vehicle) -> bool:
    """Whether a vehicle ahead is what is said, by plain comparison."""
    return (
        v.xy_m[0] > 0
        and said.noun in (CALLED[v.body][0], "vehicle")
        and said.paint in (v.paint, None)
        and said.side in ("left" if v.xy_m[1] > 0 else "right", None)
        and said.state in ("parked" if v.speed_mps == 0 else "moving", None)
        and (not said.lane or abs(v.xy_m[1]) < 1)
    )


def chosen(said: Description, fitting: list[Vehicle]) -> list[Vehicle]:
    """Those that an order leaves."""
    keys = {
        "nearest": lambda v: v.distance_m,
        "farthest": lambda v: -v.distance_m,
        "last": lambda v: -v.xy_m[0],
        "leftmost": lambda v: -v.xy_m[1],
        "rightmost": lambda v: v.xy_m[1],
    }
    if said.order in keys:
        return sorted(fitting, key=keys[said.order])[:1]
    numbers = {"first": 0, "second": 1, "third": 2}
    return fitting if said.order is None else fitting[numbers[said.order] :][:1]


def test_the_same_seed_makes_the_same_cases(town: Town) -> None:
    one, again, other = (make_cases(town, 40, seed, False, lambda _: None).cases for seed in (1, 1, 2))
    assert [case.sentence for case in one] == [case.sentence for case in again]
    assert [case.sentence for case in one] != [case.sentence for case in other]


def test_from_a_map_alone_nothing_is_said_of_speeds_and_kinds_that_look_alike(town: Town) -> None:
    cases = make_cases(town, 60, 1, True, lambda _: None).cases
    assert not [case for case in cases if re.search(r"\b(parked|moving)\b", case.sentence)]
    assert not [case for case in cases if case.kind == "absent" and case.said[0] == Description("van")]


# Judging ----------------------------------------------------------------------------------------------------------


def answer(case: Case, moment: TrueFrame, **changed: object) -> Asked:
    """What a product that is always right answers."""
    found = tuple((v.instance, v.xy_m) for v in case.vehicles)
    if case.region is None:
        return Asked("ambiguous" if case.kind == "ambiguous" else "not_found", "", candidates=found)
    cell = moment.bev.grid.cell_of(case.region.best_m)
    right = Asked("ok", "", (int(cell[0]), int(cell[1])), case.region.best_m, case.region.yaws_rad[0], found)
    return right._replace(**changed)  # type: ignore[arg-type]


def test_right_answers_are_right_and_wrong_ones_wrong(made: GeneratedCases, town: Town) -> None:
    judged = []
    for case in made.cases:
        moment = town.moment(case.token)
        verdict = judge(case, answer(case, moment), moment.bev, by_name=True)
        assert verdict.vehicle
        assert verdict.place == (case.kind == "one")
        judged.append(verdict)
        if case.kind == "one":
            assert verdict.off_m == pytest.approx(0.0)
            assert not judge(case, Asked("not_found", ""), moment.bev, True).vehicle
            assert not judge(case, answer(case, moment, status="ambiguous"), moment.bev, True).vehicle
            across = answer(case, moment, yaw_rad=case.region.yaws_rad[0] + np.pi / 2) if case.region else None
            assert across is not None
            assert case.group in ("near", "at", "toward") or not judge(case, across, moment.bev, True).place
        if case.kind == "one" and case.vehicles:
            moved = tuple(("blob 1", v.xy_m + 1.0) for v in case.vehicles)
            far = tuple(("blob 1", v.xy_m + 3.0) for v in case.vehicles)
            assert judge(case, answer(case, moment, vehicles=moved), moment.bev, by_name=False).vehicle
            assert not judge(case, answer(case, moment, vehicles=moved), moment.bev, by_name=True).vehicle
            assert not judge(case, answer(case, moment, vehicles=far), moment.bev, by_name=False).vehicle
    assert table(judged).row_count == len(SUITS) + 1
    lines = summary(judged, made.left_out)
    count = sum(case.kind == "ambiguous" for case in made.cases)
    assert lines[0] == f"ambiguous: {count} of {count} declared"


def test_it_is_told_who_was_asked_about(made: GeneratedCases, town: Town) -> None:
    case = next(case for case in made.cases if case.kind == "one" and case.vehicles)
    bev, asked = town.moment(case.token).bev, Asked("ambiguous", "")
    right, wrong = (
        judge(case, asked._replace(candidates=((name, case.vehicles[0].xy_m),)), bev, by_name=True)
        for name in (case.vehicles[0].instance, "other")
    )
    assert (right.vehicle, right.among) == (False, True)
    assert not wrong.among
    lines = summary([right, wrong], made.left_out)
    assert "asked back though there is one answer: 2, about the right vehicle 1" in lines


def test_violations_are_counted_cell_by_cell(moments: list[TrueFrame]) -> None:
    bev = moments[0].bev
    free = Asked("ok", "", (0, 0), np.array([5.0, 0.0]))
    assert violations(free, bev) == (0, 0)
    on_red = violations(free._replace(place_m=np.array([14.0, -6.6])), bev)
    assert on_red[0] > 40
    assert on_red[1] == 0
    assert violations(free._replace(place_m=np.array([5.0, 7.4])), bev) == (0, 11)
    assert violations(free._replace(place_m=np.array([38.9, 0.0])), bev) == (0, 2)
    assert violations(Asked("not_found", ""), bev) == (0, 0)


def test_a_noisy_map_shows_the_street_otherwise(moments: list[TrueFrame]) -> None:
    exact = moments[0].bev
    shown = [noisy_map(moments[0], np.random.default_rng(seed)) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(shown[0].occupancy, shown[1].occupancy)
    assert (shown[0].occupancy[VEHICLE] != shown[2].occupancy[VEHICLE]).any()
    np.testing.assert_array_equal(shown[0].occupancy[[0, 2]], exact.occupancy[[0, 2]])
    assert set(np.unique(exact.occupancy[VEHICLE])) == {0.0, 1.0}
    assert 0.5 < shown[0].occupancy[VEHICLE][shown[0].occupancy[VEHICLE] > 0].min() < 1.0


def test_the_command_tells_all(town_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([str(town_root), "--cases", "30", "--errors", "--pictures", str(tmp_path / "pictures")])
    printed = capsys.readouterr().out
    assert re.search(r"all +│ \d\d ", printed)
    assert "hard violations: 0 on a vehicle, 0 off the road" in printed
    assert "error," not in printed
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path)])
    assert stopped.value.code == 2
    assert str(tmp_path) in capsys.readouterr().err


def test_boxes_of_an_empty_frame_are_none(moments: list[TrueFrame]) -> None:
    assert len(moments[2].boxes) == len(Boxes.empty())

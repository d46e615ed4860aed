"""Cases with known answers: are their answers right? On a made street whose vehicles are known by heart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from street import BLACK, BLUE, GREEN, RED, WHITE, WORLD_FROM_EGO, Street
from tiny_dataset import TinyDataset

from appocc.bevmap import VEHICLE, bev_path
from appocc.boxes import Boxes
from appocc.errors import DataError
from appocc.geometry import footprints, quaternion_from_yaw, transform, wrap_angle
from appocc.nuscenes.writer import Annotation, Writer, token_of
from appocc.rasterise import polygon_cover
from benchmarks.grounding_cases import Asked, judge, main, noisy_map, summary, table, violations
from benchmarks.grounding_truth.making import OF_MANY, SUITS, Case, Made, make_cases
from benchmarks.grounding_truth.moments import Moment, Town, Vehicle
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.regions import frame_yaw, region
from benchmarks.grounding_truth.sentences import CALLED, Description, describe, meant

NAMES = {RED: "red", BLUE: "blue", WHITE: "white", BLACK: "black", GREEN: "green"}
CAR, VAN, TRUCK = (1.8, 4.4, 1.5), (2.0, 5.4, 2.3), (2.0, 5.4, 1.9)
Row = tuple[str, str, tuple[int, int, int], float, float, float, float]  # name, body, colour, x, y, yaw, speed
# The ego drives at y = 0 on a road from y = -8 to 8; parked rows on both sides, traffic in the lanes.
FRAMES: tuple[tuple[Row, ...], ...] = (
    (
        ("red", "sedan", RED, 14.0, -6.6, 0.0, 0.0),
        ("blue", "van", BLUE, 26.0, -6.6, 0.0, 0.0),
        ("facing", "suv", WHITE, 20.0, 6.6, np.pi, 0.0),
        ("mover", "hatchback", GREEN, 34.0, 0.0, 0.0, 4.0),
    ),
    (
        ("one", "sedan", WHITE, 14.0, -6.6, 0.0, 0.0),
        ("two", "hatchback", WHITE, 16.0, 6.6, np.pi, 0.0),
        ("slow", "pickup", BLUE, 14.0, 0.0, 0.0, 3.0),
        ("hidden", "sedan", BLACK, -20.0, -6.6, 0.0, 0.0),
    ),
    (),
)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset in the form of simulated ones: a key frame each of FRAMES."""
    made = tmp_path_factory.mktemp("made") / "ROOT"
    writer = Writer(made, "v1.0-simulation")
    calibration = writer.add_sensor("scene", "LIDAR_TOP", np.eye(4))
    writer.add("log", "log", logfile="", vehicle="", date_captured="", location="nowhere")
    writer.add("map", "map", category="semantic_prior", filename="", log_tokens=["log"])
    samples = [token_of("sample", n) for n in range(len(FRAMES))]
    scene = writer.add_scene("scene", "", "log", samples)
    for n, (sample, rows) in enumerate(zip(samples, FRAMES, strict=True)):
        writer.add("sample", sample, timestamp=2_000_000 * (n + 1), scene_token=scene, prev="", next="")
        writer.add_file(sample, "LIDAR_TOP", calibration, WORLD_FROM_EGO, 2_000_000 * (n + 1), "none.bin")
        add_frame(writer, scene, sample, rows)
    writer.save()
    return made


def add_frame(writer: Writer, scene: str, sample: str, rows: Sequence[Row]) -> None:
    """The map, the boxes and the paints of a key frame."""
    street, owner = Street(), np.full((200, 200), -1, np.int32)
    for n, (name, body, rgb, x, y, yaw, speed) in enumerate(rows):
        size = {"van": VAN, "pickup": TRUCK}.get(body, CAR)
        before = street.occupancy[VEHICLE] > 0
        street.car(name, x, y, rgb, yaw, speed, size)
        owner[(street.occupancy[VEHICLE] > 0) & ~before] = n
        pose = WORLD_FROM_EGO @ transform(quaternion_from_yaw(yaw), [x, y, size[2] / 2])
        category = "vehicle.truck" if body == "pickup" else "vehicle.car"
        state = "vehicle.parked" if not speed else "vehicle.moving"
        level = "1" if name == "hidden" else "4"
        box = Annotation(name, category, pose, size, state, visibility=level)
        velocity = WORLD_FROM_EGO[:2, :2] @ (speed * np.array([np.cos(yaw), np.sin(yaw)]))
        writer.add_annotation(scene, sample, box, velocity)
        token = token_of("instance", scene, name)
        writer.add_extra("paint", token, instance_token=token, rgb=list(rgb), name=NAMES[rgb], body=body)
    bev = street.bev()
    bev = replace(bev, meta={"instances": [token_of("instance", scene, row[0]) for row in rows]})
    bev.save(bev_path(writer.root, "exact", sample), {"instance": owner})


@pytest.fixture(scope="module")
def town(root: Path) -> Town:
    return Town(root)


@pytest.fixture(scope="module")
def moments(town: Town) -> list[Moment]:
    return [town.moment(sample.token) for sample in town.samples()]


@pytest.fixture(scope="module")
def made(town: Town) -> Made:
    return make_cases(town, 300, 1, False, lambda _: None)


def vehicle(moment: Moment, name: str) -> Vehicle:
    """The one of a row of FRAMES."""
    scene = token_of("scene", "scene")
    return next(v for v in moment.vehicles if v.instance == token_of("instance", scene, name))


# What is there ----------------------------------------------------------------------------------------------------


def test_a_moment_is_what_was_written(moments: list[Moment]) -> None:
    first, second, empty = moments
    red, mover = vehicle(first, "red"), vehicle(first, "mover")
    assert (red.body, red.paint, red.parked, red.visible, red.on_map) == ("sedan", "red", True, True, True)
    assert red.xy_m == pytest.approx([14.0, -6.6])
    assert (red.length_m, red.width_m, red.yaw_rad) == pytest.approx((4.4, 1.8, 0.0), abs=1e-6)
    assert mover.speed_mps == pytest.approx(4.0)
    assert not mover.parked
    assert not mover.stands
    assert red.cells == np.count_nonzero(first.owner == 0) > 40
    assert not vehicle(second, "hidden").visible
    assert first.boxes.velocity_mps[3] == pytest.approx([4.0, 0.0])
    assert empty.vehicles == ()


def test_our_lane_runs_along_the_kerbs(moments: list[Moment]) -> None:
    lane = moments[0].path
    assert lane is not None
    assert lane.bend == pytest.approx([0.0, 0.0, 0.0])
    assert lane.far_m > 38
    assert moments[0].sideways_m(vehicle(moments[0], "red")) == pytest.approx(-6.6)
    assert moments[0].is_in_street(vehicle(moments[0], "red"))


@pytest.mark.parametrize("lacking", ["paint", "body", "velocity"])
def test_what_is_not_simulated_is_told(lacking: str, tiny: TinyDataset) -> None:
    if lacking != "paint":
        paint = {"token": "a", "instance_token": tiny.tables["instance"][0]["token"], "name": "red", "body": "suv"}
        paint.pop(lacking, None)
        tiny.tables["paint"] = [{**paint, "rgb": [1, 2, 3]}]
        tiny.write()
    with pytest.raises(DataError, match=r"paint.json: missing|lacks '(body|velocity)'"):
        Town(tiny.root)


# Where a place is right -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("relation", "name", "ask", "best"),
    [
        ("behind", "red", Ask("park"), (14 - 2.2 - 1.0 - 2.3, -6.6)),
        ("behind", "red", Ask("stop", said_m=4.0), (14 - 2.2 - 4.0 - 2.3, -6.6)),
        ("in_front_of", "blue", Ask("stop"), (26 + 2.7 + 2.0 + 2.3, -6.6)),
        ("behind", "facing", Ask("park"), (20 + 2.2 + 1.0 + 2.3, 6.6)),
        ("in_front_of", "facing", Ask("pull_over"), (20 - 2.2 - 1.5 - 2.3, 6.6)),
        ("behind", "facing", Ask("park", blobs=True), (20 - 2.2 - 1.0 - 2.3, 6.6)),
        ("next_to", "red", Ask("stop"), (14.0, -6.6 + 0.9 + 0.8 + 0.95)),
        ("left_of", "red", Ask("stop"), (14.0, -6.6 + 0.9 + 0.8 + 0.95)),
        ("right_of", "facing", Ask("stop"), (20.0, 6.6 - 0.9 - 0.8 - 0.95)),
        ("before", "red", Ask("pull_over"), (14 - 2.2 - 1.5 - 2.3, -6.6)),
        ("before", "red", Ask("stop"), (14 - 2.2 - 2.0 - 2.3, 0.0)),
        ("past", "blue", Ask("park"), (26 + 2.7 + 1.0 + 2.3, -6.6)),
        ("past", "red", Ask("stop"), (14 + 2.2 + 2.0 + 2.3, 0.0)),
        ("drive_past", "red", Ask("drive_past"), (14 + 2.2 + 6.0 + 2.3, 0.0)),
        ("opposite", "red", Ask("park"), (14.0, 8.0 - 0.3 - 0.95)),
        ("opposite", "facing", Ask("stop"), (20.0, -4.0)),
        ("toward", "red", Ask("approach"), (14 - 2.2 - 2.0 - 2.3, -6.6)),
        ("follow", "mover", Ask("follow"), (34 - 2.2 - 12.0 - 2.3, 0.0)),
        ("follow", "mover", Ask("follow", blobs=True), (34 - 2.2 - 6.0 - 2.3, 0.0)),
    ],
)
def test_the_best_place(moments: list[Moment], relation: str, name: str, ask: Ask, best: tuple[float, float]) -> None:
    found = region(relation, moments[0], [vehicle(moments[0], name)], ask)
    assert found is not None
    assert found.best_m == pytest.approx(best, abs=0.41)


def test_the_best_place_beyond_a_slow_one_between_two_and_of_none(moments: list[Moment]) -> None:
    first, second, empty = moments
    gone = region("overtake", second, [vehicle(second, "slow")], Ask("overtake"))
    gap = region("between", first, [vehicle(first, "red"), vehicle(first, "blue")], Ask("park"))
    ahead = region("none", empty, [], Ask("stop", said_m=12.0))
    aside = region("none", empty, [], Ask("pull_over", side="left"))
    assert gone is not None
    assert gap is not None
    assert ahead is not None
    assert aside is not None
    assert gone.best_m == pytest.approx([14 + 2.7 + 6.0 + 2.3, 0.0], abs=0.41)
    assert gap.best_m == pytest.approx([20.0, -6.6], abs=0.41)
    assert ahead.best_m == pytest.approx([13.3, 0.0], abs=0.41)
    assert aside.best_m[0] == pytest.approx(5.3, abs=1.01)
    assert 8.0 - 0.95 - 1.5 <= aside.best_m[1] <= 8.0 - 0.95
    assert region("none", second, [], Ask("stop", said_m=12.0)) is None, "a pickup is in the way"
    assert region("between", first, [vehicle(first, "red"), vehicle(first, "facing")], Ask("park")) is None


def test_near_and_at_are_all_around(moments: list[Moment]) -> None:
    red = vehicle(moments[0], "red")
    around, at = (region(name, moments[0], [red], Ask("stop")) for name in ("near", "at"))
    assert around is not None
    assert at is not None
    np.testing.assert_array_equal(around.cells, at.cells)
    places = moments[0].centres[around.cells]
    gap = np.maximum(np.abs(places - red.xy_m) - [4.5, 1.85], 0)  # in line with it: half of both sizes
    assert np.hypot(*gap.T).max() <= 6.21
    assert places[:, 0].min() < 5
    assert places[:, 1].max() > 1


def test_what_faces_us_in_our_way_is_seen_from_us_and_doubt_leaves_it_out(moments: list[Moment]) -> None:
    facing = vehicle(moments[0], "facing")
    assert frame_yaw(moments[0], facing, blobs=False) == pytest.approx(facing.yaw_rad)
    assert np.cos(frame_yaw(moments[0], facing, blobs=True) or np.pi) == pytest.approx(1.0)
    for y_m, yaw_rad, expected in ((2.0, np.pi, 0.0), (4.5, np.pi, None), (6.6, np.radians(120), None)):
        moved = facing._replace(instance="moved", xy_m=np.array([20.0, y_m]), yaw_rad=yaw_rad)
        found = frame_yaw(replace(moments[0], vehicles=(moved,)), moved, blobs=False)
        assert (found is None) == (expected is None)
        assert found is None or wrap_angle(found) == pytest.approx(0.0, abs=1e-6)


# Cases ------------------------------------------------------------------------------------------------------------


def test_cases_of_every_kind_and_relation_are_made(made: Made) -> None:
    groups = {
        kind: {case.group for case in made.cases if case.kind == kind} for kind in ("one", "ambiguous", "absent")
    }
    assert groups["one"] == set(SUITS)
    assert len(groups["absent"]) > 5
    assert groups["absent"] <= set(OF_MANY)
    assert {"near", "next_to", "toward"} <= groups["ambiguous"] <= set(OF_MANY)
    assert {case.relation for case in made.cases} >= {"follow", "overtake", "drive_past"}
    assert len({case.sentence for case in made.cases}) > 0.8 * len(made.cases)


def test_the_best_place_lies_in_its_region_and_is_free(made: Made, town: Town) -> None:
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
        taken = [polygon_cover(moment.bev.grid, one)[moment.taken].max(initial=0.0) for one in corners]
        assert min(taken) == 0.0


TURNS = np.radians(np.arange(-10, 11, 5))


def test_whom_a_case_means_is_the_only_one(made: Made, town: Town) -> None:
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


def test_who_counts_and_who_is_told_apart(moments: list[Moment]) -> None:
    first, second, _ = moments
    assert meant(first, Description("car", "red"), False) == vehicle(first, "red")
    assert meant(first, Description("van"), False) is None, "an suv may be called one"
    assert meant(first, Description("van", side="right"), False) == vehicle(first, "blue")
    assert meant(first, Description("car"), False) is None
    assert meant(first, Description("vehicle", order="second", side="right"), False) == vehicle(first, "blue")
    assert meant(first, Description("vehicle", order="third", side="right"), False) is None
    assert meant(second, Description("car", "white"), False) is None
    assert meant(second, Description("car", "white", side="left"), False) == vehicle(second, "two")
    assert meant(second, Description("car", order="nearest"), False) is None, "not by two metres"
    said = describe(second, vehicle(second, "slow"), False, np.random.default_rng(0))
    assert said is not None
    assert meant(second, said, False) == vehicle(second, "slow")
    assert describe(second, vehicle(second, "hidden"), False, np.random.default_rng(0)) is None


# Judging ----------------------------------------------------------------------------------------------------------


def answer(case: Case, moment: Moment, **changed: object) -> Asked:
    """What a product that is always right answers."""
    found = tuple((v.instance, v.xy_m) for v in case.vehicles)
    if case.region is None:
        return Asked("ambiguous" if case.kind == "ambiguous" else "not_found", "", candidates=found)
    cell = moment.bev.grid.cell_of(case.region.best_m)
    right = Asked("ok", "", (int(cell[0]), int(cell[1])), case.region.best_m, case.region.yaws_rad[0], found)
    return right._replace(**changed)  # type: ignore[arg-type]


def test_right_answers_are_right_and_wrong_ones_wrong(made: Made, town: Town) -> None:
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


def test_violations_are_counted_cell_by_cell(moments: list[Moment]) -> None:
    bev = moments[0].bev
    free = Asked("ok", "", (0, 0), np.array([5.0, 0.0]))
    assert violations(free, bev) == (0, 0)
    on_red = violations(free._replace(place_m=np.array([14.0, -6.6])), bev)
    assert on_red[0] > 40
    assert on_red[1] == 0
    assert violations(free._replace(place_m=np.array([5.0, 7.4])), bev) == (0, 11)
    assert violations(free._replace(place_m=np.array([38.9, 0.0])), bev) == (0, 2)
    assert violations(Asked("not_found", ""), bev) == (0, 0)


def test_a_noisy_map_shows_the_street_otherwise(moments: list[Moment]) -> None:
    exact = moments[0].bev
    shown = [noisy_map(moments[0], np.random.default_rng(seed)) for seed in (0, 0, 1)]
    np.testing.assert_array_equal(shown[0].occupancy, shown[1].occupancy)
    assert (shown[0].occupancy[VEHICLE] != shown[2].occupancy[VEHICLE]).any()
    np.testing.assert_array_equal(shown[0].occupancy[[0, 2]], exact.occupancy[[0, 2]])
    assert set(np.unique(exact.occupancy[VEHICLE])) == {0.0, 1.0}
    assert 0.5 < shown[0].occupancy[VEHICLE][shown[0].occupancy[VEHICLE] > 0].min() < 1.0


def test_the_command_tells_all(root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([str(root), "--cases", "30", "--errors", "--pictures", str(tmp_path / "pictures")])
    printed = capsys.readouterr().out
    assert re.search(r"all +│ \d\d ", printed)
    assert "hard violations: 0 on a vehicle, 0 off the road" in printed
    assert "error," not in printed
    with pytest.raises(SystemExit) as stopped:
        main([str(tmp_path)])
    assert stopped.value.code == 2
    assert str(tmp_path) in capsys.readouterr().err


def test_boxes_of_an_empty_frame_are_none(moments: list[Moment]) -> None:
    assert len(moments[2].boxes) == len(Boxes.empty())

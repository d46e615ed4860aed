"""What is right in a key frame: vehicles, places and words, on a made street known by heart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_town import vehicle
from tiny_dataset import TinyDataset

from appocc.errors import DataError
from appocc.geometry import wrap_angle
from benchmarks.grounding_truth.key_frames import Town, TrueFrame
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.regions import frame_yaw, region
from benchmarks.grounding_truth.sentences import Description, command, describe, sole_referent

pytest_plugins = ["town_fixtures"]

# What is there ----------------------------------------------------------------------------------------------------


def test_a_moment_is_what_was_written(moments: list[TrueFrame]) -> None:
    first, second, empty = moments
    red, mover = vehicle(first, "red"), vehicle(first, "mover")
    assert (red.body, red.paint, red.parked, red.visible, red.on_map) == ("sedan", "red", True, True, True)
    assert red.xy_m == pytest.approx([14.0, -6.6])
    assert (red.length_m, red.width_m, red.yaw_rad) == pytest.approx((4.4, 1.8, 0.0), abs=1e-6)
    assert mover.speed_mps == pytest.approx(4.0)
    assert not mover.parked
    assert not mover.stationary
    assert red.cells == np.count_nonzero(first.owner == 0) > 40
    assert not vehicle(second, "hidden").visible
    assert first.boxes.velocity_mps[3] == pytest.approx([4.0, 0.0])
    assert empty.vehicles == ()


def test_our_lane_runs_along_the_kerbs(moments: list[TrueFrame]) -> None:
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
def test_the_best_place(
    moments: list[TrueFrame], relation: str, name: str, ask: Ask, best: tuple[float, float]
) -> None:
    found = region(relation, moments[0], [vehicle(moments[0], name)], ask)
    assert found is not None
    assert found.best_m == pytest.approx(best, abs=0.41)


def test_the_best_place_beyond_a_slow_one_between_two_and_of_none(moments: list[TrueFrame]) -> None:
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


def test_near_and_at_are_all_around(moments: list[TrueFrame]) -> None:
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


def test_what_faces_us_in_our_way_is_seen_from_us_and_doubt_leaves_it_out(moments: list[TrueFrame]) -> None:
    facing = vehicle(moments[0], "facing")
    assert frame_yaw(moments[0], facing, blobs=False) == pytest.approx(facing.yaw_rad)
    assert np.cos(frame_yaw(moments[0], facing, blobs=True) or np.pi) == pytest.approx(1.0)
    for y_m, yaw_rad, expected in ((2.0, np.pi, 0.0), (4.5, np.pi, None), (6.6, np.radians(120), None)):
        moved = facing._replace(instance="moved", xy_m=np.array([20.0, y_m]), yaw_rad=yaw_rad)
        found = frame_yaw(replace(moments[0], vehicles=(moved,)), moved, blobs=False)
        assert (found is None) == (expected is None)
        assert found is None or wrap_angle(found) == pytest.approx(0.0, abs=1e-6)


def test_who_counts_and_who_is_told_apart(moments: list[TrueFrame]) -> None:
    first, second, _ = moments
    assert sole_referent(first, Description("car", "red"), False) == vehicle(first, "red")
    assert sole_referent(first, Description("van"), False) is None, "an suv may be called one"
    assert sole_referent(first, Description("van", side="right"), False) == vehicle(first, "blue")
    assert sole_referent(first, Description("car"), False) is None
    assert sole_referent(first, Description("vehicle", order="second", side="right"), False) == vehicle(first, "blue")
    assert sole_referent(first, Description("vehicle", order="third", side="right"), False) is None
    assert sole_referent(second, Description("car", "white"), False) is None
    assert sole_referent(second, Description("car", "white", side="left"), False) == vehicle(second, "two")
    assert sole_referent(second, Description("car", order="nearest"), False) is None, "not by two metres"
    said = describe(second, vehicle(second, "slow"), False, np.random.default_rng(0))
    assert said is not None
    assert sole_referent(second, said, False) == vehicle(second, "slow")
    assert describe(second, vehicle(second, "hidden"), False, np.random.default_rng(0)) is None


def test_parking_along_the_kerb_is_right_where_our_lane_runs_along_it_too(moments: list[TrueFrame]) -> None:
    empty = moments[2]
    lane = empty.path
    assert lane is not None
    beside = replace(empty)
    beside.__dict__["path"] = lane._replace(bend=np.array([-6.5, 0.0, 0.0]))  # 1.5 m from the kerb at y = -8
    found = region("none", beside, [], Ask("park"))
    assert found is not None
    columns = beside.centres[found.cells][:, 1]
    # On both sides of the lane's middle.
    assert (columns.min(), columns.max()) == pytest.approx((-7.0, -5.8), abs=0.21)


def test_one_stops_in_no_lane_while_changing_it(moments: list[TrueFrame]) -> None:
    empty = moments[2]
    lane = empty.path
    assert lane is not None
    for slope, ours in ((0.04, True), (0.06, False)):
        changing = replace(empty)
        changing.__dict__["path"] = lane._replace(bend=np.array([0.0, slope, 0.0]))
        assert (region("none", changing, [], Ask("stop", said_m=12.0)) is not None) == ours


def test_a_vehicle_in_our_lane_is_followed_in_it(moments: list[TrueFrame]) -> None:
    mover = vehicle(moments[0], "mover")._replace(xy_m=np.array([34.0, 0.9]))
    found = region("follow", replace(moments[0], vehicles=(mover,)), [mover], Ask("follow"))
    assert found is not None
    behind = moments[0].centres[found.cells]
    assert (behind[:, 1].min(), behind[:, 1].max()) == pytest.approx((-1.3, 2.2), abs=0.41)


def test_one_follows_right_behind_it_and_not_behind_another(moments: list[TrueFrame]) -> None:
    mover = vehicle(moments[0], "mover")
    between = mover._replace(instance="between", xy_m=np.array([22.0, 0.5]))
    assert region("follow", replace(moments[0], vehicles=(mover, between)), [mover], Ask("follow")) is None


def test_words_for_two_and_for_one_of_several() -> None:
    car, random = Description("car", "white"), np.random.default_rng(0)
    both = [command("between", Ask("stop"), [(car, "suv"), (car, "sedan")], random) for _ in range(50)]
    assert all("two white cars" in sentence for sentence in both)
    alike = [command("between", Ask("stop"), [(car, "suv"), (car, "suv")], random) for _ in range(50)]
    assert any("two white suvs" in sentence for sentence in alike)
    one = [command("behind", Ask("stop"), [(car, "sedan")], random) for _ in range(300)]
    assert any("there is a white" in sentence.lower() for sentence in one)
    several = [command("behind", Ask("stop"), [(car, "car")], random, definite=True) for _ in range(300)]
    assert not [sentence for sentence in several if " a white" in sentence]


def test_who_counts_suvs_does_not_count_cars() -> None:
    random = np.random.default_rng(0)
    said = [command("behind", Ask("stop"), [(Description("car", order="second"), "suv")], random) for _ in range(100)]
    assert all("second car" in sentence and "suv" not in sentence for sentence in said)

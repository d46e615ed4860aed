from __future__ import annotations

import numpy as np
import pytest
from street import BLACK, EGO, Street

from grounding.goal.candidates import CandidateSet, GoalCandidate
from grounding.goal.search import CandidateSearch
from grounding.referent.scene import SceneModel
from grounding.road.road_map import RoadMap


def scene_and_road(street: Street) -> tuple[SceneModel, RoadMap]:
    scene = street.scene()
    assert scene.bev is not None
    return scene, RoadMap.from_map(scene.bev, scene.objects, EGO)


def candidates_at(
    road: RoadMap, x_m: list[float], costs: list[float], words: str = "there", y_m: float = 0.2
) -> CandidateSet:
    """Candidates on a line ahead with their costs."""
    cells = road.grid.cell_of(np.array([[x, y_m] for x in x_m]).reshape(-1, 2))
    found = CandidateSet(words, cells, np.array(costs, np.float64), np.zeros(len(x_m)), np.array(x_m), "ahead")
    return found.with_detour_cost(road)


def test_the_cheapest_valid_candidate_and_runners_up_apart_from_it() -> None:
    scene, road = scene_and_road(Street().car("c", 20.2, 0, BLACK))
    search = CandidateSearch(
        [candidates_at(road, [20.2, 8.2, 9.0, 13.2, 30.2, 37.0], [0, 1, 2, 3, 4, 50])], scene, road
    )
    best = search.find_best(4)
    assert [road.grid.centre_of(place.cell)[0] for place in best] == pytest.approx([8.2, 13.4, 30.2], abs=0.3)
    assert all(abs(a.cell[0] - b.cell[0]) * 0.4 >= EGO.length_m for a in best for b in best if a is not b)
    assert len(search.find_best()) == 1


def test_the_cost_field_holds_valid_cells() -> None:
    scene, road = scene_and_road(Street().car("c", 20.2, 0, BLACK))
    picture = CandidateSearch(
        [candidates_at(road, [20.2, 8.2], [0, 1]), candidates_at(road, [8.2], [0.5])], scene, road
    ).cost_field()
    assert picture[tuple(road.grid.cell_of([8.2, 0.2]))] == pytest.approx(0.5)
    assert np.isfinite(picture).sum() == 1


def test_excluded_cells_are_left_out() -> None:
    scene, road = scene_and_road(Street())
    excluded = np.zeros(road.grid.shape, np.bool_)
    excluded[tuple(road.grid.cell_of([8.2, 0.2]))] = True
    search = CandidateSearch([candidates_at(road, [8.2], [0.0])], scene, road, excluded=excluded)
    assert search.find_best() == []
    assert search.explain_failure()[2] == ["no place there will do: the best one is ruled out by the command"]


def test_a_detour_has_a_cost() -> None:
    street = Street()
    street.occupancy[0, 115, 80:112] = 0  # a wall across the road but for a gate on the left
    scene, road = scene_and_road(street)
    search = CandidateSearch([candidates_at(road, [14.2], [0.0])], scene, road)
    open_scene, open_road = scene_and_road(Street())
    free = CandidateSearch([candidates_at(open_road, [14.2], [0.0])], open_scene, open_road).find_best()[0]
    assert free.cost < 0.05 < 0.3 < search.find_best()[0].cost


@pytest.mark.parametrize(
    ("x_m", "y_m", "violation"),
    [
        (20.2, 0.2, "is taken by the black car"),
        (8.2, 7.8, "leaves the road"),
        (39.0, 0.2, "leaves the map"),
        (30.2, 0.2, "lies where the map knows nothing"),
    ],
)
def test_violations_in_words(x_m: float, y_m: float, violation: str) -> None:
    street = Street().car("c", 20.2, 0, BLACK)
    street.road_known[172:178] = False
    scene, road = scene_and_road(street)
    search = CandidateSearch([candidates_at(road, [x_m], [0.0], y_m=y_m)], scene, road)
    place, _, words = search.explain_failure()
    assert words == [f"no place there will do: the best one {violation}"]
    assert place is not None
    assert search.explain_violation(place) == violation


def test_the_reference_vehicle_is_not_named() -> None:
    scene, road = scene_and_road(Street().car("c", 20.2, 0, BLACK))
    search = CandidateSearch([candidates_at(road, [20.2], [0.0])], scene, road, [scene.objects[0]])
    assert search.explain_failure()[2] == [
        "no place there will do: the best one comes too close to the vehicle itself"
    ]


def test_a_candidate_with_one_violation_is_reported_before_one_with_two() -> None:
    street = Street().car("c", 20.2, 7, BLACK)
    scene, road = scene_and_road(street)
    search = CandidateSearch([candidates_at(road, [20.2, 30.2], [0.0, 5.0], y_m=7.6)], scene, road)
    assert search.explain_failure()[2] == ["no place there will do: the best one leaves the road"]


def test_no_candidate_on_the_map() -> None:
    scene, road = scene_and_road(Street())
    search = CandidateSearch([candidates_at(road, [], [])], scene, road)
    assert search.find_best() == []
    assert search.explain_failure()[::2] == (None, ["no place there lies on the map"])
    assert not np.isfinite(search.cost_field()).any()


def test_the_nearest_valid_pose() -> None:
    scene, road = scene_and_road(Street().car("c", 20.2, 0, BLACK))
    near = CandidateSearch([], scene, road).find_nearest(np.array([20.2, 0.0]))
    assert near is not None
    assert np.abs(road.grid.centre_of(near.cell) - [20.2, 0.0]).max() == pytest.approx(2.2, abs=0.45)


def test_candidates_in_words() -> None:
    scene, road = scene_and_road(Street())
    search = CandidateSearch([candidates_at(road, [8.2, -3.0], [0.0, 9.0])], scene, road)
    (ahead,), (candidates,) = search.find_best(1), search.candidate_sets
    assert ahead.describe() == "there, 8.2 m ahead"
    assert GoalCandidate(candidates, 1).describe() == "there, 3.0 m back"

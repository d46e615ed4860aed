from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from appocc.checks import FloatArray
from tracking.association.cascade import MatchingCascade
from tracking.association.colour_likelihood import ColourLikelihood
from tracking.association.costs import AssociationConfig, gate_pairs
from tracking.association.paint import paint_density
from tracking.filtering.kalman import arc_offset
from tracking.records import DETECTION, PREDICTION, Records

UNKNOWN = (np.nan,) * 3
RED, BLUE = (53.0, 80.0, 67.0), (32.0, 79.0, -108.0)
# That a pair is left out costs so much that as many as possible are made.
CONFIG = AssociationConfig(min_gate_m=2.5, gate_speed_mps=7.5, max_gate_m=12.0, max_cost=1e4)
Spot = tuple[float, float]


def predicted(places: list[Spot], variance_m2: FloatArray | None = None, **more: object) -> Records:
    n = len(places)
    variance = np.full(n, 0.05) if variance_m2 is None else variance_m2
    given = {
        "xy_m": np.array(places, np.float64).reshape(-1, 2),
        "cov_m2": variance[:, None, None] * np.eye(2),
        "yaw_rad": np.zeros(n),
        "size_m": np.tile([1.8, 4.5], (n, 1)),
        "lab": np.full((n, 3), np.nan),
        "lab_variance": np.full((n, 3), 50.0),
        "kind": np.zeros(n, np.int64),
        "unseen_s": np.ones(n),
        "displacement_m": np.zeros((n, 2)),
        "gate_scale": np.ones(n),
        "heading_weight": np.ones(n),
    }
    return records(PREDICTION, n, {**given, **more})


def seen(places: list[Spot], **more: object) -> Records:
    n = len(places)
    given = {
        "position_world_m": np.pad(np.array(places, np.float64).reshape(-1, 2), ((0, 0), (0, 1))),
        "noise_m2": np.tile(0.05 * np.eye(2), (n, 1, 1)),
        "yaw_world_rad": np.zeros(n),
        "size_m": np.tile([1.8, 4.5, 1.5], (n, 1)),
        "lab": np.full((n, 3), np.nan),
        "kind": np.zeros(n, np.int64),
    }
    all_of_them: dict[str, Any] = {**given, **more}
    return records(DETECTION, n, {**all_of_them, "colour_density": paint_density(all_of_them["lab"])})


def records(kind: np.dtype[np.void], count: int, fields: dict[str, Any]) -> Records:
    result = np.zeros(count, kind)
    for name, values in fields.items():
        result[name] = values
    return result


def pairs(
    tracks: Records, detections: Records, config: AssociationConfig = CONFIG, doubt: float = 0.02
) -> dict[int, int]:
    cascade, every = MatchingCascade(tracks, detections), (np.ones(len(tracks), bool), np.ones(len(detections), bool))
    cascade.match(ColourLikelihood(doubt).add_cost(cascade.candidates(*every, config)), *every)
    (rows,) = (~cascade.unmatched_tracks).nonzero()
    return dict(zip(rows.tolist(), cascade.detection[rows].tolist(), strict=True))


def labs(*colours: tuple[float, ...]) -> FloatArray:
    return np.array(colours, np.float64)


def test_assignment_is_globally_optimal() -> None:
    assert pairs(predicted([(0, 0), (1, 0)]), seen([(0.9, 0), (2.2, 0)])) == {0: 0, 1: 1}


def test_nothing_beyond_the_gate() -> None:
    assert pairs(predicted([(0, 0)]), seen([(2.6, 0)])) == {}
    assert pairs(predicted([(0, 0)]), seen([(2.4, 0)])) == {0: 0}


def test_gate_grows_with_uncertainty_up_to_a_maximum() -> None:
    assert pairs(predicted([(0, 0)], np.array([9.0])), seen([(6, 0)])) == {0: 0}
    assert pairs(predicted([(0, 0)], np.array([1e4])), seen([(11, 0)])) == {}
    assert pairs(predicted([(0, 0)], np.array([1e4]), unseen_s=np.array([2.0])), seen([(11, 0)])) == {0: 0}
    assert pairs(predicted([(0, 0)], np.array([1e4]), unseen_s=np.array([9.0])), seen([(13, 0)])) == {}


def test_a_certain_track_goes_before_an_uncertain_one() -> None:
    assert pairs(predicted([(0, 0), (0.5, 0)], np.array([0.05, 30.0])), seen([(0.4, 0)])) == {0: 0}


def test_heading_disambiguates_detections() -> None:
    detections = seen([(0.5, 0), (-0.5, 0)], yaw_world_rad=np.array([np.pi / 2, np.pi]))
    assert pairs(predicted([(0, 0)]), detections) == {0: 1}  # turned round is no difference
    assert pairs(predicted([(0.1, 0)]), detections, replace(CONFIG, max_heading_cost=0.0)) == {0: 0}


def test_size_disambiguates_detections() -> None:
    detections = seen([(0.3, 0), (-0.5, 0)], size_m=np.array([[2.5, 9.0, 1.5], [1.8, 4.4, 1.5]]))
    assert pairs(predicted([(0, 0)]), detections, replace(CONFIG, max_size_cost=9.0)) == {0: 1}


def test_categories_are_not_matched_across() -> None:
    assert pairs(predicted([(0, 0)]), seen([(0, 0), (1, 0)], kind=np.array([1, 0]))) == {0: 1}


def test_colour_tells_neighbours_apart() -> None:
    crossed: list[Spot] = [(0.5, 0), (0.7, 0)]
    plain = predicted([(0, 0), (1.2, 0)])
    assert pairs(plain, seen(crossed)) == {0: 0, 1: 1}
    painted, detections = predicted([(0, 0), (1.2, 0)], lab=labs(RED, BLUE)), seen(crossed, lab=labs(BLUE, RED))
    assert pairs(painted, detections) == {0: 1, 1: 0}
    assert pairs(painted, detections, doubt=1.0) == {0: 0, 1: 1}


def test_colour_does_not_overrule_a_clear_place() -> None:
    tracks = predicted([(0, 0), (5, 0)], lab=labs(RED, BLUE))
    assert pairs(tracks, seen([(0, 0), (5, 0)], lab=labs(BLUE, RED))) == {0: 0, 1: 1}


def test_an_unknown_colour_is_between_like_and_unlike() -> None:
    track = predicted([(0, 0)], lab=labs(RED))
    places: list[Spot] = [(0.5, 0), (-0.5, 0)]
    assert pairs(track, seen(places, lab=labs(UNKNOWN, BLUE))) == {0: 0}
    assert pairs(track, seen(places, lab=labs(UNKNOWN, RED))) == {0: 1}


def test_more_sightings_than_tracks_and_none_at_all() -> None:
    assert pairs(predicted([(0, 0)]), seen([(9, 9), (0.1, 0), (5, 5)])) == {0: 1}
    assert pairs(predicted([(0, 0)]), seen([])) == {}
    assert pairs(predicted([]), seen([(0, 0)])) == {}


def test_pairs_above_the_maximum_cost_stay_unmatched() -> None:
    """A row of parked cars: the first is hidden and another one appears at the end; no car has moved."""
    row: list[Spot] = [(0, 0), (6, 0), (12, 0)]
    tracks, detections = predicted(row, np.full(3, 9.0)), seen([(6, 0), (12, 0), (18, 0)])
    assert pairs(tracks, detections, CONFIG) == {0: 0, 1: 1, 2: 2}
    assert pairs(tracks, detections, replace(CONFIG, max_cost=7.0)) == {1: 0, 2: 1}


def test_turns_are_matched_along_an_arc() -> None:
    """An arc of 8 m that turns by one radian ends 7.67 m away, at half that angle."""
    track = predicted([(8.0, 0.0)], displacement_m=np.array([[8.0, 0.0]]))
    chord = 2 * 8.0 * np.sin(0.5)
    turned = seen([(chord * np.cos(0.5), -chord * np.sin(0.5))], yaw_world_rad=np.array([-1.0]))
    ways = gate_pairs(track, turned, np.zeros(1, np.int64), np.zeros(1, np.int64), replace(CONFIG, min_gate_m=0.5))
    assert ways.turn_rad.tolist() == [-1.0]
    straight = seen([(8.0, 0.1)], yaw_world_rad=np.array([-0.1]))
    ways = gate_pairs(track, straight, np.zeros(1, np.int64), np.zeros(1, np.int64), CONFIG)
    assert ways.turn_rad.tolist() == [0.0]


def test_a_rare_colour_pays_for_a_place_farther_off() -> None:
    place: list[Spot] = [(3.0, 0.0)]
    track = predicted([(0, 0)], np.full(1, 4.0), lab=labs(RED), lab_variance=np.full((1, 3), 9.0))
    strict = replace(CONFIG, max_cost=1.0)
    assert pairs(track, seen(place), strict) == {}
    assert pairs(track, seen(place, lab=labs(RED)), strict) == {0: 0}


def test_merged_detections_have_more_position_noise_along_their_heading() -> None:
    every, merged = np.zeros(1, np.int64), seen([(0, 0)], size_m=np.array([[1.8, 10.5, 1.5]]))
    noise = gate_pairs(predicted([(0, 0)]), merged, every, every, CONFIG).noise_m2
    np.testing.assert_allclose(noise[0], np.diag([0.05 + 36 / 12, 0.05]))


@pytest.mark.parametrize("seed", range(3))
def test_components_solved_separately_equal_the_joint_solution(seed: int) -> None:
    random = np.random.default_rng(seed)
    tracks, detections = (
        predicted(random.uniform(0, 40, (60, 2)).tolist()),
        seen(random.uniform(0, 40, (70, 2)).tolist()),
    )
    offset = detections["position_world_m"][None, :, :2] - tracks["xy_m"][:, None]
    far = (offset**2).sum(axis=-1) / 0.1
    possible = np.hypot(*np.moveaxis(offset, -1, 0)) <= CONFIG.min_gate_m
    rows, columns = linear_sum_assignment(np.where(possible, far, 1e6))
    keep = possible[rows, columns]
    assert pairs(tracks, detections, CONFIG) == dict(zip(rows[keep].tolist(), columns[keep].tolist(), strict=True))


# Reach, bends, likelihoods ----------------------------------------------------------------------------------------


def test_gate_radius_grows_with_time_unseen() -> None:
    config = AssociationConfig(min_gate_m=2.0, gate_speed_mps=12.0, max_gate_m=6.0)
    np.testing.assert_allclose(config.gate_radius_m(np.array([0.0, 0.1, 1.0, 9.0])), [2.0, 3.2, 6.0, 6.0])


def turned_by(angle: float, variance_m2: float = 0.05) -> float:
    """By how much a track is taken to have turned that is seen where an arc of 10 m with such a turn ends."""
    ahead, left = arc_offset(np.array([angle]))
    tracks = predicted([(10, 0)], np.array([variance_m2]), displacement_m=np.array([[10.0, 0.0]]))
    detections = seen([(10 + 10 * float(ahead[0]), 10 * float(left[0]))], yaw_world_rad=np.array([angle]))
    every = np.zeros(1, np.int64)
    (turn_rad,) = gate_pairs(tracks, detections, every, every, replace(CONFIG, min_gate_m=20.0)).turn_rad
    return float(turn_rad)


def test_a_detection_at_the_end_of_an_arc_is_a_turn() -> None:
    assert turned_by(0.8) == pytest.approx(0.8)
    assert turned_by(-0.5) == pytest.approx(-0.5)


def test_large_heading_errors_are_no_turns() -> None:
    assert turned_by(1.3) == 0


def test_small_evidence_is_no_turn() -> None:
    assert turned_by(0.1, variance_m2=0.01) == pytest.approx(0.1)
    assert turned_by(0.1, variance_m2=0.15) == 0


def test_colour_ratio_is_that_of_two_densities() -> None:
    """The ratio of two densities: a Gaussian about the track's colour, and that of all vehicles' paints."""
    off = np.array([3.0, -5.0, 7.0])
    tracks, detections = predicted([(0, 0)], lab=labs(RED)), seen([(0, 0)], lab=labs(tuple(RED + off)))
    every = np.zeros(1, np.int64)
    (alike,) = gate_pairs(tracks, detections, every, every, CONFIG).colour_ratio
    assert alike == pytest.approx(np.exp(-(off @ off) / 50 / 2) / 50**1.5 / detections["colour_density"][0])


def test_excluded_detections_stay_unmatched() -> None:
    tracks, detections = predicted([(0, 0)]), seen([(0.1, 0), (1.0, 0)])
    cascade, every = MatchingCascade(tracks, detections), np.ones(1, np.bool_)
    both = cascade.candidates(every, np.ones(2, np.bool_), CONFIG)
    assert len(both.rows) == 2
    cascade.match(both, every, np.array([False, True]))
    assert cascade.detection.tolist() == [1]
    assert cascade.unmatched_detections.tolist() == [True, False]

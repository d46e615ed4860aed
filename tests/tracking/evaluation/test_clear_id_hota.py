from __future__ import annotations

import tracemalloc
import warnings
from dataclasses import replace

import numpy as np
import pytest

from appocc.errors import ShapeError
from tracking.evaluation.clear import clear_counts
from tracking.evaluation.clear_id_hota import Metrics, count, evaluate, evaluate_distances
from tracking.evaluation.frames import (
    GATE_M,
    IOU_RULE,
    DistanceFrame,
    EvaluationFrame,
    MatchingRule,
    centre_distance_rule,
)

Placed = dict[int, tuple[float, float]]


def moment(
    truth: Placed, tracks: Placed, ignored: tuple[int, ...] = (), unjudged: tuple[int, ...] = ()
) -> EvaluationFrame:
    """Objects and tracks by id; some objects are not demanded, some tracks not judged."""
    return EvaluationFrame(
        np.array(list(truth), np.int64),
        np.array(list(truth.values()), np.float64).reshape(-1, 2),
        np.array([name not in ignored for name in truth], np.bool_),
        np.array(list(tracks), np.int64),
        np.array(list(tracks.values()), np.float64).reshape(-1, 2),
        np.array([name not in unjudged for name in tracks], np.bool_),
    )


# By hand ----------------------------------------------------------------------------------------------------------


def test_perfect_tracks() -> None:
    scores = evaluate([moment({1: (0, t), 2: (9, t)}, {7: (0, t), 8: (9, t)}) for t in range(4)])
    np.testing.assert_allclose([scores.MOTA, scores.IDF1, scores.HOTA, scores.MOTP], [1, 1, 1, 0])
    assert (scores.GT, scores.FP, scores.FN, scores.IDS, scores.FRAG, scores.MT, scores.ML) == (8, 0, 0, 0, 0, 2, 0)


def test_every_kind_of_error_counts_once() -> None:
    frames = [
        moment({1: (0, 0), 2: (20, 0)}, {5: (1, 0), 6: (20, 0)}),
        moment({1: (0, 0), 2: (20, 0)}, {5: (1, 0)}),  # 2 is missed
        moment({1: (0, 0), 2: (20, 0)}, {5: (1, 0), 9: (20, 0)}),  # 2 is found again under another id
        moment({1: (0, 0)}, {5: (1, 0), 9: (50, 50)}),  # 9 is nothing
    ]
    scores = evaluate(frames)
    assert (scores.GT, scores.FP, scores.FN, scores.IDS, scores.FRAG) == (7, 1, 1, 1, 1)
    assert pytest.approx(1 - 3 / 7) == scores.MOTA
    assert pytest.approx(4 / 6) == scores.MOTP
    # Object 1 keeps its track for 4 frames; object 2 is given 6 or 9 for one frame: 5 of 7 + 7.
    assert pytest.approx(10 / 14) == scores.IDF1
    assert (scores.MT, scores.ML) == (1, 0)


def test_recordings_are_pooled_by_their_counts_in_little_memory() -> None:
    """Tables of all objects, tracks and thresholds of these recordings would take 137 MB."""
    rng = np.random.default_rng(3)

    def recording(number: int) -> list[EvaluationFrame]:
        ids, tracks = range(3 * number, 3 * number + 3), rng.permuted(np.arange(3 * number, 3 * number + 3))
        steps = rng.normal(0, 0.9, (4, 3, 2))
        return [
            moment(
                {i: (20.0 * k, t) for k, i in enumerate(ids)},
                {int(i): (20.0 * k + step[k, 0], t + step[k, 1]) for k, i in enumerate(tracks) if k or t != 2},
            )
            for t, step in enumerate(steps)
        ]

    recordings = [recording(number) for number in range(320)]
    tracemalloc.start()
    together = evaluate([frame for frames in recordings for frame in frames])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 30e6
    assert 0 < together.MOTA < 1
    counts = count(recordings[0])
    for frames in recordings[1:]:
        counts = counts.plus(count(frames))
    assert counts.metrics() == together


@pytest.mark.parametrize(("found", "mostly"), [(5, (1, 0)), (4, (1, 0)), (3, (0, 0)), (1, (0, 0)), (0, (0, 1))])
def test_mostly_tracked_and_mostly_lost(found: int, mostly: tuple[int, int]) -> None:
    """Of five frames: 80 % are mostly tracked, 20 % are not yet mostly lost."""
    scores = evaluate([moment({1: (0, 0)}, {5: (0, 0)} if t < found else {}) for t in range(5)])
    assert mostly == (scores.MT, scores.ML)


def test_a_swap_is_two_switches() -> None:
    frames = [moment({1: (0, 0), 2: (9, 0)}, {5: (0, 0), 6: (9, 0)})] * 2
    frames += [moment({1: (0, 0), 2: (9, 0)}, {6: (0, 0), 5: (9, 0)})] * 2
    scores = evaluate(frames)
    assert (scores.IDS, scores.FP, scores.FN) == (2, 0, 0)
    assert pytest.approx(0.5) == scores.IDF1


def test_a_switch_counts_at_any_distance_in_time() -> None:
    frames = [moment({1: (0, 0)}, {5: (0, 0)})] + [moment({}, {})] * 50 + [moment({1: (0, 0)}, {6: (0, 0)})]
    assert evaluate(frames).IDS == 1


def test_an_earlier_pair_is_kept_though_another_track_comes_nearer() -> None:
    frames = [moment({1: (0, 0)}, {5: (0, 0)}), moment({1: (0, 0)}, {5: (1.5, 0), 6: (0, 0)})]
    scores = evaluate(frames)
    assert (scores.IDS, scores.FP) == (0, 1)


def test_the_gate_is_strict() -> None:
    assert evaluate([moment({1: (0, 0)}, {5: (GATE_M - 1e-6, 0)})]).FN == 0
    scores = evaluate([moment({1: (0, 0)}, {5: (GATE_M, 0)})])
    assert (scores.FN, scores.FP) == (1, 1)


def test_ignored_objects_are_neither_demanded_nor_punished() -> None:
    truth: Placed = {1: (0, 0), 2: (9, 0), 3: (20, 0)}
    scores = evaluate([moment(truth, {5: (0, 0), 6: (9, 0)}, ignored=(2, 3))])
    assert (scores.GT, scores.FP, scores.FN, scores.MOTA) == (1, 0, 0, 1.0)


def test_all_ground_truth_is_matched_before_any_is_dropped() -> None:
    """The track on the ignored object must not fall to the demanded one beside it."""
    scores = evaluate([moment({1: (0, 0), 2: (1.5, 0)}, {5: (1.5, 0)}, ignored=(2,))])
    assert (scores.FN, scores.FP, scores.GT) == (1, 0, 1)


def test_tracks_beyond_the_range_are_not_judged_unless_they_match() -> None:
    scores = evaluate([moment({1: (0, 0)}, {5: (0, 0), 6: (99, 0), 7: (98, 0)}, unjudged=(5, 6))])
    assert (scores.FN, scores.FP) == (0, 1)


def test_nothing_demanded_gives_no_shares() -> None:
    for frames in ([], [moment({}, {})], [moment({1: (0, 0)}, {5: (0, 0)}, ignored=(1,))]):
        scores = evaluate(frames)
        assert np.isnan([scores.MOTA, scores.MOTP, scores.HOTA]).all()
        assert scores.as_json()["MOTA"] is None
        assert scores.as_json()["GT"] == 0


def test_no_tracks_at_all() -> None:
    scores = evaluate([moment({1: (0, 0)}, {})] * 3)
    assert (scores.MOTA, scores.IDF1, scores.HOTA, scores.FN, scores.ML) == (0.0, 0.0, 0.0, 3, 1)


def test_tracks_without_any_truth_are_false() -> None:
    scores = evaluate([moment({}, {5: (0, 0)})] * 3)
    assert scores.FP == 3
    assert np.isnan(scores.MOTA)


def test_hota_falls_with_distance() -> None:
    """At 1 m of 2 m every threshold up to 0.5 is met: 10 of 19."""
    scores = evaluate([moment({1: (0, 0)}, {5: (1.0, 0)})] * 3)
    assert pytest.approx(10 / 19) == scores.HOTA
    assert pytest.approx(10 / 19) == scores.DetA


def test_another_gate() -> None:
    """Two metres of four: HOTA's thresholds up to 0.5 are met, 10 of 19."""
    frames = [moment({1: (0, 0)}, {5: (2.0, 0)})] * 3
    assert evaluate(frames).FN == 3
    scores = evaluate(frames, 4.0)
    assert scores.FN == 0
    assert pytest.approx(10 / 19) == scores.HOTA


def test_half_an_overlap_is_enough() -> None:
    def frame(iou: float) -> DistanceFrame:
        one, yes = np.array([1]), np.ones(1, np.bool_)
        return DistanceFrame(one, yes, one, yes, np.array([[1 - iou]]))

    assert evaluate_distances([frame(0.5)], IOU_RULE).FN == 0
    assert evaluate_distances([frame(0.5 - 1e-9)], IOU_RULE).FN == 1
    # IoU 0.7 meets the thresholds up to 0.7: 14 of 19.
    assert pytest.approx(14 / 19) == evaluate_distances([frame(0.7)], IOU_RULE).HOTA


def test_sequences_that_share_no_ids_add_up() -> None:
    one, other = random_moments(0), random_moments(1)
    both = evaluate([*one, *(moved_on(frame, 10_000) for frame in other)])
    first, second = evaluate(one), evaluate(other)
    for name in ("GT", "FP", "FN", "IDS", "FRAG", "MT", "ML"):
        assert getattr(both, name) == getattr(first, name) + getattr(second, name), name


def moved_on(frame: EvaluationFrame, by: int) -> EvaluationFrame:
    """The same under other ids."""
    return replace(frame, truth_ids=frame.truth_ids + by, track_ids=frame.track_ids + by)


def test_non_switches_are_listed() -> None:
    frames = [moment({1: (0, 0)}, {5: (0, 0)}), moment({1: (0, 0)}, {6: (0, 0)}), moment({1: (0, 0)}, {6: (0, 0)})]
    clear = clear_counts([frame.with_distances() for frame in frames], centre_distance_rule())
    assert clear.non_switches == [[0], [], [0]]
    assert (clear.matches, clear.switches) == (3, 1)


def test_tracks_can_be_selected() -> None:
    compared = moment({1: (0, 0)}, {5: (0, 0), 6: (1, 0)}, unjudged=(5,)).with_distances()
    only = compared.select_tracks(np.array([False, True]))
    assert (only.track_ids.tolist(), only.penalised.tolist(), only.distance.tolist()) == ([6], [True], [[1.0]])


def test_shapes_are_checked() -> None:
    empty, no_xy, none = np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0, np.bool_)
    with pytest.raises(ShapeError, match="frame truth_xy_m"):
        EvaluationFrame(np.ones(2, np.int64), no_xy, none, empty, no_xy, none)
    one, yes = np.array([1]), np.ones(1, np.bool_)
    with pytest.raises(ShapeError, match="frame distance"):
        DistanceFrame(one, yes, one, yes, np.zeros((1, 2)))
    with pytest.raises(ShapeError, match="finite"):
        DistanceFrame(one, yes, one, yes, np.full((1, 1), np.nan))
    with pytest.raises(ShapeError, match="frame penalised"):
        DistanceFrame(one, yes, one, none, np.zeros((1, 1)))
    with pytest.raises(ShapeError, match="frame required"):
        DistanceFrame(one, none, one, yes, np.zeros((1, 1)))


# Against motmetrics and TrackEval -----------------------------------------------------------------------------------


def random_moments(seed: int) -> list[EvaluationFrame]:
    """Objects that wander and come and go; tracks with noise, misses, clutter, swaps and handed-on ids."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 25, (9, 2))
    id_of = np.arange(9) + 100
    frames = []
    for t in range(40):
        places = places + rng.normal(0, 0.5, places.shape)
        if t % 7 == 3:
            id_of = np.where(rng.random(9) < 0.3, rng.permutation(id_of), id_of)
            id_of = np.array([name if name not in id_of[:i] else 200 + 10 * t + i for i, name in enumerate(id_of)])
        there = np.flatnonzero(rng.random(9) < 0.8)
        seen = there[rng.random(len(there)) < 0.75]
        tracks = {int(id_of[i]): tuple(places[i] + rng.normal(0, 0.7, 2)) for i in seen}
        tracks |= {1000 + 10 * t + k: tuple(rng.uniform(0, 25, 2)) for k in range(rng.integers(0, 3))}
        frames.append(moment({int(i): tuple(places[i]) for i in there}, tracks))
    return frames


def compared_moments(seed: int) -> list[DistanceFrame]:
    return [frame.with_distances() for frame in random_moments(seed)]


def random_overlaps(seed: int) -> list[DistanceFrame]:
    """The same places as boxes in an image, some 4 wide and 3 high, compared by their overlap."""
    frames = []
    for frame in random_moments(seed):
        size = np.array([4.0, 3.0])
        offset = np.abs(frame.truth_xy_m[:, None] - frame.track_xy_m)
        common = np.prod(np.maximum(size - offset, 0), axis=2)
        iou = common / (2 * size.prod() - common)
        frames.append(replace(frame.with_distances(), distance=1 - iou))
    return frames


CASES = [(kind, seed) for kind in ("centre", "overlap") for seed in range(4)]


def made(kind: str, seed: int) -> tuple[list[DistanceFrame], MatchingRule]:
    return (compared_moments(seed), centre_distance_rule()) if kind == "centre" else (random_overlaps(seed), IOU_RULE)


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_equal_to_motmetrics(kind: str, seed: int) -> None:
    motmetrics = pytest.importorskip("motmetrics")
    frames, rule = made(kind, seed)
    ours = evaluate_distances(frames, rule)
    names = {
        "mota": ours.MOTA,
        "motp": ours.MOTP,
        "idf1": ours.IDF1,
        "idp": ours.IDP,
        "idr": ours.IDR,
        "recall": ours.recall,
        "precision": ours.precision,
        "num_switches": ours.IDS,
        "num_fragmentations": ours.FRAG,
        "num_false_positives": ours.FP,
        "num_misses": ours.FN,
        "num_objects": ours.GT,
        "mostly_tracked": ours.MT,
        "mostly_lost": ours.ML,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        accumulator = motmetrics.MOTAccumulator(auto_id=True)
        for frame in frames:
            impossible = frame.distance >= GATE_M if kind == "centre" else frame.distance > 0.5
            distance = np.where(impossible, np.nan, frame.distance)
            accumulator.update(frame.truth_ids, frame.track_ids, distance)
        theirs = motmetrics.metrics.create().compute(accumulator, metrics=list(names)).iloc[0]
    assert ours.IDS > 3
    assert ours.FRAG > 3
    for name, value in names.items():
        assert value == pytest.approx(theirs[name], abs=1e-12), name


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_equal_to_trackeval(kind: str, seed: int) -> None:
    pytest.importorskip("trackeval")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from trackeval.metrics.hota import HOTA
    frames, rule = made(kind, seed)
    truths = np.unique(np.concatenate([frame.truth_ids for frame in frames]))
    tracks = np.unique(np.concatenate([frame.track_ids for frame in frames]))
    data = {
        "num_gt_ids": len(truths),
        "num_tracker_ids": len(tracks),
        "num_gt_dets": sum(len(frame.truth_ids) for frame in frames),
        "num_tracker_dets": sum(len(frame.track_ids) for frame in frames),
        "gt_ids": [np.searchsorted(truths, frame.truth_ids) for frame in frames],
        "tracker_ids": [np.searchsorted(tracks, frame.track_ids) for frame in frames],
        "similarity_scores": [
            np.maximum(1 - frame.distance / (GATE_M if kind == "centre" else 1), 0) for frame in frames
        ],
    }
    theirs = HOTA().eval_sequence(data)
    ours: Metrics = evaluate_distances(frames, rule)
    assert pytest.approx(np.mean(theirs["HOTA"])) == ours.HOTA
    assert pytest.approx(np.mean(theirs["DetA"])) == ours.DetA
    assert pytest.approx(np.mean(theirs["AssA"])) == ours.AssA

from __future__ import annotations

import dataclasses
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.errors import ShapeError
from tracking.evaluation.amota import (
    RECALLS,
    ScoredFrame,
    ThresholdMetrics,
    evaluate_amota,
    filter_by_score,
    prepare_frames,
)
from tracking.evaluation.clear_id_hota import evaluate
from tracking.evaluation.frames import EvaluationFrame
from tracking.io.nuscenes_detections import read_scene_file

Placed = dict[int, tuple[float, float]]
STEP_US = 500_000


def scored(
    time: int,
    truth: Placed,
    tracks: Placed,
    scores: dict[int, float],
    ignored: tuple[int, ...] = (),
    unjudged: tuple[int, ...] = (),
) -> ScoredFrame:
    """Objects and tracks by id at a key frame; some objects are not demanded, some tracks not judged."""
    moment = EvaluationFrame(
        np.array(list(truth), np.int64),
        np.array(list(truth.values()), np.float64).reshape(-1, 2),
        np.array([name not in ignored for name in truth], np.bool_),
        np.array(list(tracks), np.int64),
        np.array(list(tracks.values()), np.float64).reshape(-1, 2),
        np.array([name not in unjudged for name in tracks], np.bool_),
    )
    return ScoredFrame(time * STEP_US, moment, np.array([scores[name] for name in tracks], np.float64))


# By hand ----------------------------------------------------------------------------------------------------------


def test_perfect_tracks() -> None:
    result = evaluate_amota([scored(t, {1: (0, t)}, {7: (0.5, t)}, {7: 0.9}) for t in range(10)])
    assert result.AMOTA == 1
    assert pytest.approx(0.5) == result.AMOTP
    assert pytest.approx(0.9) == result.threshold
    assert result.best is not None
    assert (result.best.GT, result.best.TP, result.best.FN, result.best.LGD_s) == (10, 10, 0, 0)


def test_a_recall_that_is_not_reached_counts_as_the_worst() -> None:
    """Half of the objects are never found: of the recalls from 0.1 to 1, 18 of 40 are at most 0.5."""
    frames = [scored(t, {1: (0, t), 2: (50, t)}, {7: (1, t)}, {7: 0.9}) for t in range(10)]
    result = evaluate_amota(frames)
    reached = int((RECALLS <= 0.5).sum())
    assert pytest.approx(reached / 40) == result.AMOTA
    assert pytest.approx((reached * 1 + (40 - reached) * 2) / 40) == result.AMOTP
    assert [one is None for one in result.by_recall] == [True] * (40 - reached) + [False] * reached


def test_the_best_threshold_leaves_false_tracks_out() -> None:
    frames = [scored(t, {1: (0, t)}, {7: (0, t), 8: (30, t)}, {7: 0.9, 8: 0.2}) for t in range(10)]
    result = evaluate_amota(frames)
    assert result.AMOTA == 1
    assert pytest.approx(0.9) == result.threshold
    assert evaluate(filter_by_score(prepare_frames(frames), result.threshold)).FP == 0
    assert evaluate(filter_by_score(prepare_frames(frames), 0.1)).FP == 10


def test_a_track_scores_the_mean_of_its_boxes() -> None:
    frames = [scored(t, {1: (0, t)}, {7: (0, t)}, {7: t / 10}) for t in range(10)]
    np.testing.assert_allclose(np.concatenate([one.scores for one in prepare_frames(frames)]), np.full(10, 0.45))


def test_gaps_are_filled_as_the_devkit_does_it() -> None:
    """In a gap of two frames each place takes the weight of the other neighbour."""
    places = {0: 0.0, 3: 3.0}
    frames = [scored(t, {1: (places[t], 5)} if t in places else {}, {}, {}) for t in range(5)]
    filled = [one.frame.truth_xy_m.tolist() for one in prepare_frames(frames)]
    np.testing.assert_allclose(filled[:4], [[[0, 5]], [[2, 5]], [[1, 5]], [[3, 5]]])
    assert filled[4] == []


def test_what_is_not_asked_for_is_removed() -> None:
    """Unlike in the plain metrics a track on it is then a false positive, unless it is removed too."""
    frames = [scored(0, {1: (0, 0), 2: (9, 0)}, {7: (0, 0), 8: (9, 0), 9: (60, 0)}, {7: 1, 8: 1, 9: 1}, (2,), (9,))]
    best = evaluate_amota(frames).best
    assert best is not None
    assert (best.GT, best.TP, best.FP) == (1, 1, 1)


def test_nothing_to_be_found() -> None:
    result = evaluate_amota([scored(0, {}, {7: (0, 0)}, {7: 1.0})])
    assert np.isnan([result.AMOTA, result.AMOTP, result.threshold]).all()
    assert result.best is None
    assert evaluate_amota([]).best is None


def test_nothing_found() -> None:
    result = evaluate_amota([scored(t, {1: (0, 0)}, {7: (9, 9)}, {7: 1.0}) for t in range(3)])
    assert (result.AMOTA, result.AMOTP) == (0, 2)
    assert result.best is not None
    metrics = result.best.as_json()
    assert (metrics["MOTA"], metrics["FN"], metrics["ML"], metrics["IDS"]) == (0, 3, 1, None)


def test_scores_are_checked() -> None:
    moment = scored(0, {}, {7: (0, 0)}, {7: 1.0}).frame
    with pytest.raises(ShapeError, match="frame scores"):
        ScoredFrame(0, moment, np.zeros(2))
    with pytest.raises(ShapeError, match="finite"):
        ScoredFrame(0, moment, np.array([np.nan]))


# Against the devkit -----------------------------------------------------------------------------------------------


def devkit_scores(scenes: list[list[ScoredFrame]]) -> tuple[dict[str, float], Any]:
    """AMOTA, AMOTP and the figures at the best MOTA, by nuscenes-devkit's own code; and all that it has."""
    pytest.importorskip("nuscenes.eval.tracking.algo", exc_type=ImportError)
    from nuscenes.eval.common.config import config_factory
    from nuscenes.eval.tracking.algo import TrackingEvaluation
    from nuscenes.eval.tracking.data_classes import TrackingBox
    from nuscenes.eval.tracking.loaders import interpolate_tracks

    config = config_factory("tracking_nips_2019")  # first: it also tells TrackingBox the classes

    def box(name: int, xy: list[float], score: float) -> Any:
        place, turn = (*xy, 0.0), (1.0, 0.0, 0.0, 0.0)
        return TrackingBox("", place, (1.0,) * 3, turn, (0.0, 0.0), (0.0,) * 3, 1, str(name), "car", score)

    truths, outputs = {}, {}
    for number, moments in enumerate(scenes):
        truth, output, scores = defaultdict(list), defaultdict(list), defaultdict(list)
        for one in moments:
            m = one.frame
            for name, score in zip(m.track_ids[m.penalised].tolist(), one.scores[m.penalised].tolist(), strict=True):
                scores[name].append(score)
        for one in moments:
            m = one.frame
            rows = zip(m.truth_ids[m.required].tolist(), m.truth_xy_m[m.required].tolist(), strict=True)
            truth[one.timestamp_us] = [box(name, xy, -1.0) for name, xy in rows]
            rows = zip(m.track_ids[m.penalised].tolist(), m.track_xy_m[m.penalised].tolist(), strict=True)
            output[one.timestamp_us] = [box(name, xy, float(np.mean(scores[name]))) for name, xy in rows]
        truths[str(number)], outputs[str(number)] = interpolate_tracks(truth), interpolate_tracks(output)
    worst = config.metric_worst
    evaluation = TrackingEvaluation(
        truths, outputs, "car", config.dist_fcn_callable, 2.0, config.min_recall, 40, worst, verbose=False
    )
    data = evaluation.accumulate()
    best = int(np.nanargmax(data.mota))
    figures = {name: float(data.get_metric(name)[best]) for name in data.metrics}
    for name, of in (("amota", "motar"), ("amotp", "motp")):
        figures[name] = float(np.where(np.isnan(data.get_metric(of)), worst[name], data.get_metric(of)).mean())
    return figures, data


def assert_equal_to_devkit(scenes: list[list[ScoredFrame]]) -> ThresholdMetrics:
    theirs, data = devkit_scores(scenes)
    ours = evaluate_amota([one for scene in scenes for one in scene])
    assert ours.best is not None
    assert pytest.approx(theirs["amota"], abs=1e-9) == ours.AMOTA
    assert pytest.approx(theirs["amotp"], abs=1e-9) == ours.AMOTP
    for field in dataclasses.fields(ThresholdMetrics):
        name = field.name.lower().removesuffix("_s")
        ours_too = getattr(ours.best, field.name)
        assert pytest.approx(theirs[name], abs=1e-9, nan_ok=True) == ours_too, name
        all_of = [np.nan if one is None else getattr(one, field.name) for one in ours.by_recall]
        if any(one is not None for one in ours.by_recall):
            np.testing.assert_allclose(all_of, data.get_metric(name), atol=1e-9, err_msg=name)
    return ours.best


def random_scene(rng: np.random.Generator, first_id: int, found: float) -> list[ScoredFrame]:
    """Objects that wander, come and go; tracks with noise, gaps, clutter, swaps and a score of their own."""
    places = rng.uniform(0, 30, (8, 2))
    scores: defaultdict[int, float] = defaultdict(lambda: float(rng.choice([0.2, 0.5, rng.random()])))
    id_of = first_id + 100 + np.arange(8)
    moments, time = [], 0
    for t in range(20):
        time += int(rng.integers(1, 4))
        places = places + rng.normal(0, 0.5, places.shape)
        if t % 6 == 5:
            id_of = rng.permutation(id_of) if rng.random() < 0.5 else np.where(rng.random(8) < 0.2, id_of + 10, id_of)
        there = np.flatnonzero(rng.random(8) < 0.8)
        seen = there[rng.random(len(there)) < found]
        tracks = {int(id_of[i]): tuple((places[i] + rng.normal(0, 0.6, 2)).tolist()) for i in seen}
        tracks |= {
            first_id + 1000 + int(k): tuple(rng.uniform(0, 30, 2).tolist())
            for k in np.flatnonzero(rng.random(3) < 0.5)
        }
        truth = {first_id + int(i): tuple(places[i].tolist()) for i in there}
        noisy = {name: scores[name] + (rng.normal(0, 0.1) if name % 2 else 0.0) for name in tracks}
        ignored = tuple(name for name in truth if rng.random() < 0.05)
        unjudged = tuple(name for name in tracks if rng.random() < 0.05)
        moments.append(scored(time, truth, tracks, noisy, ignored, unjudged))
    return moments


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("seed", "found"), [(0, 0.9), (1, 0.9), (2, 0.6), (3, 0.3), (4, 1.0), (5, 0.05), (6, 0.0)])
def test_equal_to_the_devkit(seed: int, found: float) -> None:
    rng = np.random.default_rng(seed)
    scenes = [random_scene(rng, 10_000 * (k + 1), found) for k in range(2)]
    best = assert_equal_to_devkit(scenes)
    if found >= 0.6:
        assert best.IDS > 3
        assert best.FRAG > 3


@pytest.mark.filterwarnings("ignore")
def test_equal_to_the_devkit_where_nothing_is_found() -> None:
    best = assert_equal_to_devkit([[scored(t, {1: (0, 0)}, {7: (9, 9)}, {7: 1.0}) for t in range(3)]])
    assert np.isnan(best.IDS)


@pytest.mark.realdata
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("detector", ["centerpoint", "megvii"])
def test_equal_to_the_devkit_on_a_recorded_scene(data_root: Path, detector: str) -> None:
    """A detector's cars, each with the id of the nearest one just before."""
    (scene,) = read_scene_file(data_root / "mot" / "nuscenes_scene-0103" / "derived_tracking.json", detector)
    # The devkit finds distances from squares, which for coordinates of kilometres costs seven digits.
    origin = scene.world_from_ego[0, :2, 3]
    moments, born = [], 0
    before: Placed = {}
    for k, pose in enumerate(scene.world_from_ego):
        seen, truth = scene.detections[k], scene.truth[k]
        seen = seen.select(np.array([kind == "car" for kind in seen.kind]))
        truth_is = np.array([kind == "car" for kind in truth.kind])
        places = (seen.ground_m @ pose[:3, :3].T + pose[:3, 3])[:, :2] - origin
        now: Placed = {}
        for place in places:
            free = [name for name in before if name not in now]
            near = min(free, key=lambda name: float(np.hypot(*(place - before[name]))), default=None)
            if near is None or np.hypot(*(place - before[near])) > 2:
                born += 1
                near = born
            now[near] = tuple(place)
        before = now
        objects, ego = truth.centre_m[truth_is, :2] - origin, pose[:2, 3] - origin
        demanded = (truth.points[truth_is] > 0) & (np.hypot(*(objects - ego).T) < 50)
        judged = np.hypot(*(places - ego).T) < 50
        moment = EvaluationFrame(
            truth.ids[truth_is], objects, demanded, np.array(list(now), np.int64), places, judged
        )
        moments.append(ScoredFrame(int(scene.timestamps_us[k]), moment, seen.log_odds.copy()))
    best = assert_equal_to_devkit([moments])
    assert best.GT == 773
    assert best.IDS > 10
    assert best.FRAG > 0

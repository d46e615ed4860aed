from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_kitti import label, made_kitti, region, write

from appocc.checks import FloatArray
from appocc.errors import DataError
from tracking.evaluation.kitti import Results, prepare_evaluation
from tracking.io.kitti import KittiLabels, KittiSequence, read_sequences
from tracking.io.kitti_results import KittiResult

HIGH, LOW = np.array([600.0, 170.0, 700.0, 240.0]), np.array([600.0, 170.0, 700.0, 195.0])


def result(
    id_: int, ground: FloatArray, box: FloatArray = HIGH, score: float = 0.5, kind: str = "car"
) -> KittiResult:
    return KittiResult(
        id=id_,
        kind=kind,
        score=score,
        image_box_px=box,
        ground_m=ground,
        yaw_rad=0.0,
        size_m=np.array([1.8, 4.2, 1.5]),
    )


def perfect(labels: KittiLabels, score: float = 0.5) -> list[KittiResult]:
    """All objects of the kinds that count, under their own numbers."""
    chosen = [i for i, name in enumerate(labels.types) if name in ("Car", "Van")]
    return [result(int(labels.ids[i]), labels.ground_m[i], labels.image_boxes_px[i], score) for i in chosen]


def truth(sequence: KittiSequence) -> tuple[KittiLabels, ...]:
    assert sequence.labels is not None
    return sequence.labels


def sequence_of(root: Path, *labels: str, frames: int = 3) -> KittiSequence:
    write(made_kitti(root, frames) / "label" / "0001.txt", labels)
    return read_sequences(root)[0]


def counts(sequence: KittiSequence, results: Results) -> tuple[int, int, int, int]:
    """Objects, missed, false, switches."""
    metrics = prepare_evaluation([(sequence, results)]).metrics()
    return metrics.GT, metrics.FN, metrics.FP, metrics.IDS


def test_a_perfect_tracker(tmp_path: Path) -> None:
    sequence = read_sequences(made_kitti(tmp_path))[0]
    metrics = prepare_evaluation([(sequence, [perfect(labels) for labels in truth(sequence)])]).metrics()
    assert (metrics.MOTA, metrics.IDF1, metrics.IDS, metrics.GT) == (1.0, 1.0, 0, 3)
    assert pytest.approx(1.0) == metrics.HOTA


@pytest.mark.parametrize(
    ("kind", "state", "demanded"),
    [
        ("Car", "0 0", True),
        ("Car", "0 2", True),
        ("Car", "0 3", False),
        ("Car", "1 0", False),
        ("Car", "2 1", False),
        ("Van", "0 0", False),
    ],
)
def test_required_objects(tmp_path: Path, kind: str, state: str, demanded: bool) -> None:
    sequence = sequence_of(tmp_path, label(0, 4, kind, state), frames=1)
    assert counts(sequence, [[]]) == (int(demanded), int(demanded), 0, 0)
    # Who is found there is never wrong.
    assert counts(sequence, [perfect(truth(sequence)[0])]) == (int(demanded), 0, 0, 0)


@pytest.mark.parametrize("kind", ["Truck", "Pedestrian", "Misc"])
def test_a_track_on_something_else_is_wrong(tmp_path: Path, kind: str) -> None:
    sequence = sequence_of(tmp_path, label(0, 4, kind), frames=1)
    assert counts(sequence, [[result(1, truth(sequence)[0].ground_m[0])]]) == (0, 0, 1, 0)


def test_a_track_falls_to_the_nearest_of_all_objects(tmp_path: Path) -> None:
    # Two tracks, at a demanded car and at a van 1.5 m behind it: were vans dropped first, one would be wrong.
    rows = [label(0, 4, "Car", ahead_m=20.0), label(0, 5, "Van", ahead_m=21.5)]
    sequence = sequence_of(tmp_path, *rows, frames=1)
    assert counts(sequence, [[result(1, np.array([z, -2.0, 0.0])) for z in (20.0, 21.5)]]) == (1, 0, 0, 0)


def test_only_cars_are_judged_and_height_does_not_matter(tmp_path: Path) -> None:
    sequence = read_sequences(made_kitti(tmp_path, 1))[0]
    place = np.array([20.0, -2.0, 50.0])
    aside = np.array([0.0, 1.0, 0.0])
    far = place + 2.1 * aside
    found = [result(1, place), result(2, far, kind="bicycle"), result(3, far, kind="pedestrian")]
    assert counts(sequence, [found]) == (1, 0, 0, 0)
    assert counts(sequence, [[result(1, far)]]) == (1, 1, 1, 0)
    assert counts(sequence, [[result(1, place + 1.9 * aside)]]) == (1, 0, 0, 0)


@pytest.mark.parametrize(
    ("box", "regions", "false"),
    [
        (HIGH, [], 1),
        (LOW, [], 0),
        (np.array([600.0, 170.0, 700.0, 195.5]), [], 1),
        (HIGH, ["600 170 650 240"], 1),
        (HIGH, ["600 170 651 240"], 0),
        # Two halves that only together cover it.
        (HIGH, ["600 170 650 240", "650 170 700 240"], 1),
        (HIGH, ["0 0 100 100", "0 0 1241 374"], 0),
    ],
)
def test_unmatched_tracks_that_are_not_judged(
    tmp_path: Path, box: FloatArray, regions: list[str], false: int
) -> None:
    sequence = sequence_of(tmp_path, *(region(0, each) for each in regions), frames=1)
    assert counts(sequence, [[result(1, np.array([20.0, 5.0, 0.0]), box)]]) == (0, 0, false, 0)


def test_a_matched_track_counts_however_small(tmp_path: Path) -> None:
    sequence = sequence_of(tmp_path, label(0), region(0, "0 0 1241 374"), frames=1)
    assert counts(sequence, [[result(1, truth(sequence)[0].ground_m[0], LOW)]]) == (1, 0, 0, 0)


def test_sequences_add_up_and_share_no_ids(tmp_path: Path) -> None:
    sequences = read_sequences(made_kitti(tmp_path, names=("0001", "0002")))
    # The same object number and other track numbers: no switch, since they are other cars.
    outcomes = [
        (one, [[replace(each, id=each.id + number) for each in perfect(labels)] for labels in truth(one)])
        for number, one in enumerate(sequences)
    ]
    metrics = prepare_evaluation(outcomes).metrics()
    assert (metrics.GT, metrics.MOTA, metrics.IDS, metrics.MT) == (6, 1.0, 0, 2)
    # And the same track number on both is no merging of two cars.
    same = prepare_evaluation([(one, [perfect(labels) for labels in truth(one)]) for one in sequences])
    assert same.metrics().IDF1 == 1.0
    assert {score for each in same.by_track().sequences for row in each.scores for score in row} == {0.5}


def with_false_tracks(tmp_path: Path) -> tuple[KittiSequence, Results]:
    """The car with scores of 0.9, 0.1 and 0.2, and beside it a false track of 0.3."""
    sequence = read_sequences(made_kitti(tmp_path))[0]
    moments = [perfect(labels, score) for labels, score in zip(truth(sequence), (0.9, 0.1, 0.2), strict=True)]
    return sequence, [[*moment, result(9, np.array([20.0, 8.0, 0.0]), score=0.3)] for moment in moments]


def test_cut_removes_whole_tracks(tmp_path: Path) -> None:
    trial = prepare_evaluation([with_false_tracks(tmp_path)]).by_track()
    np.testing.assert_allclose(trial.sequences[0].scores, [[0.4, 0.3]] * 3)
    assert (trial.metrics().MOTA, trial.metrics().FP) == (0.0, 3)
    assert trial.best_cut() == pytest.approx(0.4)
    assert trial.metrics(trial.best_cut()).MOTA == 1.0
    assert trial.metrics(0.5).MOTA == 0.0


@pytest.mark.parametrize("false", [0, 1, 37, 64, 83, 117])
def test_the_best_cut_among_many(tmp_path: Path, false: int) -> None:
    # 120 cars in a row and as many tracks with rising scores, the first of them beside the road.
    sequence = sequence_of(tmp_path, *(label(0, i, ahead_m=10.0 + 5 * i) for i in range(120)), frames=1)
    found = [replace(each, score=i / 120) for i, each in enumerate(perfect(truth(sequence)[0]))]
    for i in range(false):
        found[i] = replace(found[i], ground_m=found[i].ground_m + np.array([0.0, 50.0, 0.0]))
    trial = prepare_evaluation([(sequence, [found])])
    assert trial.best_cut() == false / 120
    best = trial.metrics(trial.best_cut()).as_json()
    assert (best["FP"], best["FN"]) == (0, false)


def test_nothing_to_be_cut(tmp_path: Path) -> None:
    sequence = read_sequences(made_kitti(tmp_path))[0]
    nothing = prepare_evaluation([(sequence, [[], [], []])])
    assert nothing.best_cut() == -np.inf
    assert nothing.metrics().MOTA == 0.0
    write(tmp_path / "label" / "0001.txt", [])
    sequence = read_sequences(tmp_path)[0]
    assert prepare_evaluation([(sequence, [[result(1, np.zeros(3))], [], []])]).best_cut() == -np.inf


def test_without_labels_nothing_is_judged(tmp_path: Path) -> None:
    sequence = read_sequences(made_kitti(tmp_path, labels=False))[0]
    with pytest.raises(DataError, match="sequence 0001: expected labels to judge tracks by, got none"):
        prepare_evaluation([(sequence, [[], [], []])])


@pytest.mark.realdata
def test_a_perfect_tracker_of_the_recorded_sequences(data_root: Path) -> None:
    root = data_root / "mot" / "kitti"
    if not root.is_dir():
        pytest.skip(f"no KITTI sequences at {root}")
    trial = prepare_evaluation([(one, [perfect(labels) for labels in truth(one)]) for one in read_sequences(root)])
    metrics = trial.metrics()
    assert (metrics.GT, metrics.MOTA, metrics.FP, metrics.FN, metrics.IDS) == (15691, 1.0, 0, 0, 0)
    assert metrics.IDF1 == 1.0

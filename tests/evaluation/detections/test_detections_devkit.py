"""nuScenes' detection metric equals that of the published devkit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from made_annotations import VERSION, all_samples, detected, write_annotated

from appocc.evaluation.detections.benchmark import ERRORS, GATES_M, BenchmarkScores, score_benchmark
from appocc.evaluation.detections.box_table import detected_boxes
from appocc.evaluation.detections.truth import read_truth
from appocc.nuscenes import Dataset
from appocc.nuscenes.detection_results import ResultBox, write_results
from appocc.objects import KINDS

THEIRS = dict(zip(ERRORS, ("trans_err", "scale_err", "orient_err", "vel_err", "attr_err"), strict=True))


def devkit_metrics(dataset: Dataset, results: Path, version: str = VERSION) -> Any:
    """The metrics of all classes by nuscenes-devkit's own evaluation; writes a file of splits into the dataset."""
    reason = "nuscenes-devkit is not installed (--no-deps)"
    evaluate = pytest.importorskip("nuscenes.eval.detection.evaluate", reason=reason, exc_type=ImportError)
    from nuscenes.eval.common.config import config_factory
    from nuscenes.nuscenes import NuScenes

    splits = {"made": [scene.name for scene in dataset.scenes]}
    (dataset.root / version / "splits.json").write_text(json.dumps(splits))
    devkit = NuScenes(version, str(dataset.root), verbose=False)
    config = config_factory("detection_cvpr_2019")
    out = str(results.parent / "devkit")
    return evaluate.DetectionEval(devkit, config, str(results), "made", out, verbose=False).evaluate()[0]


def own_scores(dataset: Dataset, boxes: dict[str, list[ResultBox]]) -> BenchmarkScores:
    """The scores of results for all key frames."""
    truth = read_truth(dataset, all_samples(dataset), None, lambda _: None)
    return score_benchmark(detected_boxes(list(boxes.values()), truth.world_from_ego, truth.racks), truth.boxes)


def assert_equal(ours: BenchmarkScores, theirs: Any) -> None:
    """Compare the figures of each class, and the means over our classes."""
    for kind, scores in ours.by_class.items():
        for gate_m in GATES_M:
            assert scores.ap[gate_m] == pytest.approx(theirs.get_label_ap(kind, gate_m), abs=1e-6), (kind, gate_m)
        for name, error in scores.errors.items():
            assert error == pytest.approx(theirs.get_label_tp(kind, THEIRS[name]), abs=1e-6), (kind, name)
    # The devkit's means are over its ten classes.
    for kind in set(theirs.cfg.class_names) - set(ours.by_class):
        del theirs._label_aps[kind], theirs._label_tp_errors[kind]
    theirs.cfg.class_names = tuple(ours.by_class)
    assert ours.mean_ap == pytest.approx(theirs.mean_ap, abs=1e-6)
    assert ours.nds == pytest.approx(theirs.nd_score, abs=1e-6)
    assert ours.errors == pytest.approx({name: theirs.tp_errors[THEIRS[name]] for name in ERRORS}, abs=1e-6)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("seed", "share", "noise"), [(0, 0.3, 1.0), (1, 0.1, 0.3), (2, 0.6, 3.0), (3, 0.93, 1.0), (4, 0.0, 0.0)]
)
def test_equal_to_the_devkit(tmp_path: Path, seed: int, share: float, noise: float) -> None:
    dataset = write_annotated(tmp_path / "data", seed=seed)
    boxes = detected(dataset, seed + 10, share, noise)
    write_results(tmp_path / "results.json", boxes)
    theirs = devkit_metrics(dataset, tmp_path / "results.json")

    ours = own_scores(dataset, boxes)
    assert set(ours.by_class) == set(KINDS)
    assert_equal(ours, theirs)
    if share == 0.3:
        assert 0.2 < ours.mean_ap < 0.8
        assert 0 < ours.errors["AAE"] < 1


@pytest.mark.realdata
@pytest.mark.filterwarnings("ignore")
def test_equal_to_the_devkit_on_recorded_key_frames(data_root: Path, tmp_path: Path) -> None:
    """Real annotations: hidden objects, missing attributes, velocities that are unknown."""
    root = tmp_path / "data"
    shutil.copytree(data_root / "nuscenes_real" / "v1.0-mini", root / "v1.0-mini")
    for part in ("maps", "samples"):
        (root / part).symlink_to(data_root / "nuscenes_real" / part)
    dataset = Dataset(root)
    boxes = detected(dataset, share=0.2, noise=0.5)
    write_results(tmp_path / "results.json", boxes)
    ours = own_scores(dataset, boxes)
    assert {"car", "pedestrian"} <= set(ours.by_class)
    assert_equal(ours, devkit_metrics(dataset, tmp_path / "results.json", "v1.0-mini"))


def test_a_range_is_an_upper_limit(tmp_path: Path) -> None:
    dataset = write_annotated(tmp_path / "data", scenes=1)
    truth = read_truth(dataset, all_samples(dataset), None, lambda _: None)
    boxes = detected(dataset, share=0.0, noise=0.0)
    found = detected_boxes(list(boxes.values()), truth.world_from_ego, truth.racks)
    counts = [
        {kind: scores.positives for kind, scores in score_benchmark(found, truth.boxes, range_m).by_class.items()}
        for range_m in (None, 45.0, 20.0)
    ]
    assert counts[0]["car"] > counts[1]["car"] > counts[2]["car"]
    assert counts[0]["pedestrian"] == counts[1]["pedestrian"] > counts[2]["pedestrian"]

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_amota import random_scene
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.errors import DataError, ShapeError
from cli.main import app
from tracking.evaluation.alignment import align_files
from tracking.evaluation.amota import ScoredFrame, evaluate_amota
from tracking.evaluation.clear_id_hota import evaluate
from tracking.evaluation.evaluate import EvaluationOptions, EvaluationReport, evaluate_files

KITTI = "{frame} {id} {kind} {cut} 0 -10 {left} 100 {right} {bottom} 1.5 1.6 4.0 {x} 1.7 {z} 0.1"


def kitti(frame: int, name: int, x: float, z: float, **changes: Any) -> str:
    """A row; the image box is large, and empty if `left` is -1."""
    values = {"kind": "Car", "cut": 0, "left": 500, "right": 600, "bottom": 200} | changes
    return KITTI.format(frame=frame, id=name, x=x, z=z, **values)


def text(path: Path, *rows: str) -> Path:
    path.write_text("".join(row + "\n" for row in rows))
    return path


def box(name: str, x: float, y: float, score: float | None = None, kind: str = "car") -> dict[str, Any]:
    own = {} if score is None else {"tracking_score": score}
    return {"translation": [x, y, 1.0], "tracking_id": name, "tracking_name": kind, **own}


def results(path: Path, frames: dict[str, list[dict[str, Any]]]) -> Path:
    path.write_text(json.dumps({"meta": {}, "results": frames}))
    return path


# Files on either side ---------------------------------------------------------------------------------------------


def as_file(path: Path, moments: list[ScoredFrame], tracks: bool) -> Path:
    frames = {}
    for k, one in enumerate(moments):
        m = one.frame
        ids, places = (m.track_ids, m.track_xy_m) if tracks else (m.truth_ids, m.truth_xy_m)
        scores = one.scores.tolist() if tracks else [None] * len(ids)
        frames[f"k{k}"] = [
            box(str(i), x, y, s) for i, (x, y), s in zip(ids.tolist(), places.tolist(), scores, strict=True)
        ]
    return results(path, frames)


def test_nuscenes_files_score_as_their_moments_do(tmp_path: Path) -> None:
    scene = random_scene(np.random.default_rng(3), 0, 0.8)
    even = []
    for k, one in enumerate(scene):
        m = one.frame
        all_of = [np.ones(len(ids), np.bool_) for ids in (m.truth_ids, m.track_ids)]
        whole = type(m)(m.truth_ids, m.truth_xy_m, all_of[0], m.track_ids, m.track_xy_m, all_of[1])
        even.append(ScoredFrame(k * 500_000, whole, one.scores))
    paths = as_file(tmp_path / "gt.json", even, False), as_file(tmp_path / "t.json", even, True)
    answer = evaluate_files(*paths, EvaluationOptions())
    assert asdict(answer.metrics) == pytest.approx(asdict(evaluate([one.frame for one in even])))
    assert answer.amota is not None
    expected = evaluate_amota(even)
    assert pytest.approx((expected.AMOTA, expected.AMOTP)) == (answer.amota.AMOTA, answer.amota.AMOTP)
    wider = evaluate_files(*paths, EvaluationOptions(gate_m=4.0))
    assert asdict(wider.metrics) == pytest.approx(asdict(evaluate([one.frame for one in even], 4.0)))
    assert wider.metrics.FN < answer.metrics.FN
    assert wider.protocol["gate_m"] == wider.protocol["hota_zero_m"] == 4.0


def test_kinds(tmp_path: Path) -> None:
    truth = results(
        tmp_path / "gt.json", {"a": [box("1", 0, 0), box("2", 9, 0, kind="bus"), box("3", 20, 0, kind="cone")]}
    )
    found = results(
        tmp_path / "t.json", {"a": [box("7", 0, 0), box("8", 9, 0, kind="bus"), box("9", 50, 0, kind="bus")]}
    )

    def counts(kind: str | None) -> tuple[int, int, int]:
        m = evaluate_files(truth, found, EvaluationOptions(kind)).metrics
        return m.GT, m.FN, m.FP

    assert counts(None) == (3, 1, 1)
    assert counts("car") == counts("Car") == (1, 0, 0)
    assert counts("bus") == (1, 0, 1)
    assert counts("vehicle") == (2, 0, 1)
    with pytest.raises(DataError, match="expected objects of kind 'tram', got bus, car, cone"):
        evaluate_files(truth, found, EvaluationOptions("tram"))


def test_amota_needs_scores(tmp_path: Path) -> None:
    truth = results(tmp_path / "gt.json", {"a": [box("1", 0, 0)], "b": []})
    without = results(tmp_path / "t.json", {"a": [box("1", 0, 0)], "b": [], "c": [box("1", 0, 0)]})
    answer = evaluate_files(truth, without, EvaluationOptions())
    assert answer.amota is None
    assert answer.as_json()["metrics"]["AMOTA"] is None
    assert answer.protocol["samples_without_truth"] == 1
    scored = results(tmp_path / "s.json", {"a": [box("1", 0, 1, 0.5)], "b": []})
    metrics = evaluate_files(truth, scored, EvaluationOptions()).as_json()["metrics"]
    assert (metrics["AMOTA"], metrics["AMOTP"], metrics["MOTP"]) == (1.0, 1.0, 1.0)
    assert (metrics["at_best_MOTA"]["threshold"], metrics["at_best_MOTA"]["TP"]) == (0.5, 1)


def test_motchallenge_by_overlap(tmp_path: Path) -> None:
    """Halves that just overlap by half match, less does not; a conf of 0 in truth is ignored."""
    truth = text(tmp_path / "gt.txt", "1,1,0,0,10,10,1", "1,2,50,0,10,10,1", "1,3,90,0,10,10,0")
    found = text(tmp_path / "t.txt", "1,7,0,0,10,5,1", "1,8,50,0,10,4.9,1", "1,9,90,0,10,10,1", "2,9,0,0,5,5,0")
    answer = evaluate_files(truth, found, EvaluationOptions())
    m = answer.metrics
    assert (m.GT, m.FN, m.FP) == (2, 1, 2)
    assert pytest.approx(0.5) == m.MOTP
    assert answer.protocol["gate_iou"] == 0.5
    assert answer.amota is None


def test_kitti_ignores_what_its_benchmark_does(tmp_path: Path) -> None:
    region = kitti(0, -1, -1000, -1000, kind="DontCare", left=0, right=200, bottom=300)
    truth = text(
        tmp_path / "gt.txt",
        kitti(0, 1, 0, 20),
        kitti(0, 2, 8, 20, kind="Van"),
        kitti(0, 3, 16, 20, cut=1),
        kitti(0, 4, 24, 20, kind="Pedestrian"),
        kitti(0, 5, 0, 70),
        region,
    )
    on_all = [kitti(0, 10 + i, 8 * i, 20) for i in range(4)]
    beside = [
        kitti(0, 20, -20, 20, bottom=125),  # 25 px
        kitti(0, 21, -20, 30, left=90, right=299),  # 110 of 209 px in the region
        kitti(0, 22, -20, 40, left=90, right=311),  # 110 of 221 px
        kitti(0, 23, -20, 50, left=-1, right=-1, bottom=-1),  # no image box
    ]
    found = text(tmp_path / "t.txt", *on_all, *beside)
    m = evaluate_files(truth, found, EvaluationOptions("car")).metrics
    # False are the one on a pedestrian, and the last two.
    assert (m.GT, m.FN, m.FP) == (2, 1, 3)
    m = evaluate_files(truth, found, EvaluationOptions("car", range_m=53.0)).metrics
    assert (m.GT, m.FN, m.FP) == (1, 0, 2)
    everything = evaluate_files(truth, found, EvaluationOptions()).metrics
    assert (everything.GT, everything.FN, everything.FP) == (4, 1, 2)


def test_an_empty_file_of_tracks_finds_nothing(tmp_path: Path) -> None:
    truth = text(tmp_path / "gt.txt", "1,1,0,0,10,10,1", "2,1,0,0,10,10,1")
    m = evaluate_files(truth, text(tmp_path / "t.txt"), EvaluationOptions()).metrics
    assert (m.GT, m.FN, m.FP, m.MOTA) == (2, 2, 0, 0)


def test_files_that_do_not_fit(tmp_path: Path) -> None:
    mot = text(tmp_path / "mot.txt", "1,1,0,0,10,10,1")
    kit = text(tmp_path / "kitti.txt", kitti(0, 1, 0, 20))
    one = results(tmp_path / "one.json", {"a": [box("1", 0, 0)]})
    two = results(tmp_path / "two.json", {"a": [box("1", 0, 0)], "b": [], "c": []})
    cases = [
        (mot, kit, EvaluationOptions(), f"{kit}: expected MOTChallenge text, as {mot} is, got KITTI text"),
        (one, mot, EvaluationOptions(), f"{mot}: expected nuScenes JSON"),
        (text(tmp_path / "none.txt"), mot, EvaluationOptions(), "expected objects, got an empty file"),
        (
            two,
            one,
            EvaluationOptions(),
            f"{one}: expected tracks, or an empty list, for sample b and 1 more, got nothing",
        ),
        (one, one, EvaluationOptions(range_m=5.0), "does not say where the ego is"),
        (mot, mot, EvaluationOptions(range_m=5.0), "--range cannot be answered"),
        (mot, mot, EvaluationOptions(gate_m=5.0), "--gate cannot be answered"),
        (mot, mot, EvaluationOptions(kind="car"), "--kind cannot be answered"),
        (
            results(tmp_path / "no.json", {"a": []}),
            one,
            EvaluationOptions(),
            "expected objects of kind 'any', got none",
        ),
    ]
    for truth, found, question, reason in cases:
        with pytest.raises(DataError) as caught:
            evaluate_files(truth, found, question)
        assert reason in str(caught.value)


# A dataset --------------------------------------------------------------------------------------------------------


def tracks_of(tiny: TinyDataset, path: Path, shift_m: float = 0.0) -> Path:
    """The annotations as tracks."""
    frames: dict[str, list[dict[str, Any]]] = {row["token"]: [] for row in tiny.tables["sample"]}
    for row in tiny.tables["sample_annotation"]:
        x, y, _ = row["translation"]
        kind = "car" if row["instance_token"] == token("car") else "pedestrian"
        frames[row["sample_token"]].append(box(row["instance_token"], x + shift_m, y, 0.9, kind))
    return results(path, frames)


def test_against_a_dataset(tiny: TinyDataset, tmp_path: Path) -> None:
    found = tracks_of(tiny, tmp_path / "t.json", 0.5)
    answer = evaluate_files(tiny.root, found, EvaluationOptions())
    m = answer.metrics
    assert len(tiny.tables["sample_annotation"]) == m.GT
    assert (m.FN, m.FP) == (0, 0)
    assert pytest.approx(0.5) == m.MOTP
    assert answer.amota is not None
    assert answer.amota.AMOTA == 1
    assert answer.protocol["scenes"] == 1
    assert answer.protocol["range_m"] == {"bicycle": 40, "motorcycle": 40, "pedestrian": 40, "others": 50}
    reaches = [
        evaluate_files(tiny.root, found, EvaluationOptions(kind)).protocol["range_m"]
        for kind in ("car", "pedestrian")
    ]
    assert reaches == [50, 40]
    cars = evaluate_files(tiny.root, found, EvaluationOptions("car", range_m=9.0)).metrics
    # The car is 10, 7.5 and 5 m from the ego.
    assert (cars.GT, cars.FN, cars.FP) == (2, 0, 0)


def test_boxes_without_points_are_ignored(tiny: TinyDataset, tmp_path: Path) -> None:
    found = tracks_of(tiny, tmp_path / "t.json")
    for i, (lidar, radar) in enumerate([(0, 0), (0, 2), (5, 0)]):
        tiny.row("sample_annotation", token("car", i)).update(num_lidar_pts=lidar, num_radar_pts=radar)
    tiny.write()
    answer = evaluate_files(tiny.root, found, EvaluationOptions("car"))
    assert (answer.metrics.GT, answer.metrics.FP) == (2, 0)
    # nuScenes removes them, so that the track there is false.
    assert answer.amota is not None
    assert answer.amota.best is not None
    assert (answer.amota.best.GT, answer.amota.best.FP) == (2, 1)


def test_beyond_the_range_of_the_class(tiny: TinyDataset, tmp_path: Path) -> None:
    for i in range(3):
        tiny.row("sample_annotation", token("car", i))["translation"] = [100.0, 255.0, 0.8]
    tiny.write()
    # The ego is at y = 200, 202.5 and 205 m.
    m = evaluate_files(tiny.root, tracks_of(tiny, tmp_path / "t.json"), EvaluationOptions("car")).metrics
    assert (m.GT, m.FP) == (0, 0)
    far = evaluate_files(
        tiny.root, tracks_of(tiny, tmp_path / "t.json"), EvaluationOptions("car", range_m=53.0)
    ).metrics
    assert (far.GT, far.FP) == (2, 0)


def test_a_dataset_that_does_not_fit(tiny: TinyDataset, tmp_path: Path) -> None:
    cases = [
        (results(tmp_path / "t.json", {"x": [box("1", 0, 0)]}), "expected samples of an annotated scene"),
        (results(tmp_path / "p.json", {token("sample", 0): []}), "for sample " + token("sample", 1) + " and 1 more"),
        (text(tmp_path / "mot.txt", "1,1,0,0,10,10,1"), "expected nuScenes JSON, as "),
    ]
    for found, reason in cases:
        with pytest.raises(DataError) as caught:
            evaluate_files(tiny.root, found, EvaluationOptions())
        assert str(caught.value).startswith(f"{found}: ")
        assert reason in str(caught.value)


def test_scenes_share_no_ids(tiny: TinyDataset, tmp_path: Path) -> None:
    assert {frame.scene for frame in align_files(tiny.root, tracks_of(tiny, tmp_path / "t.json")).frames} == {
        "scene-tiny"
    }


def test_the_folder_of_one_scene_has_its_tracks_in_both_formats(tiny: TinyDataset, tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    text(folder / "mot.txt", "1,1,0,0,10,10,1")
    with pytest.raises(DataError, match=rf"{tiny.root}: expected a folder with mot.txt, .*, got neither"):
        evaluate_files(tiny.root, folder, EvaluationOptions())
    tracks_of(tiny, folder / "tracking.json")
    assert evaluate_files(tiny.root, folder, EvaluationOptions()).metrics.MOTA == 1
    truth = text(tmp_path / "mot.txt", "1,1,0,0,10,10,1").parent
    assert evaluate_files(truth, folder, EvaluationOptions()).protocol["format"] == "MOTChallenge text"


def test_every_sequence_of_a_folder_needs_a_file(tmp_path: Path) -> None:
    row = "1,1,0,0,10,10,1"
    truth, tracks = tmp_path / "gt", tmp_path / "out"
    for folder, names in ((truth, "abc"), (tracks, "a")):
        folder.mkdir()
        for name in names:
            text(folder / f"{name}.txt", row)
    with pytest.raises(DataError, match=rf"{tracks}: expected a file, .*, for b.txt and 1 more of {truth}"):
        evaluate_files(truth, tracks, EvaluationOptions())
    for name in "bc":
        text(tracks / f"{name}.txt")
    metrics = evaluate_files(truth, tracks, EvaluationOptions()).metrics
    assert (metrics.GT, metrics.FN) == (3, 2)


@pytest.mark.parametrize("score", [float("nan"), float("inf")])
def test_a_minimum_score_is_a_number(score: float) -> None:
    with pytest.raises(ShapeError, match="--min-score: expected a finite number, got"):
        EvaluationOptions(min_score=score)


# The command ------------------------------------------------------------------------------------------------------


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["eval", "tracks", *map(str, words)])


def test_the_command_for_machines(tiny: TinyDataset, tmp_path: Path) -> None:
    found = tracks_of(tiny, tmp_path / "t.json")
    done = run("--gt", tiny.root, "--tracks", found, "--kind", "car", "--json")
    assert done.exit_code == 0, done.output
    metrics = json.loads(done.stdout)
    assert set(metrics) == {"metrics", "protocol"}
    assert (metrics["metrics"]["MOTA"], metrics["metrics"]["HOTA"], metrics["metrics"]["AMOTA"]) == (1, 1, 1)
    assert metrics["protocol"]["kind"] == "car"
    assert metrics["protocol"]["gate_m"] == 2


def test_the_command_for_people(tmp_path: Path) -> None:
    truth = text(tmp_path / "gt.txt", "1,1,0,0,10,10,1", "2,1,0,0,10,10,1")
    found = text(tmp_path / "t.txt", "1,7,0,0,10,10,1")
    done = run("--gt", truth, "--tracks", found)
    assert done.exit_code == 0
    assert done.stdout == ""
    for part in ("2 objects", "IoU of 0.5", "50.00", "IDS", "FRAG"):
        assert part in done.stderr
    assert "AMOTA" not in done.stderr


def test_command_prints_the_best_threshold(tiny: TinyDataset, tmp_path: Path) -> None:
    found = tracks_of(tiny, tmp_path / "t.json")
    more = json.loads(found.read_text())["results"] | {"elsewhere": []}
    done = run("--gt", tiny.root, "--tracks", results(found, more), "--range", 30)
    assert done.exit_code == 0
    assert "within 40 or 50 m by class" in run("--gt", tiny.root, "--tracks", found).stderr
    for part in ("within 30 m", "1 samples of the tracks", "AMOTA", "with scores from 0.9000", "MOTA 100.00, IDS 0"):
        assert part in done.stderr


def test_the_command_on_bad_files(tmp_path: Path) -> None:
    done = run("--gt", tmp_path / "none", "--tracks", tmp_path / "none")
    assert isinstance(done.exception, DataError)
    assert done.exception.exit_code == 2


# Published scores -------------------------------------------------------------------------------------------------

PUBLISHED = {
    "TUD-Campus": (0.526462, 0.277201, 0.557659, 7, 7),
    "TUD-Stadtmitte": (0.564014, 0.345904, 0.644619, 7, 6),
}


def tud(data_root: Path, name: str) -> EvaluationReport:
    folder = data_root / "mot" / "tud" / name
    return evaluate_files(folder / "gt.txt", folder / "test.txt", EvaluationOptions())


@pytest.mark.realdata
@pytest.mark.parametrize("name", PUBLISHED)
def test_published_scores(data_root: Path, name: str) -> None:
    m = tud(data_root, name).metrics
    mota, motp, idf1, switches, fragments = PUBLISHED[name]
    assert pytest.approx((mota, motp, idf1), abs=5e-7) == (m.MOTA, m.MOTP, m.IDF1)
    assert switches == m.IDS
    assert fragments == m.FRAG


@pytest.mark.realdata
def test_recorded_labels_against_themselves(data_root: Path) -> None:
    path = data_root / "mot" / "kitti" / "label" / "0003.txt"
    m = evaluate_files(path, path, EvaluationOptions("car", range_m=50.0)).metrics
    assert m.GT > 100
    assert (m.MOTA, m.IDF1, m.HOTA, m.FRAG) == (1, 1, 1, 0)

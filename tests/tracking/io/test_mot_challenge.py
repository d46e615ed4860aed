from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError, ShapeError
from cli.main import app
from tracking.detections import MAX_LOG_ODDS
from tracking.evaluation.evaluate import EvaluationOptions, evaluate_files
from tracking.io import mot_challenge
from tracking.io.mot_challenge import MotSequence, read_mot_detections, write_mot_tracks
from tracking.pipeline import people_config, run_tracker
from tracking.presets import PEOPLE_IN_IMAGE, PEOPLE_ON_GROUND
from tracking.tracker import Tracker
from tracking.tracks import Track

FPS = 25.0


def write(path: Path, rows: Iterable[str]) -> Path:
    path.write_text("".join(f"{row}\n" for row in rows))
    return path


def walker(frame: int, left: float = 100.0, conf: float = 1.0, more: str = "") -> str:
    """A person of 170 pixels who moves 2 pixels per frame to the right: 0.5 m/s."""
    return f"{frame},-1,{left + 2 * frame},50,60,170,{conf}{more}"


def confidences(path: Path, *conf: float) -> list[float]:
    sequence = read_mot_detections(write(path, [walker(i, conf=c) for i, c in enumerate(conf)]), FPS)
    return [frame.detections.log_odds[0] for frame in sequence.frames]


# Reading ----------------------------------------------------------------------------------------------------------


def test_boxes_in_the_picture(tmp_path: Path) -> None:
    rows = ["7,-1,10,20,60,170,0.5,-1,-1,-1", "4,99,100,50,40,85,0.9,-1,-1,-1", "", "4,-1,0,0,60,340,0.2,-1,-1,-1\r"]
    sequence = read_mot_detections(write(tmp_path / "det.txt", rows), FPS)
    assert people_config(sequence) is PEOPLE_IN_IMAGE
    assert sequence.px_per_m == pytest.approx(100)  # the median box has 170 pixels
    assert [frame.number for frame in sequence.frames] == [4, 5, 6, 7]
    assert [frame.timestamp_us for frame in sequence.frames] == [160_000, 200_000, 240_000, 280_000]
    assert [len(frame.detections) for frame in sequence.frames] == [2, 0, 0, 1]
    first = sequence.frames[0]
    np.testing.assert_array_equal(first.boxes_px, [[100, 50, 40, 85], [0, 0, 60, 340]])
    np.testing.assert_allclose(first.detections.ground_m, [[1.2, -1.35, 0], [0.3, -3.4, 0]])
    np.testing.assert_allclose(first.detections.size_m, [[0.255, 0.255, 0.85], [1.02, 1.02, 3.4]])
    np.testing.assert_allclose(first.detections.log_odds, np.log([9, 0.25]))
    assert first.detections.kind == ("pedestrian",) * 2
    assert not first.detections.heading_known.any()
    np.testing.assert_array_equal(first.world_from_ego, np.eye(4))


def test_places_on_the_ground(tmp_path: Path) -> None:
    sequence = read_mot_detections(write(tmp_path / "det.txt", ["1,-1,10,20,60,170,0.5,4.5,-1,0.25"]), FPS)
    assert sequence.px_per_m is None
    assert people_config(sequence) is PEOPLE_ON_GROUND
    seen = sequence.frames[0].detections
    np.testing.assert_array_equal(seen.ground_m, [[4.5, -1, 0.25]])
    np.testing.assert_allclose(seen.size_m, [[0.51, 0.51, 1.7]])


def test_empty_frames_are_skipped(tmp_path: Path) -> None:
    rows = [walker(i, 0) for i in range(1, 6)] + [walker(40, 0), walker(999_000, -1.998e6), walker(999_999, -2e6)]
    sequence = read_mot_detections(write(tmp_path / "det.txt", rows), FPS)
    numbers = [frame.number for frame in sequence.frames]
    assert numbers == [*range(1, 32), *range(40, 67), *range(999_000, 999_027), 999_999]
    assert [frame.number for frame in sequence.frames if len(frame.detections)] == [
        *range(1, 6),
        40,
        999_000,
        999_999,
    ]
    assert [frame.timestamp_us for frame in sequence.frames] == [number * 40_000 for number in numbers]


def test_skipped_frames_change_no_track(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [walker(i) for i in (*range(20), *range(30, 40), *range(90, 110))]
    path = write(tmp_path / "det.txt", rows)
    short = read_mot_detections(path, FPS)
    monkeypatch.setattr(
        mot_challenge, "_kept_frames", lambda numbers, fps: np.arange(numbers.min(), numbers.max() + 1)
    )
    full = read_mot_detections(path, FPS)
    assert (len(short.frames), len(full.frames)) == (86, 110)
    for name, sequence in (("short", short), ("full", full)):
        write_mot_tracks(tmp_path / name, sequence, run_tracker(Tracker(people_config(sequence)), sequence.frames))
    assert (tmp_path / "short").read_text() == (tmp_path / "full").read_text()


def test_columns_after_conf_that_are_no_place(tmp_path: Path) -> None:
    rows = ["1,-1,10,20,60,170,0.5,1,0.8", "2,-1,10,20,60,170,0.5"]
    assert read_mot_detections(write(tmp_path / "gt.txt", rows), FPS).px_per_m == pytest.approx(100)


def test_confidences_within_0_and_1_are_probabilities(tmp_path: Path) -> None:
    expected = [0, np.log(3), -MAX_LOG_ODDS, MAX_LOG_ODDS]
    np.testing.assert_allclose(confidences(tmp_path / "d", 0.5, 0.75, 0, 1), expected, atol=1e-9)


def test_other_confidences_count_by_their_rank(tmp_path: Path) -> None:
    # The shares below them, with half of their equals, are 1/8, 4/8 twice and 7/8.
    expected = np.log([1 / 7, 1, 1, 7]) + 1
    np.testing.assert_allclose(confidences(tmp_path / "d", -30, 12, 12, 800), expected, atol=1e-9)
    np.testing.assert_allclose(confidences(tmp_path / "d", 0.1, 0.2, 0.2, 1.1), expected, atol=1e-9)


@pytest.mark.parametrize("conf", [-1, 0, 0.5, 1, 100])
def test_equal_confidences_carry_no_information(tmp_path: Path, conf: float) -> None:
    assert confidences(tmp_path / "d", conf, conf) == [1.0, 1.0]


GOOD = walker(1)
DAMAGED = [
    ([], "expected detections, got an empty file"),
    ([GOOD, "2,-1,5,6,2"], "line 2: expected at least 7 columns, got 5"),
    (["1 -1 5 6 2 3 1"], "line 1: expected at least 7 columns, got 1"),
    (["0,2,600,170,700,240,3,1.5,1.8,4.2,2,1.6,20,-1.5,-1.6"], "line 1: expected at most 10 columns, got 15"),
    ([GOOD, "", "2,-1,5,6,two,3,1"], "line 3: expected numbers, got 'two'"),
    (["2,-1,5,6,nan,3,1"], "line 1: expected finite numbers up to 1e+09, got nan"),
    (["2,-1,5,6,2,3,inf"], "line 1: expected finite numbers up to 1e+09, got inf"),
    (["2,-1,5,6,2,3,1,nan,1,1"], "line 1: expected finite numbers up to 1e+09, got nan"),
    (["2,-1,5,6,2,0,1"], "line 1: expected a positive width and height, got 2 x 0"),
    (["0.5,-1,5,6,2,3,1"], "line 1: expected a whole number from 0 for frame, got 0.5"),
    (["-1,-1,5,6,2,3,1"], "line 1: expected a whole number from 0 for frame, got -1"),
    ([GOOD, walker(2, more=",1,2,3")], "line 2: expected no place x,y,z, as in the lines before, got one"),
    (
        [walker(1, more=",1,2,3"), walker(2, more=",-1,-1,-1")],
        "line 2: expected a place x,y,z, as in the lines before",
    ),
    ([GOOD, walker(1_000_001)], "expected up to 1000000 frames, got 1 to 1000001"),
    (
        ["1,-1,0,0,1,1e-7,1", "2,-1,0,0,1,1e-7,1", "3,-1,9e8,9e8,1,1,1"],
        "detections ground_m: expected at most 1e+09 m",
    ),
]


@pytest.mark.parametrize(("rows", "reason"), DAMAGED, ids=[reason[:40] for _, reason in DAMAGED])
def test_damaged_files(tmp_path: Path, rows: list[str], reason: str) -> None:
    path = write(tmp_path / "det.txt", rows)
    with pytest.raises(DataError) as caught:
        read_mot_detections(path, FPS)
    assert str(caught.value).startswith(f"{path}: ")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        read_mot_detections(tmp_path / "none", FPS)


@pytest.mark.parametrize("fps", [0.0, -25.0, 1e-300, float("nan"), float("inf"), 1001.0])
def test_frame_rates(tmp_path: Path, fps: float) -> None:
    with pytest.raises(DataError, match=r"expected 0\.01 \.\. 1000 frames a second, got"):
        read_mot_detections(write(tmp_path / "d", [GOOD]), fps)


def test_a_frame_checks_its_boxes(tmp_path: Path) -> None:
    frame = read_mot_detections(write(tmp_path / "d", [GOOD]), FPS).frames[0]
    with pytest.raises(ShapeError, match="boxes_px"):
        replace(frame, boxes_px=np.zeros((2, 4)))


# Writing ----------------------------------------------------------------------------------------------------------


def someone(x: float, y: float, detection: int | None, number: int = 3) -> Track:
    place, unknown = np.array([x, y, 0.5]), np.full(3, np.nan)
    seen = detection is not None
    return Track(
        id=number,
        position_world_m=place,
        velocity_world_mps=np.zeros(2),
        yaw_world_rad=0.0,
        heading_known=False,
        length_m=0.5,
        width_m=0.5,
        rgb=unknown,
        score=0.75,
        seen=seen,
        detection=detection,
    )


def tracks_of(sequence: MotSequence) -> tuple[tuple[Track, ...], ...]:
    return run_tracker(Tracker(people_config(sequence)), sequence.frames)


def lines_of(path: Path, sequence: MotSequence, *tracks: tuple[Track, ...]) -> list[str]:
    write_mot_tracks(path, sequence, tracks)
    return path.read_text().splitlines()


def test_boxes_stand_on_the_position_of_the_track(tmp_path: Path) -> None:
    rows = [walker(1, left=300), walker(1), walker(3)]
    sequence = read_mot_detections(write(tmp_path / "det.txt", rows), FPS)
    moments = (someone(1.3, -2.1, 1), someone(0, 0, None, 8)), (someone(1.5, -2.0, None),), ()
    assert lines_of(tmp_path / "out" / "a.txt", sequence, *moments) == [
        "1,3,100.00,40.00,60.00,170.00,0.7500,-1,-1,-1",
        "2,3,120.00,30.00,60.00,170.00,0.7500,-1,-1,-1",
    ]


def test_sizes_of_boxes_are_smoothed(tmp_path: Path) -> None:
    sizes = np.array([[60, 170], [66, 187], [60, 153], [60, 170]])
    rows = [f"{i},-1,0,0,{width},{height},1" for i, (width, height) in enumerate(sizes)]
    sequence = read_mot_detections(write(tmp_path / "det.txt", rows), FPS)
    lines = lines_of(tmp_path / "a.txt", sequence, *[(someone(1, -2, 0),)] * 4)
    written = np.array([[float(column) for column in line.split(",")[4:6]] for line in lines])
    two = np.sqrt(sizes[0] * sizes[1])
    three = two**0.6 * sizes[2] ** 0.4
    expected = [sizes[0], two, three, three**0.6 * sizes[3] ** 0.4]
    np.testing.assert_allclose(written, expected, atol=0.006)


def test_on_the_ground_the_last_box_is_kept_and_the_position_is_written(tmp_path: Path) -> None:
    sequence = read_mot_detections(write(tmp_path / "det.txt", [walker(i, more=",5,6,0") for i in (1, 3)]), FPS)
    moments = (someone(5, 6, 0),), (someone(5.5, 6.25, None),), ()
    assert lines_of(tmp_path / "a.txt", sequence, *moments) == [
        "1,3,102.00,50.00,60.00,170.00,0.7500,5.000,6.000,0.500",
        "2,3,102.00,50.00,60.00,170.00,0.7500,5.500,6.250,0.500",
    ]


def test_what_cannot_be_written(tmp_path: Path) -> None:
    sequence = read_mot_detections(write(tmp_path / "det.txt", [GOOD]), FPS)
    with pytest.raises(DataError, match="cannot be written"):
        write_mot_tracks(tmp_path / "det.txt" / "a.txt", sequence, [()])


# Following --------------------------------------------------------------------------------------------------------


def test_people_who_cross_keep_their_ids(tmp_path: Path) -> None:
    """One comes from the left, a nearer one from the right, at 1.5 m/s; the farther is hidden for 0.2 s."""
    rows = []
    for i in range(75):
        rows.append(f"{i},-1,{100 + 6 * i},60,60,170,-1")
        if not 34 <= i < 39:
            rows.append(f"{i},-1,{550 - 6 * i},40,50,150,-1")
    tracks = tracks_of(read_mot_detections(write(tmp_path / "d", rows), FPS))
    places = {track.id: [] for track in tracks[10]}  # type: ignore[var-annotated]
    for moment in tracks:
        for track in moment:
            places[track.id].append(track.position_world_m[0])
    assert len(places) == 2
    for path in places.values():
        assert (np.diff(path) > 0).all() or (np.diff(path) < 0).all()


def test_a_new_person_needs_two_boxes_but_in_the_first_frame(tmp_path: Path) -> None:
    rows = [walker(i) for i in range(8)] + [walker(i, 600) for i in (0, 4, 5, 6)] + [walker(2, 900)]
    tracks = tracks_of(read_mot_detections(write(tmp_path / "d", rows), FPS))
    assert [[track.id for track in moment if track.seen] for moment in tracks[:7]] == [
        [1, 2],
        *[[1]] * 3,
        *[[1, 2]] * 3,
    ]


def test_people_go_backwards_and_sideways(tmp_path: Path) -> None:
    """Down the picture, then up, then to the left, without pause."""
    steps = np.repeat([[0, 4], [0, -4], [-4, 0]], 25, axis=0)
    places = np.array([300, 100]) + np.cumsum(steps, axis=0)
    rows = [f"{i},-1,{x},{y},60,170,0.9" for i, (x, y) in enumerate(places)]
    tracks = tracks_of(read_mot_detections(write(tmp_path / "d", [*rows, walker(0, 0, 0.8)]), FPS))
    assert {track.id for moment in tracks[5:] for track in moment} == {1}


def test_people_on_the_ground_are_followed_by_their_places(tmp_path: Path) -> None:
    """Two far apart whose boxes are the same in the picture, and a third whose box jumps about."""
    rows = []
    for i in range(40):
        rows += [f"{i},-1,100,50,60,170,1,{4 + 0.05 * i},{y},0" for y in (2, 9)]
        rows.append(f"{i},-1,{300 * (i % 2)},50,60,170,1,20,{5 - 0.04 * i},0")
    tracks = tracks_of(read_mot_detections(write(tmp_path / "d", rows), FPS))
    assert [[track.id for track in moment] for moment in tracks[5:]] == [[1, 2, 3]] * 35
    np.testing.assert_allclose([track.speed_mps for track in tracks[-1]], [1.25, 1.25, 1.0], atol=0.05)


# The command ------------------------------------------------------------------------------------------------------


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["track", *map(str, words)])


def test_people_are_tracked_and_written(tmp_path: Path) -> None:
    path = write(tmp_path / "seq.txt", [walker(i) for i in range(1, 30)])
    result = run("--mot", path, "--fps", 25, "--json")
    assert result.exit_code == 0, result.output
    written = tmp_path / "tracks" / "seq.txt"
    assert json.loads(result.stdout) == {
        "detections": str(path),
        "frames": 29,
        "followed": "in the picture",
        "tracks": 1,
        "files": [str(written)],
    }
    rows = np.loadtxt(written, delimiter=",")
    assert set(rows[:, 1]) == {1}
    np.testing.assert_allclose(rows[:, 2:6], [[100 + 2 * i, 50, 60, 170] for i in rows[:, 0]], atol=2)
    metrics = evaluate_files(
        write(tmp_path / "gt.txt", [walker(i) for i in range(1, 30)]), written, EvaluationOptions()
    ).metrics
    assert (metrics.FP, metrics.IDS) == (0, 0)
    assert metrics.FN <= 5
    assert "1 people in 29 frames, followed in the picture" in result.stderr


def test_people_below_the_minimum_score_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "seq.txt", [walker(i, conf=0.7 + 0.001 * i) for i in range(1, 30)])
    result = run("--mot", path, "--fps", 25, "--min-score", 0.999)
    assert "0 people in 29 frames" in result.stderr
    assert "1 more stay below --min-score 0.999; their highest score is 0." in result.stderr


def test_the_detections_are_not_overwritten(tmp_path: Path) -> None:
    path = write(tmp_path / "seq.txt", [GOOD])
    error = run("--mot", path, "--fps", 25, "--out", tmp_path).exception
    assert isinstance(error, DataError)
    assert "written over the detections" in str(error)
    assert path.read_text() == GOOD + "\n"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--mot", "d"), "--mot needs --fps, got no --fps"),
        (
            ("--mot", "d", "--fps", "25", "ROOT"),
            "--mot goes only with --fps, --min-score, --out and --json, got ROOT",
        ),
        (
            ("--mot", "d", "--fps", "25", "--scene", "s"),
            "--mot goes only with --fps, --min-score, --out and --json, got --scene",
        ),
        (("--mot", "d", "--fps", "25", "--bev", "b"), "expected one of --bev, --detections, --kitti and --mot"),
        (("--mot", "d", "--kitti", "k"), "got --kitti and --mot"),
        (
            ("ROOT", "--scene", "s", "--bev", "b", "--fps", "2"),
            "--bev goes only with ROOT, --scene, --version, --smooth, --min-score, --out",
        ),
    ],
)
def test_invalid_option_combinations(words: tuple[str, ...], complaint: str) -> None:
    error = run(*words).exception
    assert isinstance(error, AppoccError)
    assert error.exit_code == 2
    assert complaint in str(error)
    assert "\n" not in str(error)


# Recorded people --------------------------------------------------------------------------------------------------


def seen_of(truth: FloatArray, seed: int) -> FloatArray:
    """Detections made of true boxes: one of five is missing, the others are off by 2.5 % of their height."""
    random = np.random.default_rng(seed)
    seen = truth[random.random(len(truth)) >= 0.2].copy()
    seen[:, 2:4] += random.normal(0, 0.025, (len(seen), 2)) * seen[:, 5:6]
    seen[:, 4:6] *= np.exp(random.normal(0, 0.025, (len(seen), 1)))
    seen[:, 1], seen[:, 6], seen[:, 7:] = -1, random.uniform(0.7, 1, len(seen)), -1
    return seen


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["TUD-Campus", "TUD-Stadtmitte"])
def test_recorded_people(data_root: Path, tmp_path: Path, name: str) -> None:
    truth = data_root / "mot" / "tud" / name / "gt.txt"
    if not truth.is_file():
        pytest.skip(f"no recorded people at {truth}")
    np.savetxt(tmp_path / "det.txt", seen_of(np.loadtxt(truth, delimiter=","), 0), fmt="%.3f", delimiter=",")
    sequence = read_mot_detections(tmp_path / "det.txt", FPS)
    write_mot_tracks(tmp_path / "t.txt", sequence, tracks_of(sequence))
    metrics = evaluate_files(truth, tmp_path / "t.txt", EvaluationOptions()).metrics
    assert metrics.IDF1 > 0.85
    assert metrics.IDS <= 4

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_kitti import PROJECTION, box_around, detection, label, made_kitti, pose, region, write

from appocc.checks import FloatArray
from appocc.errors import DataError, ShapeError
from tracking.detections import MAX_LOG_ODDS, Detections
from tracking.io.kitti import KittiSequence, KittiView, read_sequences
from tracking.io.kitti_results import kitti_results, project_box, write_kitti_results
from tracking.pipeline import track_sequence
from tracking.tracks import Track


class Parrot:
    """A tracker that returns the detections in reverse order; the first of each frame is marked as unseen."""

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> tuple[Track, ...]:
        ground = detections.ground_m @ world_from_ego[:3, :3].T + world_from_ego[:3, 3]
        return tuple(
            track(ground[i], detections.yaw_rad[i], i if i else None, detections.kind[i])
            for i in reversed(range(len(detections)))
        )


def track(place: FloatArray, yaw: float, detection: int | None = None, kind: str = "car") -> Track:
    seen = detection is not None
    nowhere = np.full(3, np.nan)
    return Track(
        id=7,
        position_world_m=place,
        velocity_world_mps=np.zeros(2),
        yaw_world_rad=float(yaw),
        heading_known=True,
        length_m=4.2,
        width_m=1.8,
        rgb=nowhere,
        score=0.75,
        seen=seen,
        height_m=1.5,
        kind=kind,
        detection=detection,
    )


def only(root: Path) -> KittiSequence:
    (sequence,) = read_sequences(root)
    return sequence


# Reading ----------------------------------------------------------------------------------------------------------


def test_a_sequence_is_read(tmp_path: Path) -> None:
    sequence = only(made_kitti(tmp_path))
    assert sequence.name == "0001"
    np.testing.assert_array_equal(sequence.projection, PROJECTION)
    assert [frame.timestamp_us for frame in sequence.frames] == [0, 100_000, 200_000]
    frame = sequence.frames[2]
    np.testing.assert_allclose(frame.world_from_ego, np.eye(4) + np.eye(4, k=3) * 2.0)
    found = frame.detections
    np.testing.assert_allclose(found.ground_m, [[18.0, -2.0, -1.6]])
    np.testing.assert_allclose(found.yaw_rad, [1.5 - np.pi / 2])
    np.testing.assert_allclose(found.size_m, [[1.8, 4.2, 1.5]])
    assert (found.log_odds.tolist(), found.kind, found.heading_known.tolist()) == ([3.0], ("car",), [True])
    np.testing.assert_array_equal(frame.image_boxes_px, [[600, 170, 700, 240]])
    assert sequence.labels is not None
    truth = sequence.labels[2]
    assert (truth.ids.tolist(), truth.types) == ([4], ("Car",))
    for name in ("ground_m", "yaw_rad", "size_m"):
        np.testing.assert_allclose(getattr(truth, name), getattr(found, name))
    np.testing.assert_array_equal(truth.image_boxes_px, frame.image_boxes_px)


def test_the_world_is_turned_as_the_ego_is(tmp_path: Path) -> None:
    # The camera has turned to the right by 90 degrees, about its y axis, and went 3 m down, 5 m to the right.
    write(made_kitti(tmp_path, 1) / "pose" / "0001.txt", ["0 0 1 5  0 1 0 3  -1 0 0 0"])
    expected = [[0, 1, 0, 0], [-1, 0, 0, -5], [0, 0, 1, -3], [0, 0, 0, 1]]
    np.testing.assert_allclose(only(tmp_path).frames[0].world_from_ego, expected, atol=1e-12)


def test_kinds_and_order_of_rows(tmp_path: Path) -> None:
    rows = [detection(1, 3), detection(0, 1), detection(1, 2, ahead_m=30.0)]
    write(made_kitti(tmp_path) / "detection_made" / "0001.txt", rows)
    frames = only(tmp_path).frames
    assert [frame.detections.kind for frame in frames] == [("pedestrian",), ("bicycle", "car"), ()]
    np.testing.assert_allclose(frames[1].detections.ground_m[:, 0], [19.0, 30.0])


def test_types_as_words(tmp_path: Path) -> None:
    rows = [detection(0).replace(",2,", f",{word},", 1) for word in ("Pedestrian", "car", "Cyclist")]
    write(made_kitti(tmp_path) / "detection_made" / "0001.txt", rows)
    assert only(tmp_path).frames[0].detections.kind == ("pedestrian", "car", "bicycle")


def test_scores_within_0_and_1_are_probabilities(tmp_path: Path) -> None:
    path = made_kitti(tmp_path, names=("0001", "0002")) / "detection_made" / "0001.txt"
    write(path, [detection(0, score=0.5), detection(1, score=0.0)])
    # Another sequence says that they are log-odds.
    assert [frame.detections.log_odds.tolist() for frame in read_sequences(tmp_path)[0].frames] == [[0.5], [0.0], []]
    write(tmp_path / "detection_made" / "0002.txt", [detection(0, score=1.0)])
    first, second = read_sequences(tmp_path)
    np.testing.assert_allclose(first.frames[0].detections.log_odds, [0.0], atol=1e-12)
    np.testing.assert_allclose(first.frames[1].detections.log_odds, [-MAX_LOG_ODDS])
    np.testing.assert_allclose(second.frames[0].detections.log_odds, [MAX_LOG_ODDS])


def test_labels_of_all_kinds(tmp_path: Path) -> None:
    rows = [label(1, 5, "Van", "1 2"), region(1, "0 0 10 20"), label(1, 4, state="0 3"), region(0, "1 2 3 4")]
    write(made_kitti(tmp_path) / "label" / "0001.txt", rows)
    labels = only(tmp_path).labels
    assert labels is not None
    assert [len(frame.ids) for frame in labels] == [0, 2, 0]
    assert (labels[1].types, labels[1].truncated.tolist(), labels[1].occluded.tolist()) == (
        ("Van", "Car"),
        [1, 0],
        [2, 3],
    )
    np.testing.assert_array_equal(labels[1].dont_care_px, [[0, 0, 10, 20]])
    assert labels[2].dont_care_px.shape == (0, 4)


def test_no_labels_and_no_detections(tmp_path: Path) -> None:
    write(made_kitti(tmp_path, labels=False) / "detection_made" / "0001.txt", [])
    sequence = only(tmp_path)
    assert sequence.labels is None
    assert [len(frame.detections) for frame in sequence.frames] == [0, 0, 0]


def _without_detections(root: Path) -> None:
    (root / "detection_made" / "0001.txt").unlink()


def _folders(root: Path) -> None:
    (root / "detection_other").mkdir()


def _rows(name: str, *rows: str) -> Callable[[Path], object]:
    return lambda root: write(root / name / "0001.txt", rows)


@pytest.mark.parametrize(
    ("harm", "complaint"),
    [
        (_without_detections, r"detection_made: expected files NNNN.txt, got none"),
        (_folders, r"expected one folder 'detection_\*', got detection_made, detection_other"),
        (_rows("detection_made", detection(0)[:-5]), r"0001.txt: line 1: expected 15 columns .*, got 14"),
        (_rows("detection_made", "", detection(0, kind=4)), r"line 2: expected type 1, 2 or 3, got 4"),
        (_rows("detection_made", detection(0).replace("1.8", "0")), r"line 1: expected positive h, w and l, got 0 m"),
        (_rows("detection_made", detection(0).replace("1.8", "car")), r"line 1: expected numbers, got 'car'"),
        (
            _rows("detection_made", detection(0, score=np.nan)),
            r"line 1: expected finite numbers up to 1e\+09, got nan",
        ),
        (_rows("detection_made", detection(0, score=1e30)), r"expected finite numbers up to 1e\+09, got 1e\+30"),
        (_rows("detection_made", detection(-1)), r"line 1: expected a whole number from 0 for frame, got -1"),
        (_rows("detection_made", "0.5" + detection(0)[1:]), r"expected a whole number from 0 for frame, got 0.5"),
        (_rows("detection_made", detection(3)), r"expected frames below 3, the number of poses, got 3"),
        (_rows("pose"), r"pose/0001.txt: expected poses, got an empty file"),
        (_rows("pose", pose(0), "1 2 3"), r"pose/0001.txt: line 2: expected 12 numbers, got 3"),
        (_rows("pose", pose(0).replace("1", "2")), r"line 1: expected a rotation matrix in the upper left"),
        (_rows("calib", "P0: 1 2"), r"calib/0001.txt: expected a line P2, got none"),
        (_rows("calib", "P2: 1 2"), r"calib/0001.txt: line 1: expected 12 numbers after P2, got 2"),
        (_rows("calib", "P2:" + " 0" * 12), r"calib/0001.txt: line 1: expected positive focal lengths"),
        (_rows("label", "0 1 Car"), r"label/0001.txt: line 1: expected 17 columns"),
        (_rows("label", label(0), label(0)), r"line 2: expected one label of object 4 in frame 0, got two"),
        (_rows("label", label(0, -1)), r"line 1: expected a whole number from 0 for id, got -1"),
        (_rows("label", label(0, state="0.5 0")), r"expected a whole number from -1 for truncated, got 0.5"),
        (_rows("label", label(0, state="0 -2")), r"expected a whole number from -1 for occluded, got -2"),
        (_rows("label", label(0).replace("1.8", "-1")), r"expected positive h, w and l, got -1 m"),
        (lambda root: (root / "pose" / "0001.txt").unlink(), r"pose/0001.txt: cannot be read \(No such file"),
    ],
)
def test_damaged_folders(tmp_path: Path, harm: Callable[[Path], object], complaint: str) -> None:
    harm(made_kitti(tmp_path))
    with pytest.raises(DataError, match=complaint) as caught:
        read_sequences(tmp_path)
    assert "\n" not in str(caught.value)


def test_no_folder_of_detections(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"expected one folder 'detection_\*', got none"):
        read_sequences(tmp_path)


def test_a_frame_checks_its_arrays(tmp_path: Path) -> None:
    frame = only(made_kitti(tmp_path)).frames[0]
    with pytest.raises(ShapeError, match="image_boxes_px"):
        replace(frame, image_boxes_px=np.zeros((2, 4)))
    with pytest.raises(ShapeError, match="world_from_ego"):
        replace(frame, world_from_ego=np.zeros((4, 4)))


# The view ---------------------------------------------------------------------------------------------------------


def test_places_in_view() -> None:
    # 10 m ahead the picture reaches from 8.857 m left to 8.871 m right, and a car needs 1.5 m to each side.
    places = [[10, 0], [10, 7.35], [10, 7.36], [10, -7.37], [10, -7.38], [2, 0], [2.5, 0], [-10, 0], [0, 0]]
    expected = [True, True, False, True, False, False, True, False, False]
    assert KittiView(PROJECTION).sees(np.array(places, dtype=np.float64)).tolist() == expected
    assert KittiView(PROJECTION).sees(np.zeros((0, 2))).shape == (0,)


# Results ----------------------------------------------------------------------------------------------------------


def test_tracks_are_written_as_rows(tmp_path: Path) -> None:
    rows = [detection(1, ahead_m=25.0), detection(1, 3)]
    write(made_kitti(tmp_path) / "detection_made" / "0001.txt", rows)
    sequence = only(tmp_path)
    results = kitti_results(sequence, track_sequence(sequence, Parrot()))
    write_kitti_results(tmp_path / "out" / "0001.txt", results)
    seen, unseen = (line.split() for line in (tmp_path / "out" / "0001.txt").read_text().splitlines())
    # The one that was seen has the rectangle of its detection; all have its place in the camera's frame.
    assert seen[:5] == ["1", "7", "Cyclist", "-1", "-1"]
    alpha = round(-1.5 - np.arctan2(2.0, 19.0), 4)
    place = [1.5, 1.8, 4.2, 2.0, 1.6, 19.0, -1.5]
    assert [float(column) for column in seen[5:]] == [alpha, 600, 170, 700, 240, *place, 1.098612]
    assert seen[-1] == "1.098612"  # log-odds of 0.75
    assert (unseen[:5], unseen[15]) == (["1", "7", "Car", "-1", "-1"], "25.0000")
    np.testing.assert_allclose(np.array(unseen[6:10], float), box_around(unseen), atol=0.01)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 1.6, 3.0, -2.0])
def test_a_written_box_projects_back(tmp_path: Path, yaw: float) -> None:
    # A camera that looks elsewhere: turned to the right by 90 degrees, 5 m beside the origin.
    write(made_kitti(tmp_path, 1) / "pose" / "0001.txt", ["0 0 1 5  0 1 0 0  -1 0 0 0"])
    sequence = only(tmp_path)
    results = kitti_results(sequence, [[track(np.array([1.0, -20.0, -1.6]), yaw)]])
    write_kitti_results(tmp_path / "0001.txt", results)
    (row,) = ((tmp_path / "0001.txt").read_text().split(),)
    np.testing.assert_allclose(np.array(row[13:16], float), [-1.0, 1.6, 15.0], atol=1e-9)
    np.testing.assert_allclose(np.array(row[6:10], float), box_around(row), atol=0.02)


def test_what_is_not_in_the_picture_is_not_written(tmp_path: Path) -> None:
    sequence = only(made_kitti(tmp_path, 1))
    places = [[-10.0, 0.0, -1.6], [10.0, 30.0, -1.6], [10.0, 0.0, 40.0], [10.0, 0.0, -1.6]]
    (results,) = kitti_results(sequence, [[track(np.array(place), 0.0) for place in places]])
    assert [result.ground_m.tolist() for result in results] == [places[-1]]


def test_rectangles_end_with_the_picture() -> None:
    size = np.array([1.8, 4.2, 1.5])
    box = project_box(PROJECTION, np.array([6.0, 5.0, -1.6]), 0.0, size)
    assert box is not None
    assert box[0] == 0.0
    # A box around the camera, from behind it to 10 m ahead, fills the picture.
    around = project_box(PROJECTION, np.array([0.0, 0.0, -2.0]), 0.0, np.array([2.0, 20.0, 4.0]))
    assert around is not None
    np.testing.assert_array_equal(around, [0, 0, 1241, 374])
    # One that reaches behind the camera beside it ends where it passes out of sight: right of what is 10 m ahead.
    beside = project_box(PROJECTION, np.array([0.0, -3.0, -2.0]), 0.0, np.array([2.0, 20.0, 1.0]))
    assert beside is not None
    np.testing.assert_allclose(beside, [620 + 700 * 2 / 10, 180 + 700 * 1 / 10, 1241, 374])


def test_an_unknown_height_is_that_of_the_class(tmp_path: Path) -> None:
    sequence = only(made_kitti(tmp_path, 1))
    ((result,),) = kitti_results(sequence, [[replace(track(np.array([10.0, 0, -1.6]), 0.0), height_m=np.nan)]])
    assert result.size_m.tolist() == [1.8, 4.2, 1.6]


def test_results_in_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        write_kitti_results(tmp_path / "file" / "0001.txt", [])


# Recorded sequences -----------------------------------------------------------------------------------------------


@pytest.mark.realdata
def test_the_ten_recorded_sequences(data_root: Path) -> None:
    root = data_root / "mot" / "kitti"
    if not root.is_dir():
        pytest.skip(f"no KITTI sequences at {root}")
    sequences = read_sequences(root)
    assert " ".join(one.name for one in sequences) == "0000 0002 0003 0004 0005 0007 0009 0011 0017 0020"
    assert [len(one.frames) for one in sequences] == [154, 233, 144, 314, 297, 800, 803, 373, 145, 837]
    assert all(one.labels is not None for one in sequences)
    # Detections look like the truth: their boxes, projected, are near the detector's rectangles.
    for frame in sequences[0].frames[::20]:
        found = frame.detections
        for i in np.flatnonzero(found.log_odds > 4):
            box = project_box(sequences[0].projection, found.ground_m[i], float(found.yaw_rad[i]), found.size_m[i])
            assert box is not None
            np.testing.assert_allclose(box, frame.image_boxes_px[i], atol=3)

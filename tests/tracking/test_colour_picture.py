from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from appocc.files import read_image
from appocc.geometry import apply, inverse
from benchmarks.colour_ablation import Scene, judged, made_scene, without_colour
from benchmarks.colour_picture import SEED, Loss, draw, losses, main, places_of_labels, tracks_of, ways_of
from benchmarks.encounters import encounters
from tracking.presets import MAPS


@pytest.fixture(scope="module")
def scene() -> Scene:
    return made_scene(SEED, noisy=False)


def test_a_loss_is_another_track_after_however_long_a_gap() -> None:
    assert losses(np.array([0, 4, 4, 0, 0, 7, 0, 7, 4])) == [Loss(5, 4, 7), Loss(8, 7, 4)]
    assert losses(np.array([0, 4, 0, 4])) == losses(np.zeros(3, np.int64)) == []


def test_as_many_switches_are_marked_as_the_benchmark_counts(scene: Scene) -> None:
    marked = []
    for config in (without_colour(MAPS), MAPS):
        tracks = tracks_of(scene, config)
        marked.append(sum(len(losses(ids)) for ids in tracks.values()))
        assert marked[-1] == judged(scene, config).IDS
    assert marked[1] < marked[0]


def test_only_required_vehicles_have_tracks(scene: Scene) -> None:
    tracks = tracks_of(scene[:10], MAPS)
    for k, step in enumerate(scene[:10]):
        there = {number for number, ids in tracks.items() if ids[k] > 0}
        assert there
        assert there <= set(step.number[step.demanded].tolist())


def test_ways_are_the_true_places() -> None:
    sights = encounters(5, seconds=2.0)
    ways = ways_of(sights)
    for k, sight in enumerate(sights):
        np.testing.assert_array_equal([ways[number][k] for number in sight.number.tolist()], sight.xy_m)
        assert {number for number, way in ways.items() if np.isfinite(way[k]).all()} == set(sight.number.tolist())


def test_labels_lie_over_no_other_and_inside() -> None:
    marks = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05], [0.97, 0.97], [-0.95, 0.0]])
    places = places_of_labels(marks, np.zeros((1, 2)))
    assert (np.abs(places) < [1 - 0.13, 1 - 0.0425]).all()
    for i, place in enumerate(places):
        assert not (np.abs(np.delete(places, i, axis=0) - place) < [0.26, 0.085]).all(axis=1).any()
        assert not (np.abs(marks - place) < [0.13, 0.0425]).all(axis=1).any()
    assert places_of_labels(np.zeros((0, 2)), np.zeros((0, 2))).shape == (0, 2)


def test_the_picture_is_written_the_same_each_time(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        main(["--seed", "2", "--out", str(tmp_path / name)])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert read_image(tmp_path / "a.png", (1300, 730)).shape == (730, 1300, 3)


def test_ahead_is_up_and_left_is_left() -> None:
    now = min(encounters(2), key=lambda sight: float(np.hypot(*sight.world_from_ego[:2, 3])))
    in_ego_m = apply(inverse(now.world_from_ego), np.pad(now.xy_m, ((0, 0), (0, 1))))
    expected = {
        (round(-y, 6), round(x, 6)): tuple(rgb / 255) for (x, y, _), rgb in zip(in_ego_m, now.rgb, strict=True)
    }
    for axes in draw(2).axes:
        boxes = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
        drawn = {(round(float(x), 6), round(float(y), 6)): box for box in boxes for x, y in [box.get_center()]}
        assert set(expected) <= set(drawn)
        for place, paint in expected.items():
            assert drawn[place].get_facecolor()[:3] == pytest.approx(paint)
        assert axes.get_xlim()[0] < 0 < axes.get_xlim()[1]
        assert axes.get_ylim()[0] < 0 < axes.get_ylim()[1]


@pytest.mark.parametrize("words", [["--seed", "-1"], ["--seed", "2", "--out", "{file}/a.png"]])
def test_bad_input_is_a_line_and_exit_code_2(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as stopped:
        main([word.format(file=tmp_path / "file") for word in words])
    assert stopped.value.code == 2
    assert "error: " in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]

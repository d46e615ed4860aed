from __future__ import annotations

from pathlib import Path

from made_street import BLUE, RED, START_US, STEP_US, WORLD_FROM_STREET, Plan, Solid, car, make
from tiny_dataset import START_US as TINY_START_US
from tiny_dataset import TinyDataset
from tolerances import assert_rounded

from appocc.boxes import Boxes
from appocc.geometry import apply, inverse
from appocc.groundtruth.inputs import gather_inputs
from appocc.nuscenes import Dataset


def street(t: float) -> list[Solid]:
    """A car at 8 m/s, one that stands, and one that is annotated in the first half second only."""
    gone = [car(-10, 3, RED, "gone")] if t < 0.4 else []
    return [car(6 + 8 * t, 3, BLUE, "moving"), car(15, -3, RED, "parked"), *gone]


def centres(boxes_world: Boxes) -> list[float]:
    return [round(float(x), 3) for x in apply(inverse(WORLD_FROM_STREET), boxes_world.centre_m)[:, 0]]


def test_sweeps_have_the_boxes_of_their_own_time(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=3, with_lidar=(0, 1, 2), sweeps_s=(0.1, 0.4, 0.75)))
    inputs = gather_inputs(dataset, dataset.scenes[0])
    assert [centres(sweep.boxes_world) for sweep in inputs.sweeps] == [
        [6.0, 15.0, -10.0],
        [6.8, 15.0, -10.0],  # at 0.1 s; what is annotated on one side only stays
        [9.2, 15.0],  # at 0.4 s, from the sample at 0.5 s, which is nearer
        [10.0, 15.0],
        [12.0, 15.0],
        [14.0, 15.0],
    ]


def test_images_have_the_boxes_of_their_key_frame(tmp_path: Path) -> None:
    """They are stamped earlier than the sweep, but the LiDAR passed the car when they were taken."""
    dataset = make(tmp_path, Plan(street, samples=2, camera_delay_s=-0.1))
    inputs = gather_inputs(dataset, dataset.scenes[0])
    assert [centres(view.boxes_world) for view in inputs.samples[1].views] == [[10.0, 15.0]] * 4
    assert [centres(view.boxes_world) for view in inputs.samples[0].views] == [[6.0, 15.0, -10.0]] * 4
    assert [centres(view.boxes_world) for view in inputs.sweeps[1].rounds[0]] == [[10.0, 15.0]] * 4


def test_motion_is_carried_on_by_one_interval_at_most(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=2, sweeps_s=(9.0,)))
    assert centres(gather_inputs(dataset, dataset.scenes[0]).sweeps[-1].boxes_world) == [14.0, 15.0]


def test_a_single_sample_needs_no_interpolation(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=1, with_lidar=(0,), sweeps_s=(0.3,)))
    assert centres(gather_inputs(dataset, dataset.scenes[0]).sweeps[-1].boxes_world) == [6.0, 15.0, -10.0]


def test_rounds_go_by_time(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=5, with_lidar=(0, 3), cameras=("CAM_BACK", "CAM_FRONT")))
    first, later = gather_inputs(dataset, dataset.scenes[0]).sweeps
    for sweep, nearest in ((first, [0, 1, 2]), (later, [3, 2, 4])):
        assert [[(v.timestamp_us - START_US) // STEP_US for v in views] for views in sweep.rounds] == [
            [k, k] for k in nearest
        ]
        assert [[v.camera.channel for v in views] for views in sweep.rounds] == [["CAM_BACK", "CAM_FRONT"]] * 3


def test_cameras_without_enough_images_leave_rounds_short(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, samples=2))
    assert [len(views) for views in gather_inputs(dataset, dataset.scenes[0]).sweeps[0].rounds] == [4, 4, 0]


def test_a_hand_made_dataset(tiny: TinyDataset) -> None:
    inputs = gather_inputs(Dataset(tiny.root), Dataset(tiny.root).scenes[0])
    assert inputs.annotated
    assert [sample.timestamp_us - TINY_START_US for sample in inputs.samples] == [0, 500_000, 1_000_000]
    assert len(inputs.sweeps) == 4
    assert_rounded(inputs.sweeps[1].world_from_lidar[:3, 3], [100, 202.25, 1.8], 16)
    walker = inputs.sweeps[1].boxes_world.centre_m[1]
    assert_rounded(walker, [95.0, 205.25, 0.9], 16)
    assert all(sweep.labels is None for sweep in inputs.sweeps)


def test_a_test_set_has_no_annotations(tiny: TinyDataset) -> None:
    tiny.tables["sample_annotation"], tiny.tables["instance"] = [], []
    inputs = gather_inputs(Dataset(tiny.write()), Dataset(tiny.root).scenes[0])
    assert not inputs.annotated
    assert all(len(sample.boxes_world) == 0 for sample in inputs.samples)


def test_samples_without_lidar(tmp_path: Path) -> None:
    dataset = make(tmp_path, Plan(street, with_lidar=(1,)))
    first, second = gather_inputs(dataset, dataset.scenes[0]).samples
    assert first.lidar is None
    assert second.lidar is not None
    assert second.lidar[0].is_file()

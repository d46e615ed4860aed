"""Networks with memory see the frames of a drive one after the other; another drive begins anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_map import pose
from made_model import MadeModel, MadePlan, predictor
from tiny_dataset import SPEED_MPS, STEP_US, TinyDataset
from torch import Tensor

from appocc.bevmap import BEVMap
from appocc.camera import CameraRig
from appocc.checks import FloatArray
from appocc.frame import Frame
from appocc.geometry import apply
from appocc.grid import BEVGrid
from appocc.inference.predictor import Predictor, Weights
from appocc.levelling import ground_pose
from appocc.models.base import VELOCITY_UNIT_MPS, ModelOutput
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.network import AppoccNet
from appocc.nuscenes import Dataset

SPEC = ModelSpec("tiny", ("CAM_FRONT", "CAM_BACK"), BEVGrid(-9.6, 9.6, -9.6, 9.6, 0.8), 96, 64)


class Counting(MadeModel):
    """Its memory is the number of frames that it has seen in a row."""

    def __init__(self) -> None:
        super().__init__()
        self.pasts: list[Past | None] = []

    def forward(  # type: ignore[override]
        self, images: Tensor, plan: MadePlan, past: Past | None = None
    ) -> ModelOutput:
        self.pasts.append(past)
        before = torch.zeros(1, 1, 2, 2) if past is None or past.state is None else past.state
        return super().forward(images, plan)._replace(memory=before + 1)

    @property
    def seen(self) -> list[int]:
        """Frames in memory at each call."""
        return [0 if past is None or past.state is None else int(past.state[0, 0, 0, 0]) for past in self.pasts]


@pytest.fixture
def drive(tiny: TinyDataset) -> list[Frame]:
    """Three frames, half a second and 2.5 m apart; the cameras look at different colours."""
    dataset = Dataset(tiny.root)
    frames = [dataset.frame(sample) for sample in dataset.samples(dataset.scenes[0])]
    random = np.random.default_rng(0)
    return [
        replace(
            frame,
            images={
                name: random.integers(0, 256, image.shape).astype(np.uint8) for name, image in frame.images.items()
            },
        )
        for frame in frames
    ]


def test_a_frame_is_linked_to_one_before_it(drive: list[Frame]) -> None:
    model = Counting()
    answer = predictor(model)
    for frame in drive:
        answer(frame)
    assert model.seen == [0, 1, 1]
    assert model.pasts[0] is None
    for past, elapsed_s in zip(model.pasts[1:], (0.5, 1.0), strict=True):
        assert past is not None
        ahead = np.array([[1, 0, SPEED_MPS * elapsed_s], [0, 1, 0]])
        np.testing.assert_allclose(past.past_from_now[0, 0], ahead, atol=1e-6)
        assert past.elapsed_s.tolist() == [[elapsed_s]]
        assert past.linked.tolist() == [[1]]


def test_a_reset_forgets_all_frames(drive: list[Frame]) -> None:
    model = Counting()
    answer = predictor(model)
    for frame in drive[:2]:
        answer(frame)
    answer.reset()
    answer(drive[2])
    assert model.seen == [0, 1, 0]


@pytest.mark.parametrize(
    ("later_s", "moved_m", "seen"),
    [
        (0.5, 2.5, 1),
        (2.9, 2.5, 1),
        (3.1, 2.5, 0),  # a break
        (0.5, 40.0, 0),  # a jump
        (0.0, 0.0, 0),  # the same frame again
        (-0.5, 2.5, 0),  # back in time
    ],
)
def test_breaks_and_jumps_begin_anew(drive: list[Frame], later_s: float, moved_m: float, seen: int) -> None:
    model = Counting()
    answer = predictor(model)
    first = drive[0]
    time_us = first.timestamp_us + round(later_s * 1e6)
    moved = replace(first, timestamp_us=time_us, world_from_ego=first.world_from_ego @ pose(moved_m))
    for frame in (first, moved, replace(moved, timestamp_us=time_us + 2 * STEP_US)):
        answer(frame)
    assert model.seen == [0, seen, seen + 1]


def test_at_high_frame_rates_the_memory_is_one_second_old(drive: list[Frame]) -> None:
    model = Counting()
    answer = predictor(model)
    for number in range(9):
        answer(replace(drive[0], timestamp_us=drive[0].timestamp_us + number * 200_000))
    # Frames 0 to 2 are alone: a memory of less than half a second is not used.
    assert model.seen == [0, 0, 0, 1, 1, 1, 1, 1, 2]
    ages = [round(past.elapsed_s.item(), 3) for past in model.pasts if past is not None]
    assert ages == [0.6, 0.8, 1.0, 1.0, 1.0, 1.0]


def test_a_network_without_memory_has_no_past(drive: list[Frame]) -> None:
    class Forgetful(Counting):
        def forward(self, images: Tensor, plan: MadePlan, past: Past | None = None) -> ModelOutput:  # type: ignore[override]
            return super().forward(images, plan, past)._replace(memory=None)

    model = Forgetful()
    answer = predictor(model)
    for frame in drive:
        answer(frame)
    assert model.pasts == [None] * 3


# A network --------------------------------------------------------------------------------------------------------


def network(parts: Parts, speed_mps: float = 10.0) -> Predictor:
    """A network with random weights that uses its memory and sees objects everywhere, of about a speed along x."""
    torch.manual_seed(4)
    model = AppoccNet(SPEC, parts=parts)
    with torch.no_grad():
        model.get_parameter("heads.answer.weight").normal_(std=0.3)
        if parts.memory:
            model.get_parameter("trunk.recall.fused.weight").normal_(std=0.1)
        if parts.objects:
            model.get_parameter("objects.centre.bias").zero_()
            model.get_parameter("objects.box.weight")[8:].zero_()
            model.get_parameter("objects.box.bias")[8:] = torch.tensor([speed_mps / VELOCITY_UNIT_MPS, 0.0])
    return Predictor(
        model, Weights("made", "d1", dict.fromkeys(("road", "vehicle", "lane"), 0.5)), torch.device("cpu")
    )


def maps(answer: Predictor, frames: list[Frame]) -> list[BEVMap]:
    return [answer(frame).bev for frame in frames]


def same(one: BEVMap, other: BEVMap) -> bool:
    return np.array_equal(one.occupancy, other.occupancy) and np.array_equal(one.appearance, other.appearance)


def test_the_same_frames_give_the_same_maps_after_a_reset(drive: list[Frame]) -> None:
    answer = network(Parts(depth=True, memory=True, objects=True))
    first = maps(answer, drive)
    answer.reset()
    again = maps(answer, drive)
    assert all(map(same, again, first))
    for one, other in zip(again, first, strict=True):
        assert one.objects is not None
        assert other.objects is not None
        for name, values in one.objects.as_arrays().items():
            np.testing.assert_array_equal(values, other.objects.as_arrays()[name])
    alone = maps(network(Parts(depth=True, memory=True, objects=True)), drive[1:])
    assert not same(alone[0], first[1])  # it remembers
    answer(drive[2])  # and back in time
    assert same(answer(drive[0]).bev, first[0])


def test_objects_stand_on_the_ground_that_is_tilted(drive: list[Frame]) -> None:
    pose = ground_pose(0.05, 0.0, -0.2)
    tilted = replace(drive[0], rig=posed(drive[0].rig, pose), ego_from_level=pose)
    level, found = (maps(network(Parts(objects=True)), [frame])[0].objects for frame in (drive[0], tilted))
    assert level is not None
    assert found is not None
    # What the network sees is the same to rounding: few objects can change their order.
    np.testing.assert_allclose(found.centre_m[:5], apply(pose, level.centre_m)[:5], atol=0.02)


def posed(rig: CameraRig, ego_from_level: FloatArray) -> CameraRig:
    """A rig that is level in a frame that is not."""
    return rig.with_cameras(replace(each, ego_from_cam=ego_from_level @ each.ego_from_cam) for each in rig)


def test_objects_come_with_the_map_and_move_once_there_is_a_past(drive: list[Frame]) -> None:
    first, second, _ = maps(network(Parts(memory=True, objects=True)), drive)
    assert first.objects is not None
    assert second.objects is not None
    assert min(len(first.objects), len(second.objects)) > 3
    assert np.isnan(first.objects.velocity_mps).all()
    assert np.isfinite(second.objects.velocity_mps).all()
    still = maps(network(Parts(objects=True)), drive)
    assert all(each.objects is not None and np.isnan(each.objects.velocity_mps).all() for each in still)


def test_low_speeds_are_unknown_and_those_of_people_lower_ones(drive: list[Frame]) -> None:
    def known(speed_mps: float) -> list[tuple[bool, bool]]:
        objects = maps(network(Parts(memory=True, objects=True), speed_mps), drive)[1].objects
        assert objects is not None
        assert {True, False} == set(objects.are_vehicles.tolist())
        return sorted(set(zip(objects.are_vehicles.tolist(), np.isfinite(objects.velocity_mps[:, 0]), strict=True)))

    assert known(4.0) == [(False, True), (True, True)]
    assert known(1.5) == [(False, True), (True, False)]
    assert known(0.3) == [(False, False), (True, False)]


@pytest.mark.parametrize("parts", [Parts(), Parts(depth=True), Parts(memory=True)])
def test_maps_without_object_heads_have_no_objects(drive: list[Frame], parts: Parts) -> None:
    assert all(bev.objects is None for bev in maps(network(parts), drive[:2]))

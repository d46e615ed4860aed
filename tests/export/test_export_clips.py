"""Frames of a dataset become clips: linked frames are one clip, with their ego motion."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from made_export import ALL_PARTS, SMALL
from tiny_dataset import TinyDataset

from appocc.camera import CameraRig
from appocc.export.clips import Clip, frame_clips
from appocc.export.graph import input_shapes
from appocc.export.run import ExportSource, source_from_inputs
from appocc.frame import Frame
from appocc.geometry import transform
from appocc.inference.inputs import LoadedFrame, dataset_inputs
from appocc.models.model_spec import Parts
from appocc.nuscenes import Dataset

PICKED = {(6, True): [1, 2, 3], (6, False): [0, 2, 5], (2, True): [0, 1], (2, False): [0, 1], (1, True): [0]}


@pytest.fixture
def source(tiny: TinyDataset) -> ExportSource:
    dataset = Dataset(tiny.root)
    return source_from_inputs(dataset_inputs(dataset, dataset.scenes), "tiny")


def clips_of(frames: list[Frame], rig: CameraRig, parts: Parts = ALL_PARTS) -> dict[str, Clip]:
    return frame_clips(frames, rig, SMALL, input_shapes(SMALL, parts, len(rig)))


def test_a_drive_is_one_clip(source: ExportSource) -> None:
    frames = source.frames(consecutive=True)
    (clip,) = clips_of(frames, source.rig).values()
    assert len(clip) == 3
    assert not clip[0]["memory"].any()
    assert clip[0]["elapsed_s"] == 0
    for inputs in clip[1:]:
        assert "memory" not in inputs
        # 5 m/s, a key frame every half second.
        np.testing.assert_allclose(inputs["past_from_now"][0], np.array([[1, 0, 2.5], [0, 1, 0]]), atol=1e-5)
        np.testing.assert_allclose(inputs["elapsed_s"], [0.5])


def test_without_memory_every_frame_is_a_clip(source: ExportSource) -> None:
    frames = source.frames(consecutive=False)
    clips = clips_of(frames, source.rig, Parts())
    assert [*clips] == [f"frame {frame.token}" for frame in frames]
    assert all([*inputs] == ["images"] for (inputs,) in clips.values())


def test_a_break_begins_another_clip_and_a_frame_without_a_camera_is_left_out(source: ExportSource) -> None:
    first, second, third = source.frames(consecutive=True)
    far = replace(third, world_from_ego=third.world_from_ego @ transform([1, 0, 0, 0], [500.0, 0, 0]))
    assert [len(clip) for clip in clips_of([first, second, far], source.rig).values()] == [2, 1]
    lame = replace(second, images={"CAM_BACK": second.images["CAM_BACK"]})
    (clip,) = clips_of([first, lame, third], source.rig).values()
    assert len(clip) == 2
    np.testing.assert_allclose(clip[1]["past_from_now"][0, 0], [1, 0, 5.0], atol=1e-5)
    np.testing.assert_allclose(clip[1]["elapsed_s"], [1.0])


@pytest.mark.parametrize(("count", "consecutive"), PICKED)
def test_frames_are_from_the_middle_or_spread(source: ExportSource, count: int, consecutive: bool) -> None:
    whole = source.inputs
    frames = [replace(whole[0].read().frame, token=str(i)) for i in range(count)]
    inputs = [whole[0]._replace(read=partial(LoadedFrame, frame, {})) for frame in frames]
    found = source._replace(inputs=inputs).frames(consecutive)
    assert [int(frame.token) for frame in found] == PICKED[count, consecutive]


def test_no_drive_has_no_frames(source: ExportSource) -> None:
    for consecutive in (True, False):
        assert ExportSource(source.rig, "rig").frames(consecutive) == []

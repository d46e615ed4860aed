"""Clips that a file is verified with: inputs of consecutive frames, synthetic or of a dataset.

A network without memory has clips of one frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from appocc.camera import CameraRig
from appocc.checks import Float32Array, FloatArray
from appocc.export.graph import ELAPSED, IMAGES, MEMORY, NEXT_MEMORY, PAST_FROM_NOW
from appocc.export.runtimes import Inputs, Outputs, Runner
from appocc.frame import Frame
from appocc.models.input_images import fit_image
from appocc.models.memory import ground_motion, is_linked
from appocc.models.model_spec import ModelSpec

# Inputs of consecutive frames; the first has the memory to start with, the others get that of the frame before.
Clip = Sequence[Inputs]
# Number of frames of a clip of a network with memory.
FRAMES = 3


def run_clip(run: Runner, clip: Clip) -> list[Outputs]:
    """Return the outputs of all frames; a runner that returns no memory ends the clip."""
    found: list[Outputs] = []
    for inputs in clip:
        if found and NEXT_MEMORY not in found[-1]:
            break
        found.append(run({**inputs, MEMORY: found[-1][NEXT_MEMORY]} if found else inputs))
    return found


def synthetic_clips(shapes: Mapping[str, tuple[int, ...]], seed: int = 0) -> dict[str, Clip]:
    """Return synthetic clips by name: noise, noise in large patches, and uniform grey.

    Args:
        shapes: shapes of the inputs, see `input_shapes`. With a memory, the clip of noise starts with noise as its
            memory and the others with nothing; the ego moves and turns.
        seed: seed of the noise.
    """
    draw = np.random.default_rng(seed)
    count = FRAMES if MEMORY in shapes else 1
    images = [_synthetic_images(draw, shapes[IMAGES]) for _ in range(count)]
    clips = {name: [{IMAGES: each[name]} for each in images] for name in images[0]}
    if MEMORY in shapes:
        for name, clip in clips.items():
            for inputs in clip:
                inputs |= _motion_inputs(_synthetic_motion(draw), draw.uniform(0.1, 0.5))
            memory = draw.random(shapes[MEMORY], dtype=np.float32)
            memory[:, 0] = 1
            clip[0][MEMORY] = memory * np.float32(name == "noise")
    return dict(clips)


def frame_clips(
    frames: Sequence[Frame], rig: CameraRig, spec: ModelSpec, shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, Clip]:
    """Return clips of the frames in which every camera works, by name; with a memory, linked frames are one clip.

    Args:
        frames: frames in the order of time.
        rig: cameras that are used.
        spec: model spec.
        shapes: shapes of the inputs, see `input_shapes`.
    """
    clips: dict[str, list[Inputs]] = {}
    before: Frame | None = None
    for frame in frames:
        if any(camera.channel not in frame.images for camera in rig):
            continue
        images = {IMAGES: _frame_images(frame, rig, spec)}
        if MEMORY not in shapes:
            clips[f"frame {frame.token}"] = [images]
            continue
        motion, elapsed_s = (np.eye(2, 3), 0.0) if before is None else _link(before, frame)
        inputs = images | _motion_inputs(motion, elapsed_s)
        if is_linked(motion, elapsed_s):
            clips[next(reversed(clips))].append(inputs)
        else:
            clips[f"frames from {frame.token}"] = [inputs | {MEMORY: np.zeros(shapes[MEMORY], np.float32)}]
        before = frame
    return dict(clips)


def _synthetic_images(draw: np.random.Generator, shape: tuple[int, ...]) -> dict[str, Float32Array]:
    """Return images (1, N, 3, H, W) by name."""
    patches = draw.random((*shape[:3], -(-shape[3] // 16), -(-shape[4] // 16)), dtype=np.float32)
    large = patches.repeat(16, axis=3).repeat(16, axis=4)[..., : shape[3], : shape[4]]
    return {
        "noise": draw.random(shape, dtype=np.float32),
        "patches": np.ascontiguousarray(large),
        "grey": np.full(shape, 0.5, np.float32),
    }


def _synthetic_motion(draw: np.random.Generator) -> FloatArray:
    """Return (2, 3) past_from_now: one or two metres ahead, with a small turn."""
    yaw, ahead = draw.uniform(-0.1, 0.1), draw.uniform(1.0, 2.0)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, ahead], [sin, cos, ahead * yaw / 2]])


def _motion_inputs(motion: FloatArray, elapsed_s: float) -> dict[str, Float32Array]:
    return {PAST_FROM_NOW: motion[None].astype(np.float32), ELAPSED: np.array([elapsed_s], np.float32)}


def _link(before: Frame, now: Frame) -> tuple[FloatArray, float]:
    """Return the ego motion on the ground (2, 3) between two frames, and the seconds."""
    elapsed_s = (now.timestamp_us - before.timestamp_us) / 1e6
    return ground_motion(before.world_from_ego, now.world_from_ego), elapsed_s


def _frame_images(frame: Frame, rig: CameraRig, spec: ModelSpec) -> Float32Array:
    """Return the images (1, N, 3, H, W) of a frame."""
    pairs = [fit_image(frame.images[camera.channel], frame.rig[camera.channel], spec) for camera in rig]
    stacked = np.stack([image for image, _ in pairs]).transpose(0, 3, 1, 2)[None]
    return np.ascontiguousarray(stacked, np.float32) / np.float32(255)

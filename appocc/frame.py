"""A key frame of a recording: images, rig, ego pose, time, boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from appocc.boxes import Boxes
from appocc.camera import CameraRig
from appocc.checks import ByteArray, FloatArray, check_dtype, check_shape, check_transform, freeze_arrays
from appocc.errors import ShapeError


@dataclass(frozen=True, eq=False)
class Frame:
    """A key frame of a recording.

    Attributes:
        token: sample token.
        timestamp_us: time of the sample, microseconds.
        world_from_ego: (4, 4) ego pose at that time.
        rig: the cameras. Each `ego_from_cam` is corrected for the ego motion between the time of the image and the
            time of the sample, so that `world_from_ego @ ego_from_cam` is the camera's pose when it took the image.
        images: channel -> (H, W, 3) uint8 RGB, shared with the caller; a camera without an image is missing.
        boxes_ego: annotated boxes in the ego frame; None if the scene is not annotated.
        ego_from_level: (4, 4) pose of a level frame on the ground (`appocc.levelling`); None: the ego frame is level.
    """

    token: str
    timestamp_us: int
    world_from_ego: FloatArray
    rig: CameraRig
    images: Mapping[str, ByteArray]
    boxes_ego: Boxes | None = None
    ego_from_level: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check pose and images.

        Raises:
            ShapeError: if an image does not fit its camera.
        """
        check_transform("world_from_ego", self.world_from_ego)
        freeze_arrays(self, "world_from_ego")
        if self.ego_from_level is not None:
            check_transform("ego_from_level", self.ego_from_level)
            freeze_arrays(self, "ego_from_level")
        object.__setattr__(self, "images", dict(self.images))
        for channel, image in self.images.items():
            if channel not in self.rig.channels:
                raise ShapeError(f"images: expected channels of the rig, got '{channel}'")
            camera = self.rig[channel]
            check_shape(f"image {channel}", image, (camera.height_px, camera.width_px, 3))
            check_dtype(f"image {channel}", image, np.uint8)

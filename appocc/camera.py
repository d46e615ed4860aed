"""Pinhole cameras and rigs: projection between the ego frame and pixels."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from appocc.checks import FloatArray, check_intrinsic, check_transform, freeze_arrays
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import NotFoundError, ShapeError
from appocc.geometry import apply, inverse
from appocc.typing import Flags, List2, List3, Numbers


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified pinhole camera. Cameras with the same numbers are equal.

    Attributes:
        channel: nuScenes channel name, such as CAM_FRONT.
        width_px: image width.
        height_px: image height.
        intrinsic: (3, 3) K in pixels; pixel centres are at whole numbers (OpenCV).
        ego_from_cam: (4, 4) pose of the camera frame (x right, y down, z ahead) in the ego frame, metres.
    """

    channel: str
    width_px: int
    height_px: int
    intrinsic: FloatArray
    ego_from_cam: FloatArray

    def __post_init__(self) -> None:
        """Check sizes, intrinsics and pose.

        Raises:
            ShapeError: if one of them is invalid.
        """
        if self.width_px < 1 or self.height_px < 1:
            raise ShapeError(f"{self.channel}: expected an image size, got {self.width_px}x{self.height_px}")
        check_intrinsic(f"{self.channel} intrinsic", self.intrinsic)
        check_transform(f"{self.channel} ego_from_cam", self.ego_from_cam)
        freeze_arrays(self, "intrinsic", "ego_from_cam")

    def __eq__(self, other: object) -> bool:
        """Whether the other is a camera with the same channel, size, intrinsics and pose."""
        return self._key == other._key if isinstance(other, Camera) else NotImplemented

    def __hash__(self) -> int:
        """Hash that agrees with equality."""
        return hash(self._key)

    @cached_property
    def _key(self) -> tuple[str, int, int, bytes, bytes]:
        # Adding zero turns -0.0 into 0.0: they are equal, but not their bytes.
        matrices = (np.asarray(matrix, np.float64) + 0.0 for matrix in (self.intrinsic, self.ego_from_cam))
        intrinsic, pose = (matrix.tobytes() for matrix in matrices)
        return self.channel, self.width_px, self.height_px, intrinsic, pose

    def project(self, points_cam: List3) -> tuple[List2, Numbers]:
        """Project points (N, 3) in the camera frame to pixels (N, 2) as (u, v) and depths (N,) in metres.

        Points at or behind the camera plane get pixel NaN.
        """
        depth = points_cam[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            uv = (points_cam @ self.intrinsic.T)[:, :2] / depth[:, None]
        uv[depth <= 1e-6] = np.nan
        return uv, depth

    def project_ego(self, points_ego: List3) -> tuple[List2, Numbers]:
        """Project points (N, 3) in the ego frame, as `project`."""
        return self.project(apply(inverse(self.ego_from_cam), points_ego))

    def sees(self, uv_px: List2, depth_m: Numbers) -> Flags:
        """Return whether pixels (N, 2) with depths (N,) are in the image and in front of the camera."""
        with np.errstate(invalid="ignore"):
            inside = (uv_px >= -0.5) & (uv_px < np.array([self.width_px, self.height_px]) - 0.5)
        return np.asarray(inside.all(axis=1) & (depth_m > 0.1))

    def resized(self, width_px: int, height_px: int) -> Camera:
        """Return the camera of the resized image, with K scaled (pixel centres at whole numbers)."""
        scale = np.diag([width_px / self.width_px, height_px / self.height_px, 1.0])
        half = np.array([[1.0, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        intrinsic = np.linalg.inv(half) @ scale @ half @ self.intrinsic
        return Camera(self.channel, width_px, height_px, intrinsic, self.ego_from_cam)

    def cropped(self, left_px: int, top_px: int, width_px: int, height_px: int) -> Camera:
        """Return the camera of an image crop, with the principal point moved."""
        intrinsic = self.intrinsic.copy()
        intrinsic[:2, 2] -= [left_px, top_px]
        return Camera(self.channel, width_px, height_px, intrinsic, self.ego_from_cam)


@dataclass(frozen=True)
class CameraRig:
    """The cameras of a vehicle in a fixed order, and the vehicle's dimensions.

    Attributes:
        cameras: cameras with unique channels.
        ego_vehicle: dimensions of the vehicle that carries them.
    """

    cameras: tuple[Camera, ...]
    ego_vehicle: EgoVehicle = field(default_factory=EgoVehicle)

    def __post_init__(self) -> None:
        """Check that channels are unique.

        Raises:
            ShapeError: if a channel occurs twice.
        """
        if len(set(self.channels)) != len(self.cameras):
            raise ShapeError(f"rig: expected unique channels, got {', '.join(self.channels)}")

    @property
    def channels(self) -> tuple[str, ...]:
        """Channel names in order."""
        return tuple(camera.channel for camera in self.cameras)

    def with_cameras(self, cameras: Iterable[Camera]) -> CameraRig:
        """Return the rig of the same vehicle with other cameras."""
        return replace(self, cameras=tuple(cameras))

    def select(self, channels: Collection[str]) -> CameraRig:
        """Return the rig with only the cameras of some channels, in the rig's order."""
        return self.with_cameras(camera for camera in self if camera.channel in channels)

    def __getitem__(self, channel: str) -> Camera:
        """Return the camera of a channel.

        Raises:
            NotFoundError: if the rig has no such channel.
        """
        for camera in self.cameras:
            if camera.channel == channel:
                return camera
        raise NotFoundError(f"rig has no camera '{channel}'; it has {', '.join(self.channels) or 'none'}")

    def __iter__(self) -> Iterator[Camera]:
        """Iterate over the cameras in order."""
        return iter(self.cameras)

    def __len__(self) -> int:
        """Number of cameras."""
        return len(self.cameras)

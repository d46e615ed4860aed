"""The cameras of a vehicle with any lenses, and the pinhole cameras into which their pictures are rectified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, Float32Array, check_dtype, check_shape, freeze_arrays
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError, NotFoundError
from appocc.lenses import DistortedLens
from appocc.rigs.source_camera import SourceCamera

# A picture reduced to whole pixels has this aspect up to half a pixel on its shorter side.
_ASPECT_PX = 1.0


@dataclass(frozen=True, eq=False)
class View:
    """A pinhole camera cut out of the picture of a source camera.

    Attributes:
        camera: the pinhole camera.
        source: name of the source camera.
        places: (2, H, W) float32, the source pixel u, v of each of its pixels; None if the picture itself is a
            pinhole's.
    """

    camera: Camera
    source: str
    places: Float32Array | None = None

    def __post_init__(self) -> None:
        """Check the shape of the places.

        Raises:
            ShapeError: if it is not that of the camera's images.
        """
        if self.places is not None:
            check_shape(
                f"{self.camera.channel} places", self.places, (2, self.camera.height_px, self.camera.width_px)
            )
            freeze_arrays(self, "places")

    def cut(self, image: ByteArray) -> ByteArray:
        """Return the image of the pinhole camera, (H, W, 3) uint8, from that of the source camera."""
        if self.places is None:
            return image
        cut = cv2.remap(image, self.places[0], self.places[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(cut, np.uint8)

    def cut_classes(self, classes: ByteArray, outside: int) -> ByteArray:
        """Return the pixel classes of the pinhole camera, (H, W) uint8, each that of the nearest source pixel."""
        if self.places is None:
            return classes
        u, v = self.places
        cut = cv2.remap(classes, u, v, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=(outside,) * 4)
        return np.asarray(cut, np.uint8)


@dataclass(frozen=True, eq=False)
class SourceRig:
    """Source cameras, with the names that a user gives them, and the pinhole rig that everything else works with.

    Attributes:
        cameras: the source cameras, with unique names.
        views: the pinhole cameras; those of one source camera follow each other.
        ego_vehicle: dimensions of the vehicle that carries the cameras.
    """

    cameras: tuple[SourceCamera, ...]
    views: tuple[View, ...]
    ego_vehicle: EgoVehicle

    @classmethod
    def of_pinholes(cls, rig: CameraRig) -> SourceRig:
        """Return the source rig of pinhole cameras: their pictures are the images, named by channel."""
        flat = np.zeros(4)
        cameras = tuple(
            SourceCamera(
                c.channel, c.channel, c.width_px, c.height_px, DistortedLens(c.intrinsic, flat), c.ego_from_cam
            )
            for c in rig
        )
        return cls(cameras, tuple(View(camera, camera.channel) for camera in rig), rig.ego_vehicle)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the source cameras, in order: the file name of their pictures without the ending."""
        return tuple(camera.name for camera in self.cameras)

    @cached_property
    def sizes_px(self) -> Mapping[str, tuple[int, int]]:
        """(width, height) of the picture of each source camera, by name."""
        return {camera.name: (camera.width_px, camera.height_px) for camera in self.cameras}

    @property
    def is_pinhole(self) -> bool:
        """Whether all source cameras are pinholes, so that their pictures are the images as they are."""
        return all(view.places is None for view in self.views)

    def as_json(self) -> dict[str, Any]:
        """Return JSON values that identify the source cameras."""
        return {camera.name: camera.as_json() for camera in self.cameras}

    @cached_property
    def rig(self) -> CameraRig:
        """The pinhole cameras."""
        return CameraRig(tuple(view.camera for view in self.views), self.ego_vehicle)

    def channels(self, name: str) -> tuple[str, ...]:
        """Return the channels that are cut out of a source camera's picture: one, or several for a wide lens."""
        return tuple(view.camera.channel for view in self.views if view.source == name)

    def scaling(self, name: str, width_px: int, height_px: int) -> str | None:
        """Return a line that tells how a picture of another size is scaled; None for a picture of the rig's size.

        Raises:
            NotFoundError: if the rig has no such source camera.
            DataError: if the picture has another aspect.
        """
        width, height = self._size(name)
        if (width_px, height_px) == (width, height):
            return None
        sizes = f"{name}: expected {width}x{height} pixels, as size_px of its rig says, got {width_px}x{height_px}"
        if abs(width_px * height - height_px * width) > _ASPECT_PX * max(width, height):
            raise DataError(f"{sizes}, which has another aspect")
        return f"{sizes}; pictures are scaled"

    def rectify(self, images: Mapping[str, ByteArray]) -> dict[str, ByteArray]:
        """Return the images of the pinhole cameras, (H, W, 3) uint8 by channel.

        Args:
            images: (H, W, 3) uint8 by name of source camera; missing ones are left out. A picture of another size
                with the same aspect is scaled.

        Raises:
            NotFoundError: if the rig has no such source camera.
            DataError: if a picture has another aspect than its camera.
            ShapeError: if a picture is not (H, W, 3) uint8.
        """
        fitted = {name: self._fitted(name, image) for name, image in images.items()}
        return {view.camera.channel: view.cut(fitted[view.source]) for view in self.views if view.source in fitted}

    def rectify_classes(self, name: str, classes: ByteArray, outside: int) -> dict[str, ByteArray]:
        """Return the pixel classes of the pinhole cameras of a source camera, (H, W) uint8 by channel.

        Args:
            name: source camera.
            classes: (H, W) uint8 class of each pixel of its picture.
            outside: class of what the source camera does not see.

        Raises:
            NotFoundError: if the rig has no such source camera.
            ShapeError: if the classes have another size than the rig says; they are not scaled.
        """
        width, height = self._size(name)
        check_shape(f"pixel classes of {name}", classes, (height, width))
        views = (view for view in self.views if view.source == name)
        return {view.camera.channel: view.cut_classes(classes, outside) for view in views}

    def _fitted(self, name: str, image: ByteArray) -> ByteArray:
        check_shape(f"image {name}", image, (None, None, 3))
        check_dtype(f"image {name}", image, np.uint8)
        if self.scaling(name, image.shape[1], image.shape[0]) is None:
            return image
        size = self._size(name)
        shrinks = size[0] < image.shape[1]
        scaled = cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        return np.asarray(scaled, np.uint8)

    def _size(self, name: str) -> tuple[int, int]:
        if name not in self.sizes_px:
            raise NotFoundError(f"rig has no camera '{name}'; it has {', '.join(self.names) or 'none'}")
        return self.sizes_px[name]

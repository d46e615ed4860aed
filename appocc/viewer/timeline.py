"""What a viewer shows of a scene, key frame by key frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from appocc.bevmap import BEVMap, load_map
from appocc.boxes import Boxes, is_person_or_bicycle, is_vehicle
from appocc.camera import CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import open_picture, read_file, read_image
from appocc.geometry import apply
from appocc.jpeg import end_of, is_jpeg
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, Scene
from appocc.visualization.canvas import BEVCanvas

_QUALITY, _PX_PER_CELL = 90, 2
_VEHICLE, _PERSON, _OTHER = (70, 130, 240), (240, 130, 60), (170, 170, 170)
_EGO_HEIGHT_M = 1.5
_NO_TRAILS: tuple[FloatArray, ...] = ()


class ShownBoxes(NamedTuple):
    """N boxes to show, in the world frame.

    Attributes:
        centre_m: (N, 3) centres.
        size_lwh_m: (N, 3) length, width, height.
        rotation: (N, 3, 3) world-from-box rotations.
        rgb: (N, 3) uint8 colours.
        labels: N short texts.
        ids: N ids, constant over time.
        trails: the past positions (K, 3) of each box; empty without trails.
    """

    centre_m: FloatArray
    size_lwh_m: FloatArray
    rotation: FloatArray
    rgb: ByteArray
    labels: tuple[str, ...]
    ids: tuple[str, ...]
    trails: tuple[FloatArray, ...] = _NO_TRAILS

    @classmethod
    def of_annotations(cls, boxes_world: Boxes) -> ShownBoxes:
        """Return annotated boxes, labelled with the last part of their category."""
        rgb = [_category_colour(name) for name in boxes_world.category]
        return cls(
            boxes_world.centre_m,
            boxes_world.size_wlh_m[:, [1, 0, 2]],
            boxes_world.rotation,
            np.array(rgb, np.uint8).reshape(-1, 3),
            tuple(name.removeprefix("vehicle.").split(".")[-1] for name in boxes_world.category),
            boxes_world.instance,
        )


class ShownGoal(NamedTuple):
    """The goal of a command, in the world frame.

    Attributes:
        world_from_goal: (4, 4) pose of the ego frame at the goal.
        centre_m: (3,) centre of the ego vehicle at the goal.
        size_lwh_m: (3,) size of the ego vehicle.
        route: (P, 3) way to the goal; empty if unknown.
        text: the command.
        first: index of the key frame from which on the goal is shown.
    """

    world_from_goal: FloatArray
    centre_m: FloatArray
    size_lwh_m: FloatArray
    route: FloatArray
    text: str
    first: int


@dataclass(frozen=True, eq=False)
class TimelineFrame:
    """A key frame of a timeline.

    Attributes:
        number: index in the scene.
        timestamp_us: time of the key frame.
        world_from_ego: (4, 4) ego pose.
        rig: cameras with poses at the time of their images, see `Frame.rig`.
        images: channel -> encoded JPEG.
        boxes: annotated boxes; None if the scene has none.
        tracks: tracked vehicles; None without maps.
        bev: map; None without maps.
    """

    number: int
    timestamp_us: int
    world_from_ego: FloatArray
    rig: CameraRig
    images: Mapping[str, bytes]
    boxes: ShownBoxes | None
    tracks: ShownBoxes | None
    bev: BEVMap | None


@dataclass(frozen=True, eq=False)
class Timeline:
    """A scene as viewers show it. Iterate over it to read its key frames one at a time.

    Attributes:
        dataset: dataset of the scene.
        scene: the scene.
        source: source of the maps; None shows none.
        tracks: tracks of each key frame; None shows none.
        goal: goal of a command; None shows none.
        advance: called with 1 after each key frame.
    """

    dataset: Dataset
    scene: Scene
    source: str | None = None
    tracks: Sequence[ShownBoxes] | None = None
    goal: ShownGoal | None = None
    advance: Callable[[float], None] = lambda _: None

    @property
    def samples(self) -> tuple[Sample, ...]:
        """The key frames in order of time."""
        return self.dataset.samples(self.scene)

    def __iter__(self) -> Iterator[TimelineFrame]:
        """Read the key frames.

        Raises:
            DataError: if the scene has none, or an image or a map is missing or damaged.
        """
        if not self.samples:
            raise DataError(f"{self.dataset.root}: scene '{self.scene.name}' has no key frames")
        for number, sample in enumerate(self.samples):
            yield self._frame(number, sample)
            self.advance(1)

    def _frame(self, number: int, sample: Sample) -> TimelineFrame:
        frame = self.dataset.frame(sample, images=False)
        boxes = None if frame.boxes_ego is None else ShownBoxes.of_annotations(self.dataset.boxes_world(sample))
        files = {c: d for c, d in self.dataset.data(sample).items() if c in frame.rig.channels}
        images = {
            c: encoded_image(self.dataset.path(d), (frame.rig[c].width_px, frame.rig[c].height_px))
            for c, d in files.items()
        }
        return TimelineFrame(
            number,
            sample.timestamp_us,
            frame.world_from_ego,
            frame.rig,
            images,
            boxes,
            None if self.tracks is None else self.tracks[number],
            None if self.source is None else load_map(self.dataset.root, self.source, sample.token),
        )


def encoded_image(path: Path, size_px: tuple[int, int]) -> bytes:
    """Return an image file of a size (width, height) as JPEG: a JPEG as it is, other formats encoded.

    Raises:
        DataError: if it is missing, truncated or not an image, or has another size.
    """
    data = read_file(path)
    if not is_jpeg(data):
        picture = cv2.cvtColor(read_image(path, size_px), cv2.COLOR_RGB2BGR)
        return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
    try:
        with open_picture(path) as opened:
            found = (opened.width, opened.height)
    except (OSError, SyntaxError, ValueError) as error:
        raise DataError(f"{path}: not a readable image ({len(data)} bytes), expected JPEG or PNG") from error
    if end_of(data) < 0:
        raise DataError(f"{path}: the image is truncated ({len(data)} bytes)")
    if found != size_px:
        expected = f"{size_px[0]}x{size_px[1]}"
        raise DataError(f"{path}: expected {expected} pixels, as its table says, got {found[0]}x{found[1]}")
    return data


def map_pictures(bev: BEVMap) -> dict[str, ByteArray]:
    """Return pictures (rows, columns, 3) of a map, `appearance` and `classes`; forward up, unknown hatched."""
    pictures = {}
    for name, draw in (("appearance", BEVCanvas.appearance), ("classes", BEVCanvas.occupancy)):
        canvas = BEVCanvas(bev.grid, _PX_PER_CELL)
        draw(canvas, bev)
        pictures[name] = canvas.picture
    return pictures


def ground_corners(bev: BEVMap) -> FloatArray:
    """Return the corners (4, 3) of a map on the ground, ego frame, in the order of the corners of its pictures.

    These are upper left, upper right, lower right, lower left.
    """
    grid = bev.grid
    front, rear, left, right = grid.x_max_m, grid.x_min_m, grid.y_max_m, grid.y_min_m
    return np.array([[front, left, 0.0], [front, right, 0.0], [rear, right, 0.0], [rear, left, 0.0]])


def ego_box(ego: EgoVehicle) -> tuple[FloatArray, FloatArray]:
    """Return centre (3,) and length, width and height (3,) of the ego vehicle, as high as a car."""
    centre = np.array([ego.centre_m, 0.0, _EGO_HEIGHT_M / 2])
    return centre, np.array([ego.length_m, ego.width_m, _EGO_HEIGHT_M])


def on_ground(points: FloatArray, world_from_ego: FloatArray) -> FloatArray:
    """Return the world points (N, 3) of points (N, 2) on the ground of the ego frame."""
    return apply(world_from_ego, np.pad(np.asarray(points, np.float64), ((0, 0), (0, 1))))


def _category_colour(category: str) -> tuple[int, int, int]:
    """Return the colour of a category: vehicles, people and bicycles, and others."""
    if is_vehicle(category):
        return _VEHICLE
    return _PERSON if is_person_or_bicycle(category) else _OTHER

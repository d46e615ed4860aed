"""MCAP recordings with Foxglove's schemas: the messages of a scene over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import CLASSES, BEVMap
from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.extras import import_extra
from appocc.files import whole_file
from appocc.geometry import quaternion_from_rotation
from appocc.grid import BEVGrid
from appocc.viewer.timeline import ShownBoxes, ShownGoal, Timeline, TimelineFrame, ego_box
from appocc.visualization.canvas import class_colours, shown_appearance

# The package, its extra, and what needs it.
FOXGLOVE = ("foxglove", "mcap", "an MCAP file")
WORLD, EGO = "world", "ego"
_GREEN, _CYAN, _BOX_ALPHA, _LINE_M, _TEXT_M = (60, 200, 90), (60, 220, 255), 0.45, 0.1, 0.8
_COLOURS = ("red", "green", "blue", "alpha")


def write_mcap(timeline: Timeline, path: Path) -> None:
    """Write a scene as an MCAP file, atomically, one key frame at a time.

    Topics: `/tf` (FrameTransform: ego in world, cameras in ego), `/CHANNEL/image` (CompressedImage),
    `/CHANNEL/calibration` (CameraCalibration), `/bev/appearance` and `/bev/classes` (Grid, in the ego frame),
    `/ego`, `/annotations`, `/tracks` and `/goal` (SceneUpdate). All messages of a key frame have its time.

    Raises:
        AppoccError: if foxglove-sdk is not installed.
        DataError: as iterating over the timeline, or if the file cannot be written.
    """
    foxglove = import_extra(*FOXGLOVE)
    with whole_file(path) as temporary, temporary.open("wb") as handle:
        context = foxglove.Context()
        try:
            with foxglove.open_mcap(handle, context=context):
                topics = _Topics(context)
                for frame in timeline:
                    topics.log(frame)
                    if timeline.goal is not None and frame.number == timeline.goal.first:
                        topics.log_goal(frame, timeline.goal)
        except RuntimeError as error:  # its only kind of error
            raise DataError(f"{path}: cannot be written ({error})") from error


class _Topics:
    """The topics of a file; a topic exists from its first message on."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self._made: dict[str, Any] = {}
        self._m = import_extra("foxglove.messages", *FOXGLOVE[1:])
        self._kinds = import_extra("foxglove.channels", *FOXGLOVE[1:])

    def _put(self, topic: str, message: Any, time_us: int) -> None:
        if topic not in self._made:
            kind = getattr(self._kinds, f"{type(message).__name__}Channel")
            self._made[topic] = kind(topic, context=self._context)
        self._made[topic].log(message, log_time=time_us * 1000)

    def log(self, frame: TimelineFrame) -> None:
        """Write the messages of a key frame."""
        us = frame.timestamp_us
        self._put("/tf", self._transform(us, WORLD, EGO, frame.world_from_ego), us)
        for camera in frame.rig:
            self._put("/tf", self._transform(us, EGO, camera.channel, camera.ego_from_cam), us)
            self._put(f"/{camera.channel}/calibration", self._calibration(us, camera), us)
            if camera.channel in frame.images:
                image = self._m.CompressedImage(
                    timestamp=self._time(us),
                    frame_id=camera.channel,
                    format="jpeg",
                    data=frame.images[camera.channel],
                )
                self._put(f"/{camera.channel}/image", image, us)
        if frame.bev is not None:
            self._put("/bev/appearance", self._appearance(us, frame.bev), us)
            self._put("/bev/classes", self._classes(us, frame.bev), us)
        self._put("/ego", self._ego(frame), us)
        for topic, boxes in (("/annotations", frame.boxes), ("/tracks", frame.tracks)):
            if boxes is not None:
                self._put(topic, self._scene(self._entities(us, boxes)), us)

    # Values -------------------------------------------------------------------------------------------------------

    def _time(self, us: int) -> Any:
        return self._m.Timestamp(sec=us // 1_000_000, nsec=us % 1_000_000 * 1000)

    def _colour(self, rgb: Sequence[float], alpha: float = 1.0) -> Any:
        red, green, blue = (float(v) / 255 for v in rgb)
        return self._m.Color(r=red, g=green, b=blue, a=alpha)

    def _vector(self, xyz: ArrayLike) -> Any:
        x, y, z = (float(v) for v in np.asarray(xyz))
        return self._m.Vector3(x=x, y=y, z=z)

    def _quaternion(self, rotation: FloatArray) -> Any:
        w, x, y, z = (float(v) for v in quaternion_from_rotation(rotation))
        return self._m.Quaternion(x=x, y=y, z=z, w=w)

    def _pose(self, position: ArrayLike, rotation: FloatArray) -> Any:
        return self._m.Pose(position=self._vector(position), orientation=self._quaternion(rotation))

    def _points(self, xyz: FloatArray) -> list[Any]:
        return [self._m.Point3(x=x, y=y, z=z) for x, y, z in xyz.tolist()]

    # Messages -----------------------------------------------------------------------------------------------------

    def _transform(self, us: int, parent: str, child: str, parent_from_child: FloatArray) -> Any:
        return self._m.FrameTransform(
            timestamp=self._time(us),
            parent_frame_id=parent,
            child_frame_id=child,
            translation=self._vector(parent_from_child[:3, 3]),
            rotation=self._quaternion(parent_from_child[:3, :3]),
        )

    def _calibration(self, us: int, camera: Camera) -> Any:
        projection = np.pad(camera.intrinsic, ((0, 0), (0, 1)))
        return self._m.CameraCalibration(
            timestamp=self._time(us),
            frame_id=camera.channel,
            width=camera.width_px,
            height=camera.height_px,
            K=camera.intrinsic.ravel().tolist(),
            R=np.eye(3).ravel().tolist(),
            P=projection.ravel().tolist(),
        )

    def _appearance(self, us: int, bev: BEVMap) -> Any:
        return self._grid(us, bev.grid, _rgba(shown_appearance(bev), bev.appearance_valid), _COLOURS)

    def _classes(self, us: int, bev: BEVMap) -> Any:
        """Return the drawn colours of the classes and their probabilities, 255 for 1."""
        rgb, known = class_colours(bev), bev.occupancy_valid.any(axis=0)
        shares = np.moveaxis(np.round(bev.occupancy * 255).astype(np.uint8), 0, -1)
        return self._grid(us, bev.grid, np.concatenate([_rgba(rgb, known), shares], axis=-1), (*_COLOURS, *CLASSES))

    def _grid(self, us: int, grid: BEVGrid, cells: ByteArray, names: Sequence[str]) -> Any:
        """Return bytes (X, Y, fields) as a grid: its columns go along x and its rows along y."""
        uint8 = self._m.PackedElementFieldNumericType.Uint8
        fields = [self._m.PackedElementField(name=n, offset=i, type=uint8) for i, n in enumerate(names)]
        return self._m.Grid(
            timestamp=self._time(us),
            frame_id=EGO,
            pose=self._pose([grid.x_min_m, grid.y_min_m, 0.0], np.eye(3)),
            column_count=grid.shape[0],
            cell_size=self._m.Vector2(x=grid.cell_m, y=grid.cell_m),
            row_stride=grid.shape[0] * len(names),
            cell_stride=len(names),
            fields=fields,
            data=np.ascontiguousarray(np.swapaxes(cells, 0, 1)).tobytes(),
        )

    def _scene(self, entities: Iterable[Any]) -> Any:
        """Return an update that replaces all entities of its topic."""
        everything = self._m.SceneEntityDeletion(type=self._m.SceneEntityDeletionType.All)
        return self._m.SceneUpdate(deletions=[everything], entities=list(entities))

    def _cube(self, centre: ArrayLike, rotation: FloatArray, size_lwh_m: ArrayLike, rgb: Sequence[float]) -> Any:
        return self._m.CubePrimitive(
            pose=self._pose(centre, rotation), size=self._vector(size_lwh_m), color=self._colour(rgb, _BOX_ALPHA)
        )

    def _text(self, above: ArrayLike, text: str) -> Any:
        return self._m.TextPrimitive(
            pose=self._pose(above, np.eye(3)),
            billboard=True,
            font_size=_TEXT_M,
            color=self._colour((255, 255, 255)),
            text=text,
        )

    def _line(self, points: FloatArray, rgb: Sequence[float]) -> Any:
        strip = self._m.LinePrimitiveLineType.LineStrip
        return self._m.LinePrimitive(
            type=strip, thickness=_LINE_M, points=self._points(points), color=self._colour(rgb)
        )

    def _entities(self, us: int, boxes: ShownBoxes) -> Iterable[Any]:
        trails = boxes.trails or (np.zeros((0, 3)),) * len(boxes.ids)
        for i, (name, trail) in enumerate(zip(boxes.ids, trails, strict=True)):
            centre, size = boxes.centre_m[i], boxes.size_lwh_m[i]
            yield self._m.SceneEntity(
                timestamp=self._time(us),
                frame_id=WORLD,
                id=name,
                metadata=[self._m.KeyValuePair(key="label", value=boxes.labels[i])],
                cubes=[self._cube(centre, boxes.rotation[i], size, boxes.rgb[i].tolist())],
                texts=[self._text(centre + np.array([0.0, 0.0, size[2] / 2 + _TEXT_M]), boxes.labels[i])],
                lines=[self._line(trail, boxes.rgb[i].tolist())] if len(trail) > 1 else [],
            )

    def _ego(self, frame: TimelineFrame) -> Any:
        centre, size = ego_box(frame.rig.ego_vehicle)
        cube = self._cube(centre, np.eye(3), size, _GREEN)
        return self._scene(
            [self._m.SceneEntity(timestamp=self._time(frame.timestamp_us), frame_id=EGO, id=EGO, cubes=[cube])]
        )

    def log_goal(self, frame: TimelineFrame, goal: ShownGoal) -> None:
        """Write the goal of a command at the time of a key frame; it stays."""
        rotation = goal.world_from_goal[:3, :3]
        arrow = self._m.ArrowPrimitive(
            pose=self._pose(goal.world_from_goal[:3, 3], rotation),
            shaft_length=3.0,
            shaft_diameter=0.2,
            head_length=1.0,
            head_diameter=0.5,
            color=self._colour(_CYAN),
        )
        entity = self._m.SceneEntity(
            timestamp=self._time(frame.timestamp_us),
            frame_id=WORLD,
            id="goal",
            cubes=[self._cube(goal.centre_m, rotation, goal.size_lwh_m, _CYAN)],
            texts=[self._text(goal.centre_m + np.array([0.0, 0.0, 2.0]), goal.text)],
            arrows=[arrow],
            lines=[self._line(goal.route, _CYAN)] if len(goal.route) > 1 else [],
        )
        self._put("/goal", self._scene([entity]), frame.timestamp_us)


def _rgba(rgb: ByteArray, known: Any) -> ByteArray:
    """Return colours (X, Y, 4), opaque where known (X, Y)."""
    alpha = np.where(known, 255, 0).astype(np.uint8)[..., None]
    return np.concatenate([rgb, alpha], axis=-1)

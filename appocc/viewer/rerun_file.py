"""Rerun recordings (.rrd): the entities of a scene over time, and how the viewer arranges them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from appocc.errors import DataError
from appocc.extras import import_extra
from appocc.files import whole_file
from appocc.geometry import quaternion_from_rotation
from appocc.viewer.timeline import (
    ShownBoxes,
    ShownGoal,
    Timeline,
    TimelineFrame,
    ego_box,
    ground_corners,
    map_pictures,
)
from appocc.visualization.cameras import camera_rows

# The package, its extra, and what needs it.
RERUN = ("rerun", "viewer", "a Rerun file")
_EGO, _GREEN, _CYAN = "world/ego", (60, 200, 90), (60, 220, 255)
_IMAGE_PLANE_M, _ROOM = 1.5, 1 << 17
# Eyes of the two views, ego frame: behind the car, and above the map.
_LOOK_AT_M, _BEHIND_M, _ABOVE_M = (8.0, 0.0, 0.0), (-26.0, 0.0, 20.0), (-14.0, 0.0, 62.0)
# Corners of a picture in the texture of a mesh, and its two triangles.
_TEXTURE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], np.float32)
_TRIANGLES = np.array([[0, 2, 1], [0, 3, 2]], np.uint32)


def write_rerun(timeline: Timeline, path: Path) -> None:
    """Write a scene as a Rerun recording, atomically, one key frame at a time.

    Timelines: `time` (the time of the recording) and `frame` (the index). Entities below `world`: `ego` with one
    pinhole camera and image per channel, `ego/bev/appearance` and `ego/bev/classes` (the map on the ground),
    `annotations`, `tracks`, `trails` and `goal`.

    Raises:
        AppoccError: if rerun-sdk is not installed.
        DataError: as iterating over the timeline, or if the file cannot be written.
    """
    rr = import_extra(*RERUN)
    with whole_file(path) as temporary:
        # Rerun blocks for ever if there is no room for the blueprint.
        temporary.write_bytes(bytes(_ROOM))
        recording = rr.RecordingStream("appocc", recording_id=f"appocc-{timeline.scene.token}")
        try:
            blueprint = None
            for frame in timeline:
                if blueprint is None:
                    blueprint = _blueprint(frame, timeline)
                    recording.save(temporary, default_blueprint=blueprint)
                    _log_constants(rr, recording, frame, timeline)
                _log_frame(rr, recording, frame)
                if timeline.goal is not None and frame.number == timeline.goal.first:
                    _log_goal(rr, recording, timeline.goal)
            recording.flush()
        except RuntimeError as error:  # its only kind of error
            raise DataError(f"{path}: cannot be written ({error})") from error
        finally:
            recording.disconnect()
        _check_complete(temporary, path)


def _check_complete(temporary: Path, path: Path) -> None:
    """Check that the end of the file is there: Rerun does not report a full disk.

    Raises:
        DataError: if it is not.
    """
    chunk = import_extra("rerun.chunk", *RERUN[1:])
    try:
        chunk.RrdReader(temporary).store()
    except Exception as error:  # of several kinds
        raise DataError(f"{path}: cannot be written completely: disk full? ({error})") from error


def _log_constants(rr: Any, recording: Any, frame: TimelineFrame, timeline: Timeline) -> None:
    """Log what does not change: axes, the ego vehicle, and the name of the scene."""
    centre, size = ego_box(frame.rig.ego_vehicle)
    recording.send_recording_name(timeline.scene.name)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log(f"{_EGO}/vehicle", rr.Boxes3D(centers=[centre], sizes=[size], colors=[_GREEN]), static=True)
    maps = timeline.source or "none"
    text = f"# {timeline.scene.name}\n\n{timeline.scene.description}\n\nmaps: {maps}; frames: {len(timeline.samples)}"
    recording.log("about", rr.TextDocument(text, media_type="text/markdown"), static=True)


def _log_frame(rr: Any, recording: Any, frame: TimelineFrame) -> None:
    recording.set_time("time", timestamp=np.datetime64(frame.timestamp_us, "us"))
    recording.set_time("frame", sequence=frame.number)
    recording.log(_EGO, _transform(rr, frame.world_from_ego))
    for camera in frame.rig:
        entity = f"{_EGO}/{camera.channel}"
        pinhole = rr.Pinhole(
            image_from_camera=camera.intrinsic,
            resolution=[camera.width_px, camera.height_px],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=_IMAGE_PLANE_M,
        )
        recording.log(entity, _transform(rr, camera.ego_from_cam), pinhole)
        if camera.channel in frame.images:
            image = rr.EncodedImage(contents=frame.images[camera.channel], media_type="image/jpeg")
            recording.log(f"{entity}/image", image)
    if frame.boxes is not None:
        recording.log("world/annotations", _boxes(rr, frame.boxes, labelled=False))
    if frame.tracks is not None:
        recording.log("world/tracks", _boxes(rr, frame.tracks, labelled=True))
        recording.log("world/trails", rr.LineStrips3D(list(frame.tracks.trails), colors=frame.tracks.rgb))
    if frame.bev is not None:
        for name, picture in map_pictures(frame.bev).items():
            mesh = rr.Mesh3D(
                vertex_positions=ground_corners(frame.bev),
                triangle_indices=_TRIANGLES,
                vertex_texcoords=_TEXTURE,
                albedo_texture=picture,
            )
            recording.log(f"{_EGO}/bev/{name}", mesh)


def _transform(rr: Any, target_from_source: Any) -> Any:
    return rr.Transform3D(translation=target_from_source[:3, 3], mat3x3=target_from_source[:3, :3])


def _boxes(rr: Any, boxes: ShownBoxes, labelled: bool) -> Any:
    wxyz = quaternion_from_rotation(boxes.rotation).reshape(-1, 4)
    return rr.Boxes3D(
        centers=boxes.centre_m,
        half_sizes=boxes.size_lwh_m / 2,
        quaternions=wxyz[:, [1, 2, 3, 0]],
        colors=boxes.rgb,
        labels=list(boxes.labels),
        show_labels=labelled,
        fill_mode="MajorWireframe",
    )


def _log_goal(rr: Any, recording: Any, goal: ShownGoal) -> None:
    """Log the goal at the time of the last frame; it stays."""
    wxyz = quaternion_from_rotation(goal.world_from_goal[:3, :3])
    place = rr.Boxes3D(
        centers=[goal.centre_m],
        half_sizes=[goal.size_lwh_m / 2],
        quaternions=[wxyz[[1, 2, 3, 0]]],
        colors=[_CYAN],
        labels=[goal.text],
    )
    recording.log("world/goal", place)
    heading = goal.world_from_goal[:3, 0] * 4.0
    arrow = rr.Arrows3D(origins=[goal.world_from_goal[:3, 3]], vectors=[heading], colors=[_CYAN], radii=0.15)
    recording.log("world/goal/heading", arrow)
    if len(goal.route):
        recording.log("world/goal/route", rr.LineStrips3D([goal.route], colors=[_CYAN], radii=0.1))


def _blueprint(frame: TimelineFrame, timeline: Timeline) -> Any:
    """Return the arrangement: the scene and the classes of the map beside the cameras, front row over rear row."""
    rrb = import_extra("rerun.blueprint", *RERUN[1:])

    def view(name: str, contents: list[str], position: tuple[float, float, float]) -> Any:
        """Return a view that moves with the ego."""
        eye = rrb.EyeControls3D(position=position, look_target=_LOOK_AT_M, eye_up=(0.0, 0.0, 1.0))
        return rrb.Spatial3DView(origin=_EGO, name=name, contents=contents, eye_controls=eye)

    left = [view("scene", ["+ /world/**", f"- /{_EGO}/bev/classes/**"], _BEHIND_M)]
    if timeline.source is not None:
        kept = [f"+ /{_EGO}/bev/classes/**", f"+ /{_EGO}/vehicle", "+ /world/tracks", "+ /world/goal/**"]
        left.append(view("classes of the map", kept, _ABOVE_M))
    rows = [
        rrb.Horizontal(
            *(
                rrb.Spatial2DView(
                    origin=f"{_EGO}/{camera.channel}", name=camera.channel, contents=["$origin/**", "/world/tracks"]
                )
                for camera in row
            )
        )
        for row in camera_rows(frame.rig)
    ]
    cameras = rrb.Vertical(*rows)
    return rrb.Blueprint(rrb.Vertical(rrb.Horizontal(*left), cameras, row_shares=[3, 2]), collapse_panels=True)

"""Pictures of a report as data URIs."""

from __future__ import annotations

import base64
from typing import NamedTuple

import cv2
import numpy as np

from appocc.bevmap import load_map
from appocc.boxes import Boxes
from appocc.checks import ByteArray
from appocc.evaluation.bev import FrameScore
from appocc.nuscenes import Dataset
from appocc.visualization.canvas import PANELS
from appocc.visualization.layout import resized
from appocc.visualization.predictions import figure_below_cameras, map_panel
from appocc.visualization.vehicle_marks import VehicleMarks
from cli.infer import vehicle_marks
from cli.report.content import ReportContent

# Two maps side by side fill a picture: a larger one would be reduced, with the writing in it.
_WIDTH_PX, _MAP_PX, _QUALITY = 1216, 600, 78


class ReportPicture(NamedTuple):
    """A picture of a key frame.

    Attributes:
        scene: name of the scene.
        number: index of the key frame in it.
        iou: IoU by class; None without true maps.
        uri: data URI of a JPEG.
    """

    scene: str
    number: int
    iou: dict[str, float] | None
    uri: str


def frame_pictures(content: ReportContent, count: int) -> list[ReportPicture]:
    """Return pictures of key frames, evenly chosen over all scenes."""
    frames = [(one.name, n) for one in content.scenes for n in range(len(content.dataset.samples(one)))]
    chosen = np.unique(np.linspace(0, len(frames) - 1, min(count, len(frames)) + 2).round().astype(int)[1:-1])
    scores = {
        (s.name, f.number): f for s in (content.evaluation.scenes if content.evaluation else ()) for f in s.frames
    }
    shown = [frames[i] for i in chosen]
    return [frame_picture(content, scene, number, scores.get((scene, number))) for scene, number in shown]


def worst_pictures(content: ReportContent, count: int) -> list[ReportPicture]:
    """Return pictures of the frames with the lowest IoU, the lowest first."""
    return [frame_picture(content, scene, frame.number, frame) for scene, frame in content.worst(count)]


def frame_picture(content: ReportContent, scene: str, number: int, score: FrameScore | None) -> ReportPicture:
    """Return the picture of a key frame: its cameras, its map, and the true map if there is one.

    Raises:
        DataError: if an image or a map is missing or damaged.
    """
    dataset = content.dataset
    picture = _draw(dataset, content, scene, number)
    return ReportPicture(scene, number, None if score is None else dict(score.iou), jpeg_uri(picture))


def _draw(dataset: Dataset, content: ReportContent, scene: str, number: int) -> ByteArray:
    sample = dataset.samples(dataset.scene(scene))[number]
    frame = dataset.frame(sample)
    shown = [(content.source, load_map(dataset.root, content.source, sample.token))]
    if content.against is not None:
        shown.append((content.against, load_map(dataset.root, content.against, sample.token)))
    marks = [vehicle_marks(shown[0][1]), VehicleMarks.of_boxes(frame.boxes_ego or Boxes.empty())]
    ego = frame.rig.ego_vehicle
    cell_px = max(_MAP_PX // shown[0][1].grid.shape[1], 1)
    rows = [
        [
            map_panel(bev, what, mark, ego, f"{name}: ", cell_px)
            for (name, bev), mark in zip(shown, marks, strict=False)
        ]
        for what in PANELS
    ]
    rows = rows if len(shown) > 1 else [[panels[0] for panels in rows]]
    return figure_below_cameras(frame, shown[0][1], rows)


def jpeg_uri(picture: ByteArray) -> str:
    """Return a picture (H, W, 3) as the data URI of a JPEG, at most 1216 pixels wide."""
    small = resized(picture, min(1.0, _WIDTH_PX / picture.shape[1]))
    data = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"


def svg_uri(svg: str) -> str:
    """Return an SVG as a data URI: inside of the page, the ids of several would clash."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"

"""Visualization of an answer: the map with referent and goal, and the camera in which the referent is largest."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from appocc.bevmap import ROAD
from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.frame import Frame
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.visualization.canvas import (
    CLASS_COLOURS,
    GREEN,
    HATCH_COLOUR,
    RED,
    UNKNOWN_LEGEND,
    WHITE,
    YELLOW,
    BEVCanvas,
    Colour,
    draw_box,
    put_text,
)
from grounding.answer import Answer
from grounding.describe import describe_object
from grounding.goal.planner import Target
from grounding.scene_object import SceneObject
from tracking.vehicle_classes import HEIGHT_M

CYAN: Colour = (60, 220, 255)
PALE_CYAN: Colour = (120, 170, 185)
_VEHICLE: Colour = (205, 210, 220)
_SCALE = 4
_LINE_PX, _LEGEND_PX, _MOST_REASONS = 22, 250, 6
# Width of the camera panel, at most, relative to the map panel.
_MAX_RELATIVE_WIDTH = 1.8
# Nearest depth and farthest pixels of what is drawn into a camera image.
_NEAR_M, _FAR_PX = 0.5, 1e5
_STATUS_COLOUR: dict[str, Colour] = {"ok": (90, 220, 110), "ambiguous": YELLOW}


def draw_answer(answer: Answer, frame: Frame | None = None, *, show_costs: bool = False, said: str = "") -> ByteArray:
    """Draw an answer of any status as RGB (H, W, 3).

    Args:
        answer: answer with its scene.
        frame: camera images of the moment; None without them.
        show_costs: whether to shade possible goals: brighter for lower costs.
        said: words above the picture, such as those of a conversation; by default the command.
    """
    bev = _draw_bev_panel(answer, show_costs)
    camera = None if frame is None else _draw_camera_panel(answer, frame, bev.shape[0])
    panels = bev if camera is None else np.hstack([bev, camera])
    return np.ascontiguousarray(np.vstack([_draw_caption(answer, said, panels.shape[1]), panels]))


def _draw_caption(answer: Answer, said: str, width: int) -> ByteArray:
    """Draw the caption: command, status and reasons."""
    reasons = answer.reasons[:_MOST_REASONS]
    band = np.full((72 + len(reasons) * _LINE_PX, width, 3), 24, np.uint8)
    status = answer.status.replace("_", " ")
    put_text(band, f'"{_truncate(said or answer.query.command, width // 14)}"', (12, 28), WHITE, 0.7)
    told = f"{status}: {answer.question}" if answer.question else status
    put_text(band, _truncate(told, width // 12), (12, 56), _STATUS_COLOUR.get(answer.status, RED), 0.6)
    for number, reason in enumerate(reasons):
        put_text(band, _truncate(reason, width // 10), (12, 82 + number * _LINE_PX), WHITE, 0.5)
    return band


def _truncate(text: str, characters: int = 200) -> str:
    """Truncate a text."""
    return text if len(text) <= characters else text[: characters - 3] + "..."


def _draw_bev_panel(answer: Answer, show_costs: bool) -> ByteArray:
    """Draw the map with its vehicles, numbered candidates, referent, route, and the ego at the goal."""
    bev = answer.scene.bev
    canvas = BEVCanvas(BEVGrid.surround() if bev is None else bev.grid, _SCALE)
    if bev is not None:
        canvas.occupancy(bev)
        canvas.appearance(bev)
    if show_costs and answer.plan.cost_field is not None:
        _shade_costs(canvas, answer.plan.cost_field)
    canvas.ego(answer.scene.ego)
    for vehicle in answer.scene.objects:
        canvas.line(vehicle.footprint(), _VEHICLE, 1, closed=True)
    for number, candidate in enumerate(answer.candidates, start=1):
        if candidate is not answer.referent:
            canvas.line(candidate.item.footprint(), YELLOW, 1, closed=True)
            canvas.label(candidate.item.centre_m, str(number), YELLOW)
    if answer.referent:
        for item in (answer.referent.item, answer.referent.partner):
            if item:
                canvas.line(item.footprint(), RED, 2, closed=True)
    for other in answer.plan.runners_up:
        canvas.line(other.footprint(), PALE_CYAN, 1, closed=True)
    if answer.plan.route is not None:
        canvas.line(answer.plan.route, PALE_CYAN, 1)
    if answer.target:
        _draw_pose(canvas, answer.target, CYAN)
    elif answer.plan.nearest:
        _draw_pose(canvas, answer.plan.nearest, WHITE)
    _draw_legend(canvas, answer)
    return canvas.picture


def _draw_pose(canvas: BEVCanvas, target: Target, colour: Colour) -> None:
    """Draw the footprint and the heading of the ego at a goal pose."""
    corners = target.footprint()
    canvas.line(corners, colour, 2, closed=True)
    canvas.line([target.ego_m, (corners[0] + corners[3]) / 2], colour, 2)
    canvas.dot(target.ego_m, colour, 3)


def _shade_costs(canvas: BEVCanvas, cost: FloatArray) -> None:
    """Blend the costs (X, Y) of possible goals over the map: brighter for lower costs."""
    possible = np.isfinite(cost)
    score = np.exp(-np.where(possible, cost, 0.0) / 2)
    background = canvas.picture.copy()
    canvas.cells(np.asarray((0.25 + 0.75 * score[..., None]) * np.array(CYAN), np.uint8), possible)
    cv2.addWeighted(canvas.picture, 0.5, background, 0.5, 0, dst=canvas.picture)


def _draw_legend(canvas: BEVCanvas, answer: Answer) -> None:
    """Draw a legend of the colours in use."""
    bev = answer.scene.bev
    entries = [("the car now", GREEN), (UNKNOWN_LEGEND, HATCH_COLOUR)]
    if bev is not None and (bev.on[ROAD] & ~bev.appearance_valid).any():
        entries.append(("plain grey: road of unknown colour", CLASS_COLOURS[ROAD]))
    entries += [("vehicles", _VEHICLE)] if answer.scene.objects else []
    entries += [("the vehicle meant", RED)] if answer.referent else []
    entries += [("the place to go", CYAN)] if answer.target else []
    entries += [("the way, and other places", PALE_CYAN)] if answer.plan.route is not None else []
    entries += [("the nearest place that would do", WHITE)] if answer.plan.nearest else []
    entries += (
        [("other candidates" if answer.referent else "candidates", YELLOW)]
        if len(answer.candidates) > (answer.referent is not None)
        else []
    )
    bottom = canvas.picture.shape[0]
    behind = canvas.picture[bottom - 18 - len(entries) * _LINE_PX :, :_LEGEND_PX]
    behind[:] = behind // 4  # legible on bright maps
    for row, (words, colour) in enumerate(entries):
        top = bottom - 12 - (len(entries) - row) * _LINE_PX
        cv2.rectangle(canvas.picture, (10, top), (22, top + 12), colour, -1)
        put_text(canvas.picture, words, (28, top + 11))


def _draw_camera_panel(answer: Answer, frame: Frame, height: int) -> ByteArray | None:
    """Draw the camera in which the referent or first candidate is largest, with the goal if it is in view."""
    shown = [answer.referent] if answer.referent else list(answer.candidates)
    if not frame.images:
        return None
    channel = _best_channel(frame, shown[0].item) if shown else None
    if channel is None:
        channel = "CAM_FRONT" if "CAM_FRONT" in frame.images else next(iter(frame.images))
    camera, picture = _resize(frame.rig[channel], frame.images[channel], height)
    if answer.target:
        _draw_footprint(
            picture, camera, answer.target.footprint(), [_corners(o, frame) for o in answer.scene.objects]
        )
    for candidate in shown:
        draw_box(picture, camera, _corners(candidate.item, frame), RED if answer.referent else YELLOW, 2)
    put_text(picture, channel, (10, 22), WHITE, 0.6)
    if shown and not answer.referent:
        _draw_numbers(picture, camera, answer, frame)
    elif shown:
        put_text(
            picture, _truncate(describe_object(shown[0].item, answer.scene)), (10, len(picture) - 12), WHITE, 0.55
        )
    return np.pad(picture, ((0, height - len(picture)), (0, 0), (0, 0)), constant_values=24)


def _resize(camera: Camera, image: ByteArray, height: int) -> tuple[Camera, ByteArray]:
    """Resize a camera and its image to a height in pixels, or to the maximum width if that is less."""
    scale = min(height / camera.height_px, _MAX_RELATIVE_WIDTH * height / camera.width_px)
    size = (round(camera.width_px * scale), round(camera.height_px * scale))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return camera.resized(*size), np.asarray(cv2.resize(image, size, interpolation=how), dtype=np.uint8)


def _corners(item: SceneObject, frame: Frame) -> FloatArray:
    """Return box corners (8, 3) in the ego frame: of the annotated box, else of one with the height of a car."""
    boxes = frame.boxes_ego or Boxes.empty()
    if item.id in boxes.instance:
        return np.asarray(boxes.corners()[boxes.instance.index(item.id)])
    foot = np.pad(item.footprint(), ((0, 0), (0, 1)))
    return np.concatenate([foot, foot + np.array([0.0, 0.0, HEIGHT_M["car"]])])


def _best_channel(frame: Frame, item: SceneObject) -> str | None:
    """Return the camera that shows the box largest; None if no camera sees its centre."""
    corners = _corners(item, frame)
    sizes = {channel: _visible_px(frame.rig[channel], corners) for channel in frame.images}
    best = max(sizes, key=lambda channel: sizes[channel])
    return best if sizes[best] > 0 else None


def _visible_px(camera: Camera, corners: FloatArray) -> float:
    """Return the area of the bounding rectangle inside the image; 0 if the camera does not see the box centre."""
    middle, depth = camera.project_ego(corners.mean(axis=0, keepdims=True))
    if not camera.sees(middle, depth)[0]:
        return 0.0
    uv, depths = camera.project_ego(corners)
    uv = np.clip(uv[depths > 0.1], 0, [camera.width_px, camera.height_px])
    return float(np.prod(uv.max(axis=0) - uv.min(axis=0)))


def _draw_footprint(
    picture: ByteArray, camera: Camera, footprint: FloatArray, vehicles: Sequence[FloatArray]
) -> None:
    """Blend a footprint on the ground plane into the image if it is completely in front of the camera.

    Vehicles, box corners (8, 3) each in the ego frame, hide the part of it that is behind them.
    """
    points = np.pad(footprint, ((0, 0), (0, 1)))
    in_cam = apply(inverse(camera.ego_from_cam), points)
    if float(in_cam[:, 2].min()) < _NEAR_M:
        return
    uv, _ = camera.project(in_cam)
    if np.abs(uv).max() > _FAR_PX:
        return
    before, overlay = picture.copy(), picture.copy()
    outline = np.round(uv).astype(np.int32).reshape(-1, 1, 2)
    cv2.fillPoly(overlay, [outline], CYAN)
    cv2.addWeighted(overlay, 0.45, picture, 0.55, 0, dst=picture)
    cv2.polylines(picture, [outline], True, CYAN, 3, cv2.LINE_AA)
    hidden = np.zeros(picture.shape[:2], np.uint8)
    for corners in vehicles:
        uv, depth = camera.project_ego(corners)
        if depth.min() > _NEAR_M and depth.mean() < in_cam[:, 2].mean() and np.abs(uv).max() < _FAR_PX:
            cv2.fillConvexPoly(hidden, cv2.convexHull(np.round(uv).astype(np.int32)), 1)
    picture[hidden > 0] = before[hidden > 0]


def _draw_numbers(picture: ByteArray, camera: Camera, answer: Answer, frame: Frame) -> None:
    """Draw the numbers of the candidates at their centres."""
    for number, candidate in enumerate(answer.candidates, start=1):
        middle = _corners(candidate.item, frame).mean(axis=0, keepdims=True)
        uv, depth = camera.project_ego(middle)
        if camera.sees(uv, depth)[0]:
            column, row = (round(float(v)) for v in uv[0])
            put_text(picture, str(number), (column, row), YELLOW, 0.7, centred=True)

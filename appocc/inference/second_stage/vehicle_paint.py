"""Paint of predicted vehicles: hue and chroma of their bodywork in the images.

A cell of a map mixes the colour of a vehicle with those around it, so that saturated paints fade. The sides of a
vehicle show its paint, in other light than from above: the lightness is the mean of both.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.colours import LUMINANCE
from appocc.groundtruth.bodywork import estimate_exposure, estimate_paint, extract_bodywork
from appocc.groundtruth.painting import MIN_PIXELS, BoxView, box_pixels
from appocc.objects import BEVObjects
from appocc.srgb import encode_srgb, linear_from_srgb

# Vehicles below this score neither get paint from the images nor occlude others.
_LEAST_SCORE = 0.2
_SAME_EXPOSURE = np.ones(3)
# Luminance (linear) of the darkest paint: black in shadow.
_BLACK = 1e-3


def paint_from_images(objects: BEVObjects, images: ByteArray, cameras: Iterable[Camera]) -> BEVObjects:
    """Return the objects, the vehicles among them with the paint of their bodywork in the images.

    Vehicles that no image shows keep the paint that they have.

    Args:
        objects: objects of a map with the paint of its cells, in the ego frame of the cameras.
        images: (N, 3, H, W) uint8 sRGB.
        cameras: N cameras.
    """
    chosen = np.flatnonzero(objects.are_vehicles & (objects.score >= _LEAST_SCORE))
    boxes, rgb = objects.select(chosen).boxes, objects.rgb.copy()
    views = [
        (BoxView.project(image, camera, camera.ego_from_cam, boxes), estimate_exposure(image))
        for image, camera in zip(images.transpose(0, 2, 3, 1), cameras, strict=True)
    ]
    for number, own in enumerate(chosen.tolist()):
        shown = [(box_pixels(view, number, None), light) for view, light in views]
        seen = [(pixels, light) for pixels, light in shown if len(pixels.rgb) >= MIN_PIXELS]
        if seen:
            paint = estimate_paint([extract_bodywork(*pixels, light, _SAME_EXPOSURE) for pixels, light in seen])
            rgb[own] = _in_mean_light(paint.astype(np.float64), rgb[own])
    return objects.painted(rgb)


def _in_mean_light(paint: FloatArray, other: FloatArray) -> FloatArray:
    """Return a paint (3,) at the geometric mean of its luminance and that of another colour, if that is known."""
    if not np.isfinite(other).all():
        return paint
    linear = linear_from_srgb(paint)
    own, goal = (max(float(light @ LUMINANCE), _BLACK) for light in (linear, linear_from_srgb(other)))
    return np.asarray(255 * encode_srgb(np.minimum(linear * np.sqrt(goal / own), 1.0)))

"""Second stage of detection: the vehicles of a map, corrected by their image crops."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file
from scipy.special import expit, logit

from appocc.boxes import is_vehicle
from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.colours import lab_from_rgb
from appocc.geometry import wrap_angle
from appocc.inference.second_stage.image_crops import ImageCrops, crop_images
from appocc.inference.second_stage.network import Corrections, CropInputs, CropNetwork
from appocc.inference.second_stage.vehicle_paint import paint_from_images
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.objects import KINDS, BEVObjects

# Weights of the second stage, named as the shipped weights that they belong to; the default ones for all others.
WEIGHTS_FOLDER, DEFAULT = Path(__file__).parent / "data", "appocc"
# Vehicles below this score are neither looked at nor occlude others.
LEAST_SCORE = 0.08
_VEHICLE_KINDS = np.array([is_vehicle(kind) for kind in KINDS], np.bool_)
_USUAL_WLH_M, _USUAL_DISTANCE_M, _USUAL_SIZE_PX = (1.9, 4.5, 1.6), 15.0, 33.0
# A vehicle is turned round only where it is this likely: real cars look less alike than simulated ones.
_LEAST_LOG_ODDS = 2.0
# Bodywork is between tyres and windows, by the place on the box (-1..1); fewer pixels of it are too few.
_BODYWORK, _LEAST_PIXELS = (-0.45, 0.25), 8


class SecondStage:
    """Correct the vehicles of a map by their images: score, kind, heading, size and paint."""

    def __init__(self, network: CropNetwork, device: torch.device) -> None:
        """Take a trained network to a device."""
        self._network = fold_batch_norms(network).to(device)
        self._device = device

    @classmethod
    def shipped(cls, device: torch.device, name: str = DEFAULT) -> SecondStage:
        """Return the second stage of shipped weights by their name, or the default one."""
        return cls(shipped_network(name), device)

    def __call__(self, objects: BEVObjects, images: ByteArray, cameras: Iterable[Camera]) -> BEVObjects:
        """Return the objects, the best first, with corrected vehicles; what no image shows stays as it is.

        Args:
            objects: objects of a map, in the ego frame of the cameras.
            images: (V, 3, H, W) uint8 sRGB.
            cameras: V cameras.
        """
        cameras = list(cameras)
        chosen = np.flatnonzero(objects.are_vehicles & (objects.score >= LEAST_SCORE))
        boxes, away = facing_away(objects.select(chosen))
        crops = crop_images(boxes.boxes, images.transpose(0, 2, 3, 1), cameras)
        if not len(crops.owner):
            return objects
        boxes, away = boxes.select(crops.owner), away[crops.owner]
        with torch.inference_mode():
            inputs = CropInputs(*(tensor.to(self._device) for tensor in crop_inputs(boxes, away, crops)))
            outputs = Corrections(*(output.float().cpu() for output in self._network(inputs)))
        objects = paint_from_images(objects, images, cameras)
        return _corrected(objects, chosen[crops.owner], boxes, away, outputs)


def shipped_network(name: str = DEFAULT) -> CropNetwork:
    """Return the network of the second stage of shipped weights by their name, or the default one."""
    network = CropNetwork()
    network.load_state_dict(load_file(WEIGHTS_FOLDER / f"{name}.safetensors"))
    return network


def facing_away(objects: BEVObjects) -> tuple[BEVObjects, FloatArray]:
    """Return objects with headings that point away from the ego, and (N,) 1 where they did before, -1 elsewhere."""
    bearing_rad = np.arctan2(objects.centre_m[:, 1], objects.centre_m[:, 0])
    away = np.where(np.cos(objects.yaw_rad - bearing_rad) >= 0, 1.0, -1.0)
    return replace(objects, yaw_rad=np.where(away > 0, objects.yaw_rad, objects.yaw_rad + np.pi)), away


def crop_inputs(boxes: BEVObjects, away: FloatArray, crops: ImageCrops) -> CropInputs:
    """Return the network inputs of K boxes from `facing_away` and their crops.

    Args:
        boxes: boxes whose headings point away from the ego.
        away: (K,) 1 where the predicted heading pointed away, -1 where it was turned.
        crops: crops of the boxes.
    """
    rgb = crops.rgb.astype(np.float32) / 127.5 - 1
    pixels = np.concatenate([rgb, crops.place, crops.visible[..., None]], axis=-1, dtype=np.float32)
    numbers = box_numbers(boxes, away, crops).astype(np.float32)
    body_lab = lab_from_rgb(_mean_of_body(crops)).astype(np.float32)
    images = torch.from_numpy(np.ascontiguousarray(pixels.transpose(0, 3, 1, 2)))
    return CropInputs(images, torch.from_numpy(numbers), torch.from_numpy(body_lab))


def box_numbers(boxes: BEVObjects, away: FloatArray, crops: ImageCrops) -> FloatArray:
    """Return the numbers (K, 18) of boxes with their crops, each about zero."""
    x, y = boxes.centre_m[:, :2].T
    aspect_rad = boxes.yaw_rad - np.arctan2(y, x)
    known = np.asarray(np.isfinite(boxes.rgb).all(axis=1))
    paint = np.where(known[:, None], lab_from_rgb(np.nan_to_num(boxes.rgb)), 0.0)
    return np.column_stack(
        [
            np.log(np.maximum(np.hypot(x, y), 1.0) / _USUAL_DISTANCE_M),
            boxes.size_wlh_m - _USUAL_WLH_M,
            logit(boxes.score.clip(0.02, 0.98)),
            np.sin(aspect_rad),
            np.cos(aspect_rad),
            paint / 50,
            known,
            lab_from_rgb(crops.light) / 50,
            np.log(crops.size_px / _USUAL_SIZE_PX),
            np.array([kind == "car" for kind in boxes.kind]),
            away,
        ]
    )


def _mean_of_body(crops: ImageCrops) -> FloatArray:
    """Return the mean colour (K, 3) of the pixels that show bodywork; of all in the box where they are too few."""
    low, high = _BODYWORK
    body = (crops.visible > 0) & (crops.place[..., 2] > low) & (crops.place[..., 2] < high)
    few = body.sum(axis=(1, 2)) < _LEAST_PIXELS
    chosen = np.where(few[:, None, None], crops.visible != 0, body)[..., None]
    return np.asarray((crops.rgb * chosen).sum(axis=(1, 2)) / np.maximum(chosen.sum(axis=(1, 2)), 1))


def _corrected(
    objects: BEVObjects, index: IntArray, boxes: BEVObjects, away: FloatArray, outputs: Corrections
) -> BEVObjects:
    """Return the objects, the best first, with corrections of those of an index (K,), whose boxes face away."""
    from skimage.color import lab2rgb

    found, near_front, kind, lab, size = (output.numpy().astype(np.float64) for output in outputs)
    score, yaw, rgb = objects.score.copy(), objects.yaw_rad.copy(), objects.rgb.copy()
    size_wlh, kinds = objects.size_wlh_m.copy(), list(objects.kind)
    score[index] = expit(found)
    facing_ego = near_front > _LEAST_LOG_ODDS * away
    yaw[index] = wrap_angle(boxes.yaw_rad + np.where(facing_ego, np.pi, 0.0))
    size_wlh[index] = boxes.size_wlh_m * np.exp(size)
    # The mean of two estimates: the network's is better in simulation, that of the pixels on real streets.
    bodywork = np.where(np.isfinite(rgb[index]), lab_from_rgb(np.nan_to_num(rgb[index])), lab)
    rgb[index] = 255 * lab2rgb((lab + bodywork) / 2)
    for i, number in zip(index.tolist(), np.where(_VEHICLE_KINDS, kind, -np.inf).argmax(axis=1), strict=True):
        kinds[i] = KINDS[number]
    corrected = replace(objects, score=score, yaw_rad=yaw, size_wlh_m=size_wlh, rgb=rgb, kind=tuple(kinds))
    return corrected.select(np.argsort(-score, kind="stable"))

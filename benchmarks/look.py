"""Robustness to the look of images: IoU under five filters, and its swing.

    OMP_NUM_THREADS=1 python -m benchmarks.look ROOT [--weights F] [--frames 16] [--against groundtruth] [--json]

Filters act on the network's input images, after resizing and cropping, so that they are equally strong for every
camera; what the images show does not change:

    contrast   CLAHE of the lightness (clip limit 3, 8 x 8 tiles), then unsharp masking (sigma 1 px, weight 1)
    median     median of 3 x 3 pixels
    blur       Gaussian, sigma 1 px
    dark       gamma 1.4
    jpeg       JPEG of quality 30

IoU is at the thresholds of each map, over all cells, on frames spread evenly over ROOT. The swing of a class is
its largest minus its smallest IoU, with the unfiltered images among them. docs/model_card.md has the figures of the
shipped weights.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from appocc.bevmap import CLASSES
from appocc.checks import ByteArray
from appocc.errors import AppoccError, DataError
from appocc.evaluation.cells import GROUPS, CellCounts, ious
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput, dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor, select_cameras
from appocc.models.input_images import fit_image
from appocc.models.model_spec import ModelSpec
from appocc.nuscenes.dataset import Dataset
from benchmarks.predicted_maps import compare, evenly, parse_options, truth_source

_CLIP_LIMIT, _TILES, _SIGMA_PX, _MEDIAN_PX, _GAMMA, _QUALITY = 3.0, (8, 8), 1.0, 3, 1.4, 30


def contrast(image: ByteArray) -> ByteArray:
    """Return an image (H, W, 3) with more local contrast, sharpened."""
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB)
    lab[..., 0] = cv2.createCLAHE(_CLIP_LIMIT, _TILES).apply(lab[..., 0])
    clear = np.asarray(cv2.cvtColor(lab, cv2.COLOR_LAB2RGB), np.uint8)
    return np.asarray(cv2.addWeighted(clear, 2.0, blur(clear), -1.0, 0.0), np.uint8)


def median(image: ByteArray) -> ByteArray:
    """Return the median of each channel around each pixel."""
    return np.asarray(cv2.medianBlur(image, _MEDIAN_PX), np.uint8)


def blur(image: ByteArray) -> ByteArray:
    """Return a blurred image."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), _SIGMA_PX), np.uint8)


def dark(image: ByteArray) -> ByteArray:
    """Return an image with darker midtones; black and white are unchanged."""
    table = (np.linspace(0, 1, 256) ** _GAMMA * 255).round().astype(np.uint8)
    return table[image]


def jpeg(image: ByteArray) -> ByteArray:
    """Return an image after lossy compression."""
    _, packed = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    decoded = cv2.imdecode(packed, cv2.IMREAD_COLOR)
    assert decoded is not None  # just encoded
    return np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), np.uint8)


FILTERS: Mapping[str, Callable[[ByteArray], ByteArray]] = {
    "as it is": lambda image: image,
    **{each.__name__: each for each in (contrast, median, blur, dark, jpeg)},
}


def input_frame(frame: Frame, spec: ModelSpec) -> Frame:
    """Return a frame whose images and cameras are those of the network's input."""
    cameras = select_cameras(spec, frame.rig.select(frame.images))
    pairs = [fit_image(frame.images[camera.channel], camera, spec) for camera in cameras]
    images = {camera.channel: image for image, camera in pairs}
    return replace(frame, rig=frame.rig.with_cameras(camera for _, camera in pairs), images=images)


def measure(
    predictor: Predictor, root: Path, against: str, inputs: Sequence[InferenceInput]
) -> dict[str, dict[str, float]]:
    """Return the IoU of each class under each filter.

    Raises:
        DataError: if there are no inputs, or a true map is missing or on another grid.
    """
    if not inputs:
        raise DataError(f"{root}: expected key frames, got none")
    counts = dict.fromkeys(FILTERS, CellCounts.zeros(1))
    for each in track(inputs, "frames", console=Console(stderr=True), transient=True):
        frame = input_frame(each.read().frame, predictor.model.spec)
        for name, changed in FILTERS.items():
            images = {channel: changed(image) for channel, image in frame.images.items()}
            counts[name] = counts[name].plus(compare(predictor, replace(frame, images=images), root, against).counts)
    return {name: ious(each.overlap[0, GROUPS.index("all")]) for name, each in counts.items()}


def swing(iou: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return the largest minus the smallest IoU of each class; NaN where it is undefined."""
    values = {name: [row[name] for row in iou.values()] for name in CLASSES}
    return {name: max(each) - min(each) for name, each in values.items()}


def as_json(iou: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Return IoU and swing; None where a class is undefined."""
    rows = {**iou, "swing": swing(iou)}
    plain = {
        key: {name: value if np.isfinite(value) else None for name, value in row.items()} for key, row in rows.items()
    }
    return {"swing": plain.pop("swing"), "iou": plain}


def table(iou: Mapping[str, Mapping[str, float]]) -> Table:
    """Return the figures as a table in percent."""
    made = Table("images", *CLASSES)
    for name, row in {**iou, "swing": swing(iou)}.items():
        made.add_row(name, *("-" if value != value else f"{100 * value:.1f}" for value in row.values()))
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table or JSON."""
    parser, options = parse_options(__doc__, arguments, frames=16)
    try:
        dataset, predictor = Dataset(options.root), load_predictor(options.weights)
        inputs = evenly(dataset_inputs(dataset, dataset.scenes), options.frames)
        iou = measure(predictor, options.root, truth_source(options.root, options.against), inputs)
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")
    if options.json:
        about = {"root": str(options.root), "frames": len(inputs), "weights": predictor.weights.as_meta()}
        print(json.dumps({**about, **as_json(iou)}, indent=2))
    else:
        Console().print(table(iou))


if __name__ == "__main__":
    main()

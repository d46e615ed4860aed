"""No-label zones: places of a key frame in which nothing is annotated, whatever is there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample
from appocc.nuscenes.writer import Writer, token_of

TABLE = "nolabelzone"


def write_no_label_zones(writer: Writer, sample: str, outlines: Sequence[FloatArray]) -> None:
    """Add the zones of a key frame, outlines (K, 2) in the world frame, to a dataset."""
    for number, outline in enumerate(outlines):
        token = token_of(TABLE, sample, number)
        writer.add_extra(TABLE, token, sample_token=sample, outline_m=outline.tolist())


def no_label_zones(dataset: Dataset, sample: Sample) -> tuple[FloatArray, ...]:
    """Return the outlines (K, 2) of the zones of a key frame, in the world frame.

    Raises:
        DataError: if one is no polygon.
    """
    outlines = dataset.tables[TABLE]["outline_m"]
    return tuple(_checked(dataset, outlines[row]) for row in dataset.tables.zones_by_sample.rows(sample.token))


def _checked(dataset: Dataset, value: object) -> FloatArray:
    try:
        outline = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        outline = np.empty(0)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3 or not np.isfinite(outline).all():
        raise DataError(f"{dataset.tables.path(TABLE)}: outline_m: expected three or more points x, y, got {value}")
    return outline

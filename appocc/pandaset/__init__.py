"""PandaSet recordings to the nuScenes schema."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from appocc.errors import DataError
from appocc.files import check_folder
from appocc.nuscenes.writer import Writer, whole_folder
from appocc.pandaset.convert import VERSION, convert
from appocc.pandaset.pickles import read_pickles
from appocc.pandaset.plain import read_plain
from appocc.pandaset.recording import Recording

__all__ = ["convert_folder", "read_recordings"]


def read_recordings(source: Path, lidar: Path | None, trust_pickles: bool) -> list[Recording]:
    """Read the recordings of a folder: one plain copy (frames.json) or, if pickles are trusted, published sequences.

    Raises:
        DataError: if there is no recording, or it has pickles that are not trusted.
    """
    for folder in [source] if lidar is None else [source, lidar]:
        check_folder(folder)
    if not trust_pickles:
        if not (source / "frames.json").is_file():
            raise DataError(
                f"{source}: no frames.json; published pickles are read only with --trust-pickles (a pickle runs code)"
            )
        return [read_plain(source, lidar)]
    sequences = [source] if (source / "camera").is_dir() else sorted(p.parent for p in source.glob("*/camera"))
    if not sequences:
        raise DataError(f"{source}: no published PandaSet sequence (expected camera/, lidar/, annotations/)")
    return [read_pickles(sequence, lidar) for sequence in sequences]


def convert_folder(
    source: Path, out: Path, lidar: Path | None, trust_pickles: bool, advance: Callable[[int], None]
) -> dict[str, Any]:
    """Convert all recordings of `source` to a new dataset `out`, atomically; return counts.

    Raises:
        DataError: if the source is damaged or `out` cannot be written.
    """
    with whole_folder(out) as folder:
        writer = Writer(folder, VERSION)
        recordings = read_recordings(source, lidar, trust_pickles)
        for recording in recordings:
            convert(recording, writer, advance)
        writer.save()
    files = [row["filename"] for row in writer.rows["sample_data"]]
    return {
        "scenes": [recording.name for recording in recordings],
        "samples": len(writer.rows["sample"]),
        "images": sum(name.endswith(".jpg") for name in files),
        "sweeps": sum(name.endswith(".bin") for name in files),
        "annotations": len(writer.rows["sample_annotation"]),
    }

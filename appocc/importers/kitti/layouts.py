"""Finds the logs in a folder of any of KITTI's layouts."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from appocc.errors import DataError
from appocc.importers.kitti.kitti360 import read_drive
from appocc.importers.kitti.log import KittiLog
from appocc.importers.kitti.raw import read_raw
from appocc.importers.kitti.tracking import read_sequence


def find_logs(src: Path, hz: float) -> list[KittiLog]:
    """Return the logs in a folder, in order of name.

    Args:
        src: a raw drive, a folder of drives or of dates; `training`, `testing` or the folder above of the tracking
            benchmark; or the root of KITTI-360.
        hz: key frames per second.

    Raises:
        DataError: if there is none.
    """
    logs = [*_raw(src, hz), *_tracking(src, hz), *_kitti360(src, hz)]
    if not logs:
        raise DataError(
            f"{src}: expected a layout of KITTI: DATE/DATE_drive_NNNN_sync/oxts (raw), training/oxts (tracking) or "
            "data_poses/DRIVE/poses.txt (KITTI-360); got none"
        )
    return logs


def _raw(src: Path, hz: float) -> list[KittiLog]:
    folders = sorted(path.parent for depth in ("", "*/", "*/*/") for path in src.absolute().glob(f"{depth}oxts/"))
    drives = [folder for folder in folders if (folder / "oxts" / "data").is_dir()]
    return [KittiLog(drive.name, "KITTI raw", partial(read_raw, drive), hz) for drive in drives]


def _tracking(src: Path, hz: float) -> list[KittiLog]:
    logs = []
    for folder in (src.absolute(), src / "training", src / "testing"):
        for path in sorted((folder / "oxts").glob("[0-9][0-9][0-9][0-9].txt")):
            name = f"{folder.name}-{path.stem}"
            logs.append(KittiLog(name, "KITTI tracking", partial(read_sequence, folder, path.stem), hz))
    return logs


def _kitti360(src: Path, hz: float) -> list[KittiLog]:
    drives = sorted(path.parent.name for path in src.glob("data_poses/*/poses.txt"))
    with_pictures = [drive for drive in drives if (src / "data_2d_raw" / drive).is_dir()]
    return [KittiLog(drive, "KITTI-360", partial(read_drive, src, drive), hz) for drive in with_pictures]

"""WebDataset shards: tar files of pictures, rig, map and objects by key frame, for streaming.

A shard is an uncompressed tar; successive files with the same name up to the first dot are a sample
(https://github.com/webdataset/webdataset). Hugging Face's `datasets` reads the same layout.
"""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.errors import DataError
from appocc.files import read_file, read_picture_bytes
from appocc.nuscenes.assembly import Assembly
from appocc.packing.frames import KeyFrame, PackedFrame, PackSource
from appocc.workers import Engine, in_order

FORMAT = "webdataset"
SETTINGS_FILE = ".pack.json"  # hidden: readers take every visible file for data


@dataclass(frozen=True, eq=False)
class _ShardWriter:
    """The job of a worker: write a shard; return its number of samples."""

    assembly: Assembly

    def __call__(self, shard: tuple[str, Sequence[tuple[int, PackedFrame]]]) -> int:
        name, frames = shard

        def write(folder: Path) -> None:
            folder.mkdir(parents=True)
            with tarfile.open(folder / f"{name}.tar", "w", format=tarfile.GNU_FORMAT) as archive:
                for number, frame in frames:
                    for ending, data in sample_files(frame):
                        _add(archive, f"{number:08d}.{ending}", data)

        self.assembly.write_files(name, write)
        return len(frames)


def pack_webdataset(
    source: PackSource,
    key_frames: Sequence[KeyFrame],
    out: Path,
    shard_bytes: int,
    pool: Engine | None,
    advance: Callable[[float], None],
) -> list[Path]:
    """Write the key frames of a source as shards `shard-000000.tar`, and return their paths.

    The same inputs give the same bytes. Finished shards are kept when it is interrupted, and the same call resumes.

    Args:
        source: dataset and maps.
        key_frames: all key frames of the source.
        out: new folder, `resolved`; or one of the same pack, which is kept.
        shard_bytes: limit of the pictures and maps in a shard; a larger sample has a shard of its own.
        pool: where the shards are written; the result does not depend on it.
        advance: progress callback in key frames.

    Raises:
        DataError: if a file is missing or damaged, or `out` holds something else or cannot be written.
    """
    settings = {"format": FORMAT, "shard_bytes": shard_bytes, **source.as_json(key_frames)}
    assembly = Assembly(out, "", SETTINGS_FILE, settings, "pack")
    if not assembly.is_finished():
        with assembly.opened():
            shards = {f"shard-{i:06d}": members for i, members in enumerate(_plan(source, key_frames, shard_bytes))}
            kept = [name for name in shards if assembly.has(name)]
            advance(sum(len(shards[name]) for name in kept))
            missing = (
                (name, [(number, source.frame(each)) for number, each in members])
                for name, members in shards.items()
                if name not in kept
            )
            for count in in_order(pool, _ShardWriter(assembly), missing):
                advance(count)
            assembly.finish(list(shards))
    return sorted(out.glob("*.tar"))


def _plan(
    source: PackSource, key_frames: Sequence[KeyFrame], shard_bytes: int
) -> Iterator[list[tuple[int, KeyFrame]]]:
    """Yield the key frames of each shard, numbered; the sizes of the files decide, so that none is read."""
    members: list[tuple[int, KeyFrame]] = []
    size = 0
    for number, each in enumerate(key_frames):
        own = sum(map(_size, [*source.picture_paths(each.sample).values(), source.map_path(each.sample)]))
        if members and size + own > shard_bytes:
            yield members
            members, size = [], 0
        members.append((number, each))
        size += own
    yield members


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    """Add a file without owner and time, so that the same data give the same bytes."""
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = len(data), 0o644
    archive.addfile(entry, io.BytesIO(data))


def sample_files(frame: PackedFrame) -> Iterator[tuple[str, bytes]]:
    """Yield extension and bytes of the files of a sample; one file is in memory at a time.

    Raises:
        DataError: if one is missing or damaged, or two cameras have the same name apart from upper case.
    """
    names = {name: name.lower().replace(".", "_") + path.suffix.lower() for name, path in frame.pictures.items()}
    if len(set(names.values())) != len(names):
        raise DataError(f"sample {frame.token}: expected cameras of different names, got {', '.join(names)}")
    for channel, path in frame.pictures.items():
        yield names[channel], read_picture_bytes(path)
    yield "rig.json", _json(_rig_json(frame, names))
    BEVMap.load(frame.bev)  # raises if it is damaged
    yield "map.npz", read_file(frame.bev)
    yield "objects.json", _json(None if frame.boxes_ego is None else _objects_json(frame.boxes_ego))


def _json(value: Any) -> bytes:
    return (json.dumps(value, allow_nan=False) + "\n").encode()


def _rig_json(frame: PackedFrame, names: dict[str, str]) -> dict[str, Any]:
    """Return cameras in the ego frame, pose and time of a key frame."""
    cameras = [
        {
            "channel": camera.channel,
            "file": names[camera.channel],
            "size_px": [camera.width_px, camera.height_px],
            "intrinsic": camera.intrinsic.tolist(),
            "ego_from_cam": camera.ego_from_cam.tolist(),
        }
        for camera in frame.rig.cameras
    ]
    return {
        "token": frame.token,
        "scene": frame.scene,
        "location": frame.location,
        "title": frame.title,
        "timestamp_us": frame.timestamp_us,
        "world_from_ego": frame.world_from_ego.tolist(),
        "cameras": cameras,
    }


def _objects_json(boxes_ego: Boxes) -> list[dict[str, Any]]:
    """Return annotated boxes in the ego frame; an unknown velocity is null."""
    velocities = [v.tolist() if np.isfinite(v).all() else None for v in boxes_ego.velocity_mps]
    return [
        {
            "token": boxes_ego.token[i],
            "instance": boxes_ego.instance[i],
            "category": boxes_ego.category[i],
            "centre_m": boxes_ego.centre_m[i].tolist(),
            "size_wlh_m": boxes_ego.size_wlh_m[i].tolist(),
            "yaw_rad": float(boxes_ego.yaw_rad[i]),
            "velocity_mps": velocities[i],
            "lidar_points": int(boxes_ego.lidar_points[i]),
        }
        for i in range(len(boxes_ego))
    ]

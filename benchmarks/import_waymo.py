"""Time and memory to import many made segments of Waymo: half as TFRecords, half as parquet files.

    PYTHONPATH=tests python -m benchmarks.import_waymo FOLDER                   # 10,000 key frames
    PYTHONPATH=tests python -m benchmarks.import_waymo FOLDER --segments 4 --frames 20

One segment of each layout is written as the tests do, with small pictures and sweeps; the others are links to it.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from pathlib import Path


def write_segments(folder: Path, segments: int, frames: int) -> None:
    """Write one segment in each layout, and link the others to them."""
    from waymo_twin import Records, write_components

    record = Records().write(folder / "v1", frames, "0_0")
    parts = write_components(folder / "v2", frames, "0_1", group_rows=256)
    for number in range(1, segments // 2):
        os.link(record, record.with_name(f"segment-{number}_0_with_camera_labels.tfrecord"))
        for part in parts.iterdir():
            os.link(part / "0_1.parquet", part / f"{number}_1.parquet")


def main() -> None:
    """Write, import in processes of their own, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="new folder")
    parser.add_argument("--segments", type=int, default=50)
    parser.add_argument("--frames", type=int, default=200, help="frames of a segment, all of them key frames")
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    write_segments(chosen.folder / "src", chosen.segments, chosen.frames)
    words = [
        "convert",
        "waymo",
        chosen.folder / "src",
        chosen.folder / "out",
        "--hz",
        10,
        "--workers",
        chosen.workers,
    ]
    begin = time.monotonic()
    subprocess.run([sys.executable, "-m", "cli.main", *map(str, words)], check=True)
    seconds, megabytes = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    samples = chosen.segments // 2 * 2 * chosen.frames
    print(f"{samples} key frames in {seconds:.0f} s; largest process: {megabytes:.0f} MB")


if __name__ == "__main__":
    main()

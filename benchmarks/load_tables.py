"""Time and memory to load tables of the size of nuScenes v1.0-trainval.

    python benchmarks/load_tables.py                    # full size for ours, a tenth for the comparison
    python benchmarks/load_tables.py --scale 0.1        # smaller

The tables are synthetic (850 scenes, 34 k samples, 2.6 M files and poses, 1.2 M annotations at scale 1), written like
the published ones (one key per line, tokens of 32 hex digits), and loaded in a fresh process: by
`Tables(...).load_all()`, and, at the comparison's scale, by `json.load` into dicts with a dict from token to row, as
in nuscenes-devkit.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TextIO

import numpy as np

SCENES, SAMPLES, BOXES, INSTANCES = 850, 41, 34, 76  # of v1.0-trainval: scenes, and the rest by sample or by scene
START_US, STEP_US = 1532402927647951, 500_000
# Files of each channel per sample: at 20, 12 and 13 Hz.
FILES = {
    "LIDAR_TOP": 10,
    **{f"CAM_{side}": 6 for side in ("FRONT", "FRONT_LEFT", "FRONT_RIGHT", "BACK", "BACK_LEFT", "BACK_RIGHT")},
    **{f"RADAR_{side}": 6 for side in ("FRONT_LEFT", "FRONT_RIGHT", "BACK_LEFT", "BACK_RIGHT")},
    "RADAR_FRONT": 7,
}
_ENDINGS = {"LIDAR": "pcd.bin", "CAM": "jpg", "RADAR": "pcd"}
SMALL = ("attribute", "calibrated_sensor", "category", "instance", "log", "map", "sample", "scene", "sensor")
LARGE = ("sample_data", "ego_pose", "sample_annotation")


class Maker:
    """Writes the tables scene by scene, so that its own memory stays small."""

    def __init__(self, folder: Path) -> None:
        """Start without rows."""
        self.folder = folder
        self.random = np.random.default_rng(7)
        self.rows: dict[str, list[dict[str, Any]]] = {name: [] for name in (*SMALL, "visibility")}
        self.counts = dict.fromkeys(LARGE, 0)

    def tokens(self, count: int) -> list[str]:
        """Tokens of 32 hex digits."""
        digits = self.random.bytes(16 * count).hex()
        return [digits[at : at + 32] for at in range(0, len(digits), 32)]

    def add(self, table: str, **record: Any) -> str:
        """One record of a small table; its token."""
        token = self.tokens(1)[0]
        self.rows[table].append({"token": token, **record})
        return token

    def quaternions(self, count: int) -> list[list[float]]:
        """Unit quaternions, mostly yaw, with all the digits of published ones."""
        raw = self.random.normal(size=(count, 4)) * [1, 0.01, 0.01, 1]
        return (raw / np.linalg.norm(raw, axis=1, keepdims=True)).tolist()  # type: ignore[no-any-return]

    def write(self, scenes: int) -> None:
        """All thirteen tables."""
        self.folder.mkdir(parents=True)
        categories = [self.add("category", name=name, description="") for name in ("vehicle.car", "vehicle.truck")]
        for level in ("v0-40", "v40-60", "v60-80", "v80-100"):
            self.add("visibility", level=level, description="")
        self.add("attribute", name="vehicle.parked", description="")
        sensors = [self.add("sensor", channel=c, modality=_modality(c)) for c in FILES]
        with ExitStack() as stack:
            files: dict[str, TextIO] = {
                name: stack.enter_context((self.folder / f"{name}.json").open("w")) for name in LARGE
            }
            for scene in range(scenes):
                self._scene(scene, sensors, categories, files)
            for name, handle in files.items():
                handle.write("\n]" if self.counts[name] else "[]")
        logs = [row["token"] for row in self.rows["log"]]
        self.add(
            "map", category="semantic_prior", filename="maps/53992ee3023e5494b90c316c183be829.png", log_tokens=logs
        )
        for name, rows in self.rows.items():
            (self.folder / f"{name}.json").write_text(json.dumps(rows, indent=0))

    def _scene(self, number: int, sensors: list[str], categories: list[str], files: dict[str, TextIO]) -> None:
        log = self.add(
            "log", logfile=f"n015-{number:04d}", vehicle="n015", date_captured="2018-07-24", location="here"
        )
        mounts = [
            self.add(
                "calibrated_sensor",
                sensor_token=sensor,
                translation=self.random.normal(size=3).tolist(),
                rotation=self.quaternions(1)[0],
                camera_intrinsic=[[1266.4, 0, 816.2], [0, 1266.4, 491.5], [0, 0, 1]] if "CAM" in channel else [],
            )
            for sensor, channel in zip(sensors, FILES, strict=True)
        ]
        samples, start = self.tokens(SAMPLES), START_US + number * 60_000_000
        scene = self.add(
            "scene",
            log_token=log,
            nbr_samples=SAMPLES,
            first_sample_token=samples[0],
            last_sample_token=samples[-1],
            name=f"scene-{number:04d}",
            description="Parked truck, construction, intersection, turn left, following a van",
        )
        for i, (before, token, after) in enumerate(_linked(samples)):
            row = {"token": token, "timestamp": start + i * STEP_US, "prev": before, "next": after}
            self.rows["sample"].append({**row, "scene_token": scene})
        for channel, mount in zip(FILES, mounts, strict=True):
            self._append(files, "sample_data", "ego_pose", self._stream(channel, mount, samples, start))
        self._append(files, "sample_annotation", None, self._boxes(categories, samples))

    def _append(
        self, files: dict[str, TextIO], first: str, second: str | None, rows: Iterator[tuple[str, str]]
    ) -> None:
        for a, b in rows:
            for name, text in ((first, a), (second, b)):
                if name:
                    files[name].write((",\n" if self.counts[name] else "[\n") + text)
                    self.counts[name] += 1

    def _stream(self, channel: str, mount: str, samples: list[str], start: int) -> Iterator[tuple[str, str]]:
        """Return the files of one channel of a scene, each with its ego pose, as JSON texts."""
        rate, ending = FILES[channel], _ENDINGS[channel.split("_")[0]]
        count = rate * (len(samples) - 1) + 1
        turns, places = self.quaternions(count), (self.random.normal(size=(count, 3)) * 400 + 800).tolist()
        height, width = (900, 1600) if "CAM" in channel else (0, 0)
        for i, (before, token, after) in enumerate(_linked(self.tokens(count))):
            time_us, key = start + i * STEP_US // rate, i % rate == 0
            sample = samples[-(-i // rate)]
            folder = "samples" if key else "sweeps"
            name = f"{folder}/{channel}/n015-2018-07-24-11-22-45+0800__{channel}__{time_us}.{ending}"
            data = (
                f'{{\n"token": "{token}",\n"sample_token": "{sample}",\n"ego_pose_token": "{token}",\n'
                f'"calibrated_sensor_token": "{mount}",\n"timestamp": {time_us},\n"fileformat": "{ending[:3]}",\n'
                f'"is_key_frame": {str(key).lower()},\n"height": {height},\n"width": {width},\n'
                f'"filename": "{name}",\n'
                f'"prev": "{before}",\n"next": "{after}"\n}}'
            )
            pose = (
                f'{{\n"token": "{token}",\n"timestamp": {time_us},\n"rotation": {_lines(turns[i])},\n'
                f'"translation": {_lines(places[i])}\n}}'
            )
            yield data, pose

    def _boxes(self, categories: list[str], samples: list[str]) -> Iterator[tuple[str, str]]:
        """Return the annotations of a scene as JSON texts: each instance is visible in several samples."""
        visibility, attribute = self.rows["visibility"][-1]["token"], self.rows["attribute"][0]["token"]
        left = BOXES * len(samples)
        for number in range(INSTANCES):
            length = min(len(samples), -(-left // (INSTANCES - number)))
            left -= length
            chain, begin = self.tokens(length), int(self.random.integers(0, len(samples) - length + 1))
            instance = self.add(
                "instance",
                category_token=categories[number % len(categories)],
                nbr_annotations=length,
                first_annotation_token=chain[0],
                last_annotation_token=chain[-1],
            )
            turns, places = (
                self.quaternions(length),
                (self.random.normal(size=(length, 3)) * 400 + 800).round(3).tolist(),
            )
            for i, (before, token, after) in enumerate(_linked(chain)):
                text = (
                    f'{{\n"token": "{token}",\n"sample_token": "{samples[begin + i]}",\n'
                    f'"instance_token": "{instance}",\n"visibility_token": "{visibility}",\n'
                    f'"attribute_tokens": [\n"{attribute}"\n],\n"translation": {_lines(places[i])},\n'
                    f'"size": {_lines([1.95, 4.623, 1.73])},\n"rotation": {_lines(turns[i])},\n'
                    f'"prev": "{before}",\n"next": "{after}",\n"num_lidar_pts": 5,\n"num_radar_pts": 0\n}}'
                )
                yield text, ""


def _modality(channel: str) -> str:
    return {"LIDAR": "lidar", "CAM": "camera", "RADAR": "radar"}[channel.split("_")[0]]


def _linked(tokens: list[str]) -> Iterator[tuple[str, str, str]]:
    """Return each token with its predecessor and successor ('' at the ends)."""
    return zip(["", *tokens[:-1]], tokens, [*tokens[1:], ""], strict=True)


def _lines(values: list[float]) -> str:
    return "[\n" + ",\n".join(map(repr, values)) + "\n]"


def load_ours(root: Path) -> dict[str, int]:
    """Load with the project's reader; rows of each table."""
    from appocc.nuscenes.schema import TABLES
    from appocc.nuscenes.tables import Tables

    tables = Tables(root)
    tables.load_all()
    return {name: len(tables[name]) for name in TABLES}


def load_dicts(root: Path) -> dict[str, int]:
    """Load as in nuscenes-devkit: every table a list of dicts, and a dict from token to row."""
    kept = {}
    for path in sorted((root / "v1.0-made").glob("*.json")):
        with path.open() as handle:
            records = json.load(handle)
        kept[path.stem] = records, {record["token"]: row for row, record in enumerate(records)}
    return {name: len(records) for name, (records, _) in kept.items()}


def _peak_bytes() -> int:
    """Return the peak memory of this process; ru_maxrss would include that of its parent before exec."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(next(line for line in status.read_text().splitlines() if "VmHWM" in line).split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def measure(way: str, root: Path) -> dict[str, Any]:
    """Load once in a fresh process; seconds, peak bytes, rows."""
    done = subprocess.run(
        [sys.executable, __file__, "--load", way, str(root)], capture_output=True, text=True, check=True
    )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _load_and_print(way: str, root: Path) -> None:
    load = {"ours": load_ours, "dicts": load_dicts}[way]
    import appocc.nuscenes.tables  # noqa: F401 - exclude the time of imports

    start = time.perf_counter()
    rows = load(root)
    print(json.dumps({"seconds": time.perf_counter() - start, "bytes": _peak_bytes(), "rows": rows}))


def _report(way: str, scale: float, root: Path) -> None:
    result = measure(way, root)
    rows = result["rows"]
    print(
        f"{way:>5} at scale {scale:g}: {result['seconds']:6.1f} s, {result['bytes'] / 1e9:5.2f} GB peak "
        f"({rows['sample']:,} samples, {rows['sample_data']:,} files, {rows['sample_annotation']:,} annotations)",
        flush=True,
    )


def main() -> None:
    """Parse arguments, make tables in a temporary folder, measure, clean up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", type=float, default=1.0, help="share of v1.0-trainval for our reader")
    parser.add_argument("--compare-scale", type=float, default=0.1, help="share for the comparison; 0 skips it")
    parser.add_argument("--load", nargs=2, metavar=("WAY", "ROOT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.load:
        _load_and_print(arguments.load[0], Path(arguments.load[1]))
        return
    for scale, ways in ((arguments.compare_scale, ("ours", "dicts")), (arguments.scale, ("ours",))):
        if scale <= 0:
            continue
        with tempfile.TemporaryDirectory(prefix="appocc-tables-") as folder:
            start = time.perf_counter()
            Maker(Path(folder) / "v1.0-made").write(max(1, round(SCENES * scale)))
            size = sum(path.stat().st_size for path in Path(folder).rglob("*.json"))
            print(f"made {size / 1e9:.2f} GB of tables in {time.perf_counter() - start:.0f} s", flush=True)
            for way in ways:
                _report(way, scale, Path(folder))


if __name__ == "__main__":
    main()

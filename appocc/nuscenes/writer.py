"""Writer of datasets in the nuScenes schema; tokens are hashes of names, tables are written at the end."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError, ShapeError
from appocc.files import RemotePath, write_image, write_json
from appocc.files.transfer import send_folder, working_folder
from appocc.geometry import quaternion_from_rotation
from appocc.nuscenes.records import NO_MAP
from appocc.nuscenes.schema import TABLES
from appocc.temporary import made_folder, partial_folder

Row = dict[str, Any]

# nuScenes' 32 categories at their nuScenes-lidarseg indices; the devkit knows no others.
CATEGORIES = (
    "noise",
    "animal",
    "human.pedestrian.adult",
    "human.pedestrian.child",
    "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility",
    "human.pedestrian.police_officer",
    "human.pedestrian.stroller",
    "human.pedestrian.wheelchair",
    "movable_object.barrier",
    "movable_object.debris",
    "movable_object.pushable_pullable",
    "movable_object.trafficcone",
    "static_object.bicycle_rack",
    "vehicle.bicycle",
    "vehicle.bus.bendy",
    "vehicle.bus.rigid",
    "vehicle.car",
    "vehicle.construction",
    "vehicle.emergency.ambulance",
    "vehicle.emergency.police",
    "vehicle.motorcycle",
    "vehicle.trailer",
    "vehicle.truck",
    "flat.driveable_surface",
    "flat.other",
    "flat.sidewalk",
    "flat.terrain",
    "static.manmade",
    "static.other",
    "static.vegetation",
    "vehicle.ego",
)
ATTRIBUTES = ("vehicle.moving", "vehicle.stopped", "vehicle.parked", "cycle.with_rider", "cycle.without_rider")
VISIBILITIES = (("1", "v0-40"), ("2", "v40-60"), ("3", "v60-80"), ("4", "v80-100"))


def visibility_token(share: float) -> str:
    """Return the nuScenes token of a share in [0, 1]: 1 up to 40 %, 2 up to 60 %, 3 up to 80 %, 4 above."""
    return VISIBILITIES[int(np.searchsorted([0.4, 0.6, 0.8], share, side="right"))][0]


def token_of(*names: object) -> str:
    """Return a 32-digit token, a hash of names: the same input gives the same tables."""
    # Slashes inside names are escaped, so that ("a/b", "c") and ("a", "b/c") differ.
    key = "/".join(str(name).replace("%", "%25").replace("/", "%2F") for name in names)
    return hashlib.md5(key.encode(errors="surrogatepass"), usedforsecurity=False).hexdigest()


def pose_fields(target_from_source: FloatArray) -> Row:
    """Return the fields `translation` and `rotation` (wxyz) of a 4x4 pose."""
    return {
        "translation": target_from_source[:3, 3].tolist(),
        "rotation": quaternion_from_rotation(target_from_source[:3, :3]).tolist(),
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Annotation:
    """A box to write, in the world frame.

    Attributes:
        instance: name of the object in all samples.
        category: one of `CATEGORIES`.
        world_from_box: (4, 4) pose; x along the length.
        size_wlh_m: width, length, height.
        attribute: one of `ATTRIBUTES`, or empty.
        lidar_points: number of LiDAR points inside, -1 if unknown.
        visibility: token 1..4, or empty if unknown.
    """

    instance: str
    category: str
    world_from_box: FloatArray
    size_wlh_m: tuple[float, float, float]
    attribute: str = ""
    lidar_points: int = -1
    visibility: str = ""


class Writer:
    """Collects rows; `save` links the chains and writes all tables."""

    def __init__(self, root: Path, version: str) -> None:
        """Start a dataset below `root` with the fixed tables filled in."""
        self.root = root
        self.version = version
        self.rows: dict[str, list[Row]] = {name: [] for name in TABLES}
        self.extra: dict[str, list[Row]] = {}
        for index, name in enumerate(CATEGORIES):
            self.add("category", token_of("category", name), name=name, description="", index=index)
        for name in ATTRIBUTES:
            self.add("attribute", token_of("attribute", name), name=name, description="")
        for token, level in VISIBILITIES:
            self.add("visibility", token, level=level, description=f"visibility of the whole object: {level} %")
        self._sensors: set[str] = set()

    def add(self, table: str, token: str, **fields: Any) -> str:
        """Add a row and return its token."""
        self.rows[table].append({"token": token, **fields})
        return token

    def add_extra(self, table: str, token: str, **fields: Any) -> None:
        """Add a row to an additional table, such as lidarseg."""
        self.extra.setdefault(table, []).append({"token": token, **fields})

    def add_sensor(
        self, scene: str, channel: str, ego_from_sensor: FloatArray, intrinsic: FloatArray | None = None
    ) -> str:
        """Add the calibration of a sensor for a scene (a camera if `intrinsic` is given) and return its token."""
        sensor = token_of("sensor", channel)
        modality = "lidar" if intrinsic is None else "camera"
        if channel not in self._sensors:
            self._sensors.add(channel)
            self.add("sensor", sensor, channel=channel, modality=modality)
        return self.add(
            "calibrated_sensor",
            token_of("calibrated_sensor", scene, channel),
            sensor_token=sensor,
            **pose_fields(ego_from_sensor),
            camera_intrinsic=[] if intrinsic is None else intrinsic.tolist(),
        )

    def add_scene(self, name: str, description: str, log: str, samples: Sequence[str]) -> str:
        """Add a scene of samples (tokens in order of time) and return its token.

        Raises:
            ShapeError: if it has no samples.
        """
        if not samples:
            raise ShapeError(f"scene {name}: expected at least one sample, got none")
        return self.add(
            "scene",
            token_of("scene", name),
            log_token=log,
            nbr_samples=len(samples),
            first_sample_token=samples[0],
            last_sample_token=samples[-1],
            name=name,
            description=description,
        )

    def add_file(
        self,
        sample: str,
        channel: str,
        calibration: str,
        world_from_ego: FloatArray,
        timestamp_us: int,
        filename: str,
        size_px: tuple[int, int] = (0, 0),
        is_key_frame: bool = True,
    ) -> str:
        """Add a sensor file (`size_px` as width, height) with its ego pose and return its token."""
        token = token_of("sample_data", sample, channel, timestamp_us)
        pose = self.add("ego_pose", token, timestamp=timestamp_us, **pose_fields(world_from_ego))
        return self.add(
            "sample_data",
            token,
            sample_token=sample,
            ego_pose_token=pose,
            calibrated_sensor_token=calibration,
            timestamp=timestamp_us,
            fileformat="jpg" if filename.endswith(".jpg") else filename.rsplit(".", 1)[-1].replace("bin", "pcd"),
            is_key_frame=is_key_frame,
            height=size_px[1],
            width=size_px[0],
            filename=filename,
            prev="",
            next="",
        )

    def add_no_map(self, log: str) -> None:
        """Add a map row for a log without a map: nuscenes-devkit needs a picture for every log."""
        token = token_of("map", NO_MAP, log)
        filename = f"maps/{token}.png"
        write_image(self.root / filename, np.zeros((1, 1), np.uint8))
        self.add("map", token, category=NO_MAP, filename=filename, log_tokens=[log])

    def add_annotation(self, scene: str, sample: str, box: Annotation, velocity_mps: FloatArray | None = None) -> str:
        """Add a box of a sample, optionally with its velocity (2,) in the world frame, and return its token.

        Raises:
            ShapeError: if its category is not a nuScenes category.
        """
        if box.category not in CATEGORIES:
            raise ShapeError(f"annotation {box.instance}: expected a nuScenes category, got '{box.category}'")
        return self.add(
            "sample_annotation",
            token_of("sample_annotation", sample, box.instance),
            sample_token=sample,
            instance_token=token_of("instance", scene, box.instance),
            visibility_token=box.visibility,
            attribute_tokens=[token_of("attribute", box.attribute)] if box.attribute else [],
            **pose_fields(box.world_from_box),
            size=list(box.size_wlh_m),
            prev="",
            next="",
            num_lidar_pts=box.lidar_points,
            num_radar_pts=0,
            category=box.category,
            **({} if velocity_mps is None else {"velocity": velocity_mps.tolist()}),
        )

    def save(self) -> None:
        """Link the chains, derive the instances and write all tables.

        Raises:
            DataError: if a file cannot be written.
        """
        times = {row["token"]: row["timestamp"] for row in self.rows["sample"]}
        channel = {row["token"]: row["sensor_token"] for row in self.rows["calibrated_sensor"]}
        scene = {row["token"]: row["scene_token"] for row in self.rows["sample"]}
        _link(self.rows["sample"], lambda row: row["scene_token"], lambda row: row["timestamp"])
        _link(
            self.rows["sample_data"],
            lambda row: (scene[row["sample_token"]], channel[row["calibrated_sensor_token"]]),
            lambda row: row["timestamp"],
        )
        _link(
            self.rows["sample_annotation"],
            lambda row: row["instance_token"],
            lambda row: times[row["sample_token"]],
        )
        self._derive_instances()
        for name, rows in {**self.rows, **self.extra}.items():
            write_json(self.root / self.version / f"{name}.json", rows, indent=0)

    def _derive_instances(self) -> None:
        """Add one instance row per object, from its annotations in order of time."""
        chains: dict[str, list[Row]] = {}
        for row in self.rows["sample_annotation"]:
            chains.setdefault(row["instance_token"], []).append(row)
        for token, rows in chains.items():
            first = next(row for row in rows if not row["prev"])
            last = next(row for row in rows if not row["next"])
            self.add(
                "instance",
                token,
                category_token=token_of("category", first["category"]),
                nbr_annotations=len(rows),
                first_annotation_token=first["token"],
                last_annotation_token=last["token"],
            )
        for row in self.rows["sample_annotation"]:
            del row["category"]


def _link(rows: list[Row], group: Any, time: Any) -> None:
    """Set prev and next of the rows of each group, in order of time."""
    chains: dict[Any, list[Row]] = {}
    for row in rows:
        chains.setdefault(group(row), []).append(row)
    for chain in chains.values():
        chain.sort(key=time)
        tokens = ["", *(row["token"] for row in chain), ""]
        for i, row in enumerate(chain):
            row["prev"], row["next"] = tokens[i], tokens[i + 2]


def is_sent_last(path: Path) -> bool:
    """Return whether a file is sent after all others of a dataset: by this table, readers find it."""
    return path.name == "sample_data.json"


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Create a temporary folder next to `path`; rename it to `path` on success and remove it on failure.

    A remote folder is written on this machine and then sent.

    Raises:
        DataError: if `path` exists and is not an empty folder, cannot be written, or is in use by another run.
        StoreError: if the store of a remote folder does not answer or refuses.
    """
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise DataError(f"{path}: exists already; name a new folder")
    try:
        place = working_folder(path) if isinstance(path, RemotePath) else path
        with made_folder(place.parent), partial_folder(place) as temporary:
            yield temporary
            if isinstance(path, RemotePath):
                send_folder(temporary, path, last=is_sent_last)
            else:
                temporary.replace(path)
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error

"""Reader of datasets in the nuScenes schema: scenes, samples, sensor files, poses, boxes, frames."""

from __future__ import annotations

from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from appocc.boxes import Boxes
from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray, IntArray, check_finite, frozen
from appocc.errors import AppoccError, DataError, NotFoundError, ShapeError
from appocc.files import inside, path_of, plain_name, read_image
from appocc.frame import Frame
from appocc.geometry import interpolate_pose, inverse, is_unit, rotation_from_quaternion, transform
from appocc.nuscenes.columns import intrinsic_of
from appocc.nuscenes.lidar import read_lidar
from appocc.nuscenes.records import NO_MAP, MapRecord, Sample, SampleData, Scene
from appocc.nuscenes.schema import LABEL_TABLES
from appocc.nuscenes.tables import Tables
from appocc.typing import PathLike

LIDAR = "LIDAR_TOP"
_NEAR_US = 2_000_000


class Dataset:
    """A dataset opened for reading.

    Frames: `world` is nuScenes' global frame; `ego` has x forward, y left, z up, with its origin on the ground below
    the rear axle.
    """

    def __init__(self, root: PathLike, version: str | None = None) -> None:
        """Open a dataset root, a folder or a URL.

        Raises:
            DataError: if it has no dataset, or several versions and `version` is None.
        """
        self.root = path_of(root)
        self.tables = Tables(self.root, version)

    # Scenes and samples -------------------------------------------------------------------------------------------

    @cached_property
    def scenes(self) -> tuple[Scene, ...]:
        """All scenes in the order of the scene table."""
        t = self.tables["scene"]
        return tuple(
            Scene(
                t.text("token", i),
                t["name"][i],
                t["description"][i],
                t.text("log_token", i),
                t.text("first_sample_token", i),
                t.text("last_sample_token", i),
            )
            for i in range(len(t))
        )

    def scene(self, name: str) -> Scene:
        """Return the scene with a name or token.

        Raises:
            NotFoundError: if there is no such scene.
        """
        for scene in self.scenes:
            if name in (scene.name, scene.token):
                return scene
        known = ", ".join(scene.name for scene in self.scenes[:12])
        raise NotFoundError(f"{self.root}: no scene '{name}'; it has {known or 'none'}")

    def samples(self, scene: Scene) -> tuple[Sample, ...]:
        """Return the key frames of a scene in order of time."""
        rows = self.tables.samples_by_scene.rows(scene.token)
        return tuple(sorted((self._sample(int(row)) for row in rows), key=lambda s: s.timestamp_us))

    def titles(self, scene: Scene) -> dict[str, str]:
        """Return, for the token of each key frame, the file name of its picture without the ending: `SCENE-0000`.

        Raises:
            DataError: if the name of the scene is unfit for a file name.
        """
        name = plain_name(self.root, scene.name)
        return {sample.token: f"{name}-{number:04d}" for number, sample in enumerate(self.samples(scene))}

    def sample(self, token: str) -> Sample:
        """Return the sample with a token.

        Raises:
            NotFoundError: if there is no such sample.
        """
        return self._sample(self.tables["sample"].row(token))

    def _sample(self, row: int) -> Sample:
        t = self.tables["sample"]
        return Sample(
            t.text("token", row),
            int(t["timestamp"][row]),
            t.text("scene_token", row),
            t.text("prev", row),
            t.text("next", row),
        )

    # Sensor files -------------------------------------------------------------------------------------------------

    def data(self, sample: Sample) -> dict[str, SampleData]:
        """Return the key-frame files of a sample by channel.

        Raises:
            DataError: if a channel has two files, or the sensor or ego pose of a file is missing.
        """
        rows = self.tables.data_by_sample.rows(sample.token)
        keys = rows[self.tables["sample_data"].array("is_key_frame")[rows]]
        records = sorted((self._data(int(row)) for row in keys), key=lambda d: d.channel)
        for one, other in pairwise(records):
            if one.channel == other.channel:
                where = f"{self.tables.path('sample_data')}: sample {sample.token}"
                raise DataError(
                    f"{where}: expected one key frame of {one.channel}, got {one.token} and {other.token}"
                )
        return {record.channel: record for record in records}

    @lru_cache(maxsize=8)  # noqa: B019 - a dataset lives as long as the command
    def stream(self, scene: Scene) -> tuple[SampleData, ...]:
        """Return all files of a scene, key frames and sweeps, in order of time."""
        rows = [self.tables.data_by_sample.rows(sample.token) for sample in self.samples(scene)]
        every = np.concatenate(rows) if rows else np.zeros(0, np.int64)
        return tuple(sorted((self._data(int(r)) for r in every), key=lambda d: (d.timestamp_us, d.channel)))

    def chain(self, scene: Scene, channel: str) -> tuple[SampleData, ...]:
        """Return the files of one channel of a scene, key frames and sweeps, in order of time.

        Raises:
            NotFoundError: if the scene has no file of the channel.
        """
        found = tuple(data for data in self.stream(scene) if data.channel == channel)
        if not found:
            known = ", ".join(sorted({data.channel for data in self.stream(scene)}))
            raise NotFoundError(f"scene '{scene.name}' has no channel '{channel}'; it has {known or 'none'}")
        return found

    def _data(self, row: int) -> SampleData:
        t, sensors = self.tables["sample_data"], self.tables["sensor"]
        sensor, calibration = int(self.tables.data_channel[row]), int(self.tables.data_calibration[row])
        pose = int(self.tables["ego_pose"].rows_of(t.array("ego_pose_token")[row : row + 1])[0])
        token = t.text("token", row)
        if sensor < 0 or pose < 0:
            lacks = "sensor" if sensor < 0 else "ego pose"
            raise DataError(f"{self.tables.path('sample_data')}: {token} refers to no {lacks}")
        return SampleData(
            token=token,
            sample_token=t.text("sample_token", row),
            channel=sensors["channel"][sensor],
            modality=sensors["modality"][sensor],
            timestamp_us=int(t["timestamp"][row]),
            is_key_frame=bool(t["is_key_frame"][row]),
            filename=t.text("filename", row),
            width_px=int(t["width"][row]),
            height_px=int(t["height"][row]),
            ego_pose_row=pose,
            calibration_row=calibration,
        )

    def path(self, data: SampleData) -> Path:
        """Return the path of a sensor file.

        Raises:
            DataError: if its name leads out of the root.
        """
        return inside(self.root, data.filename)

    def world_from_ego_at(self, data: SampleData) -> FloatArray:
        """Return the (4, 4) ego pose at the time of a sensor file."""
        return self._pose("ego_pose", data.ego_pose_row)

    def ego_motion(self, world_from_ego: FloatArray, data: SampleData) -> FloatArray:
        """Return the (4, 4) pose of the ego at the time of a sensor file, in the ego frame of another time."""
        return inverse(world_from_ego) @ self.world_from_ego_at(data)

    def ego_from_sensor(self, data: SampleData) -> FloatArray:
        """Return the (4, 4) mounting pose of the sensor of a file."""
        return self._pose("calibrated_sensor", data.calibration_row)

    def _pose(self, table: str, row: int) -> FloatArray:
        t = self.tables[table]
        try:
            return transform(_rotations(t["rotation"][row]), t["translation"][row])
        except AppoccError as error:
            raise DataError(f"{self.tables.path(table)}: {t.text('token', row)}: {error}") from error

    def camera(self, data: SampleData) -> Camera:
        """Return the camera of an image file at its mounting pose; a missing image size is read from the image.

        Raises:
            DataError: if the calibration is invalid.
        """
        t = self.tables["calibrated_sensor"]
        where = f"{self.tables.path('calibrated_sensor')}: {t.text('token', data.calibration_row)}"
        ego_from_cam = self.ego_from_sensor(data)
        width, height = data.width_px, data.height_px
        if width < 1 or height < 1:
            height, width = read_image(self.path(data)).shape[:2]
        try:
            intrinsic = intrinsic_of(t["camera_intrinsic"][data.calibration_row])
            return Camera(data.channel, width, height, intrinsic, ego_from_cam)
        except (TypeError, ValueError) as error:
            raise DataError(f"{where}: {error}") from error

    def lidar(self, data: SampleData) -> FloatArray:
        """Read the (N, 5) float64 points of a LiDAR file in the sensor frame: x, y, z, intensity, ring.

        Raises:
            DataError: if the file is missing or damaged.
        """
        return read_lidar(self.path(data))

    def label_path(self, data: SampleData, table: str) -> Path | None:
        """Return the label file (one uint8 per point) of a LiDAR file in a table of label files; None if it has none.

        Raises:
            DataError: if the table is damaged or the file name leads out of the root.
        """
        rows = self.tables.labels_by_data[table].rows(data.token)
        return inside(self.root, self.tables[table].text("filename", int(rows[0]))) if len(rows) else None

    def label_names(self, table: str) -> dict[int, str]:
        """Return the label names of a table of label files by `index`; empty if none are given.

        Raises:
            DataError: if an `index` is not a number.
        """
        categories = LABEL_TABLES[table]
        t = self.tables[categories]
        labelled = [(label, name) for label, name in zip(t["index"], t["name"], strict=True) if label is not None]
        try:
            return {int(label): name for label, name in labelled}
        except (TypeError, ValueError, OverflowError) as error:
            raise DataError(f"{self.tables.path(categories)}: index: expected a whole number ({error})") from error

    # The ego and the boxes ----------------------------------------------------------------------------------------

    def world_from_ego(self, sample: Sample) -> FloatArray:
        """Return the (4, 4) ego pose at the time of a sample.

        It is the pose of the file with the time of the sample (LIDAR_TOP in nuScenes), or is interpolated between
        the poses of the channel with the nearest file.

        Raises:
            DataError: if no file within two seconds has a pose.
        """
        own = [d for d in self.data(sample).values() if d.timestamp_us == sample.timestamp_us]
        if own:
            return self.world_from_ego_at(max(own, key=lambda d: d.channel == LIDAR))
        near = [d for d in self.stream(self.scene(sample.scene_token)) if _gap_us(d, sample) < _NEAR_US]
        if not near:
            raise DataError(f"{self.root}: sample {sample.token} has no file with an ego pose")
        # One channel only: files of several channels are milliseconds apart, too close for extrapolation.
        channel = min(near, key=lambda d: _gap_us(d, sample)).channel
        chain = [d for d in near if d.channel == channel]
        times = np.array([d.timestamp_us * 1e-6 for d in chain])
        return interpolate_pose(
            times, np.stack([self.world_from_ego_at(d) for d in chain]), sample.timestamp_us * 1e-6
        )

    def annotated(self, scene: Scene) -> bool:
        """Whether a scene has annotated boxes; the boxes of other scenes are unknown."""
        return any(len(self.tables.annotations_by_sample.rows(sample.token)) for sample in self.samples(scene))

    def boxes_world(self, sample: Sample) -> Boxes:
        """Return the annotated boxes of a sample in the world frame, with velocities from neighbouring annotations.

        Raises:
            DataError: if an annotation is invalid.
        """
        rows = self.tables.annotations_by_sample.rows(sample.token)
        t, categories = self.tables["sample_annotation"], self.tables["category"]["name"]
        category = self.tables.annotation_category[rows]
        if (category < 0).any():
            token = t.text("token", int(rows[int(np.argmin(category))]))
            raise DataError(f"{self.tables.path('sample_annotation')}: {token} refers to no instance with a category")
        try:
            return Boxes(
                centre_m=t.array("translation")[rows],
                size_wlh_m=t.array("size")[rows],
                rotation=_rotations(t.array("rotation")[rows]),
                category=tuple(categories[c] for c in category),
                instance=tuple(t.text("instance_token", int(row)) for row in rows),
                token=tuple(t.text("token", int(row)) for row in rows),
                velocity_mps=self._velocities(rows),
                lidar_points=t.array("num_lidar_pts")[rows],
            )
        except AppoccError as error:
            path = self.tables.path("sample_annotation")
            raise DataError(f"{path}: sample {sample.token}: {error}") from error

    def _velocities(self, rows: IntArray) -> FloatArray:
        """Return (N, 2) velocities from neighbouring annotations; NaN if these are missing or over 1.5 s apart."""
        t, samples = self.tables["sample_annotation"], self.tables["sample"]
        before, after = (t.rows_of(t.array(key)[rows]) for key in ("prev", "next"))
        before, after = np.where(before < 0, rows, before), np.where(after < 0, rows, after)
        moments = [samples.array("timestamp")[samples.rows_of(t.array("sample_token")[r])] for r in (before, after)]
        seconds = (moments[1] - moments[0]) * 1e-6
        seconds[(seconds <= 0) | (seconds > 1.5 * ((before != rows).astype(int) + (after != rows)))] = np.nan
        places = t.array("translation")
        return np.asarray((places[after, :2] - places[before, :2]) / seconds[:, None])

    # Frames -------------------------------------------------------------------------------------------------------

    def frame(self, sample: Sample, images: bool = True) -> Frame:
        """Return a key frame with rig, images and boxes; `images=False` does not read the images.

        Raises:
            DataError: if an image or a calibration is damaged.
        """
        world_from_ego = self.world_from_ego(sample)
        cameras, image_arrays = [], {}
        for channel, data in self.data(sample).items():
            if data.modality != "camera":
                continue
            camera = self.camera(data)
            ego_from_cam = self.ego_motion(world_from_ego, data) @ camera.ego_from_cam
            cameras.append(Camera(channel, camera.width_px, camera.height_px, camera.intrinsic.copy(), ego_from_cam))
            if images:
                image_arrays[channel] = read_image(self.path(data), (camera.width_px, camera.height_px))
                frozen(image_arrays[channel])
        annotated = self.annotated(self.scene(sample.scene_token))
        boxes = self.boxes_world(sample).transformed(inverse(world_from_ego)) if annotated else None
        return Frame(
            sample.token, sample.timestamp_us, world_from_ego, CameraRig(tuple(cameras)), image_arrays, boxes
        )

    # Maps ---------------------------------------------------------------------------------------------------------

    def location(self, scene: Scene) -> str:
        """Return the location of a scene from its log; '' if unknown.

        Raises:
            DataError: if the log of the scene is missing.
        """
        log = self.tables["log"]
        row = int(log.rows_of(np.array([scene.log_token.encode()]))[0])
        if row < 0:
            raise DataError(f"{self.tables.path('scene')}: scene '{scene.name}' refers to no log")
        return str(log["location"][row])

    def map_record(self, scene: Scene) -> MapRecord | None:
        """Return the drivable-area mask of the log of a scene; None if there is none.

        Raises:
            DataError: if `origin_m` or `unknown_value` is not a number.
        """
        t = self.tables["map"]
        row = next((i for i, logs in enumerate(t["log_tokens"]) if scene.log_token in logs), None)
        if row is None or t["category"][row] == NO_MAP:
            return None
        unknown = t["unknown_value"][row]
        try:
            x, y = (float(value) for value in t["origin_m"][row] or (0.0, 0.0))
            check_finite("origin_m", np.array([x, y]))
            return MapRecord(t["filename"][row], (x, y), None if unknown is None else int(unknown), t["source"][row])
        except (TypeError, ValueError, OverflowError) as error:
            where = f"{self.tables.path('map')}: {t.text('token', row)}"
            raise DataError(f"{where}: origin_m or unknown_value: expected numbers ({error})") from error


def _rotations(wxyz: ArrayLike) -> FloatArray:
    """Return the (..., 3, 3) rotations of quaternions (..., 4).

    Raises:
        ShapeError: if a quaternion is not finite or not a unit quaternion.
    """
    rotations = rotation_from_quaternion(wxyz)
    if not is_unit(wxyz).all():
        raise ShapeError(f"quaternion wxyz: expected a length of 1, got {np.asarray(wxyz).tolist()}")
    return rotations


def _gap_us(data: SampleData, sample: Sample) -> int:
    return abs(data.timestamp_us - sample.timestamp_us)


def sample_at(dataset: Dataset, scene: Scene, frame: int) -> Sample:
    """Return key frame `frame` of a scene, counted from 0.

    Raises:
        NotFoundError: if the scene has no such frame.
    """
    samples = dataset.samples(scene)
    if not samples:
        raise NotFoundError(f"{dataset.root}: scene '{scene.name}' has no key frames")
    if not 0 <= frame < len(samples):
        raise NotFoundError(f"{dataset.root}: scene '{scene.name}' has frames 0..{len(samples) - 1}, not {frame}")
    return samples[frame]

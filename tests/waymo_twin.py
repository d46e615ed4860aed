"""A tiny segment of the Waymo Open Dataset in both published layouts; its street is `waymo_street`.

The protocol buffers are encoded by Google's runtime from the table below, the parquet files by pyarrow: nothing is
shared with the importer.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from waymo_street import (
    BEAMS,
    CAMERAS,
    CAR_LWH,
    DISTORTION,
    DIVISOR,
    DRIFT,
    FRAMES,
    LABELLED,
    LASERS,
    NAME,
    NO_LABEL_ZONE,
    ORIGIN,
    SIZE,
    START_US,
    K,
    box_in,
    ego,
    jpeg,
    mounted,
    panoptic_png,
    sweep,
)

PROTOS = """
MatrixShape: dims=1*i
MatrixFloat: data=1*p shape=2:MatrixShape
Transform: transform=1*d
Vector: x=1d y=2d z=3d
CameraCalibration: name=1i intrinsic=2*d extrinsic=3:Transform width=4i height=5i rolling_shutter_direction=6i
LaserCalibration: name=1i beam_inclinations=2*d beam_inclination_min=3d beam_inclination_max=4d extrinsic=5:Transform
Stats: time_of_day=2s location=3s weather=4s
Context: name=1s camera_calibrations=2*:CameraCalibration laser_calibrations=3*:LaserCalibration stats=4:Stats
InstanceIDs: local_instance_id=1i global_instance_id=2i is_tracked=3i
Segmentation: panoptic_label_divisor=1i panoptic_label=2b instance_ids=3*:InstanceIDs sequence_id=4s num_cameras=5b
CameraImage: name=1i image=2b pose=3:Transform pose_timestamp=5d shutter=6d camera_trigger_time=7d
CameraImage: camera_segmentation_label=10:Segmentation
RangeImage: range_image_compressed=2b camera_projection_compressed=3b range_image_pose_compressed=4b
Laser: name=1i ri_return1=2:RangeImage ri_return2=3:RangeImage
Box: center_x=1d center_y=2d center_z=3d width=4d length=5d height=6d heading=7d
Metadata: speed_x=1d speed_y=2d accel_x=3d accel_y=4d
Label: box=1:Box metadata=2:Metadata type=3i id=4s detection_difficulty_level=5i num_lidar_points_in_box=7i
Lane: speed_limit_mph=1d type=2i interpolating=3i polyline=8*:Vector
Line: type=1i polyline=2*:Vector
StopSign: lane=1*i position=2:Vector
Area: polygon=1*:Vector
MapFeature: id=1i lane=3:Lane road_line=4:Line road_edge=5:Line stop_sign=7:StopSign crosswalk=8:Area driveway=10:Area
Frame: context=1:Context timestamp_micros=2i pose=3:Transform images=4*:CameraImage lasers=5*:Laser
Polygon: x=1*d y=2*d id=3s
Frame: laser_labels=6*:Label no_label_zones=7*:Polygon map_features=10*:MapFeature map_pose_offset=11:Vector
"""
KINDS = {"i": 3, "d": 1, "s": 9, "b": 12, "p": 2}


def messages() -> dict[str, Any]:
    """The classes of the messages of the table."""
    file = descriptor_pb2.FileDescriptorProto(name="twin.proto", package="twin", syntax="proto2")
    known: dict[str, Any] = {}
    for line in PROTOS.split("\n"):
        name, _, fields = line.partition(": ")
        if not name:
            continue
        if name not in known:
            known[name] = file.message_type.add(name=name)
        for field in fields.split():
            key, rule = field.split("=")
            number = "".join(c for c in rule.split(":")[0] if c.isdigit())
            kind = rule.split(":")[1] if ":" in rule else KINDS[rule[-1]]
            row = known[name].field.add(name=key, number=int(number), label=3 if "*" in rule else 1)
            row.type = kind if isinstance(kind, int) else 11
            if not isinstance(kind, int):
                row.type_name = f".twin.{kind}"
            row.options.packed = rule[-1] == "p"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"twin.{name}")) for name in known}


def crc32c(data: bytes) -> int:
    """CRC32C bit by bit over a table of bytes."""
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def framed(data: bytes) -> bytes:
    """A TFRecord."""

    def check(part: bytes) -> bytes:
        crc = crc32c(part)
        return struct.pack("<I", ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF)

    size = struct.pack("<Q", len(data))
    return size + check(size) + data + check(data)


class Records:
    """Writes version 1."""

    def __init__(self) -> None:
        self.make = messages()

    def write(self, folder: Path, frames: int = FRAMES, name: str = NAME) -> Path:
        """Write a file of frames."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"segment-{name}_with_camera_labels.tfrecord"
        path.write_bytes(b"".join(framed(self.frame(i, name).SerializeToString()) for i in range(frames)))
        return path

    def transform(self, pose: np.ndarray) -> Any:
        """A Transform."""
        return self.make["Transform"](transform=pose.ravel().tolist())

    def drifted(self, pose: np.ndarray) -> Any:
        """A Transform of the vehicle: the map is moved against it."""
        moved = pose.copy()
        moved[:3, 3] -= DRIFT
        return self.transform(moved)

    def frame(self, index: int, name: str = NAME) -> Any:
        """A frame; the first one has the map."""
        seconds, make = 0.1 * index, self.make
        pose = ego(seconds + 0.05)
        frame = make["Frame"](context=self.context(name), timestamp_micros=START_US + index * 100_000)
        frame.pose.CopyFrom(self.drifted(pose))
        frame.map_pose_offset.CopyFrom(make["Vector"](x=DRIFT[0], y=DRIFT[1], z=DRIFT[2]))
        for number, (_, _, delay) in CAMERAS.items():
            taken = seconds + delay
            image = frame.images.add(name=number, image=jpeg(number, taken), pose_timestamp=START_US * 1e-6 + taken)
            image.pose.CopyFrom(self.drifted(ego(taken)))
            if (index, number) in LABELLED:
                image.camera_segmentation_label.CopyFrom(self.segmentation(number, taken))
        count = 0
        for number in LASERS:
            first, second, poses, hit = sweep(number, seconds)
            count += hit
            laser = frame.lasers.add(name=number)
            laser.ri_return1.range_image_compressed = self.matrix(first)
            laser.ri_return2.range_image_compressed = self.matrix(second)
            if number == 1:
                laser.ri_return1.range_image_pose_compressed = self.matrix(poses - [0, 0, 0, *DRIFT])
        for key, kind in (("car", 1), ("sign", 3)):
            centre, heading = box_in(pose)
            box = make["Box"](length=CAR_LWH[0], width=CAR_LWH[1], height=CAR_LWH[2], heading=heading)
            box.center_x, box.center_y, box.center_z = centre
            label = frame.laser_labels.add(box=box, type=kind, id=key, num_lidar_points_in_box=count)
            label.metadata.speed_x = 0.0
        outline = ORIGIN + NO_LABEL_ZONE - DRIFT
        frame.no_label_zones.add(x=outline[:, 0], y=outline[:, 1], id="zone")
        if index == 0:
            frame.map_features.extend(self.features())
        return frame

    def segmentation(self, camera: int, seconds: float) -> Any:
        """A CameraSegmentationLabel."""
        label = self.make["Segmentation"](panoptic_label_divisor=DIVISOR, sequence_id="sequence")
        label.panoptic_label = panoptic_png(camera, seconds)
        label.instance_ids.add(local_instance_id=7, global_instance_id=3, is_tracked=1)
        return label

    def matrix(self, values: np.ndarray) -> bytes:
        """A compressed MatrixFloat."""
        shape = self.make["MatrixShape"](dims=values.shape)
        whole = self.make["MatrixFloat"](data=values.astype(np.float32).ravel().tolist(), shape=shape)
        return zlib.compress(whole.SerializeToString())

    def context(self, name: str) -> Any:
        """Calibrations and statistics."""
        context = self.make["Context"](name=name)
        context.stats.CopyFrom(self.make["Stats"](time_of_day="Day", location="location_sf", weather="sunny"))
        for number, (yaw, place, _) in CAMERAS.items():
            row = context.camera_calibrations.add(name=number, width=SIZE[0], height=SIZE[1])
            row.intrinsic.extend([K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *DISTORTION])
            row.extrinsic.CopyFrom(self.transform(mounted(yaw, place)))
        for number, (yaw, place, _) in LASERS.items():
            laser = context.laser_calibrations.add(name=number)
            laser.extrinsic.CopyFrom(self.transform(mounted(yaw, place)))
            laser.beam_inclination_min, laser.beam_inclination_max = BEAMS[number][[0, -1]]
            laser.beam_inclinations.extend(BEAMS[1] if number == 1 else [])
        return context

    def features(self) -> list[Any]:
        """A street of two lanes along x from -60 to 60 m, 10 m wide, with an island, a crossing, a driveway."""

        def line(*points: tuple[float, float]) -> list[Any]:
            make = self.make["Vector"]
            return [make(x=ORIGIN[0] + x, y=ORIGIN[1] + y, z=ORIGIN[2]) for x, y in points]

        make = self.make
        rows = [
            {"lane": make["Lane"](type=2, polyline=line((-60, -2.5), (30, -2.5)))},
            {"lane": make["Lane"](type=2, polyline=line((60, 2.5), (-60, 2.5)))},
            {"lane": make["Lane"](type=2, interpolating=1, polyline=line((30, -2.5), (60, -2.5)))},
            {"lane": make["Lane"](type=3, polyline=line((-60, -9), (60, -9)))},
            {"road_edge": make["Line"](type=1, polyline=line((-70, 5), (70, 5)))},
            {"road_edge": make["Line"](type=1, polyline=line((-70, -5), (0, -5)))},
            {"road_edge": make["Line"](type=1, polyline=line((8, -5), (70, -5)))},
            {
                "road_edge": make["Line"](
                    type=2, polyline=line((-40, -0.6), (-20, -0.6), (-20, 0.6), (-40, 0.6), (-40, -0.6))
                )
            },
            {"road_line": make["Line"](type=7, polyline=line((-15, 0), (60, 0)))},
            {"road_line": make["Line"](type=2, polyline=line((-60, -4.8), (0, -4.8)))},
            {"road_line": make["Line"](type=0, polyline=line((0, 0), (1, 1)))},
            {"crosswalk": make["Area"](polygon=line((40, -5), (43, -5), (43, 5), (40, 5)))},
            {"driveway": make["Area"](polygon=line((0, -5), (8, -5), (8, -12), (0, -12)))},
            {"stop_sign": make["StopSign"](lane=[7], position=line((30, -6))[0])},
        ]
        return [make["MapFeature"](id=i + 1, **row) for i, row in enumerate(rows)]


def write_components(folder: Path, frames: int = FRAMES, name: str = NAME, group_rows: int = 5) -> Path:
    """Write version 2: a file for each component."""
    times = [START_US + i * 100_000 for i in range(frames)]
    segment = {"key.segment_context_name": name}

    def write(component: str, rows: list[dict[str, Any]], types: dict[str, Any]) -> None:
        keys = {"key.segment_context_name": pa.string(), "key.frame_timestamp_micros": pa.int64()}
        keys |= {"key.camera_name": pa.int8(), "key.laser_name": pa.int8(), "key.laser_object_id": pa.string()}
        every = {key: kind for key, kind in (keys | types).items() if key in rows[0]}
        table = pa.Table.from_pylist(rows, pa.schema(list(every.items())))
        (folder / component).mkdir(parents=True, exist_ok=True)
        pq.write_table(table, folder / component / f"{name}.parquet", row_group_size=group_rows, compression="BROTLI")

    def at(i: int, **more: Any) -> dict[str, Any]:
        return {**segment, "key.frame_timestamp_micros": times[i], **more}

    def tensor(prefix: str, values: np.ndarray | None) -> dict[str, Any]:
        if values is None:
            return {f"{prefix}.values": None, f"{prefix}.shape": None}
        return {f"{prefix}.values": values.astype(np.float32).ravel(), f"{prefix}.shape": list(values.shape)}

    pose16, image = pa.list_(pa.float64(), 16), {".values": pa.list_(pa.float32()), ".shape": pa.list_(pa.int32(), 3)}
    key = "[VehiclePoseComponent].world_from_vehicle.transform"
    write("vehicle_pose", [at(i, **{key: ego(0.1 * i + 0.05).ravel()}) for i in range(frames)], {key: pose16})

    head = "[CameraCalibrationComponent]"
    names = [f"{head}.intrinsic.{each}" for each in ("f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3")]
    values = [K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *DISTORTION]
    rows = [
        {
            **segment,
            "key.camera_name": number,
            **dict(zip(names, values, strict=True)),
            f"{head}.extrinsic.transform": mounted(yaw, place).ravel(),
            f"{head}.width": SIZE[0],
            f"{head}.height": SIZE[1],
        }
        for number, (yaw, place, _) in CAMERAS.items()
    ]
    types = {each: pa.float64() for each in names} | {f"{head}.width": pa.int32(), f"{head}.height": pa.int32()}
    write("camera_calibration", rows, types | {f"{head}.extrinsic.transform": pose16})

    head = "[LiDARCalibrationComponent]"
    rows = [
        {
            **segment,
            "key.laser_name": number,
            f"{head}.extrinsic.transform": mounted(yaw, place).ravel(),
            f"{head}.beam_inclination.min": BEAMS[number][0],
            f"{head}.beam_inclination.max": BEAMS[number][-1],
            f"{head}.beam_inclination.values": BEAMS[1] if number == 1 else None,
        }
        for number, (yaw, place, _) in LASERS.items()
    ]
    types = {f"{head}.beam_inclination.{each}": pa.float64() for each in ("min", "max")}
    types |= {f"{head}.extrinsic.transform": pose16, f"{head}.beam_inclination.values": pa.list_(pa.float64())}
    write("lidar_calibration", rows, types)

    head = "[CameraImageComponent]"
    rows = [
        at(
            i,
            **{
                "key.camera_name": number,
                f"{head}.image": jpeg(number, 0.1 * i + delay),
                f"{head}.pose.transform": ego(0.1 * i + delay).ravel(),
                f"{head}.pose_timestamp": START_US * 1e-6 + 0.1 * i + delay,
            },
        )
        for i in range(frames)
        for number, (_, _, delay) in CAMERAS.items()
    ]
    types = {f"{head}.image": pa.binary(), f"{head}.pose.transform": pose16, f"{head}.pose_timestamp": pa.float64()}
    write("camera_image", rows, types)

    head = "[CameraSegmentationLabelComponent]"
    rows = [
        at(
            i,
            **{
                "key.camera_name": number,
                f"{head}.panoptic_label_divisor": DIVISOR,
                f"{head}.panoptic_label": panoptic_png(number, 0.1 * i + CAMERAS[number][2]),
                f"{head}.instance_id_to_global_id_mapping.local_instance_ids": [7],
                f"{head}.sequence_id": "sequence",
            },
        )
        for i, number in sorted(LABELLED)
        if i < frames
    ]
    types = {f"{head}.panoptic_label_divisor": pa.int32(), f"{head}.panoptic_label": pa.binary()}
    types |= {f"{head}.instance_id_to_global_id_mapping.local_instance_ids": pa.list_(pa.int32())}
    write("camera_segmentation", rows, types | {f"{head}.sequence_id": pa.string()})

    swept = {(i, number): sweep(number, 0.1 * i) for i in range(frames) for number in LASERS}
    first, second = (f"[LiDARComponent].range_image_return{i}" for i in (1, 2))
    rows = [
        at(
            i,
            **{"key.laser_name": laser},
            **tensor(first, found[0]),
            **tensor(second, found[1] if (found[1] > 0).any() else None),
        )
        for (i, laser), found in swept.items()
    ]
    types = {head + part: kind for head in (first, second) for part, kind in image.items()}
    write("lidar", rows, types)
    head = "[LiDARPoseComponent].range_image_return1"
    rows = [at(i, **{"key.laser_name": 1}, **tensor(head, swept[i, 1][2])) for i in range(frames)]
    write("lidar_pose", rows, {head + part: kind for part, kind in image.items()})

    head = "[LiDARBoxComponent]"
    rows = []
    for i in range(frames):
        (x, y, z), heading = box_in(ego(0.1 * i + 0.05))
        box = {f"{head}.box.center.x": x, f"{head}.box.center.y": y, f"{head}.box.center.z": z}
        box |= dict(zip((f"{head}.box.size.{axis}" for axis in "xyz"), CAR_LWH, strict=True))
        box |= {f"{head}.box.heading": heading, f"{head}.speed.x": 0.0, f"{head}.speed.y": 0.0}
        count = sum(swept[i, laser][3] for laser in LASERS)
        for key, kind in (("car", 1), ("sign", 3)):
            rows.append(at(i, **{"key.laser_object_id": key, f"{head}.type": kind}, **box))
            rows[-1][f"{head}.num_lidar_points_in_box"] = count
    types = {each: pa.float64() for each in rows[0] if "box." in each or "speed" in each}
    write("lidar_box", rows, types | {f"{head}.type": pa.int8(), f"{head}.num_lidar_points_in_box": pa.int64()})

    head = "[StatsComponent]"
    told = {f"{head}.time_of_day": "Day", f"{head}.location": "location_sf", f"{head}.weather": "sunny"}
    write("stats", [at(i, **told) for i in range(frames)], dict.fromkeys(told, pa.string()))
    return folder

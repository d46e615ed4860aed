"""Tiny recordings in KITTI's three layouts, written from one scene: a Velodyne, two front cameras, and fisheyes.

The vehicle drives over level ground, from the world's origin at a heading; a car stands, another one drives.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from import_checks import BALLS_M, COLOURS, RADIUS_PX
from scipy.spatial.transform import Rotation

FRAMES, HEADING, SPEED = 6, 0.2, 5.0
IMU_M, IMU_M_360 = [-0.05, 0.32, 0.93], [-0.05, 0.32, 0.90]
ORIGIN_360 = np.array([1200.0, 3400.0, 115.0])
RAW, DRIVE_360 = "2011_09_26_drive_0005_sync", "2013_05_28_drive_0003_sync"
RED = (255, 0, 0)
# Length, width, height; then the bottom centre and heading of each in the first frame, and its speed.
SIZE = (4.2, 1.8, 1.5)
CARS = {"standing": ((16.0, -1.5), 0.5, 0.0), "driving": ((20.0, 9.0), 0.3, 8.0)}
POINTS_IN_CAR = 40
K = np.array([[330.0, 0, 255.5], [0, 331.0, 90.0], [0, 0, 1]])
PINHOLE_PX, FISHEYE_PX = (520, 200), (500, 500)
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
MEI = {"xi": 2.2, "k1": 0.017, "k2": 1.65, "gamma1": 480.0, "gamma2": 481.0, "u0": 251.0, "v0": 249.5}
Project = Callable[[np.ndarray], np.ndarray]


def pose(turn: np.ndarray | Rotation, place: object) -> np.ndarray:
    """A 4 x 4 pose."""
    found = np.eye(4)
    found[:3, :3] = turn.as_matrix() if isinstance(turn, Rotation) else turn
    found[:3, 3] = np.asarray(place)
    return found


def vehicle(frame: int) -> np.ndarray:
    """Pose of the rear axle on the ground in the world."""
    way = SPEED * 0.1 * frame
    return pose(Rotation.from_euler("z", HEADING), [way * np.cos(HEADING), way * np.sin(HEADING), 0])


def car(name: str, frame: int) -> np.ndarray:
    """Pose of the bottom centre of a car in the world."""
    (x, y), heading, speed = CARS[name]
    way = speed * 0.1 * frame
    return pose(Rotation.from_euler("z", heading), [x + way * np.cos(heading), y + way * np.sin(heading), 0])


VELO = pose(Rotation.from_euler("x", 0.8, degrees=True), [0.76, 0.0, 1.73])
# The unrectified reference camera, a little turned, its rectifying rotation, and baselines of the others, metres.
CAM0 = pose(Rotation.from_euler("yz", [1.0, 0.7], degrees=True).as_matrix() @ OPTICAL, [1.03, 0.06, 1.65])
RECTIFY = Rotation.from_euler("xyz", [0.004, -0.007, 0.01]).as_matrix()
BASELINES = {2: [0.06, -0.0004, 0.0027], 3: [-0.47, 0.0023, 0.0027]}


def corners() -> np.ndarray:
    """The 8 corners around a bottom centre."""
    length, width, height = SIZE
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]) * [
        length / 2,
        width / 2,
        height / 2,
    ]


def edges() -> list[tuple[np.ndarray, np.ndarray]]:
    """The 12 edges of the corners."""
    found = corners()
    return [(a, b) for i, a in enumerate(found) for b in found[i + 1 :] if (np.abs(a - b) > 1e-9).sum() == 1]


def picture(project: Project, size: tuple[int, int], cam_from_world: np.ndarray, frame: int) -> np.ndarray:
    """What a camera sees: the edges of the cars in red, and the balls."""
    image = np.full((size[1], size[0], 3), 70, np.uint8)

    def pixels(points: np.ndarray) -> np.ndarray:
        return project(points @ cam_from_world[:3, :3].T + cam_from_world[:3, 3])

    for name in CARS:
        at = car(name, frame)
        for a, b in edges():
            line = np.linspace(a, b, 120) @ at[:3, :3].T + at[:3, 3]
            found = pixels(line)
            for (u, v), (s, t) in pairwise(found):
                if np.isfinite([u, v, s, t]).all() and max(map(abs, (u, v, s, t))) < 5000:
                    cv2.line(image, (round(u), round(v)), (round(s), round(t)), RED, 3)
    for (u, v), colour in zip(pixels(BALLS_M), COLOURS.tolist(), strict=True):
        if np.isfinite([u, v]).all() and max(abs(u), abs(v)) < 5000:
            cv2.circle(image, (round(u), round(v)), RADIUS_PX, colour, -1)
    return image


def pinhole(points: np.ndarray) -> np.ndarray:
    """Pixels by K."""
    with np.errstate(all="ignore"):
        found = (points @ K.T)[:, :2] / points[:, 2:]
    found[points[:, 2] < 0.5] = np.nan
    return np.asarray(found)


def mei(points: np.ndarray) -> np.ndarray:
    """Pixels by the unified sphere of Mei."""
    on_sphere = points / np.linalg.norm(points, axis=1, keepdims=True)
    x, y = on_sphere[:, :2].T / (on_sphere[:, 2] + MEI["xi"])
    r2 = x * x + y * y
    bend = 1 + MEI["k1"] * r2 + MEI["k2"] * r2 * r2
    found = np.stack([MEI["gamma1"] * bend * x + MEI["u0"], MEI["gamma2"] * bend * y + MEI["v0"]], axis=1)
    found[on_sphere[:, 2] < -0.1] = np.nan
    return found


def save(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), image[:, :, ::-1])


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def words(matrix: np.ndarray) -> str:
    return " ".join(f"{number:.12e}" for number in np.asarray(matrix).ravel())


def sweep(path: Path, frame: int) -> None:
    """Points inside the cars, and on the ground beside the vehicle."""
    made = np.random.default_rng(frame)
    points = [np.column_stack([made.uniform(-6, -3, (30, 2)), np.zeros(30)])]
    for name in CARS:
        at, inside = car(name, frame), made.uniform([-1, -1, 0.05], [1, 1, 1.95], (POINTS_IN_CAR, 3))
        points.append(inside * 0.98 * np.array(SIZE) / 2 @ at[:3, :3].T + at[:3, 3])
    velo = np.linalg.inv(vehicle(frame) @ VELO)
    local = np.concatenate(points) @ velo[:3, :3].T + velo[:3, 3]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.column_stack([local, np.full(len(local), 0.5)]).astype("<f4").tofile(path)


def oxts(frame: int) -> str:
    """The row of a frame: the inverse of the Mercator projection at the first latitude."""
    first = np.radians([49.011, 8.42])
    first_m = (vehicle(0) @ [*IMU_M, 1])[:2]
    east, north = (vehicle(frame) @ [*IMU_M, 1])[:2] - first_m
    radius = 6378137.0 * np.cos(first[0])
    north += radius * np.log(np.tan(np.pi / 4 + first[0] / 2))
    latitude = np.degrees(2 * np.arctan(np.exp(north / radius)) - np.pi / 2)
    longitude = np.degrees(first[1] + east / radius)
    return f"{latitude:.12f} {longitude:.12f} 112.8 0 0 {HEADING} " + " ".join(["0"] * 24)


def times(day: str, start: float = 10.0) -> str:
    return "".join(f"{day} 13:02:{start + 0.1 * i:012.9f}\n" for i in range(FRAMES))


def projection(number: int) -> np.ndarray:
    return np.asarray(K @ np.column_stack([np.eye(3), BASELINES[number]]))


def rectified() -> np.ndarray:
    """Pose of the rectified reference camera on the vehicle."""
    return np.asarray(CAM0 @ pose(RECTIFY.T, [0, 0, 0]))


def front_picture(number: int, frame: int) -> np.ndarray:
    camera = rectified() @ pose(np.eye(3), -np.array(BASELINES[number]))
    return picture(pinhole, PINHOLE_PX, np.linalg.inv(vehicle(frame) @ camera), frame)


def write_raw(root: Path) -> Path:
    """A raw drive; the second car is a van from frame 1 on, and a thing has no category."""
    date = root / "2011_09_26"
    imu = pose(np.eye(3), IMU_M)
    cam_from_velo, velo_from_imu = np.linalg.inv(CAM0) @ VELO, np.linalg.inv(VELO) @ imu
    lines = ["calib_time: 09-Jan-2012 13:57:47", "corner_dist: 9.95e-02", f"R_rect_00: {words(RECTIFY)}"]
    lines += [f"P_rect_{number:02d}: {words(projection(number))}" for number in BASELINES]
    write(date / "calib_cam_to_cam.txt", "\n".join(lines) + "\n")
    for name, matrix in (("velo_to_cam", cam_from_velo), ("imu_to_velo", velo_from_imu)):
        text = f"calib_time: 15-Mar-2012 11:37:16\nR: {words(matrix[:3, :3])}\nT: {words(matrix[:3, 3])}\n"
        write(date / f"calib_{name}.txt", text)
    drive = date / RAW
    for sensor in ("image_02", "image_03", "velodyne_points", "oxts"):
        write(drive / sensor / "timestamps.txt", times("2011-09-26"))
    for frame in range(FRAMES):
        for number in BASELINES:
            save(drive / f"image_{number:02d}/data/{frame:010d}.png", front_picture(number, frame))
        sweep(drive / f"velodyne_points/data/{frame:010d}.bin", frame)
        write(drive / f"oxts/data/{frame:010d}.txt", oxts(frame) + "\n")
    items = [tracklet("Car", "standing", 0), tracklet("Van", "driving", 1), tracklet("Misc", "standing", 0)]
    header = '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<boost_serialization version="9">'
    body = f'<tracklets class_id="0"><count>{len(items)}</count>{"".join(items)}</tracklets></boost_serialization>'
    write(drive / "tracklet_labels.xml", header + body)
    return drive


def tracklet(kind: str, name: str, first: int) -> str:
    rows = []
    for frame in range(first, FRAMES):
        x, y, z, turn = in_velo(name, frame)
        rows.append(
            f"<item><tx>{x}</tx><ty>{y}</ty><tz>{z}</tz><rx>0</rx><ry>0</ry><rz>{turn}</rz><state>2</state></item>"
        )
    size = "".join(f"<{key}>{SIZE[i]}</{key}>" for i, key in enumerate("lwh"))
    poses = f"<poses><count>{len(rows)}</count><item_version>2</item_version>{''.join(rows)}</poses>"
    return f"<item><objectType>{kind}</objectType>{size}<first_frame>{first}</first_frame>{poses}</item>"


def in_velo(name: str, frame: int) -> tuple[float, float, float, float]:
    found = np.linalg.inv(vehicle(frame) @ VELO) @ car(name, frame)
    return (*found[:3, 3].tolist(), float(np.arctan2(found[1, 0], found[0, 0])))


def write_tracking(root: Path) -> Path:
    """A sequence of the tracking benchmark, with a region that is no object."""
    folder, name = root / "training", "0003"
    matrices = {f"P{i}": projection(i) if i in BASELINES else projection(2) for i in range(4)}
    lines = [f"{key}: {words(value)}" for key, value in matrices.items()] + [f"R_rect {words(RECTIFY)}"]
    lines += [f"Tr_velo_cam {words((np.linalg.inv(CAM0) @ VELO)[:3])}"]
    lines += [f"Tr_imu_velo {words((np.linalg.inv(VELO) @ pose(np.eye(3), IMU_M))[:3])}"]
    write(folder / f"calib/{name}.txt", "\n".join(lines) + "\n")
    write(folder / f"oxts/{name}.txt", "\n".join(map(oxts, range(FRAMES))) + "\n")
    labels = []
    for frame in range(FRAMES):
        save(folder / f"image_02/{name}/{frame:06d}.png", front_picture(2, frame))
        sweep(folder / f"velodyne/{name}/{frame:06d}.bin", frame)
        labels.append(f"{frame} -1 DontCare -1 -1 -10 10 20 30 40 -1000 -1000 -1000 -10 -1 -1 -1")
        for number, (kind, car_name) in enumerate((("Car", "standing"), ("Van", "driving"))):
            found = np.linalg.inv(vehicle(frame) @ rectified()) @ car(car_name, frame)
            turn = np.arctan2(-found[2, 0], found[0, 0])
            size = f"{SIZE[2]} {SIZE[1]} {SIZE[0]}"
            place = " ".join(f"{value:.6f}" for value in found[:3, 3])
            labels.append(f"{frame} {number} {kind} 0 0 -1.5 10 20 30 40 {size} {place} {turn:.6f}")
    write(folder / f"label_02/{name}.txt", "\n".join(labels) + "\n")
    return folder


def write_kitti360(root: Path) -> Path:
    """A drive of KITTI-360: the world lies elsewhere, the IMU's y axis points right and its z axis down."""
    imu = pose(np.diag([1.0, -1, -1]), IMU_M_360)
    left = pose(Rotation.from_euler("zyx", [88, 3, 1], degrees=True).as_matrix() @ OPTICAL, [0.7, 0.6, 1.7])
    right = pose(Rotation.from_euler("zyx", [-91, 2, 0], degrees=True).as_matrix() @ OPTICAL, [0.7, -0.6, 1.7])
    second = CAM0 @ pose(np.eye(3), [0.6, 0.0, 0.0])
    cameras = {"image_00": CAM0, "image_01": second, "image_02": left, "image_03": right}
    lines = [f"{name}: {words((np.linalg.inv(imu) @ camera)[:3])}" for name, camera in cameras.items()]
    write(root / "calibration/calib_cam_to_pose.txt", "\n".join(lines) + "\n")
    write(root / "calibration/calib_cam_to_velo.txt", words((np.linalg.inv(VELO) @ CAM0)[:3]) + "\n")
    lines = ["calib_time: 2013"]
    for number in ("00", "01"):
        baseline = K @ np.column_stack([np.eye(3), [0.0 if number == "00" else -0.6, 0, 0]])
        lines += [
            f"S_rect_{number}: 520 200",
            f"R_rect_{number}: {words(RECTIFY)}",
            f"P_rect_{number}: {words(baseline)}",
        ]
    write(root / "calibration/perspective.txt", "\n".join(lines) + "\n")
    groups = {"mirror": ("xi",), "distortion": ("k1", "k2"), "projection": ("gamma1", "gamma2", "u0", "v0")}
    text = "%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 500\nimage_height: 500\n" + "".join(
        f"{group}_parameters:\n" + "".join(f"   {key}: {MEI[key]:.10e}\n" for key in keys)
        for group, keys in groups.items()
    )
    for name in ("image_02", "image_03"):
        write(root / f"calibration/{name}.yaml", text)
    data, sweeps = root / "data_2d_raw" / DRIVE_360, root / "data_3d_raw" / DRIVE_360 / "velodyne_points"
    rows = []
    for frame in range(FRAMES):
        for name, camera in cameras.items():
            world = vehicle(frame) @ camera
            if name in ("image_00", "image_01"):
                image = picture(pinhole, PINHOLE_PX, np.linalg.inv(world @ pose(RECTIFY.T, [0, 0, 0])), frame)
                save(data / name / f"data_rect/{frame:010d}.png", image)
            else:
                image = picture(mei, FISHEYE_PX, np.linalg.inv(world), frame)
                save(data / name / f"data_rgb/{frame:010d}.png", image)
        sweep(sweeps / f"data/{frame:010d}.bin", frame)
        rows.append(f"{frame} {words((pose(np.eye(3), ORIGIN_360) @ vehicle(frame) @ imu)[:3])}")
    for name in cameras:
        write(data / name / "timestamps.txt", times("2013-05-28"))
    write(sweeps / "timestamps.txt", times("2013-05-28"))
    write(root / f"data_poses/{DRIVE_360}/poses.txt", "\n".join(rows) + "\n")
    objects = [object_360(1, "car", 13, "standing", -1), object_360(2, "building", 11, "standing", -1)]
    objects += [object_360(3, "car", 13, "driving", frame) for frame in range(FRAMES)]
    body = "".join(f"<object{i}>{text}</object{i}>" for i, text in enumerate(objects))
    write(
        root / f"data_3d_bboxes/train/{DRIVE_360}.xml",
        f'<?xml version="1.0"?>\n<opencv_storage>{body}</opencv_storage>',
    )
    return root


def object_360(instance: int, label: str, number: int, name: str, timestamp: int) -> str:
    """An object as a unit cube that is stretched, turned and moved."""
    at = pose(np.eye(3), ORIGIN_360) @ car(name, max(timestamp, 0)) @ pose(np.eye(3), [0, 0, SIZE[2] / 2])
    stretched = at @ np.diag([*SIZE, 1.0])
    cube = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (-0.5, 0.5)])

    def matrix(tag: str, values: np.ndarray) -> str:
        rows, columns = values.shape
        return f"<{tag}><rows>{rows}</rows><cols>{columns}</cols><dt>f</dt><data>\n{words(values)}</data></{tag}>"

    fields = {"index": instance, "label": label, "start_frame": 0, "end_frame": FRAMES, "semanticId": number}
    fields |= {"instanceId": instance, "timestamp": timestamp, "dynamic": int(timestamp >= 0)}
    text = "".join(f"<{key}>{value}</{key}>" for key, value in fields.items())
    return text + matrix("transform", stretched) + matrix("vertices", cube)

from __future__ import annotations

from datetime import UTC, datetime
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from made_own_recording import write_tum

from appocc.checks import FloatArray, IntArray
from appocc.errors import DataError
from appocc.geometry import quaternion_from_yaw, transform, yaw_of
from appocc.own_cameras.pose_files import read_trajectory
from appocc.trajectory import Trajectory

START_US = 1_700_000_000_000_000
LATITUDE, LONGITUDE = 48.0, 11.0


def clock(count: int) -> IntArray:
    """Ten pictures at 10 Hz."""
    return START_US + 100_000 * np.arange(min(count, 10), dtype=np.int64)


def poses(count: int = 4) -> list[FloatArray]:
    """A drive to the north-east at 10 Hz, 1 m a step."""
    return [transform(quaternion_from_yaw(np.pi / 4), [i * 0.5**0.5, i * 0.5**0.5, 0.2]) for i in range(count)]


def read(folder: Path, text: str, name: str = "poses.txt") -> Trajectory:
    (folder / name).write_text(text)
    return read_trajectory(folder / name, clock)


def check(found: Trajectory, count: int = 4) -> None:
    assert found.times_us.tolist() == clock(count).tolist()
    np.testing.assert_allclose(found.world_from_ego, np.stack(poses(count)), atol=1e-6)


def test_tum(tmp_path: Path) -> None:
    path = write_tum(tmp_path / "poses.txt", clock(4).tolist(), poses())
    check(read_trajectory(path, clock))


def test_tum_with_times_in_nanoseconds_and_commas(tmp_path: Path) -> None:
    text = write_tum(tmp_path / "a.txt", clock(4).tolist(), poses()).read_text().replace(" ", ",")
    lines = text.split("\n")[1:-1]
    check(read(tmp_path, "\n".join(line.replace(".", "", 1).replace(",", "000,", 1) for line in lines)))


def test_kitti_has_a_pose_for_each_picture(tmp_path: Path) -> None:
    text = "".join(" ".join(f"{v:.9e}" for v in pose[:3].ravel()) + "\n" for pose in poses())
    check(read(tmp_path, text))
    with pytest.raises(DataError, match="one pose for each of 10 pictures, got 12"):
        read(tmp_path, text * 3)


@pytest.mark.parametrize("turn", ["yaw_deg", "yaw_rad", "qw, qx, qy, qz"])
def test_csv_with_a_header(tmp_path: Path, turn: str) -> None:
    yaw = {"yaw_deg": "45", "yaw_rad": f"{np.pi / 4:.9f}"}.get(turn) or ",".join(
        f"{v:.9f}" for v in quaternion_from_yaw(np.pi / 4)
    )
    rows = [
        f"7,{t / 1e6:.6f},{p[0, 3]:.9f},{p[1, 3]:.9f},{p[2, 3]},{yaw}" for t, p in zip(clock(4), poses(), strict=True)
    ]
    check(read(tmp_path, f"row, Time, x, y, z, {turn}\n" + "\n".join(rows)))


def degrees(step: int) -> tuple[float, float]:
    """Latitude and longitude 10 m further north and 10 m further east with each step."""
    north, east = 10 * step / 111_200.33, 10 * step / 74_696.56  # metres a degree at 48 degrees north
    return LATITUDE + north, LONGITUDE + east


def check_satellites(found: Trajectory) -> None:
    assert ((found.times_us - START_US) // 1_000_000).tolist() == [0, 1, 2, 3]
    expected = np.arange(4)[:, None] * [10.0, 10.0, 0.0]
    np.testing.assert_allclose(found.world_from_ego[:, :3, 3], expected, atol=0.05)
    np.testing.assert_allclose(yaw_of(found.world_from_ego), np.pi / 4, atol=0.01)
    assert "direction of motion" in found.note


def test_csv_with_latitude_and_longitude(tmp_path: Path) -> None:
    rows = [f"{START_US // 10**6 + i},{degrees(i)[0]:.8f},{degrees(i)[1]:.8f}" for i in range(4)]
    check_satellites(read(tmp_path, "timestamp,latitude,longitude\n" + "\n".join(rows), "gps.csv"))


def rmc(step: int, status: str = "A") -> str:
    moment = datetime.fromtimestamp(START_US / 1e6 + step, UTC)
    north, east = degrees(step)
    fields = [
        "GNRMC",
        moment.strftime("%H%M%S.00"),
        status,
        f"{int(north):02d}{north % 1 * 60:09.6f},N,{int(east):03d}{east % 1 * 60:09.6f},E",
        "27.5,45.0",
        moment.strftime("%d%m%y"),
        ",,A",
    ]
    sentence = ",".join(fields)
    return f"${sentence}*{reduce(lambda a, c: a ^ ord(c), sentence, 0):02X}"


def test_nmea(tmp_path: Path) -> None:
    lines = ["$GNGGA,1,2*00", rmc(0, "V"), *(rmc(i) for i in range(4)), rmc(9).replace("A*", "B*"), rmc(4)[:20]]
    check_satellites(read(tmp_path, "\r\n".join(lines), "log.nmea"))


def test_gpx(tmp_path: Path) -> None:
    points = [
        f'<trkpt lat="{degrees(i)[0]:.8f}" lon="{degrees(i)[1]:.8f}"><ele>500</ele>'
        f"<time>{datetime.fromtimestamp(START_US / 1e6 + i, UTC):%Y-%m-%dT%H:%M:%SZ}</time></trkpt>"
        for i in range(4)
    ]
    body = f"<trk><trkseg>{''.join(points)}</trkseg></trk>"
    check_satellites(
        read(tmp_path, f'<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1">{body}</gpx>')
    )


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "no poses"),
        ("1 2 3\n", "got 3 columns"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", ":2: times out of order: expected one after 1.00 s"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n", ":2: expected 8 numbers, got 7"),
        ("1 0 0 nan 0 0 0 1\n", ":1: expected finite numbers"),
        ("1 0 0 0 0 0 0 x\n", ":1: expected numbers"),
        ("1 0 0 0 1 0 0 1\n", ":1: expected a unit quaternion, got one of length 1.41"),
        ("1 1e12 0 0 0 0 0 1\n", ":1: "),
        ("1 0 0 0 0 1 0 0 0 0 2 0\n", ":1: expected a rotation"),
        ("time,a,b\n1,2,3\n", "expected columns time, x, y or time, lat, lon, got time, a, b"),
        ("time,x,y\n", "no poses below the header"),
        ("# mine\ntime,x,y\n1,2\n", ":3: expected 3 columns"),
        ("time,x,y\n1,2,3\n2,2,3\n", "the way is too short"),
        ("time,x,y,yaw\n1,2,3,0\n2,9,3,0\n", "expected headings as yaw_deg, yaw_rad or qw, .*, got 'yaw'"),
        ("time,lat,lon\n1,99,3\n", "latitudes of up to 89"),
        ("time,lat,lon\n1,9,3\n2,12,3\n", "within 1 degree"),
        ("$GPGGA,1,2\n", "no valid position"),
        ("<gpx>", "no valid XML"),
        ("<!DOCTYPE a []><gpx/>", "without a document type"),
        ("<gpx/>", "no track points"),
        ("<gpx><trkpt lat='1' lon='2'/></gpx>", "track point 1: expected lat, lon and a time"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, text: str, match: str) -> None:
    with pytest.raises(DataError, match=match) as raised:
        read(tmp_path, text)
    assert "\n" not in str(raised.value)

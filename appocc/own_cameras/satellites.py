"""Positions of satellite receivers: NMEA and GPX files, and local metric coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import reduce
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.xml_file import parse_xml

# WGS 84: half axis in metres and squared eccentricity.
_AXIS_M, _E2 = 6378137.0, 6.69437999014e-3
_FARTHEST_DEG = 1.0
Fixes = tuple[list[tuple[int, str]], FloatArray, FloatArray]


def local_places(where: Path, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
    """Return places (N, 2) in metres east and north of the first one, on the plane that touches the WGS 84 ellipsoid.

    Raises:
        DataError: if a coordinate is out of range, or farther than a degree from the first.
    """
    if not ((abs(latitude_deg) <= 89) & (abs(longitude_deg) <= 180)).all():
        raise DataError(f"{where}: expected latitudes of up to 89 and longitudes of up to 180 degrees")
    north_deg = latitude_deg - latitude_deg[0]
    east_deg = (longitude_deg - longitude_deg[0] + 180) % 360 - 180
    if max(abs(north_deg).max(), abs(east_deg).max()) > _FARTHEST_DEG:
        raise DataError(
            f"{where}: expected places within {_FARTHEST_DEG:g} degree of the first, got one farther away"
        )
    sin, cos = np.sin(np.radians(latitude_deg[0])), np.cos(np.radians(latitude_deg[0]))
    across = _AXIS_M / np.sqrt(1 - _E2 * sin**2)
    along = across * (1 - _E2) / (1 - _E2 * sin**2)
    return np.stack([np.radians(east_deg) * across * cos, np.radians(north_deg) * along], axis=1)


def read_nmea(path: Path, lines: Sequence[tuple[int, str]]) -> Fixes:
    """Read the valid $..RMC sentences of a log: times with their line numbers, latitudes and longitudes in degrees.

    Sentences without a fix or with a wrong checksum are left out, as are those that repeat a time.

    Raises:
        DataError: if no sentence is valid.
    """
    times: list[tuple[int, str]] = []
    places: list[tuple[float, float]] = []
    for number, line in lines:
        begin = line.find("$")
        sentence, _, checksum = line[begin + 1 :].partition("*")
        fields = sentence.split(",")
        wrong = checksum and checksum[:2].upper() != f"{reduce(lambda a, c: a ^ ord(c), sentence, 0):02X}"
        if begin < 0 or wrong or len(fields) < 10 or fields[0][2:] != "RMC" or fields[2] != "A":
            continue
        try:
            time, place = _rmc(fields)
        except ValueError:
            continue
        if not times or time != times[-1][1]:
            times.append((number, time))
            places.append(place)
    if not times:
        raise DataError(f"{path}: no valid position: expected $GPRMC or $GNRMC sentences with a fix")
    degrees = np.array(places)
    return times, degrees[:, 0], degrees[:, 1]


def _rmc(fields: Sequence[str]) -> tuple[str, tuple[float, float]]:
    """Return the time in seconds, latitude and longitude of the fields of an RMC sentence."""
    clock, date = fields[1], fields[9]
    day = datetime.strptime(date, "%d%m%y").replace(tzinfo=UTC)
    moment = day + timedelta(hours=int(clock[:2]), minutes=int(clock[2:4]), seconds=float(clock[4:]))
    latitude = float(fields[3][:2]) + float(fields[3][2:]) / 60
    longitude = float(fields[5][:3]) + float(fields[5][3:]) / 60
    signs = {"N": 1, "E": 1, "S": -1, "W": -1}
    if fields[4] not in signs or fields[6] not in signs:
        raise ValueError("hemisphere")
    return f"{moment.timestamp():.6f}", (latitude * signs[fields[4]], longitude * signs[fields[6]])


def read_gpx(path: Path, text: str) -> Fixes:
    """Read the track points of a GPX file: times with the numbers of the points, latitudes and longitudes in degrees.

    Raises:
        DataError: if it is no GPX file, or has no track points with times.
    """
    root = parse_xml(path, text)
    times: list[tuple[int, str]] = []
    places: list[tuple[float, float]] = []
    for number, point in enumerate(root.iterfind(".//{*}trkpt"), start=1):
        time = (point.findtext("{*}time") or "").strip()
        try:
            moment = datetime.fromisoformat(time)
            place = float(point.get("lat", "")), float(point.get("lon", ""))
        except ValueError as error:
            raise DataError(f"{path}: track point {number}: expected lat, lon and a time ({error})") from error
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        times.append((number, f"{moment.timestamp():.6f}"))
        places.append(place)
    if not times:
        raise DataError(f"{path}: no track points (trkpt)")
    degrees = np.array(places)
    return times, degrees[:, 0], degrees[:, 1]

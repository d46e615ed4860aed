"""Field numbers of the messages of the Waymo Open Dataset.

From its dataset.proto, label.proto, map.proto and vector.proto. Only what the importer reads is here.
"""

from __future__ import annotations

from enum import IntEnum


class Frame(IntEnum):
    """dataset.proto: Frame; the pose of the boxes and points, and what moves them onto the map."""

    CONTEXT = 1
    TIMESTAMP_MICROS = 2
    POSE = 3
    IMAGES = 4
    LASERS = 5
    LASER_LABELS = 6
    NO_LABEL_ZONES = 7
    MAP_FEATURES = 10
    MAP_POSE_OFFSET = 11


class Polygon(IntEnum):
    """label.proto: Polygon2dProto, in the world frame."""

    X = 1
    Y = 2


class Context(IntEnum):
    """dataset.proto: Context."""

    NAME = 1
    CAMERA_CALIBRATIONS = 2
    LASER_CALIBRATIONS = 3
    STATS = 4


class Stats(IntEnum):
    """dataset.proto: Context.Stats."""

    TIME_OF_DAY = 2
    LOCATION = 3
    WEATHER = 4


class CameraCalibration(IntEnum):
    """dataset.proto: CameraCalibration."""

    NAME = 1
    INTRINSIC = 2
    EXTRINSIC = 3
    WIDTH = 4
    HEIGHT = 5


class LaserCalibration(IntEnum):
    """dataset.proto: LaserCalibration."""

    NAME = 1
    BEAM_INCLINATIONS = 2
    BEAM_INCLINATION_MIN = 3
    BEAM_INCLINATION_MAX = 4
    EXTRINSIC = 5


class Transform(IntEnum):
    """dataset.proto: Transform, 16 doubles row by row."""

    TRANSFORM = 1


class CameraImage(IntEnum):
    """dataset.proto: CameraImage."""

    NAME = 1
    IMAGE = 2
    POSE = 3
    POSE_TIMESTAMP = 5
    SEGMENTATION = 10


class Segmentation(IntEnum):
    """dataset.proto: CameraSegmentationLabel."""

    DIVISOR = 1
    LABEL = 2


class Laser(IntEnum):
    """dataset.proto: Laser."""

    NAME = 1
    RETURN_1 = 2
    RETURN_2 = 3


class RangeImage(IntEnum):
    """dataset.proto: RangeImage; both are zlib-compressed MatrixFloat."""

    RANGE_IMAGE_COMPRESSED = 2
    POSE_COMPRESSED = 4


class MatrixFloat(IntEnum):
    """dataset.proto: MatrixFloat; `SHAPE` is a MatrixShape, whose field 1 is the dimensions."""

    DATA = 1
    SHAPE = 2
    DIMS = 1


class Label(IntEnum):
    """label.proto: Label."""

    BOX = 1
    METADATA = 2
    TYPE = 3
    ID = 4
    NUM_LIDAR_POINTS_IN_BOX = 7


class Box(IntEnum):
    """label.proto: Label.Box; width comes before length."""

    CENTER_X = 1
    CENTER_Y = 2
    CENTER_Z = 3
    WIDTH = 4
    LENGTH = 5
    HEIGHT = 6
    HEADING = 7


class Metadata(IntEnum):
    """label.proto: Label.Metadata."""

    SPEED_X = 1
    SPEED_Y = 2


class MapFeature(IntEnum):
    """map.proto: MapFeature."""

    LANE = 3
    ROAD_LINE = 4
    ROAD_EDGE = 5
    CROSSWALK = 8
    DRIVEWAY = 10


class Lane(IntEnum):
    """map.proto: LaneCenter."""

    TYPE = 2
    INTERPOLATING = 3
    POLYLINE = 8


class Line(IntEnum):
    """map.proto: RoadLine and RoadEdge."""

    TYPE = 1
    POLYLINE = 2


class Area(IntEnum):
    """map.proto: Crosswalk and Driveway."""

    POLYGON = 1


class Point(IntEnum):
    """map.proto: MapPoint; vector.proto: Vector3d."""

    X = 1
    Y = 2
    Z = 3

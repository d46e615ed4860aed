"""Recordings of one's own cameras: pictures or videos, a rig and poses; converted, or frame by frame as they come."""

from appocc.own_cameras.live import CameraDevices, LiveFrames, WatchedFolder
from appocc.own_cameras.pictures import Clock, find_streams, in_order_of_time
from appocc.trajectory import Motion, Trajectory

__all__ = [
    "CameraDevices",
    "Clock",
    "LiveFrames",
    "Motion",
    "Trajectory",
    "WatchedFolder",
    "find_streams",
    "in_order_of_time",
]

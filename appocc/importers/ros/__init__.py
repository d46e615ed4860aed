"""ROS 2 bags (sqlite3 and MCAP), read by rosbags without ROS."""

from __future__ import annotations

from appocc.importers.ros.choice import Choice
from appocc.importers.ros.log import RosLog, find_logs

__all__ = ["Choice", "RosLog", "find_logs"]

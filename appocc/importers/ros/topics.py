"""Which topics are cameras: pictures by type, paired with their CameraInfo by namespace."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from appocc.importers.ros.bag import COMPRESSED

_TRANSPORT = "/compressed"


class CameraTopics(NamedTuple):
    """The topics of a camera.

    Attributes:
        name: what tells its namespace from those of the other cameras.
        pictures: topic of its pictures.
        info: topic of its CameraInfo.
        is_rectified: whether its pictures are rectified, as image_proc names them.
    """

    name: str
    pictures: str
    info: str
    is_rectified: bool


def pair_cameras(
    pictures: Mapping[str, str], picture_frames: Mapping[str, str], info_frames: Mapping[str, str]
) -> tuple[list[CameraTopics], list[str]]:
    """Return the cameras, and the topics of pictures without a CameraInfo.

    The CameraInfo is in the same namespace, or else the only one of the same frame. Of several topics with the same
    CameraInfo, pictures as the camera takes them are preferred to rectified ones, then compressed ones.

    Args:
        pictures: types of the topics of pictures.
        picture_frames: their frames.
        info_frames: frames of the topics of CameraInfo.
    """
    of_info: dict[str, list[str]] = {}
    without = []
    for topic in sorted(pictures):
        info = f"{_namespace(topic, pictures[topic])}/camera_info"
        same = [each for each, frame in info_frames.items() if frame == picture_frames[topic]]
        if info not in info_frames:
            info = same[0] if len(same) == 1 else ""
        if info:
            of_info.setdefault(info, []).append(topic)
        else:
            without.append(topic)
    chosen = {
        info: min(topics, key=lambda topic: (_is_rectified(topic), pictures[topic] != COMPRESSED, topic))
        for info, topics in of_info.items()
    }
    spaces = [_namespace(topic, pictures[topic]) for topic in chosen.values()]
    names = _short_names(spaces)
    cameras = [
        CameraTopics(name, topic, info, _is_rectified(topic))
        for name, (info, topic) in zip(names, chosen.items(), strict=True)
    ]
    return sorted(cameras), without


def channel_of(name: str) -> str:
    """Return the channel of a camera: `camera_front_left` becomes CAM_FRONT_LEFT."""
    plain = re.sub(r"\W+", "_", name).strip("_")
    short = re.sub(r"(?i)^(camera|cam)_?(?=.)|(?<=.)_(camera|cam)$", "", plain)
    return f"CAM_{short.upper()}"


def _namespace(topic: str, kind: str) -> str:
    base = topic.removesuffix(_TRANSPORT) if kind == COMPRESSED else topic
    return base.rpartition("/")[0]


def _is_rectified(topic: str) -> bool:
    return "rect" in topic.removesuffix(_TRANSPORT).rpartition("/")[2]


def _short_names(spaces: Sequence[str]) -> list[str]:
    """Return namespaces without the parts at their beginning and end that all have."""
    parts = [[part for part in space.split("/") if part] or ["camera"] for space in spaces]
    if len(parts) == 1:
        return [parts[0][-1]]
    while all(len(each) > 1 for each in parts) and len({each[0] for each in parts}) == 1:
        parts = [each[1:] for each in parts]
    while all(len(each) > 1 for each in parts) and len({each[-1] for each in parts}) == 1:
        parts = [each[:-1] for each in parts]
    return ["_".join(each) for each in parts]

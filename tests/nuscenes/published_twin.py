"""The tiny dataset as nuScenes is published: map expansion 1.3 with all layers, basemaps, CAN bus, prediction."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tiny_dataset import TinyDataset

TOWN = "singapore-onenorth"
# The published names of masks are hashes.
MASK = "maps/53992ee3023e5494b90c316c183be829.png"


def published(root: Path) -> Path:
    """Write the dataset below a new root."""
    tiny = TinyDataset(root)
    shutil.rmtree(root / tiny.version)
    tiny.version = "v1.0-mini"
    tiny.tables["log"][0]["location"] = TOWN
    tiny.tables["map"][0]["filename"] = MASK
    (root / "maps/drivable.png").rename(root / MASK)
    tiny.write()
    (root / "LICENSE").write_text("as published")
    for folder in ("basemap", "expansion", "prediction"):
        (root / "maps" / folder).mkdir()
    cv2.imwrite(str(root / f"maps/basemap/{TOWN}.png"), np.zeros((30, 40, 3), np.uint8))
    (root / f"maps/expansion/{TOWN}.json").write_text(json.dumps(expansion()))
    (root / "maps/prediction/prediction_scenes.json").write_text(json.dumps({"scene-tiny": []}))
    (root / "can_bus").mkdir()
    (root / "can_bus/scene-tiny_pose.json").write_text(json.dumps([{"utime": 1, "pos": [0, 0, 0]}]))
    return root


def expansion() -> dict[str, Any]:
    """A road along world y around the ego's way, with a hole in it, a crossing, lanes, dividers and a junction.

    Every layer and field of the published files of version 1.3.
    """
    nodes: list[dict[str, Any]] = []

    def chain(*points: tuple[float, float]) -> list[str]:
        first = len(nodes)
        nodes.extend({"token": f"n{first + i}", "x": x, "y": y} for i, (x, y) in enumerate(points))
        return [f"n{first + i}" for i in range(len(points))]

    def box(x0: float, y0: float, x1: float, y1: float) -> list[str]:
        return chain((x0, y0), (x1, y0), (x1, y1), (x0, y1))

    polygons = {
        "road": (box(90, 150, 110, 260), [box(92, 250, 94, 252)]),
        "crossing": (box(90, 215, 110, 218), []),
        "walkway": (box(110, 150, 114, 260), []),
        "stop": (box(100, 212, 108, 212.5), []),
        "parking": (box(114, 200, 120, 210), []),
        "junction": (box(90, 218, 110, 240), []),
        "lane": (box(100, 150, 104, 212), []),
        "connector": (box(100, 212, 104, 240), []),
    }
    dividers = {"lanes": chain((104.2, 150), (104.2, 212)), "middle": chain((100.2, 150), (100.2, 212))}
    dividers |= {"edge0": chain((100, 150), (104, 150)), "edge1": chain((100, 212), (104, 212))}
    dividers |= {"light": chain((108, 213), (108, 213.2))}
    segments = [{"node_token": token, "segment_type": "SINGLE_SOLID_WHITE"} for token in dividers["lanes"]]
    ends = {"from_edge_line_token": "edge0", "to_edge_line_token": "edge1"}
    path = {"start_pose": [102, 150, 1.57], "end_pose": [102, 212, 1.57], "shape": "LSR", "radius": 999.0}
    path |= {"segment_length": [0.0, 62.0, 0.0]}
    return {
        "version": "1.3",
        "polygon": [
            {"token": name, "exterior_node_tokens": ring, "holes": [{"node_tokens": hole} for hole in holes]}
            for name, (ring, holes) in polygons.items()
        ],
        "line": [{"token": name, "node_tokens": tokens} for name, tokens in dividers.items()],
        "node": nodes,
        "drivable_area": [{"token": "d", "polygon_tokens": ["road"]}],
        "road_segment": [
            {"token": "s0", "polygon_token": "road", "is_intersection": False, "drivable_area_token": "d"},
            {"token": "s1", "polygon_token": "junction", "is_intersection": True, "drivable_area_token": "d"},
        ],
        "road_block": [{"token": "b", "polygon_token": "road", **ends, "road_segment_token": "s0"}],
        "lane": [
            {
                "token": "l",
                "polygon_token": "lane",
                "lane_type": "CAR",
                **ends,
                "left_lane_divider_segments": segments,
                "right_lane_divider_segments": [],
            }
        ],
        "ped_crossing": [{"token": "c", "polygon_token": "crossing", "road_segment_token": "s0"}],
        "walkway": [{"token": "w", "polygon_token": "walkway"}],
        "stop_line": [
            {
                "token": "t",
                "polygon_token": "stop",
                "stop_line_type": "TRAFFIC_LIGHT",
                "ped_crossing_tokens": ["c"],
                "traffic_light_tokens": ["g"],
                "road_block_token": "b",
            }
        ],
        "carpark_area": [{"token": "p", "polygon_token": "parking", "orientation": 1.57, "road_block_token": "b"}],
        "road_divider": [{"token": "m", "line_token": "middle", "road_segment_token": None}],
        "lane_divider": [{"token": "e", "line_token": "lanes", "lane_divider_segments": segments}],
        "traffic_light": [
            {
                "token": "g",
                "line_token": "light",
                "traffic_light_type": "VERTICAL",
                "from_road_block_token": "b",
                "items": [{"color": "RED", "shape": "CIRCLE", "rel_pos": {"tx": 0}, "to_road_block_tokens": []}],
                "pose": {"tx": 108, "ty": 213, "tz": 4, "rx": 0, "ry": 0, "rz": 0},
            }
        ],
        "canvas_edge": [1585.6, 2025.0],
        "arcline_path_3": {"l": [path], "k": [path]},
        "connectivity": {"l": {"incoming": [], "outgoing": ["k"]}, "k": {"incoming": ["l"], "outgoing": []}},
        "lane_connector": [{"token": "k", "polygon_token": "connector"}],
    }

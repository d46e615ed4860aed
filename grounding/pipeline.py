"""Scenes for a grounder from files: a key frame of a dataset, or one saved map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from appocc.bevmap import BEVMap, load_map
from appocc.boxes import Boxes
from appocc.frame import Frame
from appocc.nuscenes import Dataset, Sample
from appocc.nuscenes.maps import vector_map
from grounding.grounder import Grounder
from tracking.io.nuscenes_tracks import read_key_frame
from tracking.tracks import Track

# Sides of traffic by the place names with which locations of nuScenes begin.
_ON_THE_LEFT = {"singapore": True, "boston": False}
# Our speed is that since the key frame before, or until the next one, if these are not farther away in time.
_SPEED_S = 1.0


def set_key_frame(
    grounder: Grounder,
    dataset: Dataset,
    sample: Sample,
    source: str,
    *,
    tracks: Path | Sequence[Track] | None = None,
    images: bool = True,
) -> Frame:
    """Set a key frame of a dataset as the scene of a grounder.

    The vehicles are the given tracks; without tracks, the annotated boxes on a true map (`BEVMap.is_truth`) and the
    map's own objects or instances on any other one: a prediction is never completed from annotations. Traffic drives
    on the left where the location of the log says so.

    Args:
        grounder: its scene is replaced.
        dataset: with maps of `source`.
        sample: the key frame.
        source: source of the map, as in `appocc.bevmap.bev_path`.
        tracks: those of the key frame, or nuScenes tracking results that contain it.
        images: whether the returned frame has its images.

    Returns:
        The key frame: cameras, ego pose, annotated boxes.

    Raises:
        DataError: if a file is missing or damaged.
    """
    frame = dataset.frame(sample, images=images)
    bev = load_map(dataset.root, source, sample.token)
    scene = dataset.scene(sample.scene_token)
    grounder.set_street_map(vector_map(dataset, scene))
    grounder.set_left_hand_traffic(drives_on_left(dataset.location(scene)))
    given: Sequence[Track] | Boxes | None = frame.boxes_ego if bev.is_truth else None
    if tracks is not None:
        given = read_key_frame(tracks, sample.token) if isinstance(tracks, Path) else tracks
    grounder.set_scene(bev, given, frame.world_from_ego, speed_mps=own_speed_mps(dataset, sample))
    return frame


def drives_on_left(location: str) -> bool | None:
    """Return whether traffic drives on the left at a location such as "singapore-onenorth"; None: unknown."""
    return _ON_THE_LEFT.get(location.lower().split("-")[0])


def own_speed_mps(dataset: Dataset, sample: Sample) -> float | None:
    """Return the forward speed of the ego at a key frame, by its pose and those around it; None for a single one.

    Raises:
        DataError: if a pose is missing or damaged.
    """
    chain = dataset.samples(dataset.scene(sample.scene_token))
    at = next(i for i, one in enumerate(chain) if one.token == sample.token)
    for first, last in ((at - 1, at), (at, at + 1)):
        if first < 0 or last >= len(chain):
            continue
        seconds = (chain[last].timestamp_us - chain[first].timestamp_us) * 1e-6
        if 0 < seconds <= _SPEED_S:
            before, after = (dataset.world_from_ego(chain[i]) for i in (first, last))
            return float((after[:3, 3] - before[:3, 3]) @ after[:3, 0]) / seconds
    return None


def set_saved_map(grounder: Grounder, path: Path) -> None:
    """Set a saved map (.npz) and its own objects or vehicle instances as the scene of a grounder.

    Args:
        grounder: its scene is replaced; the world frame is the ego frame.
        path: the map.

    Raises:
        DataError: if the file is missing or damaged.
    """
    grounder.set_scene(BEVMap.load(path))

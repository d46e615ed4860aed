"""The scene that `appocc view` shows: tracks that are there or made, and the goal of a command."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from appocc.geometry import quaternion_from_yaw, rotation_from_quaternion, transform
from appocc.nuscenes import Dataset, Scene
from appocc.nuscenes.dataset import sample_at
from appocc.viewer.timeline import ShownGoal, ego_box, on_ground
from grounding import Answer, Grounder
from grounding.pipeline import set_key_frame
from tracking.io.nuscenes_tracks import read_tracks
from tracking.pipeline import SceneTracks, read_key_frames, track_scene, tracks_folder

MADE_NOW = "made now"


def scene_tracks(
    dataset: Dataset, scene: Scene, source: str, advance: Callable[[int], None]
) -> tuple[SceneTracks, str]:
    """Return the tracks of a scene, and where they are from: a file of `appocc track`, else they are made.

    Raises:
        DataError: if the file is damaged, or a map is missing or damaged.
    """
    file = tracks_folder(dataset.root, source, scene.name) / "tracking.json"
    if not file.is_file():
        return track_scene(dataset, scene, source, advance=advance), MADE_NOW
    samples, poses = read_key_frames(dataset, scene)
    tracks = read_tracks(file, [sample.token for sample in samples])
    return SceneTracks(scene.name, source, samples, poses, tracks), str(file)


def command_goal(
    dataset: Dataset, scene: Scene, shown: SceneTracks, origin: str, command: str, frame: int
) -> tuple[Answer, ShownGoal | None]:
    """Ground a command at a key frame; return the answer, and its goal if it has one.

    The vehicles are those of the page: tracks of a file, else annotated boxes on true maps, else the tracks made now.

    Args:
        dataset: with maps of the source of the tracks.
        scene: a scene of it.
        shown: its tracks.
        origin: where they are from, as `scene_tracks` tells.
        command: what is said.
        frame: index of the key frame.

    Raises:
        DataError: if a map is missing or damaged.
        NotFoundError: if there is no such key frame.
    """
    grounder, sample = Grounder(), sample_at(dataset, scene, frame)
    boxes = origin == MADE_NOW and shown.on_truth and dataset.annotated(scene)
    tracks = None if boxes else shown.tracks[frame]
    key_frame = set_key_frame(grounder, dataset, sample, shown.source, tracks=tracks, images=False)
    answer = grounder.ground(command)
    if answer.target is None:
        return answer, None
    pose = key_frame.world_from_ego
    yaw = rotation_from_quaternion(quaternion_from_yaw(answer.target.heading_ego_rad))
    centre, size = ego_box(answer.target.ego)
    # The target is the centre of the vehicle, the origin of its frame is the rear axle.
    ego_from_centre = transform(yaw, [*answer.target.ego_m.tolist(), 0.0])
    world_from_goal = pose @ ego_from_centre @ transform(np.eye(3), [-centre[0], 0.0, 0.0])
    route = np.zeros((0, 2)) if answer.plan.route is None else answer.plan.route
    goal = ShownGoal(
        world_from_goal,
        (world_from_goal @ np.append(centre, 1.0))[:3],
        size,
        on_ground(route, pose),
        command,
        frame,
    )
    return answer, goal

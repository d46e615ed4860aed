"""Key frames to pack: their files and tables, read in the main process, as values that workers can take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from appocc.bevmap import bev_path, load_map
from appocc.boxes import Boxes
from appocc.camera import CameraRig
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, Scene
from appocc.provenance import pack_parts


@dataclass(frozen=True, eq=False, kw_only=True)
class PackedFrame:
    """A key frame to pack.

    Attributes:
        title: SCENE-0000.
        token: sample token.
        scene: name of the scene.
        location: of the scene, '' if unknown.
        timestamp_us: time, microseconds.
        world_from_ego: (4, 4) ego pose.
        rig: cameras in the ego frame at that time.
        pictures: file of each camera by channel.
        bev: file of the map.
        boxes_ego: annotated boxes in the ego frame; None if the scene is not annotated.
    """

    title: str
    token: str
    scene: str
    location: str
    timestamp_us: int
    world_from_ego: FloatArray
    rig: CameraRig
    pictures: Mapping[str, Path]
    bev: Path
    boxes_ego: Boxes | None


class KeyFrame(NamedTuple):
    """A key frame of a source, with its title: SCENE-0000."""

    title: str
    scene: Scene
    sample: Sample


@dataclass(frozen=True, eq=False)
class PackSource:
    """The key frames of scenes with the maps of one source.

    Attributes:
        dataset: the dataset.
        scenes: scenes to pack.
        source: source of the maps (`appocc.bevmap`).
    """

    dataset: Dataset
    scenes: Sequence[Scene]
    source: str

    def key_frames(self) -> list[KeyFrame]:
        """Return all key frames in order; each has a map at this time.

        Raises:
            DataError: if there are none, one has no map, or two scenes have the same name.
        """
        found = [
            KeyFrame(titles[sample.token], scene, sample)
            for scene in self.scenes
            for titles in [self.dataset.titles(scene)]
            for sample in self.dataset.samples(scene)
        ]
        if not found:
            raise DataError(f"{self.dataset.root}: no key frames to pack")
        names = [scene.name for scene in self.scenes]
        if len(set(names)) != len(names):
            raise DataError(f"{self.dataset.root}: expected scenes of different names")
        for each in found:
            if not self.map_path(each.sample).is_file():
                load_map(self.dataset.root, self.source, each.sample.token)  # raises with the command that makes maps
        return found

    def map_path(self, sample: Sample) -> Path:
        """Return the path of the map of a sample."""
        return bev_path(self.dataset.root, self.source, sample.token)

    def picture_paths(self, sample: Sample) -> dict[str, Path]:
        """Return the path of the picture of each camera of a sample by channel.

        Raises:
            DataError: if a name leads out of the dataset.
        """
        files = self.dataset.data(sample).items()
        return {channel: self.dataset.path(data) for channel, data in files if data.modality == "camera"}

    def frame(self, key_frame: KeyFrame) -> PackedFrame:
        """Return a key frame for a worker; no picture is read.

        Raises:
            DataError: if a table entry cannot be true.
        """
        title, scene, sample = key_frame
        frame = self.dataset.frame(sample, images=False)
        return PackedFrame(
            title=title,
            token=sample.token,
            scene=scene.name,
            location=self.dataset.location(scene),
            timestamp_us=sample.timestamp_us,
            world_from_ego=frame.world_from_ego,
            rig=frame.rig,
            pictures=self.picture_paths(sample),
            bev=self.map_path(sample),
            boxes_ego=frame.boxes_ego,
        )

    def as_json(self, key_frames: Sequence[KeyFrame]) -> dict[str, Any]:
        """Return what determines the packed files of its key frames, apart from the format."""
        samples = [each.sample for each in key_frames]
        maps = [self.map_path(sample) for sample in samples]
        scenes = [scene.name for scene in self.scenes]
        return {"scenes": scenes, "source": self.source, **pack_parts(self.dataset, samples, maps)}

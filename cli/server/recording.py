"""A recording that is open in the page: scenes, key frames, maps and cameras, kept in bounded memory."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import NamedTuple

import numpy as np

from appocc.bevmap import BEVMap, bev_path, load_map, map_sources
from appocc.checks import FloatArray
from appocc.errors import DataError, NotFoundError
from appocc.frame import Frame
from appocc.nuscenes import Dataset, Sample, Scene
from appocc.nuscenes.dataset import sample_at
from appocc.nuscenes.maps import VectorMap, vector_map
from cli.server.cache import BoundedCache
from grounding.pipeline import drives_on_left, own_speed_mps

# A map of 200 x 200 cells takes about half a megabyte.
_MOST_MAPS, _MOST_FRAMES, _MOST_SCENES = 32, 64, 16
# In the order in which the page offers them.
_PREDICTED, _TRUE = "predicted", ("exact", "groundtruth")


class Place(NamedTuple):
    """A key frame seen through a source of maps.

    Attributes:
        scene: index of the scene in its table.
        frame: number of the key frame, from 0.
        source: source of the map; '' for a recording without maps.
    """

    scene: int
    frame: int
    source: str


class Recording:
    """A dataset; several threads may use it."""

    def __init__(self, key: str, title: str, root: Path, version: str) -> None:
        """Name a dataset; its tables are read when they are first needed.

        Args:
            key: short name for addresses, unique among the open recordings.
            title: name for people.
            root: root of the dataset.
            version: folder of its tables.
        """
        self.key, self.title, self.root, self.version = key, title, root, version
        self._lock = RLock()
        self._samples: BoundedCache[int, tuple[Sample, ...]] = BoundedCache(_MOST_SCENES)
        self._frames: BoundedCache[tuple[int, int], Frame] = BoundedCache(_MOST_FRAMES)
        self._street_maps: BoundedCache[int, VectorMap | None] = BoundedCache(_MOST_SCENES)
        self._maps: BoundedCache[tuple[Path, int], BEVMap] = BoundedCache(_MOST_MAPS)

    @cached_property
    def dataset(self) -> Dataset:
        """The dataset."""
        return Dataset(self.root, self.version)

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """All scenes."""
        with self._lock:
            return self.dataset.scenes

    def scene(self, index: int) -> Scene:
        """Return a scene by its index.

        Raises:
            NotFoundError: if there is none.
        """
        if not 0 <= index < len(self.scenes):
            raise NotFoundError(f"{self.title}: expected a scene in 0..{len(self.scenes) - 1}, got {index}")
        return self.scenes[index]

    def samples(self, scene: int) -> tuple[Sample, ...]:
        """Return the key frames of a scene in order of time."""
        with self._lock:
            return self._samples.get(scene, lambda: self.dataset.samples(self.scene(scene)))

    def sample(self, scene: int, frame: int) -> Sample:
        """Return a key frame by its number.

        Raises:
            NotFoundError: if there is none.
        """
        samples = self.samples(scene)
        return samples[frame] if 0 <= frame < len(samples) else sample_at(self.dataset, self.scene(scene), frame)

    def frame(self, scene: int, frame: int) -> Frame:
        """Return a key frame without its images: rig, pose and annotated boxes."""
        sample = self.sample(scene, frame)
        with self._lock:
            return self._frames.get((scene, frame), lambda: self.dataset.frame(sample, images=False))

    def annotated(self, scene: int) -> bool:
        """Return whether a scene has annotated boxes."""
        with self._lock:
            return self.dataset.annotated(self.scene(scene))

    def poses(self, scene: int) -> FloatArray:
        """Return the (T, 4, 4) poses world_from_ego of the key frames."""
        return np.stack([self.frame(scene, k).world_from_ego for k in range(len(self.samples(scene)))])

    def street_map(self, scene: int) -> VectorMap | None:
        """Return the vector map around a scene; None without one."""
        with self._lock:
            return self._street_maps.get(scene, lambda: vector_map(self.dataset, self.scene(scene)))

    def left_hand_traffic(self, scene: int) -> bool | None:
        """Return whether traffic drives on the left where a scene was recorded; None: unknown."""
        with self._lock:
            return drives_on_left(self.dataset.location(self.scene(scene)))

    def speed_mps(self, scene: int, frame: int) -> float | None:
        """Return the forward speed of the ego at a key frame; None: unknown."""
        with self._lock:
            return own_speed_mps(self.dataset, self.sample(scene, frame))

    def image_path(self, scene: int, frame: int, channel: str) -> Path:
        """Return the path of a camera image.

        Raises:
            NotFoundError: if the key frame has no such camera.
        """
        sample = self.sample(scene, frame)
        with self._lock:
            files = self.dataset.data(sample)
        if channel not in files or files[channel].modality != "camera":
            raise NotFoundError(f"{self.title}: frame {frame} has no camera '{channel}'")
        return self.dataset.path(files[channel])

    def sources(self) -> list[str]:
        """Return the sources of maps: predicted ones first, true ones last."""
        return sorted(map_sources(self.root), key=lambda name: (name in _TRUE, name != _PREDICTED, name))

    def truth(self) -> str | None:
        """Return the source of true maps; None without one."""
        return next((name for name in _TRUE if name in self.sources()), None)

    def check_source(self, source: str) -> None:
        """Check that the recording has maps of a source: only then its name may become part of a path.

        Raises:
            NotFoundError: if not.
        """
        if source not in self.sources():
            raise NotFoundError(f"{self.title}: no maps of source '{source}'; there are {', '.join(self.sources())}")

    def map_path(self, place: Place) -> Path:
        """Return the path of a map, which need not exist.

        Raises:
            NotFoundError: if the recording has no such source.
        """
        self.check_source(place.source)
        return bev_path(self.root, place.source, self.sample(place.scene, place.frame).token)

    def bev(self, place: Place) -> BEVMap:
        """Return the map of a key frame.

        Raises:
            DataError: if it is missing or damaged.
            NotFoundError: if there is no such source or key frame.
        """
        path = self.map_path(place)
        try:
            changed = path.stat().st_mtime_ns
        except OSError as error:
            raise DataError(f"{self.title}: frame {place.frame} has no map of source '{place.source}'") from error
        token = self.sample(place.scene, place.frame).token
        return self._maps.get((path, changed), lambda: load_map(self.root, place.source, token))

"""Tracks of scenes for the page: read from the recording, or made in the background from its maps."""

from __future__ import annotations

import time
from collections import OrderedDict
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotYet
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock, Thread
from typing import Literal, NamedTuple

from appocc.errors import AppoccError, DataError
from appocc.nuscenes import Dataset
from cli.server.recording import Recording
from tracking.io.nuscenes_tracks import read_tracks
from tracking.pipeline import track_scene, tracks_folder
from tracking.tracks import Track

Frames = tuple[tuple[Track, ...], ...]
# A short scene is tracked before the first answer, so that its vehicles keep their ids from the first picture on.
_PATIENCE_S = 2.0
_MOST_SCENES = 6


class SceneVehicles(NamedTuple):
    """Where the vehicles of a scene come from.

    Attributes:
        kind: tracks; annotated boxes, on true maps of an annotated scene; or the map alone, while tracks are made
            and where they cannot be made.
        tracks: T tuples of tracks; empty for the other kinds.
        share: share of the frames that are tracked, 0..1.
        problem: why there are no tracks; ''.
    """

    kind: Literal["tracks", "boxes", "map"]
    tracks: Frames = ()
    share: float = 1.0
    problem: str = ""


class _StoppedError(Exception):
    """Nobody waits for the tracks any more."""


@dataclass(eq=False)
class _Work:
    """Tracking of a scene in a thread."""

    frames: int
    done: int = 0
    began_s: float = field(default_factory=time.monotonic)
    result: Future[Frames] = field(default_factory=Future)
    stopped: bool = False
    thread: Thread | None = None

    def advance(self, steps: int) -> None:
        self.done += steps
        if self.stopped:
            raise _StoppedError


class TrackStore:
    """The tracks of the scenes that were looked at last."""

    def __init__(self) -> None:
        """Begin without tracks."""
        self._lock = Lock()
        self._work: OrderedDict[tuple[object, ...], _Work] = OrderedDict()

    def vehicles(self, recording: Recording, scene: int, source: str) -> SceneVehicles:
        """Return the vehicles of a scene: the files of `appocc track`, else boxes on true maps, else tracks made now.

        A long scene is tracked in the background; meanwhile the vehicles are those of each map alone.
        """
        file = _tracks_file(recording, scene, source)
        if file is None and source == recording.truth() and recording.annotated(scene):
            return SceneVehicles("boxes")
        work = self._started(recording, scene, source, file)
        try:
            return SceneVehicles("tracks", work.result.result(max(work.began_s + _PATIENCE_S - time.monotonic(), 0)))
        except NotYet:
            return SceneVehicles("map", share=work.done / work.frames)
        except AppoccError as error:
            return SceneVehicles("map", problem=str(error))

    def _started(self, recording: Recording, scene: int, source: str, file: Path | None) -> _Work:
        """Return the work on a scene, begun if it is new or its files have changed."""
        changed = (file or recording.root / "bev" / source).stat().st_mtime_ns
        key = (recording.key, scene, source, changed)
        with self._lock:
            if key not in self._work:
                self._work[key] = work = _Work(max(len(recording.samples(scene)), 1))
                arguments = (work, recording, scene, source, file)
                work.thread = Thread(target=_run, args=arguments, daemon=True, name="tracking")
                work.thread.start()
            self._work.move_to_end(key)
            while len(self._work) > _MOST_SCENES:
                self._work.popitem(last=False)
            return self._work[key]

    def close(self) -> None:
        """End all tracking: a thread in compiled code would abort the process at its end."""
        with self._lock:
            for work in self._work.values():
                work.stopped = True
            for thread in (work.thread for work in self._work.values() if work.thread is not None):
                thread.join()


def _tracks_file(recording: Recording, scene: int, source: str) -> Path | None:
    """Return the tracks that `appocc track` has written for a scene; None without them."""
    try:
        file = tracks_folder(recording.root, source, recording.scene(scene).name) / "tracking.json"
    except DataError:  # the name of the scene is none for a folder
        return None
    return file if file.is_file() else None


def _run(work: _Work, recording: Recording, scene: int, source: str, file: Path | None) -> None:
    """Read or make the tracks of a scene."""
    try:
        if file is not None:
            tokens = [sample.token for sample in recording.samples(scene)]
            with suppress(AppoccError):  # tracks of older maps may lack key frames: then they are made anew
                work.result.set_result(read_tracks(file, tokens))
                return
        # A reader of its own: a long scene must not hold up the pages.
        dataset = Dataset(recording.root, recording.version)
        tracked = track_scene(dataset, dataset.scenes[scene], source, advance=work.advance)
        work.result.set_result(tracked.tracks)
    except Exception as error:  # handed to whoever asks for the result
        work.result.set_exception(error)

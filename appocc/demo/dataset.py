"""The demo's recording: a short drive through a built-in town, simulated on the spot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from appocc.camera import CameraRig
from appocc.nuscenes.writer import Writer
from appocc.rigs import read_rig
from appocc.simulation.recording import SOURCE, VERSION, Recipe, build_place, record_scene, write_map
from appocc.simulation.scenario import Scenario
from appocc.simulation.sources import TownSource

SCENE, HZ = "demo", 2.0
_SIZE_PX = (416, 234)
# A drive past a silver car with a gap behind it to park in, in a town that is kept for tests.
_STORY = Scenario(name=SCENE, number=139, town="harrowmere", ego=12, start_s=137.6, weather="clear", seed=123)

__all__ = ["HZ", "SCENE", "SOURCE", "VERSION", "Settings", "write_dataset"]


def _whole_pictures() -> CameraRig:
    """The paper's cameras before its cuts, small: 16:9 is pleasant to look at."""
    return CameraRig(tuple(camera.resized(*_SIZE_PX) for camera in read_rig("paper_full")))


@dataclass(frozen=True)
class Settings:
    """Size of the dataset: fewer frames make it quicker.

    Attributes:
        samples: key frames, two a second.
        rig: cameras.
    """

    samples: int = 11
    rig: CameraRig = field(default_factory=_whole_pictures)


def write_dataset(root: Path, settings: Settings, advance: Callable[[float], None]) -> None:
    """Write the whole dataset below `root`; the same settings give the same bytes. `advance` is called a key frame.

    Raises:
        DataError: if a file cannot be written.
    """
    writer = Writer(root, VERSION)
    place = build_place(TownSource(_STORY.town), root)
    write_map(place.town, _STORY.town, root)
    record_scene(_STORY, place, Recipe(settings.samples, HZ, settings.rig), writer, advance)
    writer.save()

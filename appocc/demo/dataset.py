"""Dataset of the demo: a short simulated drive through a built-in town."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from appocc.camera import CameraRig
from appocc.nuscenes.writer import Writer
from appocc.rigs import read_rig
from appocc.simulation.recording import (
    SOURCE,
    VERSION,
    RecordingSettings,
    build_town_simulation,
    record_scene,
    write_map,
)
from appocc.simulation.scenario import Scenario
from appocc.simulation.sources import TownSource

SCENE, HZ = "demo", 2.0
_SIZE_PX = (416, 234)
# A drive past a silver car with a parking gap behind it, in a test town.
_SCENARIO = Scenario(name=SCENE, number=139, town="harrowmere", ego=12, start_s=137.6, weather="clear", seed=123)

__all__ = ["HZ", "SCENE", "SOURCE", "VERSION", "DemoSettings", "record_demo"]


def _uncropped_rig() -> CameraRig:
    """Return the paper's cameras before cropping, at a small 16:9 size."""
    rig = read_rig("paper_full")
    return rig.with_cameras(camera.resized(*_SIZE_PX) for camera in rig)


@dataclass(frozen=True)
class DemoSettings:
    """Size of the dataset.

    Attributes:
        samples: number of key frames, two per second.
        rig: camera rig.
    """

    samples: int = 11
    rig: CameraRig = field(default_factory=_uncropped_rig)


def record_demo(root: Path, settings: DemoSettings, advance: Callable[[float], None]) -> None:
    """Simulate and write the dataset below `root`; the same settings give the same bytes.

    `advance` is the progress callback in key frames.

    Raises:
        DataError: if a file cannot be written.
    """
    writer = Writer(root, VERSION)
    simulation = build_town_simulation(TownSource(_SCENARIO.town), root)
    write_map(simulation.town, _SCENARIO.town, root)
    record_scene(_SCENARIO, simulation, RecordingSettings(settings.samples, HZ, settings.rig), writer, advance)
    writer.save()

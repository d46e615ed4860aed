"""Long work of the page in a process of its own: a simulated drive, predicted maps."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType
from typing import Any

from appocc.errors import AppoccError

# The page stays quick while the work goes on.
_NICE = 10
HZ = 2.0

Report = Callable[[str, Any], None]


def run_job(connection: Connection, kind: str, root: Path, settings: dict[str, Any]) -> None:
    """Do a job and report ("total", n), ("advance", n), ("note", text), at the end ("done", None) or ("error", text).

    Args:
        connection: to the server.
        kind: a key of JOBS.
        root: of the dataset that is made, or that gets maps.
        settings: of the job.
    """
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends its jobs
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = "1"
    with suppress(OSError, AttributeError):
        os.nice(_NICE)

    def report(what: str, value: Any) -> None:
        try:
            connection.send((what, value))
        except OSError:  # the server is gone
            sys.exit(1)

    try:
        JOBS[kind](root, settings, report)
        report("done", None)
    except (AppoccError, OSError) as error:
        report("error", str(error))
    except Exception as error:
        report("error", f"{type(error).__name__}: {error}")


def _end(number: int, frame: FrameType | None) -> None:
    """Exit by an exception, so that half-written files are removed."""
    sys.exit(1)


def frames_of(settings: dict[str, Any]) -> int:
    """Return the number of key frames of a simulated drive."""
    return max(1, round(float(settings["seconds"]) * HZ))


def simulate_drive(root: Path, settings: dict[str, Any], report: Report) -> None:
    """Simulate a drive with the demo's cameras, then predict its maps; an interrupted one is resumed."""
    from appocc.demo.dataset import DemoSettings
    from appocc.simulation.generate import DatasetSettings, simulate
    from appocc.simulation.recording import RecordingSettings
    from appocc.simulation.sources import town_sources

    frames = frames_of(settings)
    report("total", 2 * frames)
    report("note", f"building {settings['town']}")
    recording = RecordingSettings(frames, HZ, DemoSettings().rig, True, False, False)
    towns = town_sources("all", [settings["town"]])
    wanted = DatasetSettings(1, towns, (settings["weather"],), settings["seed"], recording)
    first = iter(["driving and rendering"])

    def advance(steps: float) -> None:
        for note in first:
            report("note", note)
        report("advance", steps)

    simulate(root, wanted, None, advance, lambda text: report("note", text))
    report("note", "predicting maps from the cameras")
    _predict(root, settings, report)


def predict_maps(root: Path, settings: dict[str, Any], report: Report) -> None:
    """Predict the maps of all key frames of a dataset; existing ones of the same weights are kept."""
    from appocc.nuscenes import Dataset

    report("note", "")
    dataset = Dataset(root, settings["version"])
    report("total", sum(len(dataset.samples(scene)) for scene in dataset.scenes))
    _predict(root, settings, report, settings["version"])


def _predict(root: Path, settings: dict[str, Any], report: Report, version: str | None = None) -> None:
    from appocc.inference.inputs import dataset_inputs
    from appocc.inference.loading import load_predictor
    from appocc.inference.run import InferenceRun
    from appocc.nuscenes import Dataset
    from cli.infer import write_maps
    from tracking.pipeline.tracked_objects import TrackedObjects

    dataset, predictor = Dataset(root, version), load_predictor(settings["weights"])
    inputs, maps = dataset_inputs(dataset, dataset.scenes), root / "bev" / settings["source"]
    run = InferenceRun(inputs, predictor, maps, tracking=TrackedObjects())
    write_maps(run, lambda steps: report("advance", steps))


JOBS: dict[str, Callable[[Path, dict[str, Any], Report], None]] = {
    "simulate": simulate_drive,
    "predict": predict_maps,
}

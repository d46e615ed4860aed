"""Inference of several scenes at once: each scene is a job of a worker process or of a cluster."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from cli.common import progress
from cli.engine import engine, shared

if TYPE_CHECKING:
    from appocc.inference.predictor import Predictor
    from appocc.inference.run import InferenceRun, InferenceSummary


@dataclass(frozen=True)
class SceneInference:
    """The job of a worker: predict the maps of a scene.

    Attributes:
        root: dataset.
        version: folder of its tables, if it has several.
        level: whether frames are levelled.
        weights: weights file, or the name of shipped ones; None for the default.
        device: name of the device; None for the default.
        out: folder of the maps.
        pictures: whether maps have pictures.
    """

    root: Path
    version: str | None
    level: bool
    weights: Path | None
    device: str | None
    out: Path
    pictures: bool

    def __call__(self, scene: str) -> tuple[int, InferenceSummary]:
        """Predict the maps of a scene; return the number of key frames and the counts.

        Raises:
            DataError: as `InferenceRun`.
        """
        from appocc.inference.run import InferenceRun
        from cli.infer import inputs_of, write_maps
        from tracking.pipeline.tracked_objects import TrackedObjects

        inputs = inputs_of(self.root, None, scene, self.version, self.level)
        predictor = _predictor(self.weights, self.device)
        tracking = TrackedObjects()
        run = InferenceRun(inputs, predictor, self.out, None, self.pictures, is_part=True, tracking=tracking)
        write_maps(run, lambda steps: None)
        return len(inputs), run.summary


@lru_cache(maxsize=1)
def _predictor(weights: Path | None, device: str | None) -> Predictor:
    from appocc.inference.loading import load_predictor
    from cli.infer import device_of

    return load_predictor(weights, device_of(device))


def execute_by_scene(
    run: InferenceRun, job: SceneInference, scenes: list[str], workers: int, cluster: str
) -> InferenceSummary:
    """Execute a run scene by scene on workers, with a progress bar over all.

    Raises:
        DataError: as the run, or if `cluster` is not valid.
        AppoccError: if the cluster cannot be used.
    """
    from appocc.models.shipped import PACKAGED, find_weights
    from appocc.workers import in_order

    weights = job.weights
    if weights is not None and find_weights(weights).parent != PACKAGED.parent:  # shipped ones are on every node
        weights = shared(cluster, weights)
    job = replace(job, root=shared(cluster, job.root), out=shared(cluster, job.out), weights=weights)
    with engine(cluster, min(workers, len(scenes)), job.out) as pool, progress("prediction", len(run)) as advance:
        for count, summary in in_order(pool, job, scenes):
            run.add(summary)
            advance(count)
    run.finish()
    return run.summary

"""`appocc demo`: the whole chain on a short simulated drive."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.common import JsonOption, emit, out_path, progress, say

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset, Scene
    from tracking.pipeline import SceneTracks

COMMANDS = ("park behind the nearest silver car", "stop behind the nearest car ahead", "stop next to the nearest car")
FRAME, PREDICTED = 6, "predicted"


def demo(
    out: Annotated[
        Path,
        typer.Option("--out", parser=out_path, help="New folder, or an earlier demo, whose files are made anew."),
    ] = Path("appocc-demo"),
    as_json: JsonOption = False,
) -> None:
    """Run everything once on a short simulated drive: pictures, predicted maps, tracks, grounded commands.

    Example: appocc demo --out appocc-demo
    """
    # Many small matrix products: on a busy machine several threads make them slower by far. Set before numpy starts.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from appocc.demo.folder import demo_folder

    with demo_folder(out) as folder:
        outcome = _fill(folder, out)
    if as_json:
        emit({"folder": str(out), **outcome})
    say((out / "README.txt").read_text())
    say(f"All of this is in {out / 'README.txt'}; begin with {out / 'bev.png'}.")


def _fill(folder: Path, out: Path) -> dict[str, Any]:
    """Make all files of the demo in `folder`, which is to become `out`; the outcome for machines."""
    from appocc.demo.dataset import SCENE, SOURCE, DemoSettings, record_demo
    from appocc.demo.explain import explanation
    from appocc.evaluation.bev import EvaluationConfig, evaluate
    from appocc.files import write_bytes
    from appocc.nuscenes import Dataset

    root, settings = folder / "dataset", DemoSettings()
    with progress("drive", settings.samples) as advance:
        record_demo(root, settings, advance)
    dataset = Dataset(root)
    scene = dataset.scene(SCENE)
    _predict(dataset, scene)
    judged = evaluate(dataset, [scene], EvaluationConfig(PREDICTED, SOURCE, False, None), lambda _: None).as_json()
    tracks, scores = _track(dataset, scene, folder)
    answers = _ground(dataset, scene, folder)
    _draw(dataset, scene, folder, tracks)
    text = explanation(out, settings.samples, FRAME, judged, scores, answers)
    write_bytes(folder / "README.txt", text.encode())
    return {"scene": SCENE, "bev": judged, "tracks": tracks.count, **scores, "ground": answers}


def _predict(dataset: Dataset, scene: Scene) -> None:
    """The maps of a scene by the weights of the package."""
    from appocc.inference.inputs import dataset_inputs
    from appocc.inference.loading import load_predictor
    from appocc.inference.run import InferenceRun
    from cli.infer import execute

    execute(InferenceRun(dataset_inputs(dataset, [scene]), load_predictor(None), dataset.root / "bev" / PREDICTED))


def _track(dataset: Dataset, scene: Scene, folder: Path) -> tuple[SceneTracks, dict[str, Any]]:
    """The tracks of a scene, written with their scores and a video."""
    from tracking.evaluation.scene import score_scene, write_metrics
    from tracking.pipeline import track_scene, tracks_folder, write_tracks
    from tracking.visualization.video import write_video

    tracks = track_scene(dataset, scene, PREDICTED)
    scores = score_scene(dataset, tracks) or {}
    place = tracks_folder(dataset.root, PREDICTED, scene.name)
    write_tracks(place, tracks)
    write_metrics(place / "metrics.json", tracks, scores)
    with progress("video", len(tracks.samples)) as advance:
        write_video(dataset, tracks, folder / "tracks.webm", advance)
    return tracks, {name: value.as_json() for name, value in scores.items()}


def _ground(dataset: Dataset, scene: Scene, folder: Path) -> list[dict[str, Any]]:
    """What becomes of the commands on a predicted map; drawn, and how far that is from the answer on the true map."""
    import numpy as np

    from appocc.bevmap import load_map
    from appocc.demo.dataset import SOURCE
    from appocc.files import write_image
    from grounding.grounder import Grounder
    from grounding.visualization import draw_answer

    sample = dataset.samples(scene)[FRAME]
    frame = dataset.frame(sample)
    predicted, exact = Grounder(), Grounder()
    predicted.set_scene(load_map(dataset.root, PREDICTED, sample.token), None, frame.world_from_ego)
    exact.set_scene(load_map(dataset.root, SOURCE, sample.token), frame.boxes_ego, frame.world_from_ego)
    answers = []
    for number, command in enumerate(COMMANDS, start=1):
        answer, true = predicted.ground(command), exact.ground(command)
        name = f"ground-{number}.png"
        write_image(folder / name, draw_answer(answer, frame))
        apart_m = None
        if answer.target and true.target:
            apart_m = float(np.hypot(*(answer.target.ego_m - true.target.ego_m)))
        answers.append({"picture": name, **answer.to_dict(), "text": answer.text(), "apart_m": apart_m})
    return answers


def _draw(dataset: Dataset, scene: Scene, folder: Path, tracks: SceneTracks) -> None:
    """The pictures of one key frame: cameras and maps, and its tracks."""
    from appocc.bevmap import load_map
    from appocc.demo.dataset import SOURCE
    from appocc.demo.pictures import overview
    from appocc.files import write_image
    from cli.infer import places_of
    from tracking.visualization.video import draw_frame

    sample = dataset.samples(scene)[FRAME]
    frame = dataset.frame(sample)
    predicted, exact = (load_map(dataset.root, source, sample.token) for source in (PREDICTED, SOURCE))
    write_image(folder / "bev.png", overview(frame, predicted, exact, places_of(predicted)))
    write_image(folder / "tracks.png", draw_frame(tracks, FRAME, frame, predicted))

"""The demo's pipeline: simulate, predict, evaluate, track, ground and draw one short drive."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from appocc.bevmap import load_map
from appocc.demo.dataset import SCENE, SOURCE, DemoSettings, record_demo
from appocc.demo.explain import CONVERSATION_PICTURE, NEAR_M, explanation
from appocc.demo.pictures import overview
from appocc.evaluation.bev import EvaluationConfig, evaluate
from appocc.files import write_bytes, write_image
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.run import InferenceRun
from appocc.nuscenes import Dataset, Scene
from cli.infer import execute, vehicle_marks
from grounding.grounder import Grounder
from grounding.pipeline import set_key_frame
from grounding.visualization import draw_answer
from tracking.evaluation.scene import score_scene, write_scored_tracks
from tracking.pipeline import SceneTracks, track_scene, tracks_folder
from tracking.pipeline.tracked_objects import TrackedObjects
from tracking.visualization.video import draw_frame, write_video

COMMANDS = ("park behind the nearest silver car", "stop behind the nearest car ahead", "stop next to the nearest car")
# A conversation: a command that fits several vehicles, the answer to the question, and a change of mind.
CONVERSATION = ("stop next to the vehicle", "the closer one", "a bit further back", "where are you heading?")
FRAME, PREDICTED = 6, "predicted"

# Shows the progress of a named step with a number of parts; the block gets a function that advances it.
Progress = Callable[[str, int | None], AbstractContextManager[Callable[[float], None]]]


def run_demo(folder: Path, out: Path, progress: Progress) -> dict[str, Any]:
    """Write all files of the demo.

    Args:
        folder: written to; the caller renames it to `out` when everything is complete.
        out: the final name of the folder, for the text that explains the files.
        progress: shows the progress of the steps.

    Returns:
        The outcome, JSON values only: scores of the maps and tracks, answers to the commands.

    Raises:
        DataError: if a file cannot be written.
    """
    root, settings = folder / "dataset", DemoSettings()
    with progress("drive", settings.samples) as advance:
        record_demo(root, settings, advance)
    dataset = Dataset(root)
    scene = dataset.scene(SCENE)
    _predict(dataset, scene)
    judged, near = (
        evaluate(dataset, [scene], EvaluationConfig(PREDICTED, SOURCE, False, range_m), lambda _: None).as_json()
        for range_m in (None, NEAR_M)
    )
    tracks, scores = _track(dataset, scene, folder, progress)
    answers = _ground(dataset, scene, folder)
    talk = _converse(dataset, scene, folder)
    _draw(dataset, scene, folder, tracks)
    text = explanation(out, settings.samples, FRAME, judged, near, scores, answers, talk)
    write_bytes(folder / "README.txt", text.encode())
    return {"scene": SCENE, "bev": judged, "tracks": tracks.count, **scores, "ground": answers, "conversation": talk}


def _predict(dataset: Dataset, scene: Scene) -> None:
    """Predict the maps of a scene with the shipped weights."""
    inputs, maps = dataset_inputs(dataset, [scene]), dataset.root / "bev" / PREDICTED
    execute(InferenceRun(inputs, load_predictor(None), maps, tracking=TrackedObjects()))


def _track(dataset: Dataset, scene: Scene, folder: Path, progress: Progress) -> tuple[SceneTracks, dict[str, Any]]:
    """Track the vehicles of the predicted maps; write tracks, scores and a video."""
    tracks = track_scene(dataset, scene, PREDICTED)
    scores = score_scene(dataset, tracks)
    write_scored_tracks(tracks_folder(dataset.root, PREDICTED, scene.name), tracks, scores)
    with progress("video", len(tracks.samples)) as advance:
        write_video(dataset, tracks, folder / "tracks.webm", advance)
    return tracks, {name: value.as_json() for name, value in (scores or {}).items()}


def _ground(dataset: Dataset, scene: Scene, folder: Path) -> list[dict[str, Any]]:
    """Ground the commands on a predicted map and its tracks; a question is answered.

    The answers are drawn, and their error is measured against the exact map.
    """
    sample = dataset.samples(scene)[FRAME]
    predicted, exact = Grounder(), Grounder()
    tracks = tracks_folder(dataset.root, PREDICTED, scene.name) / "tracking.json"
    frame = set_key_frame(predicted, dataset, sample, PREDICTED, tracks=tracks)
    set_key_frame(exact, dataset, sample, SOURCE, images=False)
    answers = []
    for number, command in enumerate(COMMANDS, start=1):
        session, true = predicted.session(), exact.ground(command)
        first = last = session.say(command)
        text, reply = first.text(), None
        if first.status == "ambiguous":
            reply = "yes" if first.plan.question or len(first.candidates) == 1 else "the first one"
            last = session.say(reply)
            text = f"{text}\n> {reply}\n{last.text()}"
        name = f"ground-{number}.png"
        said = command if reply is None else '", "'.join((command, reply))
        write_image(folder / name, draw_answer(last, frame, said=said))
        apart_m = None
        if last.target and true.target:
            apart_m = float(np.hypot(*(last.target.ego_m - true.target.ego_m)))
        found = last.to_dict()
        replied = {} if reply is None else {"reply": reply, "target": found["target"], "referent": found["referent"]}
        answers.append({"picture": name, **first.to_dict(), **replied, "text": text, "apart_m": apart_m})
    return answers


def _converse(dataset: Dataset, scene: Scene, folder: Path) -> list[dict[str, Any]]:
    """Hold a conversation on the exact map and draw the last goal."""
    sample = dataset.samples(scene)[FRAME]
    grounder = Grounder()
    frame = set_key_frame(grounder, dataset, sample, SOURCE)
    session = grounder.session()
    answers = [session.say(sentence) for sentence in CONVERSATION]
    write_image(
        folder / CONVERSATION_PICTURE, draw_answer(session.goal or answers[-1], frame, said='", "'.join(CONVERSATION))
    )
    return [
        {"said": said, **one.to_dict(), "text": one.text()} for said, one in zip(CONVERSATION, answers, strict=True)
    ]


def _draw(dataset: Dataset, scene: Scene, folder: Path, tracks: SceneTracks) -> None:
    """Draw one key frame: its cameras and maps, and its tracks."""
    sample = dataset.samples(scene)[FRAME]
    frame = dataset.frame(sample)
    predicted, exact = (load_map(dataset.root, source, sample.token) for source in (PREDICTED, SOURCE))
    write_image(folder / "bev.png", overview(frame, predicted, exact, vehicle_marks(predicted)))
    write_image(folder / "tracks.png", draw_frame(tracks, FRAME, frame, predicted))

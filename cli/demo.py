"""`appocc demo`: the whole chain on a short simulated drive."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from cli.common import JsonOption, emit, progress, say

COMMAND, FRAME = "park behind the silver car", 3


def demo(
    out: Annotated[
        Path, typer.Option("--out", help="New folder, or an earlier demo, whose files are made anew.")
    ] = Path("appocc-demo"),
    as_json: JsonOption = False,
) -> None:
    """Run everything once on a short simulated drive: pictures, maps, tracks, a grounded command.

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
    from appocc.bevmap import load_map
    from appocc.demo.dataset import SCENE, SOURCE, Settings, write_dataset
    from appocc.demo.explain import explanation
    from appocc.demo.pictures import overview
    from appocc.files import write_bytes, write_image
    from appocc.nuscenes import Dataset
    from grounding.answer import ground
    from grounding.picture import draw
    from grounding.scene import scene_of
    from tracking.run import score, track_scene, write_metrics, write_tracks
    from tracking.video import draw_frame, write_video

    root, settings = folder / "dataset", Settings()
    with progress("drive", settings.samples) as advance:
        write_dataset(root, settings, advance)
    dataset = Dataset(root)
    scene = dataset.scene(SCENE)
    sample = dataset.samples(scene)[FRAME]
    frame, bev = dataset.frame(sample), load_map(root, SOURCE, sample.token)
    write_image(folder / "bev.png", overview(frame, bev))

    with progress("tracks", settings.samples) as advance:
        tracks = track_scene(dataset, scene, SOURCE, advance=advance)
    scores = score(dataset, tracks) or {}
    write_tracks(root / "tracks" / SCENE, tracks)
    write_metrics(root / "tracks" / SCENE / "metrics.json", tracks, scores)
    with progress("video", settings.samples) as advance:
        write_video(dataset, tracks, folder / "tracks.webm", advance)
    write_image(folder / "tracks.png", draw_frame(tracks, FRAME, frame, bev))

    answer = ground(COMMAND, scene_of(bev, frame.boxes_ego, frame.world_from_ego))
    write_image(folder / "ground.png", draw(answer, frame))

    metrics = {name: value.as_json() for name, value in scores.items()}
    text = explanation(out, settings.samples, FRAME, COMMAND, metrics["metrics"], answer.text())
    write_bytes(folder / "README.txt", text.encode())
    return {"scene": SCENE, "tracks": tracks.count, **metrics, "ground": answer.to_dict()}

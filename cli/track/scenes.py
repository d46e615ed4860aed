"""`appocc track scene` and `appocc track detections`: track the scenes of a dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.common import (
    JsonOption,
    RootArgument,
    SceneOption,
    SourceOption,
    TrustUnseenOption,
    VersionOption,
    choose_scene,
    choose_source,
    emit,
    in_path,
    out_path,
    progress,
    say,
    say_empty,
)
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, processes, shared, shared_source
from cli.track.options import ALL_SCORES, MinScoreOption, SmoothOption, VideoOption
from cli.track.output import say_files, show_metrics

if TYPE_CHECKING:
    from appocc.nuscenes import Dataset, Scene
    from tracking.evaluation.clear_id_hota import Metrics
    from tracking.pipeline import SceneTracks
    from tracking.scene_jobs import SceneTracking, TrackedScene


def track_scene_command(
    root: RootArgument,
    scene: Annotated[
        list[str] | None,
        typer.Option("--scene", help="Name or token of the scene; may be repeated. Default: all of ROOT."),
    ] = None,
    bev: SourceOption = None,
    smooth: SmoothOption = False,
    min_score: MinScoreOption = ALL_SCORES,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            parser=out_path,
            help="Output folder, of several scenes with a folder for each; by default ROOT/tracks/SOURCE/SCENE.",
        ),
    ] = None,
    video: VideoOption = None,
    trust_unseen: TrustUnseenOption = False,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track scenes through their bird's-eye-view maps: their objects, or vehicle blobs of maps without objects.

    Writes nuScenes JSON, MOTChallenge text, CSV tables and, with annotations, the scores.

    Example: appocc track scene DATA --scene 002 --bev groundtruth --video tracks.webm
    """
    from appocc.errors import DataError
    from appocc.nuscenes import Dataset
    from tracking.pipeline import track_scene
    from tracking.scene_jobs import SceneTracking

    dataset = Dataset(shared(cluster, root), version)
    every = [dataset.scene(name) for name in scene] if scene else list(dataset.scenes)
    scenes = [each for each in every if dataset.samples(each)]
    if not scenes:
        names = ", ".join(each.name for each in every[:6])
        raise DataError(f"{root}: no key frames (scenes: {names or 'none'})")
    source = choose_source(root, bev)
    if video is not None:
        _check_video(video, scenes, cluster)
    folders = _folders(dataset, root, source, scenes, out)
    if cluster == LOCAL and len(scenes) == 1:
        with progress("tracking", len(dataset.samples(scenes[0]))) as advance:
            result = track_scene(
                dataset, scenes[0], source, trust_unseen=trust_unseen, smoothing=smooth, advance=advance
            )
        _finish(dataset, result.with_scores(min_score), {"bev": source}, folders[scenes[0]], video, as_json)
        return
    job = SceneTracking(dataset.root, shared_source(cluster, source), source, smooth, min_score, trust_unseen)
    tracked = _track_scenes(dataset, folders, job, workers, cluster, out or root)
    say_empty(dataset, every)
    if len(tracked) == 1:
        _report_scene(tracked[0], {"bev": source}, as_json)
    else:
        _report_scenes(tracked, {"bev": source}, as_json)


def _check_video(video: Path, scenes: Sequence[Scene], cluster: str) -> None:
    """Check that a video can be written.

    Raises:
        DataError: if its name has another ending, or there is not one scene that is tracked on this machine.
    """
    from appocc.errors import DataError
    from tracking.visualization.video import check_video_path

    check_video_path(video)
    if cluster != LOCAL or len(scenes) != 1:
        raise DataError(f"expected --video with one --scene and without --cluster, got {len(scenes)} scenes")


def _folders(
    dataset: Dataset, root: Path, source: str, scenes: Sequence[Scene], out: Path | None
) -> dict[Scene, Path]:
    """Return the output folder of each scene.

    Raises:
        DataError: if the name of a scene is unfit for a folder, two have the same, or it is that of the tables.
    """
    from appocc.errors import DataError
    from appocc.files import plain_name
    from tracking.pipeline import check_apart, tracks_folder

    if out is not None and len(scenes) == 1:
        check_apart(out, {"the tables": dataset.tables.folder})
        return {scenes[0]: out}
    if len({scene.name for scene in scenes}) != len(scenes):
        raise DataError(f"{root}: expected scenes of different names")
    return {
        scene: tracks_folder(root, source, scene.name) if out is None else out / plain_name(root, scene.name)
        for scene in scenes
    }


def _track_scenes(
    dataset: Dataset,
    folders: Mapping[Scene, Path],
    job: SceneTracking,
    workers: int | None,
    cluster: str,
    shared_folder: Path,
) -> list[TrackedScene]:
    """Track scenes on the engine, with a progress bar over all key frames."""
    from appocc.workers import in_order
    from tracking.scene_jobs import scene_inputs

    inputs = scene_inputs(dataset, {scene: shared(cluster, folder) for scene, folder in folders.items()})
    total = sum(len(dataset.samples(scene)) for scene in folders)
    count = min(processes(workers, total), len(folders))
    tracked = []
    with engine(cluster, count, shared_folder) as pool, progress("tracking", total) as advance:
        for one, folder in zip(in_order(pool, job, inputs), folders.values(), strict=True):
            tracked.append(one._replace(files=tuple(folder / path.name for path in one.files)))
            advance(one.key_frames)
    return tracked


def track_detections_command(
    root: RootArgument,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", parser=in_path, help="nuScenes detection results for the scene.")
    ],
    scene: SceneOption = None,
    smooth: SmoothOption = False,
    min_score: MinScoreOption = ALL_SCORES,
    out: Annotated[
        Path | None,
        typer.Option("--out", parser=out_path, help="Output folder; by default ROOT/tracks/FILE/SCENE."),
    ] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track the objects of a scene in a detector's nuScenes results.

    Writes the same files as `track scene`; classes, heights and used sensors are those of the detector.

    Example: appocc track detections DATA results_nusc.json --scene scene-0103
    """
    from appocc.nuscenes import Dataset
    from tracking.pipeline import check_apart, track_detections, tracks_folder

    dataset = Dataset(root, version)
    wanted = choose_scene(dataset, scene)
    folder = out or tracks_folder(root, file.stem, wanted.name)
    check_apart(folder, {"the tables": dataset.tables.folder})
    check_apart(folder / "tracking.json", {"the detections": file})
    with progress("tracking", len(dataset.samples(wanted))) as advance:
        result, skipped = track_detections(dataset, wanted, file, smoothing=smooth, advance=advance)
    source = {"detections": str(file), "left_out": skipped}
    _finish(dataset, result.with_scores(min_score), source, folder, None, as_json)


def _finish(
    dataset: Dataset,
    result: SceneTracks,
    source: Mapping[str, Any],
    folder: Path,
    video: Path | None,
    as_json: bool,
) -> None:
    """Score and write the tracks of a scene, and print what was done; `source` are the keys of the input."""
    from tracking.evaluation.scene import read_truths
    from tracking.scene_jobs import finish_scene
    from tracking.visualization.video import write_video

    truths = read_truths(dataset, result.scene, result.samples)
    if video is not None:  # before the tracks are written, because it reads all images and may find a damaged one
        with progress("video", len(result.samples)) as advance:
            write_video(dataset, result, video, advance)
    tracked = finish_scene(result, truths, folder)
    more = () if video is None else (video,)
    _report_scene(tracked._replace(files=(*tracked.files, *more)), source, as_json)


# Names of the metrics in tables.
_TITLES = {"metrics": "all", "metrics_moving": "moving", "metrics_parked": "parked"}


def _report_scene(tracked: TrackedScene, source: Mapping[str, Any], as_json: bool) -> None:
    """Print what was done with a scene."""
    if as_json:
        emit(_scene_json(tracked, source))
    kind = "vehicles" if "bev" in source and tracked.vehicles_only else "objects"
    say(f"scene {tracked.scene}: {tracked.tracks} {kind} in {tracked.key_frames} key frames")
    if source.get("left_out"):
        counts = ", ".join(f"{name} ({count})" for name, count in source["left_out"].items())
        say(f"left out, as they are no classes of the tracking benchmark: boxes of {counts}")
    _show_scores(tracked.metrics)
    say_files(tracked.files)


def _report_scenes(tracked: Sequence[TrackedScene], source: Mapping[str, Any], as_json: bool) -> None:
    """Print what was done with several scenes, with the scores of each and of all."""
    from tracking.scene_jobs import pooled_metrics

    pooled = pooled_metrics(tracked)
    if as_json:
        emit({**source, "scenes": [_scene_json(one, {}) for one in tracked], **_metrics_json(pooled)})
    scored = {one.scene: one.metrics["metrics"] for one in tracked if one.metrics is not None}
    if scored:
        show_metrics("scene", scored)
    _show_scores(pooled)
    count, frames = (sum(values) for values in zip(*((one.tracks, one.key_frames) for one in tracked), strict=True))
    say(f"{len(tracked)} scenes: {count} tracks in {frames} key frames, in {tracked[0].files[0].parent.parent}")


def _scene_json(tracked: TrackedScene, source: Mapping[str, Any]) -> dict[str, Any]:
    files = [str(path) for path in tracked.files]
    return {
        "scene": tracked.scene,
        **source,
        "tracks": tracked.tracks,
        "files": files,
        **_metrics_json(tracked.metrics),
    }


def _metrics_json(scores: Mapping[str, Metrics] | None) -> dict[str, Any]:
    return {name: scores[name].as_json() if scores else None for name in _TITLES}


def _show_scores(scores: Mapping[str, Metrics] | None) -> None:
    if scores is None:
        say("no annotations: nothing to be scored against")
    else:
        show_metrics("vehicles", {_TITLES[name]: metrics for name, metrics in scores.items()})

"""`appocc eval`: evaluation of maps (`bev`), detections, tracks and parsed commands (`parses`)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from cli.bev_tables import show_evaluation
from cli.common import JsonOption, RootArgument, SourceOption, VersionOption, choose_source, emit, progress
from cli.engine import LOCAL, ClusterOption, ProcessesOption, engine, processes, shared, shared_source
from cli.eval_detections import detections
from cli.eval_parses import parses
from cli.eval_tracks import tracks

app = typer.Typer(name="eval", help="Evaluate results against the truth.", no_args_is_help=True)


class TruthSource(StrEnum):
    """The truth to compare with."""

    exact = "exact"
    groundtruth = "groundtruth"


class GridSetting(StrEnum):
    """The paper's two settings: the full surround grid, or its front half."""

    all_around = "360"
    ahead = "180"


@app.command()
def bev(
    root: RootArgument,
    bev: SourceOption = None,
    against: Annotated[
        TruthSource | None, typer.Option(help="The truth; default: exact if ROOT has it, else groundtruth.")
    ] = None,
    setting: Annotated[GridSetting, typer.Option(help="360: all cells; 180: cells ahead.")] = GridSetting.all_around,
    range_m: Annotated[
        float | None,
        typer.Option("--range", min=0.1, help="Only cells within this distance of the ego, in metres."),
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Only this scene.")] = None,
    workers: ProcessesOption = None,
    cluster: ClusterOption = LOCAL,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Evaluate BEV maps: IoU by class, colour errors and vehicles; by distance, visibility and weather.

    The truth is compared with itself only if --bev names it.

    Example: appocc eval bev ROOT --bev groundtruth --against exact
    """
    from appocc.bevmap import bev_folder
    from appocc.evaluation.bev import EvaluationConfig, evaluate
    from appocc.nuscenes import Dataset

    root = shared(cluster, root)
    dataset = Dataset(root, version)
    scenes = [dataset.scene(scene)] if scene else list(dataset.scenes)
    if against is None:
        against = TruthSource.exact if bev_folder(root, "exact").is_dir() else TruthSource.groundtruth
    source = choose_source(root, bev, against.value)
    question = EvaluationConfig(shared_source(cluster, source), against.value, setting is GridSetting.ahead, range_m)
    total = sum(len(dataset.samples(one)) for one in scenes)
    with (
        engine(cluster, processes(workers, total), root, writes=False) as pool,
        progress("comparing", total) as advance,
    ):
        answer = evaluate(dataset, scenes, question, advance, pool).as_json() | {"source": source}
    if as_json:
        emit(answer)
    show_evaluation(answer)


app.command()(detections)
app.command()(tracks)
app.command()(parses)

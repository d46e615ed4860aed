"""`appocc ground`: a sentence to the one cell where the car should go."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, RootArgument, VersionOption, emit, say


def ground(
    text: Annotated[str, typer.Argument(metavar="TEXT", help="The command, such as 'park behind the silver car'.")],
    root: RootArgument,
    scene: Annotated[str, typer.Option("--scene", help="Name or token of the scene.")],
    frame: Annotated[int, typer.Option("--frame", help="Number of the key frame, from 0.")],
    bev: Annotated[
        str, typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name.")
    ] = "groundtruth",
    version: VersionOption = None,
    as_json: JsonOption = False,
    picture: Annotated[Path | None, typer.Option("--picture", help="Write a picture of the answer (.png).")] = None,
) -> None:
    """Ground a driving command: which vehicle it means, and the cell where the car should stand.

    Exit code 0: found; 2: no driving command; 3: ambiguous, not found, or a command that cannot be placed yet.

    Example: appocc ground "stop behind the nearest white car" DATA --scene 002 --frame 10 --picture g.png
    """
    from appocc.bevmap import is_truth, load_map
    from appocc.files import write_image
    from appocc.nuscenes import Dataset
    from appocc.nuscenes.dataset import sample_at
    from grounding.answer import ground as answer_of
    from grounding.picture import draw
    from grounding.scene import scene_of

    dataset = Dataset(root, version)
    sample = sample_at(dataset, dataset.scene(scene), frame)
    moment = dataset.frame(sample, images=picture is not None)
    # What a model predicted is answered from what it predicted, never from annotations.
    boxes_ego = moment.boxes_ego if is_truth(bev) else None
    answer = answer_of(text, scene_of(load_map(root, bev, sample.token), boxes_ego, moment.world_from_ego))
    if picture is not None:
        write_image(picture, draw(answer, moment))
    if as_json:
        emit(answer.to_dict())
    say(answer.text())
    raise typer.Exit(answer.exit_code)

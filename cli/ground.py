"""`appocc ground`: sentences to the cells where the car should go."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from appocc.errors import DataError
from cli.common import JsonOption, TrustUnseenOption, VersionOption, emit, say

if TYPE_CHECKING:
    from appocc.frame import Frame
    from grounding import Grounder
    from grounding.language.llm import ChatEndpoint

_MOST_BYTES = 1_000_000


def ground(
    text: Annotated[
        str | None, typer.Argument(metavar="[TEXT]", help="The command, such as 'park behind the silver car'.")
    ] = None,
    root: Annotated[
        Path | None, typer.Argument(metavar="[ROOT]", help="Dataset root in the nuScenes schema.")
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    frame: Annotated[int | None, typer.Option("--frame", help="Number of the key frame, from 0.")] = None,
    bev: Annotated[
        str, typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name.")
    ] = "groundtruth",
    version: VersionOption = None,
    tracks: Annotated[
        Path | None, typer.Option("--tracks", help="The vehicles from nuScenes tracking results, such as of `track`.")
    ] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Instead of ROOT, --scene and --frame: one saved map (.npz).")
    ] = None,
    commands: Annotated[
        Path | None, typer.Option("--commands", help="Instead of TEXT: a file of commands, one a line.")
    ] = None,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="Instead of TEXT: ask, and ask again, until an empty line.")
    ] = False,
    lexicon: Annotated[
        Path | None, typer.Option("--lexicon", help="A file of words to know beside the own ones.")
    ] = None,
    llm: Annotated[
        str | None,
        typer.Option(
            "--llm",
            help="Address of a language model to read first (chat completions; $APPOCC_LLM_MODEL and _KEY).",
        ),
    ] = None,
    trust_unseen: TrustUnseenOption = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Also what each word was read as, every score, and the field of places.")
    ] = False,
    as_json: JsonOption = False,
    picture: Annotated[Path | None, typer.Option("--picture", help="Write a picture of the answer (.png).")] = None,
) -> None:
    """Ground a driving command: which vehicle it means, and the cell where the car should stand.

    Exit code 0: found; 2: no driving command; 3: ambiguous, not found, or nowhere to stand; of several the highest.

    Example: appocc ground "stop behind the nearest white car" DATA --scene 002 --frame 10 --picture g.png
    """
    from grounding import Grounder, GrounderConfig

    if (commands or interactive) and root is None and text is not None:
        root, text = Path(text), None  # the only word without an option is then the dataset
    _check_one(("TEXT", text), ("--commands", commands), ("--interactive", interactive or None))
    _check_one(("ROOT", root), ("--map", map_file))
    if picture is not None and text is None:
        raise DataError("--picture goes only with TEXT")
    config = GrounderConfig(trust_unseen=trust_unseen)
    grounder = Grounder(lexicon=lexicon, llm=_endpoint(llm), config=config)
    moment = None
    if root is not None:
        moment = _set_key_frame(grounder, root, scene, frame, bev, version, tracks, picture is not None)
    else:
        _set_map(grounder, map_file, scene, frame, tracks)
    if text is not None:
        raise typer.Exit(_answer(grounder, text, moment, explain, as_json, picture))
    asked = _lines(commands) if commands else _asked()
    raise typer.Exit(max((_answer(grounder, one, moment, explain, as_json, None) for one in asked), default=0))


def _check_one(*given: tuple[str, object]) -> None:
    """One of several ways to say the same.

    Raises:
        DataError: if none or several are given.
    """
    names = [name for name, value in given if value is not None]
    if len(names) != 1:
        wanted = " and ".join([", ".join(name for name, _ in given[:-1]), given[-1][0]])
        raise DataError(f"expected one of {wanted}, got {' and '.join(names) or 'none'}")


def _endpoint(url: str | None) -> ChatEndpoint | None:
    """Return the language model at an address; None without one."""
    if url is None:
        return None
    from grounding.language.llm import ChatEndpoint

    return ChatEndpoint(url, os.environ.get("APPOCC_LLM_MODEL", "default"), os.environ.get("APPOCC_LLM_KEY"))


def _set_key_frame(
    grounder: Grounder,
    root: Path,
    scene: str | None,
    frame: int | None,
    bev: str,
    version: str | None,
    tracks: Path | None,
    images: bool,
) -> Frame:
    """Let a grounder look at a key frame of a dataset; what a camera saw of it, if images are wanted.

    Raises:
        DataError: if something is missing or damaged.
    """
    from appocc.bevmap import is_truth, load_map
    from appocc.nuscenes import Dataset
    from appocc.nuscenes.dataset import sample_at
    from tracking.io.nuscenes_tracks import read_key_frame

    if scene is None or frame is None:
        raise DataError("ROOT needs --scene and --frame")
    dataset = Dataset(root, version)
    sample = sample_at(dataset, dataset.scene(scene), frame)
    moment = dataset.frame(sample, images=images)
    made = load_map(root, bev, sample.token)
    if tracks is not None:
        grounder.set_scene(made, read_key_frame(tracks, sample.token), moment.world_from_ego)
    else:
        # What a model predicted is answered from what it predicted, never from annotations.
        grounder.set_scene(made, moment.boxes_ego if is_truth(bev) else None, moment.world_from_ego)
    return moment


def _set_map(
    grounder: Grounder,
    map_file: Path | None,
    scene: str | None,
    frame: int | None,
    tracks: Path | None,
) -> None:
    """Let a grounder look at a saved map and the vehicles that it shows.

    Raises:
        DataError: if the file is missing or damaged, or a scene is named beside it.
    """
    from appocc.bevmap import BEVMap

    if map_file is None or (scene, frame, tracks) != (None, None, None):
        raise DataError("--map goes without --scene, --frame and --tracks")
    bev = BEVMap.load(map_file)
    grounder.set_scene(bev)


def _lines(path: Path) -> list[str]:
    """The lines of a file of commands that are not empty.

    Raises:
        DataError: if it cannot be read, is no text, is too large, or holds none.
    """
    from appocc.files import read_file

    text = read_file(path, _MOST_BYTES)
    found = [line.strip() for line in text.decode(errors="replace").splitlines() if line.strip()]
    if not found:
        raise DataError(f"{path}: expected commands, one a line, got none")
    return found


def _asked() -> Iterator[str]:
    """What people type, until an empty line or the end of input.

    Raises:
        DataError: if standard input is closed.
    """
    if sys.stdin is None:
        raise DataError("--interactive: standard input is closed")
    while True:
        typer.echo("> ", nl=False, err=True)
        try:
            line = sys.stdin.readline(_MOST_BYTES)
        except UnicodeDecodeError as error:
            raise DataError(f"standard input: expected text ({error})") from error
        if not line.strip():
            return
        yield line.strip()


def _answer(
    grounder: Grounder, text: str, moment: Frame | None, explain: bool, as_json: bool, picture: Path | None
) -> int:
    """Answer one sentence; the exit code that it means."""
    from appocc.files import write_image
    from grounding.explain import explain_answer
    from grounding.visualization import draw_answer

    answer = grounder.ground(text)
    if picture is not None:
        write_image(picture, draw_answer(answer, moment, show_costs=explain))
    if as_json:
        emit(answer.to_dict())
    say(answer.text())
    if explain:
        say(explain_answer(answer))
    return answer.exit_code

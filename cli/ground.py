"""`appocc ground`: driving commands to goal cells."""

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
_ONLY_ROOT = "with --commands or --interactive, ROOT is the only argument"


def ground(
    text: Annotated[
        str | None,
        typer.Argument(
            metavar="TEXT",
            help="The command, such as 'park behind the silver car'; omit it with --commands or --interactive.",
            show_default=False,
        ),
    ] = None,
    root: Annotated[
        Path | None,
        typer.Argument(
            metavar="ROOT", help="Dataset root in the nuScenes schema; omit it with --map.", show_default=False
        ),
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    frame: Annotated[int | None, typer.Option("--frame", help="Number of the key frame, from 0.")] = None,
    bev: Annotated[
        str, typer.Option("--bev", help="Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name.")
    ] = "groundtruth",
    version: VersionOption = None,
    tracks: Annotated[
        Path | None,
        typer.Option("--tracks", help="Take the vehicles from nuScenes tracking results, such as those of `track`."),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="Rig (name or YAML file) with the size of the ego vehicle; default: 4.6 x 1.9 m."),
    ] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="One saved map (.npz), instead of ROOT, --scene and --frame.")
    ] = None,
    commands: Annotated[
        Path | None, typer.Option("--commands", help="File of commands, one per line, instead of TEXT.")
    ] = None,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="Prompt for commands until an empty line, instead of TEXT.")
    ] = False,
    lexicon: Annotated[
        Path | None, typer.Option("--lexicon", help="File of words to add to the built-in lexicon.")
    ] = None,
    llm: Annotated[
        str | None,
        typer.Option(
            "--llm",
            help="URL of a language model to ask first (chat completions; $APPOCC_LLM_MODEL, $APPOCC_LLM_KEY).",
        ),
    ] = None,
    trust_unseen: TrustUnseenOption = False,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Also print word categories and scores, and draw the goal costs."),
    ] = False,
    as_json: JsonOption = False,
    picture: Annotated[Path | None, typer.Option("--picture", help="Write a picture of the answer (.png).")] = None,
) -> None:
    """Ground a driving command: find the vehicle it means and the goal cell of the ego vehicle.

    One command: ground TEXT ROOT --scene S --frame K

    Several: ground ROOT --scene S --frame K, with --commands FILE or --interactive

    On one saved map: --map FILE instead of ROOT, --scene and --frame

    Exit 0: found; 2: not a command; 3: ambiguous, not found, or no free goal. Of several commands, the highest code.

    Example: appocc ground "stop behind the nearest white car" DATA --scene 002 --frame 10 --picture g.png
    """
    from appocc.ego_vehicle import EgoVehicle
    from appocc.rigs import read_rig
    from grounding import Grounder, GrounderConfig
    from grounding.pipeline import set_saved_map

    several = commands is not None or interactive
    if several and root is None and text is not None:
        root, text = Path(text), None
    _check_one(("TEXT", text), ("--commands", commands), ("--interactive", interactive or None))
    _check_one(("ROOT", root), ("--map", map_file), hint=_ONLY_ROOT if several else "")
    if picture is not None and text is None:
        raise DataError("--picture goes only with TEXT")
    ego = read_rig(rig).ego_vehicle if rig is not None else EgoVehicle()
    config = GrounderConfig(trust_unseen=trust_unseen)
    grounder = Grounder(lexicon=lexicon, llm=_endpoint(llm), config=config, ego=ego)
    key_frame = None
    if root is not None:
        if scene is None or frame is None:
            raise DataError("ROOT needs --scene and --frame")
        key_frame = _set_key_frame(
            grounder,
            root,
            scene,
            frame,
            bev=bev,
            version=version,
            tracks=tracks,
            images=picture is not None,
        )
    elif map_file is not None:
        if (scene, frame, tracks) != (None, None, None):
            raise DataError("--map goes without --scene, --frame and --tracks")
        set_saved_map(grounder, map_file)
    if text is not None:
        raise typer.Exit(_answer(grounder, text, key_frame, explain, as_json, picture))
    texts = _lines(commands) if commands else _typed_lines()
    raise typer.Exit(max((_answer(grounder, one, key_frame, explain, as_json, None) for one in texts), default=0))


def _check_one(*given: tuple[str, object], hint: str = "") -> None:
    """Check that exactly one of several alternatives is given.

    Raises:
        DataError: if none or several are given; the message ends with the hint.
    """
    names = [name for name, value in given if value is not None]
    if len(names) != 1:
        wanted = " and ".join([", ".join(name for name, _ in given[:-1]), given[-1][0]])
        got = " and ".join(names) or "none"
        raise DataError(f"expected one of {wanted}, got {got}" + (f"; {hint}" if hint else ""))


def _endpoint(url: str | None) -> ChatEndpoint | None:
    """Return the language model at an address; None without one."""
    if url is None:
        return None
    from grounding.language.llm import ChatEndpoint

    return ChatEndpoint(url, os.environ.get("APPOCC_LLM_MODEL", "default"), os.environ.get("APPOCC_LLM_KEY"))


def _set_key_frame(
    grounder: Grounder,
    root: Path,
    scene: str,
    frame: int,
    *,
    bev: str,
    version: str | None,
    tracks: Path | None,
    images: bool,
) -> Frame:
    """Open the dataset and set one of its key frames as the scene.

    Raises:
        DataError: if a file is missing or damaged.
        NotFoundError: if there is no such scene or key frame.
    """
    from appocc.nuscenes import Dataset
    from appocc.nuscenes.dataset import sample_at
    from grounding.pipeline import set_key_frame

    dataset = Dataset(root, version)
    sample = sample_at(dataset, dataset.scene(scene), frame)
    return set_key_frame(grounder, dataset, sample, bev, tracks=tracks, images=images)


def _lines(path: Path) -> list[str]:
    """Return the non-empty lines of a file of commands.

    Raises:
        DataError: if it cannot be read, is too large, or has no commands.
    """
    from appocc.files import read_file

    text = read_file(path, _MOST_BYTES)
    found = [line.strip() for line in text.decode(errors="replace").splitlines() if line.strip()]
    if not found:
        raise DataError(f"{path}: expected commands, one per line, got none")
    return found


def _typed_lines() -> Iterator[str]:
    """Prompt for lines until an empty one or the end of input.

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
    grounder: Grounder, text: str, key_frame: Frame | None, explain: bool, as_json: bool, picture: Path | None
) -> int:
    """Print the answer to one command, write its picture, and return its exit code."""
    from appocc.files import write_image
    from grounding.explain import explain_answer
    from grounding.visualization import draw_answer

    answer = grounder.ground(text)
    if picture is not None:
        write_image(picture, draw_answer(answer, key_frame, show_costs=explain))
    if as_json:
        emit(answer.to_dict())
    say(answer.text())
    if explain:
        say(explain_answer(answer))
    return answer.exit_code

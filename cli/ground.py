"""`appocc ground`: driving commands to goal cells."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from appocc.errors import DataError
from cli.common import (
    JsonOption,
    SceneOption,
    SourceOption,
    TrustUnseenOption,
    VersionOption,
    choose_scene,
    choose_source,
    emit,
    in_path,
    local_path,
    out_path,
    say,
)

if TYPE_CHECKING:
    from appocc.frame import Frame
    from grounding import Answer, Grounder, Session
    from grounding.language.llm import ChatEndpoint

_MOST_BYTES = 1_000_000
_QUIT = ("quit", "exit", "bye", "q")
_HELP = """\
Say a command: "park behind the white car", "follow the bus", "stop in 20 metres".
Answer a question: "the one on the left", "the closer one", "2".
Change the goal: "in front of it instead", "not that one", "a bit further", "closer", "two metres back".
Go on: "and then turn right". Ask: "where are you heading?", "why?". Drop it: "never mind".
help shows this text, quit ends the conversation."""
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
            metavar="ROOT",
            parser=in_path,
            help="Dataset root in the nuScenes schema; omit it with --map.",
            show_default=False,
        ),
    ] = None,
    scene: SceneOption = None,
    frame: Annotated[int | None, typer.Option("--frame", help="Number of the key frame, from 0.")] = None,
    bev: SourceOption = None,
    version: VersionOption = None,
    tracks: Annotated[
        Path | None,
        typer.Option(
            "--tracks",
            parser=in_path,
            help="Take the vehicles from nuScenes tracking results, such as those of `track`.",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="Rig (name or YAML file) with the size of the ego vehicle; default: 4.6 x 1.9 m."),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", parser=in_path, help="One saved map (.npz), instead of ROOT, --scene and --frame."),
    ] = None,
    commands: Annotated[
        Path | None,
        typer.Option("--commands", parser=in_path, help="File of commands, one per line, instead of TEXT."),
    ] = None,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="Hold a conversation, until 'quit', instead of TEXT.")
    ] = False,
    lexicon: Annotated[
        Path | None,
        typer.Option("--lexicon", parser=local_path, help="File of words to add to the built-in lexicon."),
    ] = None,
    llm: Annotated[
        str | None,
        typer.Option(
            "--llm",
            help="URL of a language model to ask where the grammar leaves words out (chat completions; "
            "$APPOCC_LLM_MODEL, $APPOCC_LLM_KEY).",
        ),
    ] = None,
    trust_unseen: TrustUnseenOption = False,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Also print word categories and scores, and draw the goal costs."),
    ] = False,
    as_json: JsonOption = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", parser=out_path, help="Write a picture of the answer (.png).")
    ] = None,
) -> None:
    """Ground a driving command: find the vehicle it means and the goal cell of the ego vehicle.

    One command: ground TEXT ROOT --scene S --frame K

    Several: ground ROOT --scene S --frame K, with --commands FILE or --interactive

    On one saved map: --map FILE instead of ROOT, --scene and --frame

    Exit 0: found; 2: not a command; 3: ambiguous, not found, or no free goal. Of several commands, the highest code;
    of a conversation, the last one.

    Example: appocc ground "stop behind the nearest parked white car" DATA --scene 002 --frame 10 --picture g.png
    """
    from appocc.ego_vehicle import EgoVehicle
    from appocc.files import write_image
    from appocc.rigs import read_rig
    from grounding import Grounder, GrounderConfig
    from grounding.pipeline import set_saved_map
    from grounding.visualization import draw_answer

    several = commands is not None or interactive
    if several and root is None and text is not None:
        root, text = in_path(text), None
    if text is not None and root is not None:
        _check_order(text, root)
    _check_one(("TEXT", text), ("--commands", commands), ("--interactive", interactive or None))
    _check_one(("ROOT", root), ("--map", map_file), hint=_ONLY_ROOT if several else "")
    if picture is not None and text is None:
        raise DataError("--picture goes only with TEXT")
    ego = read_rig(rig).ego_vehicle if rig is not None else EgoVehicle()
    config = GrounderConfig(trust_unseen=trust_unseen)
    grounder = Grounder(lexicon=lexicon, llm=_endpoint(llm), config=config, ego=ego)
    key_frame = None
    if root is not None:
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
        answer = grounder.ground(text)
        if picture is not None:
            write_image(picture, draw_answer(answer, key_frame, show_costs=explain))
        raise typer.Exit(_print(answer, explain, as_json))
    if commands is not None:
        raise typer.Exit(max(_print(grounder.ground(one), explain, as_json) for one in _lines(commands)))
    raise typer.Exit(_converse(grounder.session(), explain, as_json))


def _check_order(text: str, root: Path) -> None:
    """Check that the command comes before the dataset.

    Raises:
        DataError: if it is the other way round.
    """
    with suppress(OSError):  # a command may be too long for the name of a folder
        if Path(text).is_dir() and not root.is_dir():
            raise DataError(f"expected TEXT, then ROOT, got the folder {text} first")


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
    scene: str | None,
    frame: int | None,
    *,
    bev: str | None,
    version: str | None,
    tracks: Path | None,
    images: bool,
) -> Frame:
    """Open the dataset and set one of its key frames as the scene.

    Raises:
        DataError: if a file is missing or damaged, or a scene, frame or source must be chosen.
        NotFoundError: if there is no such scene or key frame.
    """
    from appocc.nuscenes import Dataset
    from appocc.nuscenes.dataset import sample_at
    from grounding.pipeline import set_key_frame

    dataset = Dataset(root, version)
    chosen = choose_scene(dataset, scene)
    if frame is None:
        last = len(dataset.samples(chosen)) - 1
        raise DataError(f"{root}: expected --frame, 0..{last} of scene '{chosen.name}'")
    sample = sample_at(dataset, chosen, frame)
    return set_key_frame(grounder, dataset, sample, choose_source(root, bev), tracks=tracks, images=images)


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


def _converse(session: Session, explain: bool, as_json: bool) -> int:
    """Hold a conversation with the lines of standard input; return the exit code of the last answer."""
    code = 0
    for line in _typed_lines():
        if line.casefold() in _QUIT:
            break
        if line.casefold() in ("help", "?"):
            say(_HELP)
        elif line:
            code = _print(session.say(line), explain, as_json)
    return code


def _typed_lines() -> Iterator[str]:
    """Prompt for lines until the end of input, on a terminal with line editing and history.

    Raises:
        DataError: if standard input is closed or is not text.
    """
    if sys.stdin is None:
        raise DataError("--interactive: standard input is closed")
    on_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    if on_terminal:
        with suppress(ImportError):  # not on every platform
            import readline  # noqa: F401 - gives input() line editing and history
    while True:
        try:
            line = input("> ") + "\n" if on_terminal else _read_line()
        except EOFError:
            return
        except UnicodeDecodeError as error:
            raise DataError(f"standard input: expected text ({error})") from error
        if not line:
            return
        yield line.strip()


def _read_line() -> str:
    """Prompt on standard error and read a line; '' at the end of input."""
    typer.echo("> ", nl=False, err=True)
    return sys.stdin.readline(_MOST_BYTES)


def _print(answer: Answer, explain: bool, as_json: bool) -> int:
    """Print an answer and return its exit code."""
    from grounding.explain import explain_answer

    if as_json:
        emit(answer.to_dict())
    say(answer.text())
    if explain:
        say(explain_answer(answer))
    return answer.exit_code

"""The older form of `appocc track`: an option for each kind of input instead of sub-commands."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from appocc.errors import AppoccError
from cli.common import JsonOption, TrustUnseenOption, VersionOption, in_path, local_path, out_path
from cli.track.detector_files import track_kitti_command, track_mot_command
from cli.track.options import ALL_SCORES, KITTI_MIN_SCORE, SmoothOption, VideoOption
from cli.track.scenes import track_detections_command, track_scene_command

# Hidden sub-command for the form without sub-commands.
OLDER_FORM = "older-form"
_BEV_HELP = "Source of the maps: ROOT/bev/SOURCE, or a folder with a slash in its name."

# The inputs of the older form, the options that each requires, and those that it allows.
_INPUTS = {
    "--bev": (("ROOT", "--scene"), ("--version", "--smooth", "--min-score", "--out", "--video", "--trust-unseen")),
    "--detections": (("ROOT", "--scene"), ("--version", "--smooth", "--min-score", "--out")),
    "--kitti": ((), ("--smooth", "--min-score", "--out")),
    "--mot": (("--fps",), ("--min-score", "--out")),
}


def track_older_form(
    root: Annotated[
        Path | None,
        typer.Argument(
            metavar="ROOT", parser=in_path, help="Dataset root in the nuScenes schema.", show_default=False
        ),
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Name or token of the scene.")] = None,
    bev: Annotated[str | None, typer.Option("--bev", help=_BEV_HELP)] = None,
    detections: Annotated[
        Path | None, typer.Option("--detections", parser=in_path, help="nuScenes detection results for the scene.")
    ] = None,
    kitti: Annotated[
        Path | None, typer.Option("--kitti", parser=local_path, help="Folder of KITTI sequences with detections.")
    ] = None,
    mot: Annotated[
        Path | None, typer.Option("--mot", parser=local_path, help="MOTChallenge detections of people.")
    ] = None,
    fps: Annotated[float | None, typer.Option("--fps", help="Frame rate of the --mot file.")] = None,
    smooth: SmoothOption = False,
    min_score: Annotated[
        float | None, typer.Option("--min-score", min=0.0, max=1.0, help="As in the sub-commands.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", parser=out_path, help="Output folder; defaults as in the sub-commands.")
    ] = None,
    video: VideoOption = None,
    trust_unseen: TrustUnseenOption = False,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track with one of --bev, --detections, --kitti and --mot: the older form of the sub-commands."""
    values = {
        **{"ROOT": root, "--scene": scene, "--bev": bev, "--detections": detections, "--kitti": kitti, "--mot": mot},
        **{
            "--fps": fps,
            "--smooth": smooth or None,
            "--min-score": min_score,
            "--out": out,
            "--video": video,
            "--version": version,
        },
        "--trust-unseen": trust_unseen or None,
    }
    _check_combination({name for name, value in values.items() if value is not None})
    score = ALL_SCORES if min_score is None else min_score
    if kitti is not None:
        track_kitti_command(kitti, smooth, KITTI_MIN_SCORE if min_score is None else min_score, out, as_json)
    elif mot is not None and fps is not None:
        track_mot_command(mot, fps, score, out, as_json)
    elif root is not None and scene is not None and detections is not None:
        track_detections_command(root, detections, scene, smooth, score, out, version, as_json)
    elif root is not None and scene is not None and bev is not None:
        track_scene_command(
            root,
            [scene],
            bev,
            smooth=smooth,
            min_score=score,
            out=out,
            video=video,
            trust_unseen=trust_unseen,
            version=version,
            as_json=as_json,
        )


def _check_combination(given: set[str]) -> None:
    """Check that there is one input with all required and only allowed options.

    Raises:
        AppoccError: if not.
    """
    inputs = [name for name in _INPUTS if name in given]
    if len(inputs) != 1:
        got = " and ".join(inputs) or "none"
        raise AppoccError(f"track: expected one of {_listed(_INPUTS)}, got {got}; see: appocc track --help")
    required, optional = _INPUTS[inputs[0]]
    missing = [name for name in required if name not in given]
    if missing:
        raise AppoccError(f"track: {inputs[0]} needs {_listed(required)}, got no {_listed(missing)}")
    extra = sorted(given - {*inputs, *required, *optional})
    if extra:
        allowed = _listed([*required, *optional, "--json"])
        raise AppoccError(f"track: {inputs[0]} goes only with {allowed}, got {_listed(extra)}")


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


class TrackGroup(TyperGroup):
    """Sub-commands; other arguments are those of the older form."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the hidden sub-command if the first argument is neither a sub-command nor `--help`."""
        if not args or args[0] not in {*self.commands, "--help"}:
            args = [OLDER_FORM, *args]
        return super().parse_args(ctx, args)

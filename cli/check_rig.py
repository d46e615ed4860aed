"""`appocc check-rig`: a picture that shows whether the cameras and the ego frame fit together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, VersionOption, emit, out_path, say
from cli.infer import RigOption, SourceArgument, inputs_of


def check_rig(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", parser=out_path, help="The picture to write (.png).")],
    scene: Annotated[str | None, typer.Option("--scene", help="Scene of ROOT; default: the first.")] = None,
    frame: Annotated[int, typer.Option("--frame", min=0, help="Number of the key frame or sub-folder, from 0.")] = 0,
    rig: RigOption = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Draw the ground grid of the ego frame into every image: x axis red, y axis green, horizon yellow.

    Lines are 5 m apart. With a correct rig they are flat on the street, with x+ ahead and y+ to the left.

    Example: appocc check-rig IMAGES --rig rig.yaml --out rig.png
    """
    from appocc.errors import NotFoundError
    from appocc.files import write_image
    from appocc.visualization.rig_check import camera_angles, rig_sheet

    inputs = inputs_of(source, rig, scene, version)
    if frame >= len(inputs):
        raise NotFoundError(f"{source}: it has frames 0..{len(inputs) - 1}, not {frame}")
    loaded = inputs[frame].read()
    write_image(out, rig_sheet(loaded.frame))
    poses = {camera.channel: camera_angles(camera) for camera in loaded.frame.rig}
    if as_json:
        emit(
            {
                "picture": str(out),
                "cameras": {name: pose._asdict() for name, pose in poses.items()},
                "dead": loaded.missing,
            }
        )
    for camera, reason in loaded.missing.items():
        say(f"{camera}: left out ({reason})")
    for name, pose in poses.items():
        say(f"{name}: {pose.text}")
    say(f"{out}: {inputs[frame].title}")

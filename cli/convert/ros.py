"""`appocc convert ros`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, local_path
from cli.convert.importing import HzOption, LogsOption, OutArgument, WorkersOption, chosen_logs, run_import
from cli.engine import LOCAL, ClusterOption, shared


def ros(
    src: Annotated[
        Path,
        typer.Argument(
            metavar="SRC",
            parser=local_path,
            help="A ROS 2 bag (folder with metadata.yaml, .mcap or .db3), or a folder of bags.",
        ),
    ],
    out: OutArgument,
    base_frame: Annotated[
        str | None,
        typer.Option(help="Frame of the vehicle: x ahead, y left, z up. Default: base_link, else base_footprint."),
    ] = None,
    height: Annotated[
        float, typer.Option(min=-10, max=10, help="Height of the base frame's origin above the road, metres.")
    ] = 0.0,
    odometry: Annotated[
        str | None,
        typer.Option(
            metavar="TOPIC|FRAME",
            help="Ego poses: a topic of nav_msgs/Odometry, or the fixed frame of tf, such as map. Default: the only "
            "topic, else tf.",
        ),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Only this camera; may be repeated. Default: all with a CameraInfo."),
    ] = None,
    lidar: Annotated[
        str | None, typer.Option(metavar="TOPIC", help="Topic of the sweeps. Default: the only PointCloud2.")
    ] = None,
    log: LogsOption = None,
    hz: HzOption = 2.0,
    workers: WorkersOption = 1,
    cluster: ClusterOption = LOCAL,
    as_json: JsonOption = False,
) -> None:
    """Convert ROS 2 bags: one scene a bag. The same command resumes.

    Cameras, LiDAR and poses are found by the types of their topics; what was found is printed.

    Example: appocc convert ros drive_0 OUT --odometry map
    """
    from appocc.importers.ros import Choice, find_logs

    choice = Choice(base_frame, height, odometry, lidar, tuple(camera or ()))
    logs = chosen_logs(find_logs(shared(cluster, src), hz, choice), log, src)
    settings = {"src": str(src.resolve()), "hz": hz, **choice.as_json()}
    run_import(logs, out, "ros", settings, workers, cluster, as_json)

"""`appocc track`: track vehicles through maps, or objects through the detections of a recording."""

from __future__ import annotations

import typer

from cli.track.detector_files import track_kitti_command, track_mot_command
from cli.track.older_form import OLDER_FORM, TrackGroup, track_older_form
from cli.track.scenes import track_detections_command, track_scene_command

app = typer.Typer(
    name="track",
    cls=TrackGroup,
    help="""Track the vehicles of a scene, or objects in the detections of a recording.

    Examples: appocc track scene DATA --scene 002 --bev groundtruth --video tracks.webm

    appocc track detections DATA results_nusc.json --scene scene-0103

    appocc track kitti KITTI --out results

    appocc track mot det.txt --fps 25 --out results

    The older form works too: appocc track DATA --scene 002 --bev groundtruth, or with --detections, --kitti or --mot.
    """,
)
app.command("scene")(track_scene_command)
app.command("detections")(track_detections_command)
app.command("kitti")(track_kitti_command)
app.command("mot")(track_mot_command)
app.command(OLDER_FORM, hidden=True)(track_older_form)

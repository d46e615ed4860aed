"""`appocc convert`: other recordings to the nuScenes schema."""

from __future__ import annotations

import typer

from cli.convert.argoverse import argoverse
from cli.convert.kitti import kitti
from cli.convert.own_cameras import images
from cli.convert.pandaset import pandaset
from cli.convert.ros import ros
from cli.convert.waymo import waymo

app = typer.Typer(name="convert", help="Convert recordings to the nuScenes schema.")
app.command()(pandaset)
app.command()(argoverse)
app.command()(kitti)
app.command()(waymo)
app.command()(ros)
app.command()(images)

"""Overview image of the demo: the camera images, and the predicted map beside the true one."""

from __future__ import annotations

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.checks import ByteArray
from appocc.frame import Frame
from appocc.visualization.canvas import PANELS
from appocc.visualization.predictions import figure_below_cameras, map_panel
from appocc.visualization.vehicle_marks import VehicleMarks


def overview(frame: Frame, predicted: BEVMap, exact: BEVMap, vehicles: VehicleMarks) -> ByteArray:
    """Return (H, W, 3) RGB: the images; below, the colours and the classes, predicted ones beside true ones.

    `vehicles` are those of the predicted map; the true ones are the annotated boxes of the frame.
    """
    true = VehicleMarks.of_boxes(frame.boxes_ego or Boxes.empty())
    ego = frame.rig.ego_vehicle
    rows = [
        [map_panel(predicted, what, vehicles, ego, "predicted: "), map_panel(exact, what, true, ego, "true: ")]
        for what in PANELS
    ]
    return figure_below_cameras(frame, predicted, rows)

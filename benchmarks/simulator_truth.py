"""Agreement of the simulator's ground truth with its images: boxes, LiDAR and the vehicle layer against ray hits.

Run: python -m benchmarks.simulator_truth [--town NAME ...] [--frames 6]
Three figures over frames of built-in towns: (a) the rectangle around a projected 3D box against that of the vehicle's
pixels, for unoccluded vehicles of at least 12 pixels, and that of the projected mesh, as a box has corners where a
car has none; (b) depth of LiDAR points without noise against that of a 1920x1080 image rendered from the position of
the LiDAR, away from edges; (c) cells of the layer vehicle against the outlines of the meshes from above.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.camera import Camera, CameraRig
from appocc.checks import BoolArray, FloatArray
from appocc.geometry import apply, inverse, transform
from appocc.grid import BEVGrid
from appocc.rigs import read_rig
from appocc.simulation.actors.assembling import assemble
from appocc.simulation.actors.paint import draw_paints
from appocc.simulation.mesh import Mesh
from appocc.simulation.rendering.lidar import EGO_FROM_LIDAR, LidarSweep, simulate_sweep
from appocc.simulation.rendering.lighting import EgoBody
from appocc.simulation.rendering.tracing import TOWN, Tracer
from appocc.simulation.rendering.views import CameraView
from appocc.simulation.rendering.weather import WEATHERS
from appocc.simulation.scenario import draw_scenario
from appocc.simulation.sources import TownSource, town_sources
from appocc.simulation.truth.objects import ActorBoxes, objects_near
from appocc.simulation.truth.occupancy import vehicle_cells
from appocc.simulation.truth.visibility import visible_shares

_LEAST_PX = 12


class TruthFrame(NamedTuple):
    """A frame to be checked; mesh and objects exclude the ego."""

    pose: FloatArray
    mesh: Mesh
    objects: ActorBoxes
    tracer: Tracer


def box_ious(frame: TruthFrame, rig: CameraRig, views: Mapping[str, CameraView]) -> list[tuple[float, float]]:
    """Return the IoU of the rectangle around each unoccluded vehicle's pixels with those around its box and mesh."""
    found: list[tuple[float, float]] = []
    vehicles = frame.objects.select(frame.objects.are_vehicles())
    for camera in rig:
        alone = CameraRig((camera,))
        shares = visible_shares(frame.tracer, frame.mesh, vehicles.number, alone, frame.pose)
        actor = views[camera.channel].actor
        for number, corners, share in zip(vehicles.number, vehicles.corners(), shares, strict=True):
            uv, depth = camera.project_ego(apply(inverse(frame.pose), corners))
            if share < 1 or not camera.sees(uv, depth).all() or np.ptp(uv, axis=0).min() < _LEAST_PX:
                continue
            row, column = np.nonzero(actor == number)
            if not len(row):
                found.append((0.0, 0.0))
                continue
            pixels = np.array([[column.min() - 0.5, row.min() - 0.5], [column.max() + 0.5, row.max() + 0.5]])
            mesh = frame.mesh.vertices_m[frame.mesh.faces[frame.mesh.tag == number]].reshape(-1, 3)
            shape, _ = camera.project_ego(apply(inverse(frame.pose), mesh.astype(np.float64)))
            box, hull = (np.array([points.min(axis=0), points.max(axis=0)]) for points in (uv, shape))
            found.append((rectangle_iou(box, pixels), rectangle_iou(hull, pixels)))
    return found


def rectangle_iou(one: FloatArray, two: FloatArray) -> float:
    """Return the IoU of rectangles (2, 2): lower and upper corner."""
    common = np.prod(np.clip(np.minimum(one[1], two[1]) - np.maximum(one[0], two[0]), 0, None))
    return float(common / (np.prod(one[1] - one[0]) + np.prod(two[1] - two[0]) - common))


def lidar_camera(yaw_rad: float, width_px: int = 1920, height_px: int = 1080) -> Camera:
    """Return a camera of 90 degrees at the position of the LiDAR: it sees LiDAR points without parallax."""
    focal = width_px / 2
    intrinsic = np.array([[focal, 0, (width_px - 1) / 2], [0, focal, (height_px - 1) / 2], [0, 0, 1.0]])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    right_down_ahead = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    return Camera("CAM_LIDAR", width_px, height_px, intrinsic, transform(right_down_ahead, EGO_FROM_LIDAR[:3, 3]))


def depth_errors(found: LidarSweep, camera: Camera, view: CameraView) -> FloatArray:
    """Return (M,) LiDAR depth minus image depth in metres, of points whose four pixels show one smooth surface.

    The inverse depth of a plane is linear in the image, so interpolation between pixel centres is exact.
    """
    uv, depth = camera.project_ego(apply(EGO_FROM_LIDAR, found.points[:, :3].astype(np.float64)))
    low = np.floor(np.nan_to_num(uv, nan=-9)).astype(np.int64)
    inside = (depth > 0.5) & (low >= 1).all(axis=1)
    inside &= (low < np.array([camera.width_px, camera.height_px]) - 2).all(axis=1)
    low, depth, share = low[inside], depth[inside], (uv - np.floor(uv))[inside]
    column, row = low.T
    smooth = _smooth(view)[row, column]
    column, row, depth, (a, b) = column[smooth], row[smooth], depth[smooth], share[smooth].T
    near = 1 / view.depth_m.astype(np.float64)
    upper = near[row, column] * (1 - a) + near[row, column + 1] * a
    lower = near[row + 1, column] * (1 - a) + near[row + 1, column + 1] * a
    return np.asarray(depth - 1 / (upper * (1 - b) + lower * b))


def _smooth(view: CameraView) -> BoolArray:
    """Return (H, W) whether the 4x4 pixels around a pixel's lower right corner show one surface without an edge."""
    with np.errstate(divide="ignore", invalid="ignore"):
        near = 1 / view.depth_m.astype(np.float64)
    flat = np.zeros(near.shape, np.bool_)
    across = np.abs(np.diff(near, 2, axis=1))[1:-1] < 2e-5 * near[1:-1, 1:-1]
    down = np.abs(np.diff(near, 2, axis=0))[:, 1:-1] < 2e-5 * near[1:-1, 1:-1]
    flat[1:-1, 1:-1] = across & down & (near[1:-1, 1:-1] > 0)
    good = flat.copy()
    for step in ((0, 1), (1, 0), (1, 1)):
        good &= np.roll(flat, (-step[0], -step[1]), axis=(0, 1))
    return good


def silhouettes(grid: BEVGrid, frame: TruthFrame, side: int = 4) -> NDArray[np.int32]:
    """Return (X, Y) index of the vehicle whose mesh covers half of a cell from above, by side x side rays."""
    step = (np.arange(side) + 0.5) / side
    x, y = grid.shape
    i, j = ((np.arange(n)[:, None] + step).ravel() for n in (x, y))
    places = np.stack(np.meshgrid(grid.x_min_m + i * grid.cell_m, grid.y_min_m + j * grid.cell_m, indexing="ij"), 2)
    town = places.reshape(-1, 2) @ frame.pose[:2, :2].T + frame.pose[:2, 3]
    origins = np.concatenate([town, np.full((len(town), 1), 20.0)], axis=1).astype(np.float32)
    down = np.tile(np.array([0, 0, -1], np.float32), (len(town), 1))
    hits = Tracer(frame.mesh).nearest(origins, down)
    vehicles = frame.objects.number[frame.objects.are_vehicles()]
    number = np.where(hits.source == TOWN, frame.mesh.tag[hits.face], -1)
    number[~np.isin(number, vehicles)] = -1
    cells = np.sort(number.reshape(x, side, y, side).transpose(0, 2, 1, 3).reshape(x, y, -1), axis=2)
    middle = cells[..., -side * side // 2]  # of at least half of the rays, or of none
    return np.where((cells == middle[..., None]).sum(axis=2) >= side * side / 2, middle, -1)


def mask_iou(one: BoolArray, two: BoolArray) -> tuple[int, int]:
    """Return the number of cells in both and in either."""
    return int((one & two).sum()), int((one | two).sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--town", action="append", default=[], help="built-in town; all where left out")
    parser.add_argument("--frames", type=int, default=6, help="frames of each town")
    parser.add_argument("--rig", default="paper")
    arguments = parser.parse_args()
    rig = read_rig(arguments.rig)
    ious: list[tuple[float, float]] = []
    errors: list[FloatArray] = []
    cells = np.zeros(2, np.int64)
    for source in town_sources("all", arguments.town):
        for frame, views, found, camera, view in _frames(source, arguments.frames, rig):
            ious += box_ious(frame, rig, views)
            errors.append(depth_errors(found, camera, view))
            grid = BEVGrid.surround()
            cells += mask_iou(vehicle_cells(grid, frame.pose, frame.objects) >= 0, silhouettes(grid, frame) >= 0)
        print(f"{source.name}: done", flush=True)
    error = np.abs(np.concatenate(errors))
    box, shape = np.median(ious, axis=0)
    print(f"(a) boxes: median IoU {box:.3f} of {len(ious)} vehicles; {shape:.3f} of the meshes")
    print(
        f"(b) LiDAR: {100 * (error < 0.01).mean():.2f} % of {len(error)} points within 1 cm of the image's depth, "
        f"median {1000 * np.median(error):.4f} mm, 99 % within {1000 * np.quantile(error, 0.99):.3f} mm"
    )
    print(f"(c) layer vehicle: IoU {cells[0] / cells[1]:.3f} with the meshes from above, {cells[1]} cells")


def _frames(
    source: TownSource, count: int, rig: CameraRig
) -> Iterator[tuple[TruthFrame, Mapping[str, CameraView], LidarSweep, Camera, CameraView]]:
    """Yield frames of random scenes of a town, with their views, exact LiDAR sweep, and an image from the LiDAR."""
    from appocc.simulation.recording import build_town_simulation, ego_pose

    simulation = build_town_simulation(source, Path())
    paints = draw_paints(simulation.log.actors, 0)
    for number in range(count):
        scenario = draw_scenario(number, source.name, simulation.log, 10.0, ("overcast",), 5)
        ego, state = simulation.log.actors[scenario.ego], simulation.log.state_at(scenario.start_s + 5.0)
        pose = ego_pose(ego, state, scenario.ego)
        mesh = assemble(simulation.log.actors, state, paints, pose[:2, 3], scenario.ego)
        lights = np.zeros(len(simulation.log.actors), np.uint8)
        signals = np.full(len(simulation.signal_column), ord("r"), np.uint8)
        simulation.renderer.set_scene(mesh, lights, signals, WEATHERS["overcast"], EgoBody(pose, ego.size_lwh_m))
        objects = objects_near(simulation.log.actors, state, pose[:2, 3], 80.0, scenario.ego)
        frame = TruthFrame(pose, mesh, objects, simulation.renderer.tracer)
        views = simulation.renderer.views(rig, pose, np.random.default_rng(0))
        found = simulate_sweep(frame.tracer, simulation.town, mesh, simulation.category, pose, None)
        camera = lidar_camera(2 * np.pi * number / count)
        view = simulation.renderer.views(CameraRig((camera,)), pose, np.random.default_rng(0))[camera.channel]
        yield frame, views, found, camera, view


if __name__ == "__main__":
    main()

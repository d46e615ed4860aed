"""CPU time of the simulator's renderer by stage.

Run: OMP_NUM_THREADS=1 python -m benchmarks.simulator [--town NAME] [--weather NAME] [--rig NAME] [--frames 12]
Renders frames spread over the town's traffic, each from a different car, and prints the median CPU milliseconds per
frame of each stage, the times of one-off work (town, renderer, the first frame with its compilation), thousands of
rays, and memory.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections import defaultdict
from collections.abc import Iterator

import cv2
import numpy as np

from appocc.checks import FloatArray
from appocc.rigs import read_rig
from appocc.simulation.actors.assembling import assemble
from appocc.simulation.actors.paint import ActorPaint, draw_paints
from appocc.simulation.build import build_town
from appocc.simulation.builtin import TRAIN_TOWNS, load_builtin
from appocc.simulation.mesh import Mesh
from appocc.simulation.recording import ego_pose
from appocc.simulation.rendering.lighting import EgoBody
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import WEATHERS, Weather
from appocc.simulation.traffic import TrafficLog


def sample_frames(log: TrafficLog, count: int) -> Iterator[tuple[float, int]]:
    """Yield times spread over the log, and a moving car at each."""
    for time_s in np.linspace(0.1, 0.9, count) * log.duration_s:
        state = log.state_at(float(time_s))
        moving = np.hypot(*state.velocity_mps.T) > 1
        cars = [int(n) for n, moves in zip(state.index, moving, strict=True) if moves and log.actors[n].kind == "car"]
        if cars:
            yield float(time_s), cars[len(cars) // 2]


def set_scene(
    renderer: Renderer, log: TrafficLog, paints: tuple[ActorPaint, ...], time_s: float, ego: int, weather: Weather
) -> FloatArray:
    """Set the scene of the renderer; return town_from_ego."""
    state = log.state_at(time_s)
    pose = ego_pose(log.actors[ego], state, ego)
    with renderer.profile.stage("assemble"):
        mesh: Mesh = assemble(log.actors, state, paints, pose[:2, 3], ego)
    lights = np.zeros(len(log.actors), np.uint8)
    lights[state.index] = state.lights
    renderer.set_scene(mesh, lights, state.signals, weather, EgoBody(pose, log.actors[ego].size_lwh_m))
    return pose


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--town", default=TRAIN_TOWNS[0])
    parser.add_argument("--weather", default="clear", choices=tuple(WEATHERS))
    parser.add_argument("--rig", default="paper")
    parser.add_argument("--frames", type=int, default=12)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rig, weather = read_rig(options.rig), WEATHERS[options.weather]
    started = time.process_time()
    plan, log = load_builtin(options.town)
    town, paints = build_town(plan), draw_paints(log.actors, 1)
    built = time.process_time()
    renderer = Renderer(town)
    print(f"{options.town}: town {built - started:.1f} s, renderer {time.process_time() - built:.1f} s", end="")
    stages: defaultdict[str, list[float]] = defaultdict(list)
    for number, (time_s, ego) in enumerate(sample_frames(log, options.frames + 1)):
        renderer.profile.clear()
        started = time.process_time()
        pose = set_scene(renderer, log, paints, time_s, ego, weather)
        renderer.views(rig, pose, np.random.default_rng(number))
        total = time.process_time() - started
        if number == 0:  # compiles, or loads compiled kernels
            print(f", first frame {total:.1f} s")
            continue
        for name, seconds in renderer.profile.cpu_s.items():
            stages[name].append(seconds)
        stages["all"].append(total)
        for name, rays in renderer.profile.count.items():
            stages[f"rays {name}"].append(rays / 1000)
    for name, values in stages.items():
        print(f"{name:14s}{np.median(values) * (1 if name.startswith('rays') else 1000):8.1f}")
    print(f"memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()

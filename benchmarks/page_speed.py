"""Time from a request of the page of `appocc serve` to its answer, and the memory of the server over a recording.

    OMP_NUM_THREADS=1 python -m benchmarks.page_speed ROOT [--bev SOURCE] [--most-frames N]

The application is called in this process, over HTTP without a network. The frames of the first scene are visited in
order, as a page that plays does; caches begin empty. CPU is the time of the processor, which other
processes on the machine hardly change.

- key frame: vehicles with trails, cameras and boxes as JSON.
- map, camera: the sheet of values of the map; a camera image 480 pixels wide.
- sentence, new scene: the first of a conversation, which loads the street map.
- sentence, new frame: after the conversation has followed to another frame; the scene is set anew.
- sentence, same frame: everything after that.
- follow: a new frame while a goal is in force, which is planned anew.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from starlette.testclient import TestClient

from benchmarks.tracking_speed import resident_mb
from cli.server.app import build_app
from cli.server.conversations import warm_up
from cli.server.library import Library

SENTENCES = (
    "stop next to the nearest car",
    "park behind the nearest silver car",
    "stop behind the white car",
    "pull over on the right",
    "turn left",
    "stop in 20 metres",
)


def measure(root: Path, source: str, most_frames: int) -> tuple[dict[str, list[tuple[float, float]]], list[float]]:
    """Return milliseconds (elapsed, CPU) of all requests by kind, and the resident megabytes after each frame."""
    taken: dict[str, list[tuple[float, float]]] = defaultdict(list)
    memory: list[float] = []
    with TestClient(build_app(Library([root])), base_url="http://localhost") as client:

        def timed(kind: str, method: str, address: str, **more: Any) -> Any:
            start, cpu = time.perf_counter(), time.process_time()
            answer = client.request(method, address, **more)
            taken[kind].append((1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - cpu)))
            answer.raise_for_status()
            return answer

        recording = client.get("/api/recordings").json()["recordings"][0]
        frames = min(recording["scenes"][0]["frames"], most_frames)
        warm_up()
        at = f"/api/recordings/{recording['key']}/0"
        talk = None
        for frame in range(frames):
            about = {"recording": recording["key"], "scene": 0, "source": source, "frame": frame}
            moment = timed("key frame", "GET", f"{at}/{frame}?source={source}").json()
            timed("map", "GET", f"{at}/{frame}/map.png?source={source}")
            for channel in moment["cameras"]:
                timed("camera", "GET", f"{at}/{frame}/cameras/{channel}?width=480")
            if talk is not None:
                timed("follow", "POST", "/api/talk", json={**about, "talk": talk})
            for number in range(len(SENTENCES)):
                kind = "new scene" if talk is None else "new frame" if number == 0 else "same frame"
                said = {**about, "talk": talk, "say": SENTENCES[(frame + number) % len(SENTENCES)]}
                talk = timed(f"sentence, {kind}", "POST", "/api/talk", json=said).json()["talk"]
            memory.append(resident_mb())
    return taken, memory


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--bev", default="predicted")
    parser.add_argument("--most-frames", type=int, default=1000)
    asked = parser.parse_args()
    taken, memory = measure(asked.root, asked.bev, asked.most_frames)
    table = Table("request", "number", "median ms", "95 % ms", "CPU median ms", "CPU 95 % ms")
    for kind, values in taken.items():
        shares = np.percentile(values, [50, 95], axis=0).T.ravel()
        table.add_row(kind, str(len(values)), *(f"{value:.0f}" for value in shares))
    console = Console(width=110)
    console.print(table)
    steps = memory[:: max(len(memory) // 8, 1)]
    console.print(f"resident MB over {len(memory)} frames: {' '.join(f'{value:.0f}' for value in steps)}")


if __name__ == "__main__":
    main()

"""Samples per minute and peak memory of `appocc groundtruth`, alternating between one process and two.

Run: python -m benchmarks.groundtruth ROOT [--scene NAME] [--rounds 3]
Memory is the proportional set size (PSS), summed over all processes and read four times a second.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def tree_memory_mb(pid: int) -> float:
    """Return the memory of a process tree in MB, with shared pages counted once; 0 if it has ended."""
    total = 0.0
    try:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                total += int(line.split()[1]) / 1024
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                total += tree_memory_mb(int(child))
    except (OSError, ValueError):
        pass  # the process ended meanwhile
    return total


def run_once(root: Path, scene: str | None, workers: int) -> tuple[float, float]:
    """Return samples per minute and peak memory in MB of one run without earlier results."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "cli.main", "groundtruth", str(root), "--out", out, "--json"]
        command += ["--workers", str(workers), *(["--scene", scene] if scene else [])]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        start, peak = time.monotonic(), 0.0
        while process.poll() is None:
            peak = max(peak, tree_memory_mb(process.pid))
            time.sleep(0.25)
        seconds = time.monotonic() - start
        made = json.loads(process.communicate()[0])["made"]
    return made / seconds * 60, peak


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("--scene")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    results: dict[int, list[tuple[float, float]]] = {1: [], 2: []}
    for _ in range(arguments.rounds):
        for workers, runs in results.items():
            runs.append(run_once(arguments.root, arguments.scene, workers))
    for workers, runs in results.items():
        rate = statistics.median(run[0] for run in runs)
        memory = max(run[1] for run in runs)
        print(f"{workers} process(es): {rate:.1f} samples a minute (median of {len(runs)}), peak {memory:.0f} MB")


if __name__ == "__main__":
    main()

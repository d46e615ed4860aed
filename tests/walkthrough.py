"""The README's lines, a real street's and a simulated town's, run as they stand there, once for all processes."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
# How the README names a published recording, and the arguments that read the plain copy of it in the data folder.
PUBLISHED = "pandaset/002 OUT --trust-pickles"
_PLAIN = "../shared/data/pandaset_002 OUT --lidar ../shared/data/pandaset_002_lidar"


def blocks(heading: str) -> list[str]:
    """The code blocks below a heading of the README."""
    text = README.read_text().split(f"\n{heading}\n", 1)[1].split("\n## ", 1)[0]
    return [block.strip() for block in re.findall(r"```\w*\n(.*?)```", text, flags=re.DOTALL)]


@dataclass(frozen=True)
class Walkthrough:
    """Where the lines ran, the lines, and for each its exit code and what it said on stderr."""

    folder: Path
    lines: tuple[str, ...]
    outcomes: tuple[tuple[int, str], ...]

    def failures(self) -> list[str]:
        """Lines that did not end with 0, with what they said."""
        ended = zip(self.lines, self.outcomes, strict=True)
        return [f"{line}: exit {code}: {said}" for line, (code, said) in ended if code]


def run_walkthrough(base: Path, heading: str, data: Path | None) -> Walkthrough:
    """Run a section's lines in `base`/repository, on the plain copy of the data; or take an earlier outcome."""
    folder = base / "repository"
    lines = tuple(blocks(heading)[0].splitlines())
    base.mkdir(exist_ok=True)
    with (base / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        record = base / "outcomes.json"
        if not record.is_file():
            folder.mkdir()
            if data is not None:
                (base / "shared").mkdir()
                (base / "shared" / "data").symlink_to(data.resolve())
            record.write_text(json.dumps([run_line(line.replace(PUBLISHED, _PLAIN), folder) for line in lines]))
        outcomes = tuple((int(code), str(said)) for code, said in json.loads(record.read_text()))
    return Walkthrough(folder, lines, outcomes)


def run_line(line: str, folder: Path) -> tuple[int, str]:
    """Run a line in a folder; its exit code and what it said on stderr."""
    words = shlex.split(line)
    assert words[0] == "appocc"
    environment = {**os.environ, "PYTHONPATH": str(README.parent)}
    command = [sys.executable, "-m", "cli.main", *words[1:]]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr

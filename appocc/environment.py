"""The environment: machine and packages, found without importing heavy packages."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path

# Parameters of glibc's mallopt (malloc.h).
_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4
_BFLOAT16_FLAGS = re.compile(r"\b(avx512_bf16|amx_bf16|bf16)\b")
_REQUIREMENT = re.compile(
    r"^(?P<name>[\w.-]+)\s*(?:>=\s*(?P<least>[\d.]+))?.*?(?:extra == ['\"](?P<extra>[\w-]+)['\"])?$"
)


@dataclass(frozen=True)
class Package:
    """A required package.

    Attributes:
        name: name of the distribution.
        least: minimum version; empty for any version.
        version: installed version; None if it is not installed.
    """

    name: str
    least: str
    version: str | None

    @property
    def complaint(self) -> str:
        """Problem with the package; '' if there is none."""
        if self.version is None:
            return f"{self.name} is not installed"
        if _numbers(self.version) < _numbers(self.least):
            return f"{self.name} {self.version} is too old, at least {self.least} is needed"
        return ""


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Machine and packages of this process.

    Attributes:
        appocc: version of appocc.
        python: version of Python.
        platform: operating system and processor.
        cores: processor cores that this process may use.
        memory_bytes: total memory; None if unknown.
        free_memory_bytes: available memory; None if unknown.
        free_disk_bytes: free space on the disk of the dataset or the current folder.
        gpu: name of the GPU; None if there is none.
        packages: required packages.
        extras: packages of each extra.
    """

    appocc: str
    python: str
    platform: str
    cores: int
    memory_bytes: int | None
    free_memory_bytes: int | None
    free_disk_bytes: int
    gpu: str | None
    packages: tuple[Package, ...]
    extras: dict[str, tuple[Package, ...]]

    @property
    def complaints(self) -> tuple[str, ...]:
        """Problems that keep appocc from working correctly."""
        found = [package.complaint for package in self.packages if package.complaint]
        if version_of("opencv-python"):
            # Both install the folder cv2/; the last one has overwritten the other.
            found.append(
                "opencv-python is installed as well as opencv-python-headless: uninstall both, install the latter"
            )
        return tuple(found)


def inspect_environment(folder: Path) -> Environment:
    """Inspect the environment of this process; the free disk space is that of `folder`."""
    packages, extras = required_packages(_requirements())
    total, free = memory()
    return Environment(
        appocc=version_of("appocc") or "not installed",
        python=platform.python_version(),
        platform=f"{platform.system()} {platform.machine()}",
        cores=cores(),
        memory_bytes=total,
        free_memory_bytes=free,
        free_disk_bytes=shutil.disk_usage(folder).free,
        gpu=gpu(),
        packages=packages,
        extras=extras,
    )


def version_of(name: str) -> str | None:
    """Return the version of an installed package; None if it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _requirements() -> list[str]:
    try:
        return metadata.requires("appocc") or []
    except metadata.PackageNotFoundError:
        return []


def required_packages(requirements: Sequence[str]) -> tuple[tuple[Package, ...], dict[str, tuple[Package, ...]]]:
    """Parse required packages and those of each extra, from lines such as `numpy>=2.0` or `av>=1; extra == "a"`."""
    required: list[Package] = []
    extras: dict[str, list[Package]] = {}
    for line in requirements:
        match = _REQUIREMENT.match(line)
        if match:
            package = Package(match["name"], match["least"] or "", version_of(match["name"]))
            (extras.setdefault(match["extra"], []) if match["extra"] else required).append(package)
    return tuple(required), {name: tuple(packages) for name, packages in extras.items()}


def _numbers(version: str) -> tuple[int, ...]:
    """Return the leading numbers of a version: 2.13.0+cpu -> (2, 13, 0)."""
    match = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in match[0].split(".")) if match else ()


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory(table: Path = Path("/proc/meminfo")) -> tuple[int | None, int | None]:
    """Return total and available memory in bytes on Linux; None elsewhere."""
    try:
        lines = dict(line.split(":", 1) for line in table.read_text().splitlines() if ":" in line)
        return tuple(int(lines[key].split()[0]) * 1024 for key in ("MemTotal", "MemAvailable"))  # type: ignore[return-value]
    except (OSError, KeyError, ValueError):
        return None, None


def gpu() -> str | None:
    """Return name and memory of the first NVIDIA GPU, or the name of Apple's GPU; None if there is neither."""
    if platform.system() == "Darwin" and platform.machine() == "arm64":
        return "Apple GPU"
    command = ["nvidia-smi", "--query-gpu=name,memory.total", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip().split("\n")[0] or None


def choose_cache_folders(package: Path) -> None:
    """Make numba and Matplotlib use a private temporary folder if their usual cache folders are not writable.

    Must be called before numba is imported. Numba caches compiled code next to a package's modules, or in the home.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    named = os.environ.get("NUMBA_CACHE_DIR")
    numba = any(_writable(folder) for folder in (*([Path(named)] if named else []), package, home))
    if numba and _writable(home):
        return
    folder = _private_folder()
    if folder is None:  # numba says so when it compiles
        return
    os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))
    if not numba:
        os.environ["NUMBA_CACHE_DIR"] = str(folder / "numba")
        print(f"compiled code is kept in {folder}: {package} and {home} cannot be written", file=sys.stderr)


def _writable(folder: Path) -> bool:
    """Return whether a folder is writable or can be created."""
    if not folder.is_absolute():  # a home that is not known
        return False
    there = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def _private_folder() -> Path | None:
    """A temporary folder of this user alone, as code that is found there is run; None where there is none."""
    if not hasattr(os, "getuid"):
        return None
    try:
        folder = Path(tempfile.gettempdir()) / f"appocc-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
    except OSError:
        return None
    private = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o077
    return folder if private and _writable(folder) else None


def keep_freed_memory() -> None:
    """Let the C library reuse freed memory instead of returning it to the system.

    New pages take 15 % of a training step on a CPU. Without effect on systems without glibc's `mallopt`.
    """
    with suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_M_MMAP_MAX, 0)
        library.mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)


@cache
def has_bfloat16(device: str) -> bool:
    """Return whether bfloat16 is fast on a device: GPUs since 2020, CPUs with instructions for it.

    Without such instructions it is emulated, and slower than float32.
    """
    if device == "cuda":
        import torch

        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return bool(_BFLOAT16_FLAGS.search(flags))

"""A packed dataset: pictures at the network's size and their truth in memory-mapped arrays, made once."""

from __future__ import annotations

import math
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from appocc.bevmap import bev_path, load_map
from appocc.errors import DataError
from appocc.files import read_json, write_json
from appocc.grid import BEVGrid
from appocc.models.input_images import channels_of
from appocc.models.model_spec import Setting
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample as Moment
from appocc.nuscenes.records import Scene
from appocc.nuscenes.simulated import weather_of
from appocc.nuscenes.view_targets import view_targets_path
from appocc.nuscenes.writer import whole_folder
from appocc.provenance import training_parts
from appocc.temporary import locked, made_folder
from appocc.training.reading import ARRAYS, Sample, layout, read_sample, source_of
from appocc.workers import in_order, worker_pool

__all__ = ["Pack", "Sample", "pack"]
VERSION = 3
_ABOUT = "pack.json"


@dataclass(frozen=True)
class Pack:
    """An opened pack; its arrays stay on disk.

    Attributes:
        folder: where it lies.
        setting: cameras, grid and size of pictures it was made for.
        channels: the cameras that the dataset has for it.
        grid: of the truth; contains the setting's.
        tokens: of each sample.
        scenes: name of the scene of each sample.
        towns: where each was recorded, '' where unknown.
        weathers: of each, as the simulator names it; '' where unknown.
        rows: where each lies in the arrays.
        arrays: by the names of `Sample`'s fields.
    """

    folder: Path
    setting: Setting
    channels: tuple[str, ...]
    grid: BEVGrid
    tokens: tuple[str, ...]
    scenes: tuple[str, ...]
    towns: tuple[str, ...]
    weathers: tuple[str, ...]
    rows: tuple[int, ...]
    arrays: Mapping[str, NDArray[Any]]

    @classmethod
    def open(cls, folder: Path) -> Pack:
        """Open a pack that `pack` made.

        Raises:
            DataError: if it is missing or damaged.
        """
        about = read_json(folder / _ABOUT)
        try:
            told = about["made_of"]["setting"]
            grid = BEVGrid.from_array(told["grid"])
            setting = Setting(told["name"], tuple(told["channels"]), grid, told["width_px"], told["height_px"])
            lists = {name: tuple(about[name]) for name in ("tokens", "scenes", "towns", "weathers")}
            channels = tuple(about["made_of"]["channels"])
            own = BEVGrid.from_array(about["grid"])
            arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in ARRAYS}
        except OSError as error:
            raise DataError(f"{folder}: damaged pack ({error.filename}: {error.strerror})") from error
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"{folder}: damaged pack ({error})") from error
        for name, (shape, dtype) in layout(len(lists["tokens"]), len(channels), setting, own).items():
            if (arrays[name].shape, arrays[name].dtype) != (shape, dtype):
                got = f"{arrays[name].shape} {arrays[name].dtype}"
                raise DataError(f"{folder / name}.npy: expected {shape} {np.dtype(dtype)}, got {got}")
        rows = tuple(range(len(lists["tokens"])))
        return cls(folder, setting, channels, own, **lists, rows=rows, arrays=arrays)

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.tokens)

    def sample(self, number: int) -> Sample:
        """A sample, read when it is looked at; the truth is on the pack's own grid (see `cropped`)."""
        parts = {name: np.asarray(self.arrays[name][self.rows[number]]) for name in ARRAYS}
        return Sample(**parts, grid=self.grid, channels=self.channels)

    def only(self, numbers: Sequence[int]) -> Pack:
        """Some of its samples."""
        names = ("tokens", "scenes", "towns", "weathers", "rows")
        picked: dict[str, Any] = {name: tuple(getattr(self, name)[n] for n in numbers) for name in names}
        return replace(self, **picked)

    def split(self, held_out: int) -> tuple[Pack, Pack]:
        """All but the last samples of each scene, and these, so many a scene."""
        left = Counter(self.scenes)
        kept: list[int] = []
        last: list[int] = []
        for number, scene in enumerate(self.scenes):
            (last if left[scene] <= held_out else kept).append(number)
            left[scene] -= 1
        return self.only(kept), self.only(last)


# Making one -------------------------------------------------------------------------------------------------------


def pack(
    root: Path | str,
    source: str,
    setting: Setting,
    out: Path,
    advance: Callable[[float], None] | None = None,
    tell: Callable[[str], None] | None = None,
    workers: int = 1,
) -> Pack:
    """Pack a dataset and open it; a pack of the same samples, maps and setting that is there already is kept.

    Depth and kind come from the dataset's `views` where it has them (the simulator's), else depth from the LiDAR
    sweep of the sample, if it has one: the nearest return of each block of 8x8 pixels. The cameras are those of
    the dataset that the setting uses (`channels_of`); a sample may lack some (they are dead in it), but not all.

    Args:
        root: of a dataset in the nuScenes schema.
        source: of the BEV maps (`appocc.bevmap`).
        setting: cameras, grid and size of the pictures.
        out: folder of the pack, written whole or not at all.
        advance: called with the samples done, in parts.
        tell: called with a line when a pack that is there is out of date or damaged and made anew,
            or another run is making it.
        workers: processes.

    Raises:
        DataError: if there are no samples, a map or camera is missing, a file is damaged, or `out` is no pack.
    """
    dataset = Dataset(root)
    moments = [(scene, moment) for scene in dataset.scenes for moment in dataset.samples(scene)]
    if not moments:
        raise DataError(f"{dataset.root}: no key frames to train on")
    channels = _channels(dataset, setting)
    made_of = _made_of(dataset, source, setting, channels, [moment for _, moment in moments])
    advance, tell = advance or (lambda done: None), tell or (lambda line: None)
    with suppress(DataError):
        if (kept := _kept(out, made_of)[0]) is not None:
            advance(len(kept))
            return kept
    try:
        with made_folder(out.parent), locked(out.with_name(f".{out.name}.lock"), out, tell):
            kept, reason = _kept(out, made_of)  # another run may have made it, or be about to
            if kept is not None:
                advance(len(kept))
                return kept
            if reason:
                tell(f"{out}: packed anew, {reason}")
                shutil.rmtree(out)
            _make(dataset, moments, out, made_of, setting, advance, workers)
    except OSError as error:
        raise DataError(f"{out}: cannot be written ({error.strerror or error})") from error
    return Pack.open(out)


def _make(
    dataset: Dataset,
    moments: Sequence[tuple[Scene, Moment]],
    out: Path,
    made_of: dict[str, Any],
    setting: Setting,
    advance: Callable[[float], None],
    workers: int,
) -> None:
    """Write a pack."""
    source, channels = made_of["source"], tuple(made_of["channels"])
    grid = load_map(dataset.root, source, moments[0][1].token).grid
    about = {
        "made_of": made_of,
        "grid": grid.as_array().tolist(),
        "tokens": [moment.token for _, moment in moments],
        "scenes": [scene.name for scene, _ in moments],
        "towns": [dataset.location(scene) for scene, _ in moments],
        "weathers": [weather_of(scene).replace(" ", "_") for scene, _ in moments],
    }
    sources = (source_of(dataset, moment, channels) for _, moment in moments)
    read = partial(read_sample, root=dataset.root, source=source, setting=setting, grid=grid)
    with whole_folder(out) as folder, worker_pool(workers) as pool:
        with ExitStack() as opened:
            arrays = {
                name: opened.enter_context(_array_file(folder / f"{name}.npy", shape, dtype))
                for name, (shape, dtype) in layout(len(moments), len(channels), setting, grid).items()
            }
            for sample in in_order(pool, read, sources, chunksize=4):
                for name in ARRAYS:
                    arrays[name].write(getattr(sample, name).tobytes())
                advance(1)
        write_json(folder / _ABOUT, about)


@contextmanager
def _array_file(path: Path, shape: tuple[int, ...], dtype: type[np.generic]) -> Iterator[BinaryIO]:
    """A new .npy file of an array of this shape, to which its rows are written one after the other.

    Not through a map of memory, where a full disk would kill the process. Its room on the disk is taken at once,
    where the system can, so that a disk that is too small is noticed before the work.
    """
    header = {"descr": npy.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
    with path.open("wb") as file:
        npy.write_array_header_1_0(file, header)
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, file.tell() + math.prod(shape) * np.dtype(dtype).itemsize)
        yield file


def _channels(dataset: Dataset, setting: Setting) -> tuple[str, ...]:
    """The cameras of a dataset that a setting uses.

    Raises:
        DataError: if there are none.
    """
    sensors, used = dataset.tables["sensor"], np.unique(dataset.tables.data_channel)
    names = sorted(sensors["channel"][row] for row in used if row >= 0 and sensors["modality"][row] == "camera")
    channels = channels_of(setting, names)
    if not channels:
        found = f"expected one of {', '.join(setting.channels)}, got {', '.join(names) or 'no camera'}"
        raise DataError(f"{dataset.root}: {found}")
    return channels


def _made_of(
    dataset: Dataset, source: str, setting: Setting, channels: tuple[str, ...], moments: Sequence[Moment]
) -> dict[str, Any]:
    """JSON values that change with whatever a pack is made of.

    Raises:
        DataError: if a sample has no map.
    """
    more = []
    for token in (moment.token for moment in moments):
        path = bev_path(dataset.root, source, token)
        if not path.is_file():
            load_map(dataset.root, source, token)  # its error says how maps are made
        more += [path, view_targets_path(dataset.root, token)]
    return {
        "version": VERSION,
        "root": str(dataset.root.resolve()),
        "source": source,
        "setting": {
            "name": setting.name,
            "channels": list(setting.channels),
            "grid": setting.grid.as_array().tolist(),
            "width_px": setting.width_px,
            "height_px": setting.height_px,
        },
        "channels": list(channels),
        **training_parts(dataset, moments, more),
    }


def _kept(out: Path, made_of: dict[str, Any]) -> tuple[Pack | None, str]:
    """The pack that lies there, if it was made of the same; of another one, why it cannot be used.

    Raises:
        DataError: if something else lies there.
    """
    if not out.is_dir() or not any(out.iterdir()):
        return None, ""
    if not (out / _ABOUT).is_file():
        raise DataError(f"{out}: expected a pack or a new folder, got a folder with something else in it")
    try:
        old = read_json(out / _ABOUT)["made_of"]
        changed = [key for key in made_of if old.get(key) != made_of[key]]
        if not changed:
            return Pack.open(out), ""
        return None, f"its {', '.join(changed)} changed"
    except (DataError, KeyError, TypeError, AttributeError) as error:
        return None, f"it is damaged: {error}"

"""Packed dataset: images at the network's input size with ground truth in memory-mapped arrays, made once."""

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
from appocc.models.input_images import select_channels
from appocc.models.model_spec import ModelSpec
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, Scene
from appocc.nuscenes.simulated import weather_of
from appocc.nuscenes.view_targets import view_targets_path
from appocc.nuscenes.writer import whole_folder
from appocc.provenance import training_parts
from appocc.temporary import locked, made_folder
from appocc.training.batches.reading import ARRAYS, PackedSample, array_layout, read_sample, sample_files
from appocc.workers import in_order, worker_pool

VERSION = 4
_INDEX = "pack.json"


@dataclass(frozen=True, kw_only=True, eq=False)
class PackedDataset:
    """A packed dataset opened for reading; its arrays stay on disk.

    Attributes:
        folder: folder of the arrays.
        setting: cameras, grid and image size that it was packed for.
        channels: cameras of the setting that the dataset has.
        grid: grid of the ground truth; contains the grid of the setting.
        tokens: token of each sample.
        scenes: scene name of each sample.
        towns: location of each sample, '' where unknown.
        weathers: weather of each simulated sample, '' where unknown.
        rows: row of each sample in the arrays.
        arrays: memory-mapped arrays by the names of the fields of `PackedSample`.
    """

    folder: Path
    setting: ModelSpec
    channels: tuple[str, ...]
    grid: BEVGrid
    tokens: tuple[str, ...]
    scenes: tuple[str, ...]
    towns: tuple[str, ...]
    weathers: tuple[str, ...]
    rows: tuple[int, ...]
    arrays: Mapping[str, NDArray[Any]]

    @classmethod
    def open(cls, folder: Path) -> PackedDataset:
        """Open a dataset packed by `pack_dataset`.

        Raises:
            DataError: if it is missing or damaged.
        """
        index = read_json(folder / _INDEX)
        try:
            kept = index["made_of"]["setting"]
            grid = BEVGrid.from_array(kept["grid"])
            setting = ModelSpec(kept["name"], tuple(kept["channels"]), grid, kept["width_px"], kept["height_px"])
            lists = {name: tuple(index[name]) for name in ("tokens", "scenes", "towns", "weathers")}
            channels = tuple(index["made_of"]["channels"])
            own_grid = BEVGrid.from_array(index["grid"])
            arrays = _mapped(folder)
        except OSError as error:
            raise DataError(f"{folder}: damaged packed dataset ({error.filename}: {error.strerror})") from error
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"{folder}: damaged packed dataset ({error})") from error
        for name, (shape, dtype) in array_layout(len(lists["tokens"]), len(channels), setting, own_grid).items():
            if (arrays[name].shape, arrays[name].dtype) != (shape, dtype):
                got = f"{arrays[name].shape} {arrays[name].dtype}"
                raise DataError(f"{folder / name}.npy: expected {shape} {np.dtype(dtype)}, got {got}")
        rows = tuple(range(len(lists["tokens"])))
        return cls(
            folder=folder, setting=setting, channels=channels, grid=own_grid, **lists, rows=rows, arrays=arrays
        )

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.tokens)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for another process, which maps the arrays itself instead of receiving a copy."""
        return {**self.__dict__, "arrays": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a state and map the arrays."""
        self.__dict__.update(state, arrays=_mapped(state["folder"]))

    def sample(self, number: int) -> PackedSample:
        """Return a sample on the grid of the packed dataset (see `crop`); its arrays are read on access."""
        parts = {name: np.asarray(self.arrays[name][self.rows[number]]) for name in ARRAYS}
        return PackedSample(**parts, grid=self.grid, channels=self.channels)

    def subset(self, numbers: Sequence[int]) -> PackedDataset:
        """Return some of the samples."""
        names = ("tokens", "scenes", "towns", "weathers", "rows")
        picked: dict[str, Any] = {name: tuple(getattr(self, name)[n] for n in numbers) for name in names}
        return replace(self, **picked)

    def split(self, held_out: int) -> tuple[PackedDataset, PackedDataset]:
        """Split off the last `held_out` samples of each scene: the others, and these."""
        remaining = Counter(self.scenes)
        kept: list[int] = []
        last: list[int] = []
        for number, scene in enumerate(self.scenes):
            (last if remaining[scene] <= held_out else kept).append(number)
            remaining[scene] -= 1
        return self.subset(kept), self.subset(last)


def _mapped(folder: Path) -> dict[str, Any]:
    return {name: np.load(folder / f"{name}.npy", mmap_mode="r", allow_pickle=False) for name in ARRAYS}


# Packing ----------------------------------------------------------------------------------------------------------


def pack_dataset(
    root: Path | str,
    source: str,
    setting: ModelSpec,
    out: Path,
    advance: Callable[[int, int], None] | None = None,
    on_message: Callable[[str], None] | None = None,
    workers: int = 1,
) -> PackedDataset:
    """Pack a dataset and open it; an existing packed dataset of the same inputs and setting is reused.

    Depth and class targets come from the dataset's `views` (simulated datasets have them); otherwise depth is the
    nearest LiDAR return in each block of 8 x 8 pixels. Cameras are those of the dataset that the setting uses
    (`select_channels`); a sample may lack some of them, but not all.

    Args:
        root: dataset root in the nuScenes schema.
        source: source of the BEV maps (`appocc.bevmap`).
        setting: cameras, grid and image size.
        out: folder of the packed dataset, written atomically.
        advance: progress callback with the numbers of samples that are packed and of all.
        on_message: called with a message if an outdated or damaged packed dataset is replaced, or another run is
            packing it.
        workers: number of processes.

    Raises:
        DataError: if there are no samples, a map or camera is missing, a file is damaged, or `out` has other content.
    """
    dataset = Dataset(root)
    samples = [(scene, sample) for scene in dataset.scenes for sample in dataset.samples(scene)]
    if not samples:
        raise DataError(f"{dataset.root}: no key frames to train on")
    channels = _channels(dataset, setting)
    made_of = _made_of(dataset, source, setting, channels, [sample for _, sample in samples])
    advance, on_message = advance or (lambda done, total: None), on_message or (lambda line: None)
    with suppress(DataError):
        if (kept := _reusable(out, made_of)[0]) is not None:
            advance(len(kept), len(kept))
            return kept
    try:
        with made_folder(out.parent), locked(out.with_name(f".{out.name}.lock"), out, on_message):
            kept, reason = _reusable(out, made_of)  # another run may have packed it in the meantime
            if kept is not None:
                advance(len(kept), len(kept))
                return kept
            if reason:
                on_message(f"{out}: packing again, {reason}")
                shutil.rmtree(out)
            _write(
                dataset=dataset,
                samples=samples,
                out=out,
                made_of=made_of,
                setting=setting,
                advance=advance,
                workers=workers,
            )
    except OSError as error:
        raise DataError(f"{out}: cannot be written ({error.strerror or error})") from error
    return PackedDataset.open(out)


def _write(
    dataset: Dataset,
    samples: Sequence[tuple[Scene, Sample]],
    out: Path,
    made_of: dict[str, Any],
    setting: ModelSpec,
    advance: Callable[[int, int], None],
    workers: int,
) -> None:
    """Write a packed dataset."""
    source, channels = made_of["source"], tuple(made_of["channels"])
    grid = load_map(dataset.root, source, samples[0][1].token).grid
    index = {
        "made_of": made_of,
        "grid": grid.as_array().tolist(),
        "tokens": [sample.token for _, sample in samples],
        "scenes": [scene.name for scene, _ in samples],
        "towns": [dataset.location(scene) for scene, _ in samples],
        "weathers": [weather_of(scene).replace(" ", "_") for scene, _ in samples],
    }
    files = (sample_files(dataset, sample, channels) for _, sample in samples)
    read = partial(read_sample, root=dataset.root, source=source, setting=setting, grid=grid)
    with whole_folder(out) as folder, worker_pool(workers) as pool:
        with ExitStack() as opened:
            arrays = {
                name: opened.enter_context(_array_file(folder / f"{name}.npy", shape, dtype))
                for name, (shape, dtype) in array_layout(len(samples), len(channels), setting, grid).items()
            }
            for number, packed in enumerate(in_order(pool, read, files, chunksize=4), start=1):
                for name in ARRAYS:
                    arrays[name].write(getattr(packed, name).tobytes())
                advance(number, len(samples))
        write_json(folder / _INDEX, index)


@contextmanager
def _array_file(path: Path, shape: tuple[int, ...], dtype: type[np.generic]) -> Iterator[BinaryIO]:
    """Create an .npy file of an array of this shape and yield it for writing the rows one after the other.

    A memory map would kill the process when the disk is full. Disk space is reserved first where the system supports
    it, so that a full disk is an error before the work starts.
    """
    header = {"descr": npy.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
    with path.open("wb") as file:
        npy.write_array_header_1_0(file, header)
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, file.tell() + math.prod(shape) * np.dtype(dtype).itemsize)
        yield file


def _channels(dataset: Dataset, setting: ModelSpec) -> tuple[str, ...]:
    """Return the cameras of a dataset that a setting uses.

    Raises:
        DataError: if there are none.
    """
    sensors, used = dataset.tables["sensor"], np.unique(dataset.tables.data_channel)
    names = sorted(sensors["channel"][row] for row in used if row >= 0 and sensors["modality"][row] == "camera")
    channels = select_channels(setting, names)
    if not channels:
        found = f"expected one of {', '.join(setting.channels)}, got {', '.join(names) or 'no camera'}"
        raise DataError(f"{dataset.root}: {found}")
    return channels


def _made_of(
    dataset: Dataset, source: str, setting: ModelSpec, channels: tuple[str, ...], samples: Sequence[Sample]
) -> dict[str, Any]:
    """Return JSON values that identify all inputs of a packed dataset.

    Raises:
        DataError: if a sample has no map.
    """
    more = []
    for token in (sample.token for sample in samples):
        path = bev_path(dataset.root, source, token)
        if not path.is_file():
            load_map(dataset.root, source, token)  # raises with the command that makes maps
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
        **training_parts(dataset, samples, more),
    }


def _reusable(out: Path, made_of: dict[str, Any]) -> tuple[PackedDataset | None, str]:
    """Return the existing packed dataset if it has the same inputs; otherwise the reason why it cannot be reused.

    Raises:
        DataError: if the folder has other content.
    """
    if not out.is_dir() or not any(out.iterdir()):
        return None, ""
    if not (out / _INDEX).is_file():
        raise DataError(f"{out}: expected a packed dataset or a new folder, got a folder with other files")
    try:
        old = read_json(out / _INDEX)["made_of"]
        changed = [key for key in made_of if old.get(key) != made_of[key]]
        if not changed:
            return PackedDataset.open(out), ""
        return None, f"its {', '.join(changed)} changed"
    except (DataError, KeyError, TypeError, AttributeError) as error:
        return None, f"it is damaged: {error}"

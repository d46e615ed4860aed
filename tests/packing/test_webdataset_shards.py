from __future__ import annotations

import json
import pickle
import tarfile
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_pack_source import contents, made_source
from tiny_dataset import TinyDataset
from typer.testing import CliRunner

from appocc.bevmap import BEVMap
from appocc.errors import DataError
from appocc.packing.frames import PackSource
from appocc.packing.webdataset_shards import pack_webdataset
from cli.main import app

ENDINGS = ["cam_back.jpg", "cam_front.jpg", "rig.json", "map.npz", "objects.json"]


@pytest.fixture
def source(tiny: TinyDataset) -> PackSource:
    return made_source(tiny)


class Pickling:
    """An engine whose jobs and items travel as to another process."""

    def in_order(self, job: Callable[[Any], Any], items: Iterable[Any], chunksize: int = 1) -> Iterator[Any]:
        for item in items:
            run, given = pickle.loads(pickle.dumps((job, item)))
            yield run(given)


def pack(source: PackSource, out: Path, shard_bytes: int = 10**9, engine: Any = None) -> list[Path]:
    return pack_webdataset(source, source.key_frames(), out, shard_bytes, engine, lambda count: None)


def members_of(shard: Path) -> list[tarfile.TarInfo]:
    with tarfile.open(shard) as archive:
        return archive.getmembers()


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")  # not ours
def test_shards_are_read_by_webdataset(source: PackSource, tmp_path: Path) -> None:
    wds = pytest.importorskip("webdataset", reason="the extra hub is not installed")
    (shard,) = pack(source, tmp_path / "out")
    samples = list(wds.WebDataset(str(shard), shardshuffle=False))
    assert [sample["__key__"] for sample in samples] == ["00000000", "00000001", "00000002"]
    dataset = source.dataset
    for sample, wanted in zip(samples, dataset.samples(dataset.scenes[0]), strict=True):
        for channel, path in source.picture_paths(wanted).items():
            assert sample[f"{channel.lower()}.jpg"] == path.read_bytes()
        assert sample["map.npz"] == source.map_path(wanted).read_bytes()
        rig, frame = json.loads(sample["rig.json"]), dataset.frame(wanted, images=False)
        assert (rig["token"], rig["scene"], rig["timestamp_us"]) == (wanted.token, "scene-tiny", wanted.timestamp_us)
        for camera, own in zip(rig["cameras"], frame.rig.cameras, strict=True):
            assert f"{camera['channel'].lower()}.jpg" == camera["file"] in sample
            np.testing.assert_array_equal(camera["ego_from_cam"], own.ego_from_cam)
            np.testing.assert_array_equal(camera["intrinsic"], own.intrinsic)
        objects, boxes = json.loads(sample["objects.json"]), frame.boxes_ego
        assert boxes is not None
        assert [each["category"] for each in objects] == list(boxes.category)
        np.testing.assert_array_equal([each["centre_m"] for each in objects], boxes.centre_m)
    decoded = list(wds.WebDataset(str(shard), shardshuffle=False).decode("rgb8"))
    assert decoded[2]["cam_front.jpg"].shape == (*dataset.frame(wanted).images["CAM_FRONT"].shape[:2], 3)


def test_shards_have_the_layout_that_hugging_face_reads(source: PackSource, tmp_path: Path) -> None:
    (shard,) = pack(source, tmp_path / "out")
    assert list(contents(tmp_path / "out")) == ["shard-000000.tar"]  # a visible JSON file would be taken for data
    members = members_of(shard)
    split = [tuple(member.name.split(".", 1)) for member in members]
    groups = [[ending for _, ending in group] for _, group in groupby(split, key=lambda each: each[0])]
    assert groups == [ENDINGS] * 3
    assert {(member.mtime, member.uid, member.gid, member.uname, member.mode) for member in members} == {
        (0, 0, 0, "", 0o644)
    }


def test_the_size_of_shards_is_bounded_and_the_engine_changes_nothing(source: PackSource, tmp_path: Path) -> None:
    scene = source.dataset.scenes[0]
    first = source.dataset.samples(scene)[0]
    size = sum(path.stat().st_size for path in [*source.picture_paths(first).values(), source.map_path(first)])
    shards = pack(source, tmp_path / "two", shard_bytes=2 * size)
    assert [len(members_of(shard)) for shard in shards] == [10, 5]
    assert len(pack(source, tmp_path / "one", shard_bytes=1)) == 3
    pack(source, tmp_path / "elsewhere", shard_bytes=2 * size, engine=Pickling())
    assert contents(tmp_path / "elsewhere") == contents(tmp_path / "two")


def test_an_interrupted_pack_resumes_with_the_same_bytes(source: PackSource, tmp_path: Path) -> None:
    def interrupt(count: float) -> None:
        if count:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pack_webdataset(source, source.key_frames(), tmp_path / "out", 1, None, interrupt)
    assert not (tmp_path / "out").exists()
    (kept,) = tmp_path.glob(".out.unfinished/scenes/*/*.tar")
    before = kept.stat().st_ino
    counts: list[float] = []
    shards = pack_webdataset(source, source.key_frames(), tmp_path / "out", 1, None, counts.append)
    assert counts == [1, 1, 1]
    assert shards[0].stat().st_ino == before
    pack(source, tmp_path / "at-once", 1)
    assert contents(tmp_path / "out") == contents(tmp_path / "at-once")
    assert pack(source, tmp_path / "out", 1) == shards  # finished already
    with pytest.raises(DataError, match="out: holds a pack with other settings \\(shard_bytes\\)"):
        pack(source, tmp_path / "out", 2)


def test_damaged_files_are_named_and_nothing_is_left(source: PackSource, tmp_path: Path) -> None:
    sample = source.dataset.samples(source.dataset.scenes[0])[1]
    path = source.picture_paths(sample)["CAM_FRONT"]
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(DataError, match=f"{path.name}: the image is truncated"):
        pack(source, tmp_path / "out")
    path.unlink()
    with pytest.raises(DataError, match=f"{path.name}: cannot be read"):
        pack(source, tmp_path / "out")
    assert not list(tmp_path.glob("*out*"))
    path.write_bytes(data)
    source.map_path(sample).write_bytes(b"PK")
    with pytest.raises(DataError, match="damaged BEV map"):
        pack(source, tmp_path / "out")
    source.map_path(sample).unlink()
    with pytest.raises(DataError, match="no BEV map"):
        pack(source, tmp_path / "out")


def test_the_command_packs_both_formats(source: PackSource, tmp_path: Path) -> None:
    for form, files in (("webdataset", ["shard-000000.tar"]), ("coco-panoptic", ["panoptic.json"])):
        out = tmp_path / form
        arguments = [
            "pack",
            str(source.dataset.root),
            "--format",
            form,
            "--out",
            str(out),
            "--workers",
            "1",
            "--json",
        ]
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        assert json.loads(result.stdout) == {"folder": str(out), "samples": 3, "files": files}
        assert "3 key frames in " in result.stderr


def test_the_map_in_a_shard_is_a_map(source: PackSource, tmp_path: Path) -> None:
    (shard,) = pack(source, tmp_path / "out")
    with tarfile.open(shard) as archive:
        archive.extract("00000002.map.npz", tmp_path, filter="data")
    assert BEVMap.load(tmp_path / "00000002.map.npz").grid.shape == (16, 16)

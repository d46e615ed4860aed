"""URLs in worker processes, on Dask workers, in the page and in training."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from dask_processes import DaskProcesses, process
from made_model import AROUND, save_road_everywhere
from s3_server import S3Server
from tiny_dataset import TinyDataset, token

from appocc.cluster import connected
from appocc.errors import AppoccError
from appocc.files import path_of, read_file, write_bytes
from appocc.training.batches.packed_dataset import pack_dataset
from appocc.workers import in_order, worker_pool
from cli.server.library import Library
from cli.server.pictures import camera_jpeg
from cli.server.recording import Place


def test_worker_processes_make_their_own_connections(s3: S3Server) -> None:
    s3.client().create_bucket(Bucket="made")
    paths = [path_of(f"s3://made/{number}") for number in range(5)]
    for path in paths:
        write_bytes(path, path.name.encode())
    with worker_pool(2) as pool:
        assert list(in_order(pool, read_file, paths)) == [path.name.encode() for path in paths]


@pytest.mark.slow
def test_dask_workers_share_a_bucket(s3: S3Server, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    s3.client().create_bucket(Bucket="made")
    write_bytes("s3://made/a", b"1")
    with ExitStack() as opened:
        dask = DaskProcesses(tmp_path, lambda *each: opened.enter_context(process(*each)))
        dask.add_worker("--no-nanny")
        with connected(dask.address, 1, path_of("s3://made/new/bev")) as cluster:
            assert list(cluster.in_order(read_file, [path_of("s3://made/a")] * 2)) == [b"1", b"1"]
        with (
            pytest.raises(AppoccError, match=r"s3://none/\.appocc-\w+: cannot be written \(no such bucket\)"),
            connected(dask.address, 1, path_of("s3://none")),
        ):
            pass
    assert list(s3.contents("made")) == ["a"]  # the probe is removed


def test_the_page_opens_a_bucket(s3: S3Server, tiny: TinyDataset) -> None:
    save_road_everywhere(tiny)
    root = s3.put(tiny.root, "data")
    (recording,) = Library([path_of(root)]).recordings()
    assert (recording.title, recording.sources(), recording.truth()) == ("data", ["exact"], "exact")
    assert recording.bev(Place(0, 1, "exact")).meta == {}
    path = recording.image_path(0, 0, "CAM_FRONT")
    assert camera_jpeg(path, 480)[:2] == b"\xff\xd8"


def test_a_bucket_is_packed_for_training(s3: S3Server, tiny: TinyDataset, tmp_path: Path) -> None:
    save_road_everywhere(tiny)
    root = s3.put(tiny.root, "data")
    remote, local = (
        pack_dataset(each, "exact", AROUND, tmp_path / name) for name, each in (("a", root), ("b", tiny.root))
    )
    assert remote.tokens == local.tokens == tuple(token("sample", i) for i in range(3))
    for name, array in local.arrays.items():
        assert np.array_equal(array, remote.arrays[name], equal_nan=array.dtype.kind == "f"), name
    s3.requests.clear()
    assert pack_dataset(root, "exact", AROUND, tmp_path / "a").tokens == local.tokens
    assert not [request for request in s3.requests if request.startswith("GET /data/samples")]

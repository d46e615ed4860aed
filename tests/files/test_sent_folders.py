"""Datasets that are written on this machine and sent to a bucket: the same bytes, resumable, found when whole."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from s3_server import S3Server

from appocc.errors import DataError
from appocc.files import RemotePath, StoreError, path_of, write_bytes, write_image
from appocc.files.transfer import working_folder
from appocc.nuscenes import Dataset
from appocc.nuscenes.assembly import Assembly, resolved
from appocc.nuscenes.writer import Writer, token_of, whole_folder

SCENES = ("one", "two")


def write_scene(writer: Writer, name: str) -> None:
    """A scene of one sample with a picture."""
    write_image(writer.root / f"samples/CAM/{name}.jpg", np.full((4, 6, 3), 9, np.uint8))
    log, sample, scene = token_of("log"), token_of("sample", name), token_of("scene", name)
    writer.add("log", log, logfile="l", vehicle="v", date_captured="2020-01-01", location="nowhere")
    writer.add("sample", sample, timestamp=1, scene_token=scene, prev="", next="")
    camera = writer.add_sensor(name, "CAM", np.eye(4), np.eye(3))
    writer.add_file(sample, "CAM", camera, np.eye(4), 1, f"samples/CAM/{name}.jpg", (6, 4))
    writer.add_scene(name, "", log, [sample])


def assemble(out: Path, settings: int = 1) -> bool:
    """Assemble a dataset of two scenes; False if it is there."""
    assembly = Assembly(resolved(out), "v1.0-made", "made.json", {"made": settings}, "test")
    if assembly.is_finished():
        return False
    with assembly.opened():
        for name in SCENES:
            if not assembly.has(name):
                assembly.write(name, partial(write_scene, name=name))
        assembly.finish(SCENES)
    return True


def test_an_assembled_dataset_is_sent_whole_and_resumed(s3: S3Server, tmp_path: Path) -> None:
    s3.client().create_bucket(Bucket="made")
    out = path_of("s3://made/set")
    assert isinstance(out, RemotePath)
    assert assemble(tmp_path / "set")
    local = {f"set/{p.relative_to(tmp_path / 'set')}": p for p in (tmp_path / "set").rglob("*") if p.is_file()}

    def refuse(environ: dict[str, Any]) -> tuple[str, list[tuple[str, str]], bytes] | None:
        refused = environ["REQUEST_METHOD"] == "PUT" and environ["PATH_INFO"].endswith("map.json")
        return ("403 Forbidden", [("Content-Length", "0")], b"") if refused else None

    s3.faults.append(refuse)
    with pytest.raises(StoreError, match=r"s3://made/set/v1\.0-made/map\.json: cannot be written"):
        assemble(out)
    s3.faults.clear()
    part = s3.contents("made")
    assert 0 < len(part) < len(local)
    assert not [key for key in part if key.endswith("sample_data.json")]
    with pytest.raises(DataError, match="no nuScenes-schema dataset"):
        Dataset(out)
    with pytest.raises(DataError, match=r"left by a run with other settings \(made\)"):
        assemble(out, settings=2)
    assert assemble(out)
    assert s3.contents("made") == {name: path.read_bytes() for name, path in local.items()}
    assert [scene.name for scene in Dataset(out).scenes] == list(SCENES)
    assert not assemble(out)
    with pytest.raises(DataError, match=r"s3://made/set: holds a test with other settings \(made\)"):
        assemble(out, settings=2)
    assert not list(working_folder(out).parent.iterdir())


def test_a_converted_folder_is_sent_whole_or_not_at_all(s3: S3Server) -> None:
    s3.client().create_bucket(Bucket="made")
    out = path_of("s3://made/set")

    def convert(fails: bool) -> None:
        with whole_folder(out) as folder:
            for name in ("v/sample_data.json", "v/a.json", "z.jpg"):
                write_bytes(folder / name, name.encode())
            if fails:
                raise RuntimeError

    with pytest.raises(RuntimeError):
        convert(fails=True)
    assert not s3.contents("made")
    s3.requests.clear()
    convert(fails=False)
    assert s3.contents("made", "set/") == {
        f"set/{n}": n.encode() for n in ("v/sample_data.json", "v/a.json", "z.jpg")
    }
    assert [request for request in s3.requests if request.startswith("PUT")][-1].endswith("sample_data.json")
    with pytest.raises(DataError, match="s3://made/set: exists already; name a new folder"):
        convert(fails=False)

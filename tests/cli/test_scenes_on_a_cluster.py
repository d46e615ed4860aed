"""Evaluation and tracking of several scenes by two Dask workers: the bytes of a local run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from dask_processes import DaskProcesses, process
from made_scene import add_second_scene, with_maps, with_objects
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import bev_path
from appocc.errors import DataError
from cli.main import app


@pytest.fixture
def street(tiny: TinyDataset) -> TinyDataset:
    """Two scenes with true maps, and with objects in maps of a model."""
    add_second_scene(tiny)
    with_objects(with_maps(tiny))
    return tiny


@pytest.fixture
def two_workers(tmp_path: Path) -> Iterator[str]:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with ExitStack() as opened:
        dask = DaskProcesses(tmp_path, lambda *each: opened.enter_context(process(*each)))
        for _ in range(2):
            dask.add_worker("--no-nanny")
        yield dask.address


def run(*words: object) -> Result:
    return CliRunner().invoke(app, list(map(str, words)))


def output(*words: object) -> str:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result.stdout


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.*")}


def test_the_cluster_gives_the_bytes_of_a_local_run(
    street: TinyDataset, two_workers: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Paths are relative here: the workers have another working folder."""
    monkeypatch.chdir(street.root.parent)
    on_cluster, root = ("--cluster", two_workers), street.root.name
    maps = ("eval", "bev", root, "--bev", f"{root}/bev/model", "--json")
    assert (local := output(*maps)) == output(*maps, *on_cluster)
    assert (json.loads(local)["scenes"], json.loads(local)["samples"]) == (2, 6)
    detections = ("eval", "detections", root, "--bev", f"{root}/bev/model", "--json")
    assert output(*detections) == output(*detections, *on_cluster)
    tracks = ("track", "scene", root, "--bev", f"{root}/bev/model", "--smooth", "--json", "--out", "tracks")
    local, here = output(*tracks), files(tmp_path / "tracks")
    assert local == output(*tracks, *on_cluster)
    assert here == files(tmp_path / "tracks")
    assert {Path(name).parent.name for name in here} == {"scene-tiny", "scene-second"}
    one = ("--scene", "scene-tiny")
    assert output(*tracks, *one) == output(*tracks, *one, *on_cluster)

    bev_path(street.root, "model", token("sample", 1)).unlink()
    failed = run("track", "scene", street.root, "--bev", "model", *on_cluster)
    assert isinstance(failed.exception, DataError)
    assert "no BEV map" in str(failed.exception)


def test_all_scenes_are_tracked_and_their_scores_pooled(street: TinyDataset) -> None:
    result = run("track", "scene", street.root, "--bev", "groundtruth", "--json")
    answer: dict[str, Any] = json.loads(result.stdout)
    assert list(answer) == ["bev", "scenes", "metrics", "metrics_moving", "metrics_parked"]
    assert [each["scene"] for each in answer["scenes"]] == ["scene-tiny", "scene-second"]
    assert [each["metrics"]["GT"] for each in answer["scenes"]] == [3, 3]
    assert (answer["metrics"]["GT"], answer["metrics"]["MOTA"], answer["metrics"]["IDF1"]) == (6, 1.0, 1.0)
    assert "2 scenes: 2 tracks in 6 key frames" in result.stderr
    folder = street.root / "tracks" / "groundtruth"
    assert {path.name for path in folder.iterdir()} == {"scene-tiny", "scene-second"}
    pooled = json.loads(output("eval", "tracks", "--gt", street.root, "--tracks", folder, "--json", "--kind", "car"))
    assert pooled["metrics"]["MOTA"] == 1.0
    alone = json.loads(
        output("track", "scene", street.root, "--bev", "groundtruth", "--scene", "scene-tiny", "--json")
    )
    assert alone == {"scene": "scene-tiny", "bev": "groundtruth"} | {
        key: value for key, value in answer["scenes"][0].items() if key != "scene"
    }


def test_scenes_without_key_frames_are_skipped(street: TinyDataset) -> None:
    second = street.tables["scene"][1]["token"]
    for name in ("sample", "sample_data", "sample_annotation"):
        street.tables[name] = [row for row in street.tables[name] if not row["token"].endswith("2")]
    street.write()
    assert "scene-tiny" in output("track", "scene", street.root, "--bev", "groundtruth", "--json")
    empty = run("track", "scene", street.root, "--bev", "groundtruth", "--scene", second)
    assert "no key frames (scenes: scene-second)" in str(empty.exception)


def test_a_video_shows_one_scene(street: TinyDataset, tmp_path: Path) -> None:
    result = run("track", "scene", street.root, "--bev", "groundtruth", "--video", tmp_path / "t.webm")
    assert "expected --video with one --scene and without --cluster, got 2 scenes" in str(result.exception)
    assert not (street.root / "tracks").exists()

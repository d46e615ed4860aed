"""`appocc view`: what it writes is read back with Rerun's and MCAP's own readers."""

from __future__ import annotations

import json
import resource
import signal
import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_street_maps import CAR_RGB, STREET_RGB, write_street_maps
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from tiny_dataset import HEIGHT_PX, INTRINSIC, START_US, STEP_US, WIDTH_PX, TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import bev_path
from appocc.errors import AppoccError, DataError
from cli.main import app

TIMES_US = [START_US + i * STEP_US for i in range(3)]


@pytest.fixture
def street(tiny: TinyDataset) -> TinyDataset:
    """The tiny dataset with ground-truth maps."""
    return write_street_maps(tiny)


def run(root: Path, *more: str) -> Result:
    return CliRunner().invoke(app, ["view", str(root), *more])


# Rerun ------------------------------------------------------------------------------------------------------------


def rerun_rows(path: Path) -> dict[str, list[dict[str, Any]]]:
    """The rows of each entity of a recording, in order of the frame."""
    from rerun.chunk import RrdReader

    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for chunk in RrdReader(path).stream():
        rows[chunk.entity_path] += chunk.to_record_batch().to_pylist()
    return {name: sorted(each, key=lambda row: row.get("frame") or 0) for name, each in rows.items()}


def test_a_rerun_recording_holds_every_frame(street: TinyDataset, tmp_path: Path) -> None:
    path = tmp_path / "new" / "scene.rrd"
    done = run(street.root, "--rrd", str(path), "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {
        "scene": "scene-tiny",
        "frames": 3,
        "bev": "groundtruth",
        "tracks": "made now",
        "files": [str(path)],
    }
    rows = rerun_rows(path)
    moving = ["/world/ego", "/world/ego/CAM_FRONT", "/world/ego/CAM_FRONT/image", "/world/annotations"]
    moving += ["/world/tracks", "/world/trails", "/world/ego/bev/appearance", "/world/ego/bev/classes"]
    for name in moving:
        assert [row["frame"] for row in rows[name]] == [0, 1, 2], name
        assert [row["time"].value // 1000 for row in rows[name]] == TIMES_US, name
    assert [row["Transform3D:translation"] for row in rows["/world/ego"]] == [
        [[100, 200 + 2.5 * i, 0]] for i in range(3)
    ]


def test_a_rerun_recording_holds_cameras_and_their_images(street: TinyDataset, tmp_path: Path) -> None:
    assert run(street.root, "--rrd", str(tmp_path / "scene.rrd")).exit_code == 0
    rows = rerun_rows(tmp_path / "scene.rrd")
    row = rows["/world/ego/CAM_FRONT"][1]
    assert np.allclose(np.reshape(row["Pinhole:image_from_camera"], (3, 3)).T, INTRINSIC)  # columns first
    assert row["Pinhole:resolution"] == [[WIDTH_PX, HEIGHT_PX]]
    # The camera fired 10 ms before the sample, 5 cm further back.
    assert row["Transform3D:translation"][0] == pytest.approx([1.45, 0, 1.6], abs=1e-5)
    assert rows["/world/ego/CAM_FRONT/image"][1]["EncodedImage:media_type"] == ["image/jpeg"]
    written = bytes(rows["/world/ego/CAM_FRONT/image"][1]["EncodedImage:blob"][0])
    assert written == next(iter(sorted((street.root / "samples" / "CAM_FRONT").iterdir())[1:2])).read_bytes()


def test_a_rerun_recording_holds_the_map_on_the_ground(street: TinyDataset, tmp_path: Path) -> None:
    assert run(street.root, "--rrd", str(tmp_path / "scene.rrd")).exit_code == 0
    row = rerun_rows(tmp_path / "scene.rrd")["/world/ego/bev/appearance"][0]
    picture = np.array(row["Mesh3D:albedo_texture_buffer"][0], np.uint8).reshape(400, 400, 3)
    vertices = np.array(row["Mesh3D:vertex_positions"])
    texture = np.array(row["Mesh3D:vertex_texcoords"])

    def colour_at(x_m: float, y_m: float) -> list[int]:
        """The colour of the picture at a place, by the corners of the mesh."""
        u = (y_m - vertices[0, 1]) / (vertices[1, 1] - vertices[0, 1])
        v = (x_m - vertices[0, 0]) / (vertices[3, 0] - vertices[0, 0])
        return [int(value) for value in picture[int(v * 400), int(u * 400)]]

    assert texture.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert (vertices[:, 2] == 0).all()
    assert colour_at(10.0, 0.1) == [CAR_RGB] * 3
    assert colour_at(-10.0, 0.1) == [STREET_RGB] * 3
    assert colour_at(10.0, -39.9) not in ([CAR_RGB] * 3, [STREET_RGB] * 3)


def test_a_rerun_recording_holds_boxes_tracks_and_the_goal(street: TinyDataset, tmp_path: Path) -> None:
    path = tmp_path / "scene.rrd"
    done = run(street.root, "--rrd", str(path), "--command", "park behind the white car", "--frame", "1")
    assert done.exit_code == 0, done.output
    rows = rerun_rows(path)
    assert [len(row["Boxes3D:centers"]) for row in rows["/world/annotations"]] == [2, 2, 1]
    assert rows["/world/annotations"][0]["Boxes3D:labels"] == ["car", "adult"]
    (centre,) = rows["/world/tracks"][0]["Boxes3D:centers"]
    assert centre[:2] == pytest.approx([100, 210], abs=0.3)
    (goal,) = rows["/world/goal"]
    assert goal["frame"] == 1
    assert goal["Boxes3D:labels"] == ["park behind the white car"]
    # Behind the car at y = 210 in the world, on its line.
    x, y, _ = goal["Boxes3D:centers"][0]
    assert abs(x - 100) < 2
    assert 200 < y < 207


def test_tracks_that_are_there_are_shown(street: TinyDataset, tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["track", "scene", str(street.root)]).exit_code == 0
    file = street.root / "tracks" / "groundtruth" / "scene-tiny" / "tracking.json"
    written = json.loads(file.read_text())
    for boxes in written["results"].values():
        for box in boxes:
            box["tracking_id"] = "77"
    file.write_text(json.dumps(written))
    done = run(street.root, "--rrd", str(tmp_path / "scene.rrd"))
    assert f"tracks: {file}" in done.stderr
    assert rerun_rows(tmp_path / "scene.rrd")["/world/tracks"][2]["Boxes3D:labels"][0].startswith("77 ")


def test_a_command_is_about_the_tracks_that_are_shown(street: TinyDataset, tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["track", "scene", str(street.root)]).exit_code == 0
    file = street.root / "tracks" / "groundtruth" / "scene-tiny" / "tracking.json"
    written = json.loads(file.read_text())
    for boxes in written["results"].values():
        for box in boxes:
            box["rgb"] = [200, 20, 20]  # the map and the annotations know a white car
    file.write_text(json.dumps(written))
    path = tmp_path / "scene.rrd"
    done = run(street.root, "--rrd", str(path), "--command", "park behind the red car", "--frame", "1")
    assert done.exit_code == 0, done.output
    assert rerun_rows(path)["/world/goal"][0]["Boxes3D:labels"] == ["park behind the red car"]
    assert "red car" in done.stderr
    file.unlink()
    done = run(street.root, "--rrd", str(path), "--command", "park behind the red car", "--frame", "1")
    assert done.exit_code == 3, done.output


# MCAP -------------------------------------------------------------------------------------------------------------


def messages(path: Path) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, schema, time in nanoseconds and content of each message of an MCAP file."""
    with path.open("rb") as file:
        for one in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            assert one.schema is not None
            yield one.channel.topic, one.schema.name, one.message.log_time, one.decoded_message


def test_an_mcap_file_holds_every_frame(street: TinyDataset, tmp_path: Path) -> None:
    path = tmp_path / "scene.mcap"
    assert run(street.root, "--mcap", str(path)).exit_code == 0
    found = defaultdict(list)
    for topic, schema, time_ns, content in messages(path):
        found[topic, schema.removeprefix("foxglove.")].append((time_ns // 1000, content))
    times = {key: [time for time, _ in each] for key, each in found.items()}
    once = [("/CAM_FRONT/image", "CompressedImage"), ("/CAM_BACK/calibration", "CameraCalibration")]
    once += [("/bev/appearance", "Grid"), ("/bev/classes", "Grid")]
    once += [("/annotations", "SceneUpdate"), ("/tracks", "SceneUpdate"), ("/ego", "SceneUpdate")]
    for key in once:
        assert times[key] == TIMES_US, key
    assert times["/tf", "FrameTransform"] == sorted(TIMES_US * 3)
    ego, camera = found["/tf", "FrameTransform"][3][1], found["/tf", "FrameTransform"][5][1]
    assert (ego.parent_frame_id, ego.child_frame_id) == ("world", "ego")
    assert (ego.translation.x, ego.translation.y) == (100, 202.5)
    assert (camera.parent_frame_id, camera.child_frame_id) == ("ego", "CAM_FRONT")
    assert (camera.translation.x, camera.translation.z) == pytest.approx((1.45, 1.6))
    calibration = found["/CAM_BACK/calibration", "CameraCalibration"][0][1]
    assert (calibration.width, calibration.height) == (WIDTH_PX, HEIGHT_PX)
    assert np.allclose(np.reshape(calibration.K, (3, 3)), INTRINSIC)
    image = found["/CAM_FRONT/image", "CompressedImage"][0][1]
    decoded = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (HEIGHT_PX, WIDTH_PX, 3)
    (first, *_), last = found["/annotations", "SceneUpdate"][0][1].entities, found["/tracks", "SceneUpdate"][2][1]
    assert first.cubes[0].size.x > first.cubes[0].size.y > 0
    assert last.entities[0].cubes[0].pose.position.y == pytest.approx(210, abs=0.3)


def test_the_grids_of_an_mcap_file_lie_on_the_ground(street: TinyDataset, tmp_path: Path) -> None:
    assert run(street.root, "--mcap", str(tmp_path / "scene.mcap")).exit_code == 0
    (appearance, *_) = [c for topic, _, _, c in messages(tmp_path / "scene.mcap") if topic == "/bev/appearance"]
    (classes, *_) = [c for topic, _, _, c in messages(tmp_path / "scene.mcap") if topic == "/bev/classes"]

    def at(grid: Any, x_m: float, y_m: float) -> dict[str, int]:
        """The fields of the cell at a place."""
        column = int((x_m - grid.pose.position.x) / grid.cell_size.x)
        row = int((y_m - grid.pose.position.y) / grid.cell_size.y)
        begin = row * grid.row_stride + column * grid.cell_stride
        return {field.name: grid.data[begin + field.offset] for field in grid.fields}

    assert appearance.frame_id == "ego"
    assert at(appearance, 10.0, 0.1) == {"red": CAR_RGB, "green": CAR_RGB, "blue": CAR_RGB, "alpha": 255}
    assert at(appearance, 0.1, 10.0)["red"] == STREET_RGB
    assert at(appearance, 0.1, -39.9)["alpha"] == 0
    assert (at(classes, 10.0, 0.1)["vehicle"], at(classes, 0.1, 10.0)["vehicle"]) == (255, 0)
    assert at(classes, 0.1, 10.0)["road"] == 255


# What can go wrong ------------------------------------------------------------------------------------------------


def refused(root: Path, *more: str) -> str:
    """The reason of a command that fails, which leaves nothing behind."""
    done = run(root, *more)
    assert isinstance(done.exception, AppoccError), done.output
    assert "\n" not in str(done.exception)
    return str(done.exception)


def test_a_scene_without_maps_is_shown_without(tiny_root: Path, tmp_path: Path) -> None:
    done = run(tiny_root, "--rrd", str(tmp_path / "a.rrd"), "--mcap", str(tmp_path / "a.mcap"))
    assert "3 key frames, no maps" in done.stderr
    rows = rerun_rows(tmp_path / "a.rrd")
    assert len(rows["/world/annotations"]) == 3
    assert "/world/tracks" not in rows
    assert "/tracks" not in {topic for topic, *_ in messages(tmp_path / "a.mcap")}


@pytest.mark.parametrize("ending", ["rrd", "mcap"])
def test_nothing_is_left_where_a_file_is_missing(street: TinyDataset, tmp_path: Path, ending: str) -> None:
    bev_path(street.root, "groundtruth", token("sample", 2)).unlink()
    # Tracks that are there need no map; so the recording is the first to miss it.
    path = tmp_path / "made" / f"scene.{ending}"
    assert "no BEV map" in refused(street.root, f"--{ending}", str(path))
    next((street.root / "samples" / "CAM_BACK").iterdir()).write_bytes(b"\xff\xd8 no picture")
    (street.root / "bev").rename(tmp_path / "elsewhere")
    assert "not a readable image" in refused(street.root, f"--{ending}", str(path))
    assert not path.parent.exists()


def test_wrong_uses_are_one_line(street: TinyDataset, tmp_path: Path) -> None:
    assert "expected --rrd FILE" in refused(street.root)
    assert "ends in .rrd" in refused(street.root, "--rrd", str(tmp_path / "a.mcap"))
    assert "no BEV map" in refused(street.root, "--rrd", str(tmp_path / "a.rrd"), "--bev", "mine")
    command = ("--command", "follow the bus", "--rrd", str(tmp_path / "a.rrd"))
    assert run(street.root, *command).exit_code == 3
    for row in street.tables["sample"]:
        row["scene_token"] = token("other")
    street.write()
    assert "no key frames" in refused(street.root, "--rrd", str(tmp_path / "a.rrd"))
    assert list(tmp_path.iterdir()) == [street.root]


@pytest.mark.parametrize(("ending", "module", "extra"), [("rrd", "rerun", "viewer"), ("mcap", "foxglove", "mcap")])
def test_a_missing_extra_is_named(
    street: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, module: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    reason = refused(street.root, f"--{ending}", str(tmp_path / f"a.{ending}"))
    assert f"needs {module}: pip install '.[{extra}]'" in reason


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Let files grow to a size only, as a full disk does."""
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("ending", ["rrd", "mcap"])
@pytest.mark.parametrize("share", [0.1, 0.9])
def test_a_full_disk_is_reported(street: TinyDataset, tmp_path: Path, ending: str, share: float) -> None:
    assert run(street.root, f"--{ending}", str(tmp_path / f"whole.{ending}")).exit_code == 0
    path = tmp_path / "out" / f"a.{ending}"
    with largest_file(int(share * (tmp_path / f"whole.{ending}").stat().st_size)):
        done = run(street.root, f"--{ending}", str(path))
    assert isinstance(done.exception, DataError)
    assert "cannot be written" in str(done.exception)
    assert not path.parent.exists()

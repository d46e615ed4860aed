"""The routes of the page, without a browser."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from made_recording import SCENE, write_recording
from starlette.testclient import TestClient

from appocc.bevmap import CLASSES, bev_path, load_map
from appocc.errors import DataError
from appocc.nuscenes import Dataset
from appocc.nuscenes.writer import token_of
from appocc.visualization.canvas import to_image_axes
from cli.server.app import build_app
from cli.server.guard import MOST_BODY_BYTES
from cli.server.library import Library
from cli.server.pictures import camera_jpeg
from tracking.pipeline import track_scene, tracks_folder, write_tracks

pytest_plugins = ["page_fixtures"]

FRAMES = 4
JSON = {"content-type": "application/json"}


def decoded(data: bytes) -> np.typing.NDArray[np.uint8]:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
    assert image is not None
    return np.asarray(image, np.uint8)


# Recordings -----------------------------------------------------------------------------------------------------


def test_recordings_are_listed_with_scenes_and_sources(client: TestClient) -> None:
    listed = client.get("/api/recordings").json()
    (one,) = listed["recordings"]
    assert one["scenes"] == [{"name": SCENE, "description": "made for tests", "frames": FRAMES}]
    assert (one["sources"], one["truth"], one["error"]) == (["predicted", "exact"], "exact", None)
    assert listed["drives"] is None, "a dataset is no folder for new drives"


def test_a_folder_of_datasets_is_opened_and_new_ones_are_found(root: Path, tmp_path: Path) -> None:
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        assert client.get("/api/recordings").json()["recordings"] == []
        assert client.get("/api/recordings").json()["drives"]["towns"]
        write_recording(tmp_path / "one" / "two", 1)
        (found,) = client.get("/api/recordings").json()["recordings"]
        assert found["title"] == f"{tmp_path.name}/one/two"


def test_a_damaged_dataset_in_a_folder_has_its_error(tmp_path: Path) -> None:
    write_recording(tmp_path / "good", 1)
    write_recording(tmp_path / "bad", 1)
    (tmp_path / "bad" / "v1.0-made" / "scene.json").write_text("[")
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        bad, good = client.get("/api/recordings").json()["recordings"]
        assert "scene.json" in bad["error"]
        assert good["error"] is None


@pytest.mark.parametrize("name", ["missing", "file"])
def test_what_is_no_folder_is_rejected(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match=name):
        Library([tmp_path / name])


def test_a_folder_without_a_dataset_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(DataError, match="no nuScenes-schema dataset"):
        Library([tmp_path])


# Key frames -----------------------------------------------------------------------------------------------------


def test_a_key_frame_has_cameras_vehicles_boxes_and_the_grid(client: TestClient, at: str) -> None:
    moment = client.get(f"{at}/2?source=predicted").json()
    assert moment["time_s"] == 1.0
    assert moment["rows"][0] == ["CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT"]
    assert set(moment["cameras"]) == {channel for row in moment["rows"] for channel in row}
    assert moment["map"]["shape"] == [200, 200]
    assert moment["map"]["predicted"] is True
    assert moment["tracking"]["kind"] == "tracks"
    assert len(moment["boxes"]) == len(moment["vehicles"]) == 4
    white = next(one for one in moment["vehicles"] if abs(one["xy"][1] + 6) < 0.5 and one["xy"][0] < 15)
    assert white["colour"] == "white"
    assert white["xy"][0] == pytest.approx(12.0, abs=0.5)
    assert len(white["trail"]) == 2, "a track is reported from its second detection on"


def test_on_true_maps_the_vehicles_are_the_annotated_ones(client: TestClient, at: str) -> None:
    moment = client.get(f"{at}/1?source=exact").json()
    assert moment["tracking"]["kind"] == "boxes"
    assert {one["name"] for one in moment["vehicles"]} == {"car"}
    assert len(moment["vehicles"][0]["trail"]) == 2


def test_a_vehicle_keeps_its_id_and_has_a_path(client: TestClient, at: str) -> None:
    frames = [client.get(f"{at}/{k}?source=predicted").json() for k in range(1, FRAMES)]
    leader = [next(one["id"] for one in each["vehicles"] if abs(one["xy"][1]) < 1) for each in frames]
    assert len(set(leader)) == 1
    points = client.get(f"{at}/1/path", params={"source": "predicted", "id": leader[0]}).json()["points"]
    assert [point[0] for point in points] == list(range(1, FRAMES))
    assert points[-1][2] - points[0][2] == pytest.approx(2.0, abs=0.5), "it drives along world y"
    assert client.get(f"{at}/1/path?source=predicted&id=nobody").json()["points"] == []


def test_tracks_of_the_recording_are_preferred(tmp_path: Path) -> None:
    root = write_recording(tmp_path / "made", 2, "street")
    dataset = Dataset(root)
    tracked = track_scene(dataset, dataset.scenes[0], "exact")
    renamed = [tuple(replace(one, id=one.id + 40) for one in states) for states in tracked.tracks]
    for source in ("predicted", "exact"):
        write_tracks(tracks_folder(root, source, "street"), replace(tracked, tracks=tuple(renamed)))
    with TestClient(build_app(Library([root])), base_url="http://localhost") as client:
        key = client.get("/api/recordings").json()["recordings"][0]["key"]
        for source in ("predicted", "exact"):
            vehicles = client.get(f"/api/recordings/{key}/0/1?source={source}").json()["vehicles"]
            assert {one["id"] for one in vehicles} == {f"track {number}" for number in (41, 42, 43, 44)}


# Pictures -------------------------------------------------------------------------------------------------------


def test_a_map_sheet_has_the_exact_values(client: TestClient, at: str, root: Path) -> None:
    bev = load_map(root, "predicted", token_of("sample", 1))
    sheet = decoded(client.get(f"{at}/1/map.png?source=predicted").content)
    colours, chances, flags = sheet[:200], sheet[200:400], sheet[400:]
    assert np.array_equal(colours, to_image_axes(np.moveaxis(bev.appearance, 0, -1)))
    wanted = to_image_axes(np.round(255 * np.moveaxis(bev.occupancy, 0, -1)).astype(np.uint8))
    assert np.array_equal(chances, wanted)
    for n in range(len(CLASSES)):
        assert np.array_equal(
            flags[..., 0] & (1 << n) > 0, to_image_axes(bev.occupancy_valid[n].astype(np.uint8)) > 0
        )
        assert np.array_equal(flags[..., 1] & (1 << n) > 0, to_image_axes(bev.on[n].astype(np.uint8)) > 0)


def test_a_small_camera_image_is_the_file_itself_and_is_kept_by_the_browser(
    client: TestClient, at: str, root: Path
) -> None:
    answer = client.get(f"{at}/0/cameras/CAM_FRONT?width=480")
    assert answer.content == (root / "samples" / "CAM_FRONT" / "0.jpg").read_bytes()
    assert answer.headers["content-type"] == "image/jpeg"
    again = client.get(f"{at}/0/cameras/CAM_FRONT?width=480", headers={"if-none-match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_a_large_camera_image_is_reduced(tmp_path: Path) -> None:
    for size in ((700, 400), (3000, 900)):
        cv2.imwrite(str(tmp_path / "large.jpg"), np.full((size[1], size[0], 3), 90, np.uint8))
        assert decoded(camera_jpeg(tmp_path / "large.jpg", 320)).shape == (round(size[1] * 320 / size[0]), 320, 3)


def test_a_changed_map_is_another_picture(tmp_path: Path) -> None:
    root = write_recording(tmp_path / "made", 1)
    with TestClient(build_app(Library([root])), base_url="http://localhost") as client:
        key = client.get("/api/recordings").json()["recordings"][0]["key"]
        address = f"/api/recordings/{key}/0/0/map.png?source=predicted"
        before = client.get(address)
        token = token_of("sample", 0)
        load_map(root, "exact", token).save(bev_path(root, "predicted", token))
        after = client.get(address, headers={"if-none-match": before.headers["etag"]})
        assert after.status_code == 200
        assert after.content != before.content


@pytest.mark.parametrize("damage", [b"", b"\xff\xd8\xff\xe0 no image", b"GIF89a"])
def test_a_damaged_image_is_an_error_without_a_path(damage: bytes, tmp_path: Path) -> None:
    root = write_recording(tmp_path / "made", 1)
    (root / "samples" / "CAM_FRONT" / "0.jpg").write_bytes(damage)
    with TestClient(build_app(Library([root])), base_url="http://localhost") as client:
        key = client.get("/api/recordings").json()["recordings"][0]["key"]
        answer = client.get(f"/api/recordings/{key}/0/0/cameras/CAM_FRONT?width=320")
        assert answer.status_code == 400
        assert answer.json()["error"].startswith("0.jpg")
        assert client.get(f"/api/recordings/{key}/0/0?source=predicted").status_code == 200


def test_curves_of_trainings_are_shown_as_they_are_drawn(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "small"
    run.mkdir(parents=True)
    (run / "metrics.jsonl").write_text("")
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        (name,) = client.get("/api/recordings").json()["trainings"]
        assert name == f"{tmp_path.name}/runs/small"
        assert client.get("/api/curves", params={"name": name}).status_code == 404
        cv2.imwrite(str(run / "curves.png"), np.full((4, 4, 3), 90, np.uint8))
        answer = client.get("/api/curves", params={"name": name})
        assert answer.content == (run / "curves.png").read_bytes()
        assert client.get("/api/curves", params={"name": "../../etc"}).status_code == 404
        (run / "curves.png").write_text("no image")
        assert client.get("/api/curves", params={"name": name}).status_code == 400


# Hostile addresses and bodies -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rest",
    [
        "/99?source=predicted",
        "/-1?source=predicted",
        "/x?source=predicted",
        "/1?source=../../etc",
        "/1?source=/etc",
        "/1/path?source=../../etc&id=track 1",
        "/1/path?source=/etc&id=track 1",
        "/1/path?source=&id=track 1",
        "/1/map.png?source=",
        "/1/map.png?source=..%2F..%2Fexact",
        "/1/cameras/..%2F..%2Fetc%2Fpasswd?width=320",
        "/1/cameras/LIDAR_TOP?width=320",
        "/1/cameras/CAM_FRONT?width=333",
        "/1/cameras/CAM_FRONT?width=1e9",
        "/99999999999999999999?source=predicted",
    ],
)
def test_hostile_addresses_get_one_line(rest: str, client: TestClient, at: str) -> None:
    answer = client.get(at + rest)
    assert answer.status_code in (400, 404)
    assert set(answer.json()) == {"error"}
    assert "\n" not in answer.json()["error"]
    assert "Traceback" not in answer.text


@pytest.mark.parametrize(
    "path", ["/static/../app.py", "/static/..%2fapp.py", "/etc/passwd", "/api", "/static/none.js"]
)
def test_no_other_file_is_served(path: str, client: TestClient) -> None:
    assert client.get(path).status_code == 404


@pytest.mark.parametrize(
    "body",
    [b"[]", b"{", b"null", b'{"recording": 1}', b'{"recording": "x"}', b"[" * 9000, b'{"x": NaN}', b"\xff\xfe"],
)
def test_hostile_bodies_get_one_line(body: bytes, client: TestClient) -> None:
    answer = client.post("/api/talk", content=body, headers=JSON)
    assert answer.status_code in (400, 404)
    assert set(answer.json()) == {"error"}


@pytest.mark.parametrize(
    ("path", "body", "reason"),
    [
        ("talk", {"recording": 1}, "recording: expected a text, got 1"),
        ("talk", {}, "recording: expected a value, got nothing"),
        ("talk", {"recording": "x", "frame": "next"}, "frame: expected a whole number, got 'next'"),
        ("talk", {"recording": "x", "say": "a" * 2001}, "say: expected at most 2000 characters, got 'aaa"),
        ("talk", {"recording": "x", "sey": "go"}, "sey: no such key (did you mean say?); expected one of talk, "),
        ("drives", {"town": "t", "weather": "w", "seconds": 90}, "seconds: expected 60 or less, got 90"),
    ],
)
def test_wrong_bodies_are_told_key_expected_and_got(
    path: str, body: dict[str, Any], reason: str, client: TestClient
) -> None:
    answer = client.post(f"/api/{path}", json=body)
    assert answer.status_code == 400
    assert answer.json()["error"].startswith(reason)


def test_a_large_body_is_refused(client: TestClient) -> None:
    answer = client.post("/api/talk", content=b" " * (MOST_BODY_BYTES + 1), headers=JSON)
    assert answer.status_code == 413


def test_the_page_itself_is_served_with_a_strict_policy(client: TestClient) -> None:
    page = client.get("/")
    assert page.headers["content-type"].startswith("text/html")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http:" not in page.text.replace("http://www.w3.org", "")
    assert "https:" not in page.text
    for name in ("app.js", "style.css", "icon.svg"):
        assert client.get(f"/static/{name}").status_code == 200


def test_a_fault_of_the_server_is_one_plain_line(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fault(self: Library) -> None:
        raise ZeroDivisionError("secret")

    app = build_app(Library([root]))
    monkeypatch.setattr(Library, "refresh", fault)
    with TestClient(app, base_url="http://localhost", raise_server_exceptions=False) as client:
        answer = client.get("/api/recordings")
        assert answer.status_code == 500
        assert "secret" not in answer.text
    assert "ZeroDivisionError: secret" in capsys.readouterr().err


def test_the_end_of_the_server_ends_tracking_and_warming_up(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def track_for_ever(*_: object, advance: Callable[[int], None], **__: object) -> None:
        while True:
            advance(1)
            time.sleep(0.01)

    before = set(threading.enumerate())
    monkeypatch.setattr("cli.server.scene_tracks.track_scene", track_for_ever)
    monkeypatch.setattr("cli.server.scene_tracks._PATIENCE_S", 0.0)
    with TestClient(build_app(Library([root])), base_url="http://127.0.0.1:8040") as client:
        key = client.get("/api/recordings").json()["recordings"][0]["key"]
        shown = client.get(f"/api/recordings/{key}/0/0?source=predicted").json()
        assert shown["tracking"]["kind"] == "map"
        assert "tracking" in {thread.name for thread in set(threading.enumerate()) - before}
    left = {thread.name for thread in set(threading.enumerate()) - before}
    assert left & {"tracking", "warm up"} == set()

"""Long work that the page starts: progress, failure, stopping."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from made_recording import write_recording
from starlette.testclient import TestClient

from appocc.errors import NotFoundError
from cli.server.app import build_app
from cli.server.jobs import BusyError, Job, Jobs
from cli.server.library import Library

DRIVE = {"town": "harrowmere", "weather": "clear", "seconds": 0.5, "seed": 3}
WEIGHTS = {"weights": None, "source": "predicted"}
PREDICT = {"version": "v1.0-made", **WEIGHTS}
# Far above what a busy machine needs; it only ends a hang.
_PATIENCE_S = 300


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


def ended(job: Job) -> Job:
    limit = time.monotonic() + _PATIENCE_S
    while job.ended_s is None:
        assert time.monotonic() < limit
        time.sleep(0.05)
    return job


def test_a_job_that_fails_has_the_reason_in_one_line(jobs: Jobs, tmp_path: Path) -> None:
    job = ended(jobs.start("predict", "maps", tmp_path / "missing", PREDICT))
    assert job.state == "failed"
    assert "no such folder" in job.note
    assert "\n" not in job.note


def test_one_job_runs_at_a_time_and_can_be_stopped(jobs: Jobs, tmp_path: Path) -> None:
    job = jobs.start("simulate", "a long drive", tmp_path / "drive", {**DRIVE, **WEIGHTS, "seconds": 60})
    with pytest.raises(BusyError):
        jobs.start("simulate", "another", tmp_path / "other", {**DRIVE, **WEIGHTS})
    assert jobs.stop(job.number) is job
    assert ended(job).state == "stopped"
    assert job.note == "stopped; start it again to go on"
    assert not job.process.is_alive()
    assert not (tmp_path / "drive").exists(), "a dataset is complete or not there"
    with pytest.raises(NotFoundError):
        jobs.stop(99)


def test_closing_ends_the_process(tmp_path: Path) -> None:
    jobs = Jobs()
    job = jobs.start("simulate", "a long drive", tmp_path / "drive", {**DRIVE, **WEIGHTS, "seconds": 60})
    jobs.close()
    assert not job.process.is_alive()


@pytest.mark.parametrize(
    "wrong",
    [
        {"town": "../../x"},
        {"weather": "hail"},
        {"seconds": 1e9},
        {"seconds": "x"},
        {"seed": -1},
        {"more": 1},
        {"weights": "/etc/x"},
    ],
)
def test_wrong_settings_of_a_drive_are_refused(wrong: dict[str, object], tmp_path: Path) -> None:
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        answer = client.post("/api/drives", json={**DRIVE, **wrong})
        assert answer.status_code in (400, 404)
        assert client.get("/api/jobs").json() == {"jobs": []}
    assert list(tmp_path.iterdir()) == []


def test_a_drive_needs_a_folder(tmp_path: Path) -> None:
    with TestClient(
        build_app(Library([write_recording(tmp_path / "made", 1)])), base_url="http://localhost"
    ) as client:
        answer = client.post("/api/drives", json=DRIVE)
        assert (answer.status_code, "appocc serve FOLDER" in answer.json()["error"]) == (400, True)


def test_weights_of_the_opened_folders_make_maps_of_their_own(tmp_path: Path) -> None:
    made = write_recording(tmp_path / "made", 1)
    (tmp_path / "RUN").mkdir()
    (tmp_path / "RUN" / "best.safetensors").write_bytes(b"no weights")
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        listed = client.get("/api/recordings").json()
        own = f"{tmp_path.name}/RUN/best.safetensors"
        assert listed["weights"] == ["appocc", "street", own]
        predict = f"/api/recordings/{listed['recordings'][0]['key']}/predict"
        assert client.post(predict, json={"weights": f"{made}/best.safetensors"}).status_code == 404
        job = client.post(predict, json={"weights": own}).json()
        assert job["source"] == "predicted-RUN-best", "it replaces neither the maps of others nor true ones"
        limit = time.monotonic() + _PATIENCE_S
        while job["state"] == "running":
            assert time.monotonic() < limit
            time.sleep(0.05)
            (job,) = client.get("/api/jobs").json()["jobs"]
        assert (job["state"], "RUN/best.safetensors" in job["note"]) == ("failed", True)
        assert client.get("/api/recordings").json()["recordings"][0]["sources"] == ["predicted", "exact"]


@pytest.mark.slow
def test_a_drive_is_simulated_with_progress_and_opened(tmp_path: Path) -> None:
    with TestClient(build_app(Library([tmp_path])), base_url="http://localhost") as client:
        job = client.post("/api/drives", json=DRIVE).json()
        seen = set()
        limit = time.monotonic() + _PATIENCE_S
        while job["state"] == "running":
            assert time.monotonic() < limit
            time.sleep(0.05)
            (job,) = client.get("/api/jobs").json()["jobs"]
            seen.add(job["note"])
        assert job["state"] == "done", job["note"]
        assert job["done"] == job["total"] == 2
        assert "predicting maps from the cameras" in seen
        (recording,) = client.get("/api/recordings").json()["recordings"]
        assert recording["key"] == job["recording"]
        assert recording["sources"] == ["predicted", "exact"]

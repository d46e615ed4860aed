from __future__ import annotations

import errno
import fcntl
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from made_traffic import straight_traffic

from appocc.errors import DataError
from appocc.files import read_json, write_bytes, write_json
from appocc.nuscenes import assembly
from appocc.nuscenes.assembly import count_finished_scenes, unfinished_folder
from appocc.nuscenes.writer import Writer, token_of
from appocc.rigs import read_rig
from appocc.simulation import generate
from appocc.simulation.generate import DatasetSettings, simulate
from appocc.simulation.recording import RecordingSettings
from appocc.simulation.scenario import Scenario
from appocc.simulation.sources import TownSource

Contents = dict[str, bytes]


def settings_of(scenes: int = 3, seed: int = 0, vary: bool = False) -> DatasetSettings:
    recording = RecordingSettings(4, 2.0, read_rig("paper"), vary=vary)
    return DatasetSettings(scenes, (TownSource("one"), TownSource("two")), ("clear", "wet"), seed, recording)


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Write a small file per frame instead of rendering; return the names of the recorded scenes."""
    names: list[str] = []

    def record(
        scenario: Scenario,
        place: SimpleNamespace,
        recording: RecordingSettings,
        writer: Writer,
        advance: Callable[[float], None],
    ) -> None:
        names.append(scenario.name)
        samples = []
        for number in range(recording.frames):
            token = token_of(scenario.name, number)
            write_bytes(writer.root / "samples" / f"{token}.bin", f"{scenario}".encode())
            scene = token_of("scene", scenario.name)
            samples.append(writer.add("sample", token, timestamp=number, scene_token=scene, prev="", next=""))
            advance(1)
        writer.add_scene(scenario.name, scenario.weather, place.town, samples)
        writer.add("log", place.town, logfile=place.town)

    def write_map(town: str, name: str, root: Path) -> None:
        assert town == name
        if not (root / "maps" / f"{name}.json").is_file():
            write_json(root / "maps" / f"{name}.json", town)

    monkeypatch.setattr(generate, "record_scene", record)
    monkeypatch.setattr(generate, "write_map", write_map)
    monkeypatch.setattr(generate, "build_town_simulation", lambda source, folder: SimpleNamespace(town=source.name))
    monkeypatch.setattr(TownSource, "load", lambda self, folder: (None, straight_traffic()))
    return names


def contents(root: Path) -> Contents:
    return {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}


def no_advance(frames: float) -> None:
    del frames


def interrupted_after(frames: int, error: BaseException) -> Callable[[float], None]:
    left = frames

    def advance(done: float) -> None:
        nonlocal left
        left -= int(done)
        if left <= 0:
            raise error

    return advance


@pytest.mark.usefixtures("recorded")
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(tmp_path: Path) -> None:
    made = simulate(tmp_path / "a", settings_of(), None, no_advance)
    simulate(tmp_path / "b", settings_of(), None, no_advance)
    simulate(tmp_path / "c", settings_of(seed=1), None, no_advance)
    assert made == (12, 12)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert contents(tmp_path / "a") != contents(tmp_path / "c")
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(143), OSError(errno.ENOSPC, "No space left")])
def test_an_interrupted_run_resumes_with_the_same_result(
    tmp_path: Path, recorded: list[str], error: BaseException
) -> None:
    simulate(tmp_path / "whole", settings_of(), None, no_advance)
    out = tmp_path / "out"
    expected = DataError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected):
        simulate(out, settings_of(), None, interrupted_after(6, error))
    assert not out.exists()
    assert count_finished_scenes(out) == 1
    assert not list(unfinished_folder(out).rglob("*.part"))
    recorded.clear()
    done: list[float] = []
    made = simulate(out, settings_of(), None, done.append)
    assert made == (8, 12)
    assert sum(done) == 12
    assert len(recorded) == 2
    assert contents(out) == contents(tmp_path / "whole")
    assert not unfinished_folder(out).exists()


@pytest.mark.usefixtures("recorded")
def test_a_run_without_a_finished_scene_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        simulate(tmp_path / "out", settings_of(), None, interrupted_after(2, KeyboardInterrupt()))
    assert not list(tmp_path.iterdir())


def test_a_run_killed_while_files_are_merged_resumes(
    tmp_path: Path, recorded: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate(tmp_path / "whole", settings_of(), None, no_advance)
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(assembly, "write_json", lambda path, value: (_ for _ in ()).throw(KeyboardInterrupt()))
        patch.setattr(assembly.Assembly, "_check_settings", lambda self: None)
        with pytest.raises(KeyboardInterrupt):
            simulate(out, settings_of(), None, no_advance)
    recorded.clear()
    assert simulate(out, settings_of(), None, no_advance) == (0, 12)
    assert not recorded
    assert contents(out) == contents(tmp_path / "whole")


def test_a_finished_dataset_is_left_as_it_is(tmp_path: Path, recorded: list[str]) -> None:
    simulate(tmp_path / "out", settings_of(), None, no_advance)
    recorded.clear()
    assert simulate(tmp_path / "out", settings_of(), None, no_advance) == (0, 12)
    assert not recorded
    with pytest.raises(DataError, match="other settings"):
        simulate(tmp_path / "out", settings_of(scenes=4), None, no_advance)


@pytest.mark.usefixtures("recorded")
def test_a_folder_that_holds_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(DataError, match="exists already"):
        simulate(tmp_path, settings_of(), None, no_advance)
    with pytest.raises(DataError, match="exists already"):
        simulate(tmp_path / "notes.txt", settings_of(), None, no_advance)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.usefixtures("recorded")
def test_scenes_of_another_run_are_not_mixed_in(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        simulate(out, settings_of(), None, interrupted_after(6, KeyboardInterrupt()))
    with pytest.raises(DataError, match="other settings"):
        simulate(out, settings_of(seed=5), None, no_advance)
    assert count_finished_scenes(out) == 1


@pytest.mark.usefixtures("recorded")
def test_differing_settings_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulate(tmp_path / "out", settings_of(), None, no_advance)
    with pytest.raises(DataError, match=r"other settings \(scenes, seed\)"):
        simulate(tmp_path / "out", settings_of(scenes=4, seed=5), None, no_advance)
    with pytest.raises(KeyboardInterrupt):
        simulate(tmp_path / "more", settings_of(), None, interrupted_after(6, KeyboardInterrupt()))
    with pytest.raises(DataError, match=r"other settings \(vary\)"):
        simulate(tmp_path / "out", settings_of(vary=True), None, no_advance)
    monkeypatch.setattr(generate, "__version__", "99.0")
    with pytest.raises(DataError, match=r"other settings \(appocc\)"):  # scenes of two versions are not mixed
        simulate(tmp_path / "more", settings_of(), None, no_advance)


@pytest.mark.usefixtures("recorded")
def test_a_run_killed_before_its_first_scene_does_not_fix_the_settings(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_bytes(unfinished_folder(out) / "scenes" / "scene-0000.part" / "half.bin", b"half")
    write_bytes(unfinished_folder(out) / "towns" / "one.plan.json", b"{}")
    write_bytes(unfinished_folder(out) / "shared" / "maps" / "one.json", b"of another town")
    write_json(unfinished_folder(out) / "simulation.json", {"seed": 5})
    assert simulate(out, settings_of(), None, no_advance) == (12, 12)
    assert {path.name: read_json(path) for path in (out / "maps").iterdir()} == {"one.json": "one", "two.json": "two"}


@pytest.mark.usefixtures("recorded")
def test_partial_files_of_a_killed_run_are_removed(tmp_path: Path) -> None:
    simulate(tmp_path / "whole", settings_of(), None, no_advance)
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        simulate(out, settings_of(), None, interrupted_after(6, KeyboardInterrupt()))
    write_bytes(unfinished_folder(out) / "dataset" / "v1.0-simulation" / ".scene-x1y2.json", b"[")
    write_bytes(unfinished_folder(out) / "shared" / "maps" / ".one-x1y2.json", b"[")
    lines: list[str] = []
    simulate(out, settings_of(), None, no_advance, lines.append)
    assert contents(out) == contents(tmp_path / "whole")
    assert lines == [f"{out}: resuming after 1 of 3 scenes"]
    write_bytes(unfinished_folder(out) / "lock", b"")  # killed at the very end
    simulate(out, settings_of(), None, no_advance)
    assert not unfinished_folder(out).exists()


@pytest.mark.usefixtures("recorded")
def test_a_link_is_followed_and_stays(tmp_path: Path) -> None:
    (tmp_path / "disk" / "empty").mkdir(parents=True)
    for name in ("empty", "new"):
        link = tmp_path / name
        link.symlink_to(tmp_path / "disk" / name)
        simulate(link, settings_of(), None, no_advance)
        assert link.is_symlink()
        assert (link / "simulation.json").is_file()
    assert sorted(path.name for path in (tmp_path / "disk").iterdir()) == ["empty", "new"]


@pytest.mark.usefixtures("recorded")
def test_folders_created_for_a_failed_run_are_removed(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        simulate(tmp_path / "a" / "b" / "out", settings_of(), None, interrupted_after(2, KeyboardInterrupt()))
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("recorded")
def test_two_runs_cannot_write_one_dataset(tmp_path: Path) -> None:
    work = unfinished_folder(tmp_path / "out")
    work.mkdir()
    with (work / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(DataError, match="another run"):
            simulate(tmp_path / "out", settings_of(), None, no_advance)


@pytest.mark.usefixtures("recorded")
def test_towns_are_used_in_turn_and_settings_are_stored(tmp_path: Path) -> None:
    simulate(tmp_path / "out", settings_of(4), None, no_advance)
    kept = read_json(tmp_path / "out" / "simulation.json")
    assert kept["scenes"] == 4
    assert [town["name"] for town in kept["towns"]] == ["one", "two"]
    rows = read_json(tmp_path / "out" / "v1.0-simulation" / "scene.json")
    assert [row["log_token"] for row in rows] == ["one", "two", "one", "two"]
    assert len(read_json(tmp_path / "out" / "v1.0-simulation" / "log.json")) == 2

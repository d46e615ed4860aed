from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from made_study import ROWS, MadePredictor, made_study, tiny_train, with_truth
from tiny_dataset import TinyDataset

from appocc.ablation.rows import StudyRow
from appocc.ablation.run import REPORT_FILE, RESULTS_FILE
from appocc.ablation.study import Study
from appocc.errors import DataError
from appocc.evaluation.bev import EvaluationConfig, evaluate
from appocc.frame import Frame
from appocc.inference.predictor import Prediction
from appocc.training.config import Config
from appocc.training.run import StoppedError, TrainingError, TrainingMonitor
from appocc.training.run_folder import RunFolder


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A test set that nothing changes."""
    return with_truth(TinyDataset(tmp_path_factory.mktemp("study") / "tiny"))


@pytest.fixture(scope="module")
def whole(shared: Path) -> bytes:
    """The table of a study on it that nothing interrupted."""
    out = shared.parent / "whole"
    study = made_study(shared, out)
    study.check()
    study.run(ROWS, TrainingMonitor(), never)
    return (out / RESULTS_FILE).read_bytes()


@pytest.fixture
def root(tiny: TinyDataset) -> Path:
    return with_truth(tiny)


@pytest.fixture(scope="module", autouse=True)
def _no_curves() -> Iterator[None]:
    """Drawing takes longer than all else here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("appocc.training.loop.plot_curves", lambda lines, path: None)
        yield


class Counting:
    """Trains, and remembers what it was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, bool]] = []

    def __call__(
        self, config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor
    ) -> Mapping[str, Any]:
        self.asked.append((folder.path.name, resume))
        return tiny_train(config, folder, resume, monitor)


def never() -> bool:
    return False


def done(study: Study) -> dict[str, str]:
    return {each.row.name: each.state for each in study.outcomes()}


def test_all_rows_are_trained_and_evaluated(shared: Path, whole: bytes, tmp_path: Path) -> None:
    counting = Counting()
    study = made_study(shared, tmp_path / "out", train_row=counting)
    study.run(ROWS, TrainingMonitor(), never)
    assert counting.asked == [(row.name, False) for row in ROWS if row.learns]
    value = json.loads((tmp_path / "out" / RESULTS_FILE).read_text())
    assert [row["state"] for row in value["rows"]] == ["done"] * len(ROWS)
    assert value["rows"][0]["steps"] == 5
    assert value["test"] == {"root": str(shared), "against": "exact", "scenes": 1, "samples": 3}
    assert "network" not in value["training"]
    assert (tmp_path / "out" / REPORT_FILE).read_text().startswith("# ")
    # The maps were needed for the figures only.
    assert not list(tmp_path.glob("out/*/maps-*"))
    # And none of it is done again.
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*/result.json")}
    again = made_study(shared, tmp_path / "out", train_row=counting)
    again.check()
    again.run(ROWS, TrainingMonitor(), never)
    assert len(counting.asked) == len(ROWS) - 1
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert (tmp_path / "out" / RESULTS_FILE).read_bytes() == whole


@pytest.mark.parametrize("number", [0, 1, 3])
def test_figures_are_those_of_eval_bev(root: Path, tmp_path: Path, number: int) -> None:
    study, row = made_study(root, tmp_path / "out"), ROWS[number]
    study.run([row], TrainingMonitor(), never)
    predictor = MadePredictor(row, study.folder(row).best)
    for scene in study.test.scenes:
        for sample in study.test.dataset.samples(scene):
            bev, seen = predictor(study.test.dataset.frame(sample, images=False))
            bev.save(tmp_path / "maps" / f"{sample.token}.npz", {"seen": seen})
    question = EvaluationConfig(f"{tmp_path / 'maps'}/", "exact", row.setting == "180")
    wanted = evaluate(study.test.dataset, study.test.scenes, question, lambda steps: None).as_json()
    found = json.loads((study.folder(row).path / "result.json").read_text())["evaluation"]
    for key in ("iou", "iou_at_threshold", "thresholds", "setting", "samples"):
        assert found[key] == wanted[key], key
    assert found["vehicles"]["count"] == wanted["vehicles"]["count"] > 0
    assert (found["appearance_l1"] is None) == (row.outputs == "occupancy")


@pytest.mark.parametrize("stop_at", [1, 7, 18])
def test_interrupted_in_training_it_resumes_to_the_same_bytes(
    shared: Path, whole: bytes, tmp_path: Path, stop_at: int
) -> None:
    study, monitor, steps = made_study(shared, tmp_path / "out"), TrainingMonitor(), []

    def step(share: float, text: str) -> None:
        steps.append(text)
        if monitor.running and sum(": step " in each for each in steps) == stop_at:
            monitor.stop_requested = True

    monitor.on_step = step
    with pytest.raises(StoppedError):
        study.run(ROWS, monitor, never)
    assert "begun" in done(study).values()
    assert b"begun" in (tmp_path / "out" / RESULTS_FILE).read_bytes()
    assert (monitor.on_step, monitor.running) == (step, False)
    made_study(shared, tmp_path / "out").run(ROWS, TrainingMonitor(), never)
    assert (tmp_path / "out" / RESULTS_FILE).read_bytes() == whole


def test_interrupted_in_evaluation_no_map_is_predicted_twice(shared: Path, whole: bytes, tmp_path: Path) -> None:
    asked: list[tuple[str, str]] = []

    class Interrupted(MadePredictor):
        def __call__(self, frame: Frame) -> Prediction:
            if len(asked) == 2:
                raise KeyboardInterrupt
            asked.append((self.row.name, frame.token))
            return super().__call__(frame)

    with pytest.raises(KeyboardInterrupt):
        made_study(shared, tmp_path / "out", predictor_of=Interrupted).run(ROWS, TrainingMonitor(), never)
    assert len(list(tmp_path.glob("out/*/maps-*/*.npz"))) == 2

    class Told(MadePredictor):
        def __call__(self, frame: Frame) -> Prediction:
            asked.append((self.row.name, frame.token))
            return super().__call__(frame)

    made_study(shared, tmp_path / "out", predictor_of=Told).run(ROWS, TrainingMonitor(), never)
    assert len(asked) == len(set(asked)) == 3 * len(ROWS)
    assert (tmp_path / "out" / RESULTS_FILE).read_bytes() == whole


def test_killed_before_the_run_started(root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out" / ROWS[0].name
    folder.mkdir(parents=True)
    (folder / "environment.json").write_text("{}")
    (folder / ".config-x.yaml").write_text("netw")
    study = made_study(root, tmp_path / "out")
    study.run(ROWS[:1], TrainingMonitor(), never)
    assert done(study)[ROWS[0].name] == "done"
    assert not list(folder.glob(".config-*"))


def test_a_folder_with_other_files_is_not_touched(root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out" / ROWS[0].name
    folder.mkdir(parents=True)
    (folder / "letter.txt").write_text("mine")
    with pytest.raises(DataError, match="no run to resume"):
        made_study(root, tmp_path / "out").run(ROWS[:1], TrainingMonitor(), never)
    assert (folder / "letter.txt").read_text() == "mine"


def test_when_the_time_is_up_missing_rows_are_named_and_the_current_one_resumes(
    shared: Path, whole: bytes, tmp_path: Path
) -> None:
    study, monitor, steps = made_study(shared, tmp_path / "out"), TrainingMonitor(), []
    monitor.on_step = lambda share, text: None if "validating" in text else steps.append(text)
    study.run(ROWS, monitor, lambda: len(steps) > 10)
    assert list(done(study).values()) == ["done", "begun", "not run", "not run", "not run"]
    text = (tmp_path / "out" / REPORT_FILE).read_text()
    assert "Without a result: `appocc-360-both-s0`, `ipm-360-colour`, " in text
    assert "1 of 5 rows are done" in text
    made_study(shared, tmp_path / "out").run(ROWS, TrainingMonitor(), never)
    assert (tmp_path / "out" / RESULTS_FILE).read_bytes() == whole


def test_without_time_nothing_is_run(root: Path, tmp_path: Path) -> None:
    study = made_study(root, tmp_path / "out")
    study.run(ROWS, TrainingMonitor(), lambda: True)
    assert set(done(study).values()) == {"not run"}
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [RESULTS_FILE, REPORT_FILE]


def test_a_diverged_training_is_reported_and_not_repeated(root: Path, tmp_path: Path) -> None:
    tried = []

    def diverging(config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor) -> Mapping[str, Any]:
        tried.append(folder.path.name)
        if config.train.seed == 1:
            folder.create(config)
            raise TrainingError("step 3: expected finite losses")
        return tiny_train(config, folder, resume, monitor)

    rows = (ROWS[4], ROWS[0])
    for _ in range(2):
        study = made_study(root, tmp_path / "out", rows, diverging)
        study.check()
        study.run(rows, TrainingMonitor(), never)
    assert tried == [row.name for row in rows]
    assert list(done(study).values()) == ["failed", "done"]
    assert "failed: step 3: expected finite losses" in (tmp_path / "out" / REPORT_FILE).read_text()


def test_another_test_set_is_evaluated_without_training(root: Path, tmp_path: Path, tiny: TinyDataset) -> None:
    counting, rows = Counting(), ROWS[:1]
    made_study(root, tmp_path / "out", rows, counting).run(rows, TrainingMonitor(), never)
    # The weights are the same, but one sample is gone.
    tiny.tables["sample"] = tiny.tables["sample"][:2]
    tiny.tables["sample"][1]["next"] = ""
    tiny.row("scene", tiny.tables["sample"][0]["scene_token"])["last_sample_token"] = tiny.tables["sample"][1][
        "token"
    ]
    tiny.tables["scene"][0]["nbr_samples"] = 2
    kept = {each["token"] for each in tiny.tables["sample"]}
    for name in ("sample_data", "sample_annotation"):
        tiny.tables[name] = [each for each in tiny.tables[name] if each["sample_token"] in kept]
    tiny.write()
    study = made_study(root, tmp_path / "out", rows, counting)
    assert done(study)[rows[0].name] == "begun"
    study.run(rows, TrainingMonitor(), never)
    assert json.loads((tmp_path / "out" / RESULTS_FILE).read_text())["test"]["samples"] == 2
    assert json.loads((study.folder(rows[0]).path / "result.json").read_text())["evaluation"]["samples"] == 2
    assert [resume for _, resume in counting.asked] == [False, True]
    assert sum(line["kind"] == "train" for line in study.folder(rows[0]).read_metrics()) == 1


def test_rows_not_chosen_keep_their_results(root: Path, tmp_path: Path) -> None:
    study = made_study(root, tmp_path / "out")
    study.run(ROWS[:1], TrainingMonitor(), never)
    study.run(ROWS[2:3], TrainingMonitor(), never)
    assert list(done(study).values()) == ["done", "not run", "done", "not run", "not run"]


class Broken:
    """A study's folder or test set that cannot be used."""

    def config(self, root: Path, out: Path) -> Study:
        made_study(root, out, ROWS[:1]).run(ROWS[:1], TrainingMonitor(), never)
        return made_study(root, out, ROWS[:1], train__lr=0.5)

    def truth(self, root: Path, out: Path) -> Study:
        next((root / "bev" / "exact").iterdir()).unlink()
        return made_study(root, out)

    def samples(self, root: Path, out: Path) -> Study:
        study = made_study(root, out)
        object.__setattr__(study.test, "scenes", ())
        return study


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (Broken.config, "other values of train.lr"),
        (Broken.truth, "1 of 3 samples"),
        (Broken.samples, "no key frames"),
    ],
)
def test_invalid_studies_are_refused_before_the_first_training(
    root: Path, tmp_path: Path, broken: Any, said: str
) -> None:
    study = broken(Broken(), root, tmp_path / "out")
    with pytest.raises(DataError, match=said):
        study.check()


def test_several_processes_are_refused(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WORLD_SIZE", "2")
    with pytest.raises(DataError, match="expected one process"):
        made_study(root, tmp_path / "out").check()


def test_a_damaged_result_is_refused(root: Path, tmp_path: Path) -> None:
    study = made_study(root, tmp_path / "out")
    study.run(ROWS[:1], TrainingMonitor(), never)
    result = study.folder(ROWS[0]).path / "result.json"
    whole = json.loads(result.read_text())
    for damage in ({"iou": {"road": 0.5}}, {"appearance_known": "x"}, {"vehicles": None}):
        result.write_text(json.dumps({**whole, "evaluation": {**whole["evaluation"], **damage}}))
        with pytest.raises(DataError, match=r"result\.json: damaged \(.*evaluation\."):
            study.outcomes()
    result.write_text(json.dumps({"key": whole["key"]}))
    with pytest.raises(DataError, match=r"result\.json: damaged \(evaluation: expected a value, got nothing\)"):
        study.outcomes()
    result.write_text("{")
    with pytest.raises(DataError, match=r"result\.json: no valid JSON"):
        study.outcomes()
    result.write_text("[]")
    assert done(study)[ROWS[0].name] == "begun"


def test_a_read_only_folder_is_an_error(root: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(DataError, match="cannot be written"):
        made_study(root, tmp_path / "out").run(ROWS, TrainingMonitor(), never)


def test_the_monitor_reports_rows(root: Path, tmp_path: Path) -> None:
    heard: list[tuple[float, str]] = []
    said: list[str] = []
    monitor = TrainingMonitor(lambda share, text: heard.append((share, text)), said.append)
    rows: tuple[StudyRow, ...] = ROWS[1:3]
    made_study(root, tmp_path / "out").run(rows, monitor, never)
    shares = [share for share, _ in heard]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1)
    assert heard[0][1].startswith("1 of 2, appocc-360-both-s0: step 1, ")
    assert heard[-1][1] == "2 of 2, ipm-360-colour: evaluated"
    assert [text.partition(" road")[0] for text in said[:2]] == [
        "appocc-360-both-s0: step 5: IoU",
        "appocc-360-both-s0: evaluated: IoU",
    ]
    assert said[2].startswith("ipm-360-colour: evaluated: L1 ")

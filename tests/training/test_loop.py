from __future__ import annotations

import copy
import itertools
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from made_training import SETTING, Poison, TinyModel, TinySamples, made_config, made_setup, run, save
from safetensors import safe_open
from tolerances import assert_rounded
from torch import nn

from appocc.errors import DataError
from appocc.files import read_image
from appocc.models.base import BEVModel, ModelOutput
from appocc.models.rounding import rounding
from appocc.training.batches.prefetcher import _prefetch_in_thread, prefetch
from appocc.training.checkpoint import TrainingProgress
from appocc.training.curves import plot_curves
from appocc.training.loop import _optimizer, _reestimate_batch_norm, train
from appocc.training.losses import compute_losses
from appocc.training.metrics import MetricAccumulator
from appocc.training.process_group import ProcessGroup, join_process_group
from appocc.training.run import StoppedError, TrainingError, TrainingMonitor, TrainingRun, TrainingSetup
from appocc.training.run_folder import RunFolder
from appocc.training.schedule import Budget, ema_decay, learning_rate

HERE = ProcessGroup(0, 1, torch.device("cpu"))


def lines(folder: Path, kind: str) -> list[dict[str, object]]:
    return [line for line in RunFolder(folder).read_metrics() if line["kind"] == kind]


def test_it_learns_and_leaves_a_run_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    messages: list[str] = []
    shown: list[tuple[float, str]] = []
    monitor = TrainingMonitor(lambda share, text: shown.append((share, text)), messages.append)
    run(folder, made_config(train__steps=40, evaluate__every_steps=20, losses__colour=4.0), monitor)
    names = {"config.yaml", "environment.json", "metrics.jsonl", "curves.png", "best.safetensors"}
    assert {path.name for path in folder.iterdir()} == {
        *names,
        "state-00000036.safetensors",
        "state-00000040.safetensors",
    }
    val = RunFolder(folder).read_metrics()[-1]
    assert val["kind"] == "val"
    assert val["mean_iou"] > 0.8
    assert val["colour_l1"] < 45
    assert set(val["thresholds"]) == {"road", "vehicle", "lane"}
    steps = lines(folder, "train")
    assert [line["step"] for line in steps] == [10, 20, 30, 40]
    assert set(steps[0]) >= {"wait_share", "plan_share", "samples_per_s", "lr", "grad_norm"}
    assert read_image(folder / "curves.png").std() > 10
    steps_shown = [share for share, text in shown if "validating" not in text]
    assert steps_shown == [k / 40 for k in range(1, 41)]
    assert "step 20: validating, batch 1" in [text for _, text in shown]
    assert "samples/s" in shown[0][1]
    assert len(messages) == 2


def test_micro_batches_of_a_step_give_the_gradient_of_their_mean() -> None:
    """Two batches of four against their mean: batch norm aside, which the frozen trunk leaves out."""
    samples, config = TinySamples(), made_config()
    model = TinyModel().eval()
    batches = [next(samples.batches(number)) for number in range(2)]
    sums = []
    for parts in ([batches[0]], [batches[1]], batches):
        model.zero_grad()
        for batch in parts:
            images = batch.images.flatten(0, 1).contiguous(memory_format=torch.channels_last)[:, None]
            output: ModelOutput = model(images, model.plan(batch.rigs))
            total = compute_losses(output, batch.truth, config.losses, SETTING.grid).total(config.losses)
            torch.autograd.backward(total / len(parts))
        grad = model.heads.weight.grad
        assert grad is not None
        sums.append(grad.clone())
    assert_rounded((sums[0] + sums[1]) / 2, sums[2], SETTING.width_px * SETTING.height_px)


def test_accumulation_asks_for_as_many_batches(tmp_path: Path) -> None:
    config = made_config(train__steps=3, train__accumulate=2, evaluate__norm_batches=0)
    with join_process_group("cpu") as processes:
        setup = made_setup(config)
        train(setup, config, RunFolder(tmp_path / "run"), processes, TrainingMonitor())
    assert isinstance(setup.train, TinySamples)
    assert setup.train.asked[:6] == list(range(6))


def test_no_weight_decay_on_norms_and_biases() -> None:
    model = TinyModel()
    decayed, free = _optimizer(model, made_config(train__weight_decay=0.3)).param_groups
    assert (decayed["weight_decay"], free["weight_decay"]) == (0.3, 0.0)
    assert {id(each) for each in free["params"]} == {
        id(each) for name, each in model.named_parameters() if name.endswith("bias") or name.startswith("trunk.1")
    }
    assert len(decayed["params"]) == 3


def test_batch_norm_statistics_are_of_the_ema_weights(tmp_path: Path) -> None:
    config = made_config(evaluate__norm_batches=2)
    setup = made_setup(config)
    model = setup.model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    average = copy.deepcopy(model).eval()
    nn.init.constant_(average.trunk[0].weight, 0.05)
    at = TrainingRun(
        config=config,
        setup=setup,
        processes=HERE,
        folder=RunFolder(tmp_path),
        monitor=TrainingMonitor(),
        model=model,
        ema_model=average,
        optimizer=_optimizer(model, config),
        budget=Budget(1, None),
    )
    _reestimate_batch_norm(at)
    features = [
        average.trunk[0](batch.images[:, 0]) for batch, _ in zip(setup.train.batches(), range(2), strict=False)
    ]
    expected = torch.stack([each.mean((0, 2, 3)) for each in features]).mean(0)
    assert_rounded(average.trunk[1].running_mean, expected, 4 * SETTING.width_px * SETTING.height_px)
    assert not average.trunk[1].training
    assert average.trunk[1].momentum == 0.1
    assert not model.trunk[1].running_mean.any()


def test_the_best_weights_are_the_ema_weights_of_the_best_evaluation(tmp_path: Path) -> None:
    kept: list[dict[str, str]] = []

    def keep(path: Path, model: BEVModel, card: dict[str, str]) -> None:
        save(path, model, card)
        kept.append(card)

    config = made_config(train__steps=20)
    setup = made_setup(config)
    with join_process_group("cpu") as processes:
        progress = train(
            TrainingSetup(setup.model, setup.train, setup.val, keep),
            config,
            RunFolder(tmp_path / "run"),
            processes,
            TrainingMonitor(),
        )
    val = lines(tmp_path / "run", "val")
    best = max(val, key=lambda line: float(str(line["mean_iou"])))
    assert int(kept[-1]["step"]) == best["step"] == progress.best_step
    thresholds = best["thresholds"]
    assert isinstance(thresholds, dict)
    assert json.loads(kept[-1]["thresholds"]) == list(thresholds.values())


def test_occupancy_alone_has_no_colour(tmp_path: Path) -> None:
    run(tmp_path / "run", made_config(appearance=False, train__steps=5))
    val = lines(tmp_path / "run", "val")[-1]
    assert val["colour_l1"] is None
    assert (tmp_path / "run" / "curves.png").is_file()


def test_bf16_keeps_float32_weights(tmp_path: Path) -> None:
    setup = run(tmp_path / "run", made_config(train__precision="bf16", train__steps=5))
    assert {each.dtype for each in setup.model.parameters()} == {torch.float32}
    assert math.isfinite(float(str(lines(tmp_path / "run", "val")[-1]["mean_iou"])))


def test_a_budget_of_time_ends_and_anneals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count(0.0, 0.005)  # each look at it is 5 ms later, however busy the machine is
    monkeypatch.setattr("appocc.training.loop.time.perf_counter", lambda: next(clock))
    run(tmp_path / "run", made_config(train__steps=None, train__minutes=0.005, evaluate__every_steps=1000))
    last = lines(tmp_path / "run", "train")[-1]
    assert last["share"] == 1
    assert float(str(last["lr"])) < 0.02 / 2
    assert float(str(last["seconds"])) >= 0.3
    assert [line["step"] for line in lines(tmp_path / "run", "val")] == [last["step"]]


def test_nan_stops_the_training_before_the_weights_change(tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"step 1: expected finite .* road nan") as caught:
        run(tmp_path / "run", made_config(), poison=Poison(0, math.nan))
    assert caught.value.exit_code == 1
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "run").glob("*.safetensors"))


@pytest.mark.parametrize(
    ("factor", "reason"),
    [(math.nan, "step 13: expected finite losses"), (1e6, "step 13: expected a loss that falls, but it has grown")],
    ids=["no number", "growth"],
)
def test_divergence_keeps_the_last_good_weights(tmp_path: Path, factor: float, reason: str) -> None:
    folder = tmp_path / "run"
    config = made_config(train__steps=20)
    with pytest.raises(TrainingError, match=rf"^{reason}.*best.safetensors is kept\)$"):
        run(folder, config, poison=Poison(12, factor))
    assert [line["step"] for line in lines(folder, "val")] == [5, 10]
    with safe_open(folder / "best.safetensors", framework="pt") as file:
        assert all(file.get_tensor(name).isfinite().all() for name in file.keys())  # noqa: SIM118


def test_missing_validation_samples_are_an_error(tmp_path: Path) -> None:
    config = made_config(train__steps=2)
    setup = made_setup(config)
    with join_process_group("cpu") as processes, pytest.raises(DataError, match="expected samples, got none"):
        train(
            TrainingSetup(setup.model, setup.train, TinySamples(0), save),
            config,
            RunFolder(tmp_path / "run"),
            processes,
            TrainingMonitor(),
        )


def test_an_evaluation_can_be_stopped(tmp_path: Path) -> None:
    monitor = TrainingMonitor()
    monitor.on_step = lambda share, text: setattr(monitor, "stop_requested", text.startswith("step 5,"))
    with pytest.raises(StoppedError, match="after step 5"):
        run(tmp_path / "run", made_config(), monitor)
    assert (tmp_path / "run" / "state-00000005.safetensors").is_file()


def test_no_stop_request_is_lost(tmp_path: Path) -> None:
    """A signal may come while the processes tell each other whether there was one."""
    monitor = TrainingMonitor()

    class Interrupted(ProcessGroup):
        def mean(self, values: torch.Tensor) -> torch.Tensor:
            monitor.stop_requested = True
            return values

    config = made_config()
    with pytest.raises(StoppedError, match="after step 1;"):
        train(
            made_setup(config), config, RunFolder(tmp_path / "run"), Interrupted(0, 1, torch.device("cpu")), monitor
        )


def test_the_learning_rate_rises_and_falls() -> None:
    rates = [learning_rate(share, 1.0, 0.2) for share in (0.0, 0.1, 0.2, 0.6, 1.0)]
    assert rates == pytest.approx([0.04, 0.52, 1.0, 0.50005, 1e-4])
    assert learning_rate(0.0, 2.0, 0.0) == 2.0


def test_shares_of_budgets() -> None:
    assert Budget(10, None).share(5, 99.0) == 0.5
    assert Budget(None, 60.0).share(5, 15.0) == 0.25
    assert Budget(None, 60.0).share(5, 90.0) == 1.0


def test_ema_decay_is_lower_at_first() -> None:
    assert ema_decay(1, 0.999) == pytest.approx(2 / 11)
    assert ema_decay(10**6, 0.999) == 0.999


def test_iou_at_half_and_at_the_best_threshold_by_hand() -> None:
    samples = TinySamples()
    batch = samples.batch([0], 0)
    truth = batch.truth._replace(
        occupancy=torch.tensor([1.0, 1.0, 0.0, 0.0]).expand(1, 3, 1, 4).clone(),
        occupancy_valid=torch.ones(1, 3, 1, 4, dtype=torch.bool),
        appearance=torch.zeros(1, 3, 1, 4),
        appearance_valid=torch.ones(1, 1, 4, dtype=torch.bool),
    )
    truth.occupancy[:, 2] = 0  # no lane at all
    truth.occupancy_valid[:, 1, :, 3] = False
    probability = torch.tensor([0.9, 0.305, 0.2, 0.8]).expand(1, 3, 1, 4)
    output = ModelOutput(torch.logit(probability), torch.full((1, 3, 1, 4), 0.1), None)
    metrics = MetricAccumulator(torch.device("cpu"), SETTING.grid)
    terms = compute_losses(output, truth, made_config().losses, SETTING.grid)
    metrics.update(output, truth, terms, terms.total(made_config().losses))
    found = metrics.compute()
    assert found.iou == pytest.approx({"road": 1 / 3, "vehicle": 1 / 2, "lane": math.nan}, nan_ok=True)
    assert found.best_iou == pytest.approx({"road": 2 / 3, "vehicle": 1.0, "lane": math.nan}, nan_ok=True)
    assert 0.2 < found.thresholds["vehicle"] <= 0.305
    assert found.thresholds["lane"] == 0.5
    assert found.mean_iou == pytest.approx((2 / 3 + 1) / 2)
    assert found.colour_l1 == pytest.approx(25.5, rel=rounding(12))
    assert found.as_json()["iou"]["lane"] is None
    assert_rounded(found.losses["total"], terms.total(made_config().losses), len(terms.names()))


def test_a_prefetch_error_is_raised_at_its_item() -> None:
    samples = TinySamples()

    def failing() -> object:
        with prefetch(samples.batches(), TinyModel(), HERE.device, 2) as batches:
            yield from batches
        raise DataError("damaged")

    ahead = _prefetch_in_thread(failing())  # type: ignore[arg-type]
    assert [next(ahead).batch.number[0] for _ in range(2)] == [0, 4]
    with pytest.raises(DataError, match="damaged"):
        next(ahead)


def test_prefetching_can_be_closed(tmp_path: Path) -> None:
    with prefetch(TinySamples().batches(), TinyModel(), HERE.device) as batches:
        ahead = _prefetch_in_thread(batches)
        assert next(ahead).plan.seen.shape == (1 * 4, *SETTING.grid.shape)
        ahead.close()


def test_empty_curves_are_plotted(tmp_path: Path) -> None:
    plot_curves([], tmp_path / "c.png")
    assert read_image(tmp_path / "c.png").ndim == 3


def test_progress_is_json() -> None:
    assert json.loads(json.dumps(vars(TrainingProgress()))) == vars(TrainingProgress())


TWO = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
from made_training import made_config, run
run(Path({folder!r}), made_config(train__steps=6, train__accumulate=2))
"""


@pytest.mark.slow
def test_two_processes_train_as_one(tmp_path: Path) -> None:
    script, folder = tmp_path / "two.py", tmp_path / "run"
    script.write_text(TWO.format(path=[str(Path(__file__).parent)], folder=str(folder)))
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
    done = subprocess.run([*command, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    val = RunFolder(folder).read_metrics()[-1]
    assert val["samples"] == 10  # each sample once, whichever process it fell to
    assert (folder / "best.safetensors").is_file()
    assert [path.name for path in folder.glob("state-*")]

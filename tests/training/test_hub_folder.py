from __future__ import annotations

import json
import pickle
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from typer.testing import CliRunner, Result

from appocc.errors import AppoccError, DataError
from appocc.grid import BEVGrid
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import build
from appocc.models.shipped import PACKAGED, find_weights
from appocc.models.weights import save_weights
from appocc.training.hub_folder import pull_weights, push_weights
from appocc.yaml_file import parse_yaml
from cli.main import app

TINY = ModelSpec("own", ("CAM_A",), BEVGrid(0.0, 8.0, -4.0, 4.0, 0.5), 96, 64)
FIGURES = {"samples": 9, "iou": {"road": 0.5}, "iou_at_threshold": {"road": 0.61, "vehicle": None, "lane": 0.2}}


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["weights", *arguments])


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("weights") / "own.safetensors"
    card = {"figures": FIGURES, "step": 20, "commands": ["appocc train small"], "thresholds": [0.4, 0.3, 0.2]}
    texts = {"network": "appocc", **{name: json.dumps(value) for name, value in card.items()}}
    save_weights(path, build("appocc", TINY), {**texts, "attribution": "Trained on a street."})
    return path


@pytest.fixture(scope="module")
def pushed(weights: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pushed") / "my-model"
    push_weights(weights, str(folder), "cc-by-4.0")
    return folder


@pytest.fixture
def folder(pushed: Path, tmp_path: Path) -> Path:
    return shutil.copytree(pushed, tmp_path / "copy")


def head_and_text(folder: Path) -> tuple[dict[str, Any], str]:
    empty, head, text = (folder / "README.md").read_text().split("---\n", 2)
    assert empty == ""
    return parse_yaml(head), text


def test_weights_come_back_byte_by_byte(weights: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "folder", tmp_path / "out.safetensors"
    assert run("push", str(folder), "--weights", str(weights)).exit_code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["README.md", "config.json", "model.safetensors"]
    assert run("pull", str(folder), "--out", str(out)).exit_code == 0
    assert out.read_bytes() == weights.read_bytes()
    assert find_weights(folder) == folder / "model.safetensors"
    shown = json.loads(run("show", str(folder), "--json").stdout)
    assert shown["figures"] == FIGURES


def test_the_card_has_the_metadata_of_the_hub(pushed: Path) -> None:
    head, text = head_and_text(pushed)
    assert (head["license"], head["library_name"], head["metrics"]) == ("cc-by-4.0", "appocc", ["mean_iou"])
    assert "autonomous-driving" in head["tags"]
    (index,) = head["model-index"]
    (result,) = index["results"]
    assert index["name"] == "my-model"
    assert [(each["type"], each["name"], each["value"]) for each in result["metrics"]] == [
        ("mean_iou", "IoU road", 0.61),
        ("mean_iou", "IoU lane", 0.2),
    ]
    for line in ("road 61.0 %, lane 20.0 %", "| training | 20 steps |", "appocc train small", "Trained on a street."):
        assert line in text


def test_the_card_is_read_by_the_hubs_own_package(pushed: Path) -> None:
    hub = pytest.importorskip("huggingface_hub", reason="the extra hub is not installed")
    data = hub.ModelCard.load(pushed / "README.md").data
    assert (data.license, data.model_name) == ("cc-by-4.0", "my-model")
    assert [(each.metric_name, each.metric_value) for each in data.eval_results] == [
        ("IoU road", 0.61),
        ("IoU lane", 0.2),
    ]


def test_the_licence_of_the_packages_weights_is_known_and_of_others_not(weights: Path, tmp_path: Path) -> None:
    push_weights(PACKAGED, str(tmp_path / "shipped"))
    push_weights(weights, str(tmp_path / "others"))
    assert head_and_text(tmp_path / "shipped")[0]["license"] == "mit"
    assert head_and_text(tmp_path / "others")[0]["license"] == "unknown"


def test_a_clone_is_updated_and_keeps_its_other_files(folder: Path) -> None:
    before = (folder / "README.md").read_bytes()
    (folder / ".git").mkdir()
    (folder / "LICENSE").write_text("mine")
    (folder / "README.md").write_text("old")
    push_weights(folder / "model.safetensors", str(folder), "cc-by-4.0")
    assert (folder / "README.md").read_bytes() == before.replace(b"my-model", b"copy").replace(b"# my", b"# copy")
    assert (folder / "LICENSE").read_text() == "mine"


class Bomb:
    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return pytest.fail, ("it was unpickled",)


def _pickle(folder: Path) -> None:
    (folder / "pytorch_model.bin").write_bytes(pickle.dumps(Bomb()))


def _pickled_weights(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(pickle.dumps(Bomb()))


def _code(folder: Path) -> None:
    (folder / "modeling.py").write_text("raise SystemExit")


def _sub_folder(folder: Path) -> None:
    (folder / "more").mkdir()


def _without_config(folder: Path) -> None:
    (folder / "config.json").unlink()


def _without_weights(folder: Path) -> None:
    (folder / "model.safetensors").unlink()


def _other_config(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps({**config, "thresholds": [0.1, 0.1, 0.1]}))


def _list_config(folder: Path) -> None:
    (folder / "config.json").write_text("[]")


def _truncated(folder: Path) -> None:
    data = (folder / "model.safetensors").read_bytes()
    (folder / "model.safetensors").write_bytes(data[: len(data) // 2])


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (_pickle, r"pytorch_model\.bin: expected model\.safetensors, config\.json and documents only"),
        (_pickled_weights, r"model\.safetensors: not a readable file of weights"),
        (_code, r"modeling\.py: expected "),
        (_sub_folder, "more: expected "),
        (_without_config, r"config\.json: cannot be read \(No such file"),
        (_without_weights, r"model\.safetensors: no such file of weights"),
        (_other_config, r"config\.json: thresholds: expected \[0\.4, 0\.3, 0\.2\] as in model\.safetensors, got"),
        (_list_config, r"config\.json: expected a JSON object, got list"),
        (_truncated, r"model\.safetensors: not a readable file of weights"),
    ],
)
def test_a_folder_of_other_files_is_refused(
    folder: Path, tmp_path: Path, spoil: Callable[[Path], None], reason: str
) -> None:
    spoil(folder)
    with pytest.raises(DataError, match=reason) as caught:
        pull_weights(str(folder), tmp_path / "out.safetensors")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out.safetensors").exists()


def test_a_folder_of_documents_is_not_written_over(weights: Path, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(DataError, match=r"expected a new folder or one with model\.safetensors"):
        push_weights(weights, str(tmp_path))
    assert (tmp_path / "README.md").read_text() == "mine"
    with pytest.raises(
        DataError, match=r"nowhere: expected a folder with model\.safetensors and config\.json, got none"
    ):
        pull_weights(str(tmp_path / "nowhere"), tmp_path / "out.safetensors")
    with pytest.raises(DataError, match=r"expected a name that ends in \.safetensors"):
        pull_weights(str(tmp_path), tmp_path / "out.bin")


class FakeHub:
    """A hub in a folder: a repository is a folder of files."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def create_repo(self, repo_id: str, exist_ok: bool) -> None:
        (self.root / repo_id).mkdir(parents=True, exist_ok=exist_ok)

    def upload_folder(self, repo_id: str, folder_path: str, revision: str | None) -> None:
        shutil.copytree(folder_path, self.root / repo_id, dirs_exist_ok=True)

    def snapshot_download(
        self, repo_id: str, revision: str | None, local_dir: str, allow_patterns: list[str]
    ) -> None:
        if revision == "gone":
            raise RuntimeError("404 Client Error.\n\nRevision Not Found")
        for name in allow_patterns:
            shutil.copy(self.root / repo_id / name, local_dir)


@pytest.fixture
def hub(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeHub:
    fake = FakeHub(tmp_path / "hub")
    module = SimpleNamespace(HfApi=lambda: fake, snapshot_download=fake.snapshot_download)
    monkeypatch.setitem(sys.modules, "huggingface_hub", module)
    return fake


def test_weights_go_to_a_repository_and_back(hub: FakeHub, weights: Path, tmp_path: Path) -> None:
    result = run("push", "hf://me/mine", "--weights", str(weights))
    assert result.exit_code == 0, result.output
    assert "https://huggingface.co/me/mine: written" in result.stderr
    assert head_and_text(hub.root / "me/mine")[0]["model-index"][0]["name"] == "me/mine"
    _pickle(hub.root / "me/mine")  # not asked for
    pull_weights("hf://me/mine@main", tmp_path / "out.safetensors")
    assert (tmp_path / "out.safetensors").read_bytes() == weights.read_bytes()


def test_errors_of_the_hub_are_one_line(hub: FakeHub, weights: Path, tmp_path: Path) -> None:
    with pytest.raises(AppoccError, match=r"^hf://me/mine@gone: 404 Client Error\. Revision Not Found$"):
        pull_weights("hf://me/mine@gone", tmp_path / "out.safetensors")
    with pytest.raises(DataError, match=r"hf://mine: expected hf://OWNER/NAME or hf://OWNER/NAME@REVISION"):
        push_weights(weights, "hf://mine")


def test_a_missing_extra_is_named(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    with pytest.raises(AppoccError, match=r"hf://me/mine needs huggingface_hub: pip install '\.\[hub\]'"):
        push_weights(weights, "hf://me/mine")

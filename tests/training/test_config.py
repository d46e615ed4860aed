from __future__ import annotations

from pathlib import Path

import pytest

from appocc.errors import DataError
from appocc.training.config import Config, read_config
from appocc.training.configs import FOLDER, config_names, config_path

TEXT = """
data: {train: a, val: b}
train:
  steps: 10
  lr: 1e-3
"""
CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "c.yaml"
    path.write_text(TEXT)
    return path


def test_a_file_overrides_the_defaults(path: Path) -> None:
    config = read_config(path)
    assert (config.train.lr, config.train.steps, config.train.batch) == (1e-3, 10, 8)
    assert config.setting == "360"
    assert (config.data.train_roots, config.parts, config.data.clip) == (("a",), (), 1)


def test_overrides_replace_and_add(path: Path) -> None:
    words = ["train.lr=2e-4", "setting=180", "losses.classes=[1, 0, 2]", "train.steps=null", "train.minutes=1.5"]
    config = read_config(path, words)
    assert config.train.lr == 2e-4
    assert config.setting == "180"
    assert config.losses.classes == (1, 0, 2)
    assert (config.train.steps, config.train.minutes) == (None, 1.5)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["train.lrr=1"], "c.yaml with train.lrr=1: train.lrr: no such key (did you mean train.lr?)"),
        (["trian.lr=1"], "trian: no such key (did you mean train?)"),
        (["train.lr=fast"], "train.lr: expected a number"),
        (["train.lr=-1"], "train.lr: expected a number above 0, got -1"),
        (["train.lr=1e30"], "train.lr: expected 1000 or less, got '1e30'"),
        (["train.weight_decay=1e300"], "train.weight_decay: expected 1000 or less"),
        (["train.batch=1000000000"], "train.batch: expected 65536 or less, got 1000000000"),
        (["train.accumulate=1000000000"], "train.accumulate: expected 65536 or less"),
        (["train.threads=100000"], "train.threads: expected 1024 or less, got 100000"),
        (["train.lr=.nan"], "train.lr: expected a finite number"),
        (["train.precision=fp8"], "train.precision: expected 'auto', 'fp32' or 'bf16', got 'fp8'"),
        (["setting=270"], "setting: expected '360' or '180', got '270'"),
        (["losses.classes=[1, 2]"], "losses.classes"),
        (["train.minutes=5"], "either steps or minutes"),
        (["train.steps=null"], "either steps or minutes"),
        (["train.batch"], "expected key=value"),
        (["data.held_out=2"], "expected either val or held_out"),
        (["data.val=null"], "expected either val or held_out"),
        ([".=1"], "expected key=value"),
        (["network.size=1"], "'network' is a value"),
        (["train.lr=[1"], "no valid YAML value"),
        (["network=!!python/object/apply:os.getcwd []"], "no valid YAML value"),
        (["data=null"], "data: expected keys and values, got nothing"),
        (["data.train=[]"], "data.train: expected a folder or a list of folders, got []"),
        (["data.train=[a, 5]"], "data.train: expected a folder or a list of folders, got ['a', 5]"),
        (["data.train=5"], "data.train=5: data.train: expected a folder or a list of folders, got 5"),
        (["data.clip=0"], "data.clip: expected 1 or more, got 0"),
        (["data.clip=65"], "data.clip: expected 64 or less, got 65"),
        (["data.clip=3"], "c.yaml: train.batch: expected a multiple of data.clip=3, got 8"),
        (["parts=[memory]"], "c.yaml: data.clip: expected 2 or more, which train the part memory, got 1"),
        (["parts=[depth, wheels]"], "parts.1: expected 'depth', 'memory' or 'objects', got 'wheels'"),
        (["parts=depth"], "parts: expected a list, got 'depth'"),
    ],
)
def test_errors_are_one_line_with_file_and_key(path: Path, words: list[str], said: str) -> None:
    if words[0].startswith("network.size"):
        words = ["network=appocc", *words]
    with pytest.raises(DataError) as caught:
        read_config(path, words)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("data: {train: a", "no valid YAML"),
        ("network: !!python/object/apply:os.getcwd []", "no valid YAML"),
        ("- 1", "expected keys such as data and train, got list"),
        ("", "got NoneType"),
        ("data: {train: a, val: b}", "train: expected a value, got nothing"),
        ("data: {train: a, train: b}", "'train' occurs twice"),
        ("data: 2020-99-99", "no valid YAML"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(DataError, match=r"bad\.yaml") as caught:
        read_config(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none.yaml: cannot be read"):
        read_config(tmp_path / "none.yaml")


def test_a_configuration_survives_writing_and_reading(path: Path, tmp_path: Path) -> None:
    words = ["losses.pos_weight=[1, 2.5, 3]", "train.threads=2", "data.train=[a, c]", "parts=[memory]", "data.clip=4"]
    config = read_config(path, words)
    assert (config.data.train_roots, config.parts, config.data.clip) == (("a", "c"), ("memory",), 4)
    (tmp_path / "again.yaml").write_text(config.as_yaml())
    assert read_config(tmp_path / "again.yaml") == config


def test_differences_name_the_keys(path: Path) -> None:
    one, other = read_config(path), read_config(path, ["train.lr=5", "losses.classes=[1, 1, 2]"])
    assert one.differences(other) == ["train.lr", "losses.classes"]
    assert one.differences(one) == []


@pytest.mark.parametrize("name", config_names())
def test_shipped_files_are_found_by_name_and_in_the_clone(name: str) -> None:
    config = read_config(config_path(Path(name)))
    assert isinstance(config, Config)
    assert read_config(config_path(CONFIGS / f"{name}.yaml")) == config


def test_there_are_shipped_files() -> None:
    assert config_names() == ("recording", "release", "small")
    assert {path.stem for path in CONFIGS.glob("*.yaml")} == {*config_names()}


def test_an_existing_file_has_priority_over_a_shipped_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("small").mkdir()
    assert config_path(Path("small")) == FOLDER / "small.yaml"
    Path("release").write_text(TEXT)
    assert config_path(Path("release")) == Path("release")
    for wrong in ("smal", "small.yaml", "elsewhere/small"):
        with pytest.raises(DataError, match=f"{wrong}: cannot be read .*shipped are recording, release, small"):
            config_path(Path(wrong))

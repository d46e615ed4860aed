"""YAML of rigs and trainings: plain values only, read in bounded time and memory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from appocc.errors import DataError
from appocc.rigs import read_rig
from appocc.training.config import read_config
from appocc.yaml_file import parse_yaml, read_yaml

READERS: dict[str, Callable[[Path], object]] = {
    "yaml": read_yaml,
    "rig": lambda path: read_rig(str(path)),
    "training": read_config,
}
BOMB = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10))


def test_plain_values() -> None:
    assert parse_yaml("{a: [1, 2.5, x, null, true]}") == {"a": [1, 2.5, "x", None, True]}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "expected no alias"),
        ("a: &a [*a]", "expected no alias"),
        ("a: !!python/object/apply:os.mkdir [ran]", "could not determine a constructor for the tag"),
        ("a: !!python/name:os.system", "could not determine a constructor for the tag"),
        ("a: 1\nb: 2\na: 3", "'a' occurs twice"),
        ("a: [1", "expected ',' or ']'"),
        ("a: 2020-99-99", "month must be in 1..12"),
        ("[" * 5000, "recursion"),
        ("x" * 200_001, "expected at most 200000 bytes"),
    ],
)
def test_what_is_no_plain_value_is_one_short_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: str, text: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(DataError, match=r"a\.yaml: ") as caught:
        READERS[reader](tmp_path / "a.yaml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600
    assert not (tmp_path / "ran").exists()


def test_values_of_overrides_are_plain_as_well(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("data: {train: a}")
    with pytest.raises(DataError, match=r"no valid YAML value .*constructor for the tag"):
        read_config(tmp_path / "a.yaml", ["train.lr=!!python/object/apply:os.mkdir [ran]"])


def test_a_long_value_is_told_in_part(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"data: {{train: a, val: b}}\ntrain: [{'x, ' * 50_000}]")
    with pytest.raises(DataError, match=r"train: expected keys and values") as caught:
        read_config(tmp_path / "a.yaml")
    assert len(str(caught.value)) < 600

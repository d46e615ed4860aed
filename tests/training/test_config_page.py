from __future__ import annotations

from pathlib import Path

from appocc.training.config import Config, DataConfig
from appocc.training.config_page import attribute_docs, configuration_page

PAGE = Path(__file__).parents[2] / "docs" / "configuration.md"


def test_the_page_in_the_docs_is_up_to_date() -> None:
    assert PAGE.read_text() == configuration_page()


def test_every_key_is_on_the_page_with_its_range_and_default() -> None:
    page = configuration_page()
    values = Config(data=DataConfig(train="A", val="B"), train={"steps": 1}).model_dump()  # type: ignore[arg-type]
    for key, value in values.items():
        for name in [f"{key}.{inner}" for inner in value] if isinstance(value, dict) else [key]:
            assert f"| `{name}` |" in page, name
    assert "| `train.lr` | number above 0 to 1,000 | `0.002` | highest learning rate. |" in page
    assert "| `setting` | `360`, `180` | `360` |" in page
    assert "| `data.train` | text or list of text | needed |" in page


def test_descriptions_are_those_of_the_docstring() -> None:
    assert attribute_docs(DataConfig)["held_out"].endswith("for validation instead of training.")

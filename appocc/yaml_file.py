"""YAML that people write: rigs and trainings. Plain values only; nothing in it is executed, nothing unfolds."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import yaml

from appocc.errors import DataError
from appocc.files import read_text

# PyYAML reads some 50 kB a second; a rig of six cameras has 1 kB.
_MOST_BYTES = 200_000
_MOST_TOLD = 300


def read_yaml(path: Path) -> Any:
    """The value of a YAML file.

    Raises:
        DataError: if it cannot be read, is too large, or is no valid YAML.
    """
    text = read_text(path, _MOST_BYTES)
    try:
        return parse_yaml(text)
    except ValueError as error:
        raise DataError(f"{path}: no valid YAML ({error})") from error


def parse_yaml(text: str) -> Any:
    """The value of a YAML text.

    Raises:
        ValueError: if it is none, in one line: it has an alias, a key twice, a tag of Python, or is damaged.
    """
    try:
        return yaml.load(text, _Loader)
    # A date that is none, or a number of thousands of digits, is a plain ValueError of PyYAML.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(" ".join(str(error).split())[:_MOST_TOLD]) from error


class _Loader(yaml.SafeLoader):
    """YAML without aliases, which make gigabytes of a few lines, and in which no key hides another of its name."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "expected no alias (*name)", None)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        times = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        if twice := [name for name, count in times.items() if count > 1]:
            raise yaml.constructor.ConstructorError(None, None, f"'{twice[0]}' stands twice", node.start_mark)
        return super().construct_mapping(node, deep)

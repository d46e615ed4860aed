"""YAML files written by users, such as rigs and training configurations: plain values only, without aliases."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import yaml

from appocc.errors import DataError
from appocc.files import read_text
from appocc.typing import PathLike

# PyYAML reads about 50 kB a second; a rig of six cameras has 1 kB.
_MOST_BYTES = 200_000
_MESSAGE_CHARACTERS = 300


def read_yaml(path: PathLike) -> Any:
    """Read a YAML file.

    Raises:
        DataError: if it cannot be read, is too large, or is not valid YAML.
    """
    text = read_text(path, _MOST_BYTES)
    try:
        return parse_yaml(text)
    except ValueError as error:
        raise DataError(f"{path}: no valid YAML ({error})") from error


def parse_yaml(text: str) -> Any:
    """Parse a YAML text.

    Raises:
        ValueError: if it has an alias, a duplicate key, a Python tag or a syntax error; the message is one line.
    """
    try:
        return yaml.load(text, _Loader)
    # For an invalid date or a number of thousands of digits, PyYAML raises a plain ValueError.
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        # PyYAML names a text that came from no file.
        text = str(error).replace('in "<unicode string>", ', "in ")
        raise ValueError(" ".join(text.split())[:_MESSAGE_CHARACTERS]) from error


def plain_yaml(text: str) -> str:
    """Return the first document of OpenCV's or ROS' YAML, without OpenCV's own first line and tags."""
    documents = re.split(r"^---[ \t\r]*$", re.sub(r"\A\s*%YAML[^\n]*\n", "", text), flags=re.MULTILINE)
    return re.sub(r"!!opencv-[\w-]+", "", next((each for each in documents if each.strip()), ""))


class _Loader(yaml.SafeLoader):
    """YAML loader that refuses aliases, which can expand to gigabytes, and duplicate keys."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "expected no alias (*name)", None)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        times = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        if twice := [name for name, count in times.items() if count > 1]:
            raise yaml.constructor.ConstructorError(None, None, f"'{twice[0]}' occurs twice", node.start_mark)
        return super().construct_mapping(node, deep)

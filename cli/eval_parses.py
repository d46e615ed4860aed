"""`appocc eval parses`: accuracy of the command parser on labelled commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.common import JsonOption, emit, local_path, say, wide_console

if TYPE_CHECKING:
    from grounding.language.evaluation import ParseScores


def parses(
    labelled: Annotated[
        Path,
        typer.Argument(metavar="FILE.jsonl", parser=local_path, help="Labelled commands, one JSON object per line."),
    ],
    errors: Annotated[bool, typer.Option("--errors", help="List every command with a wrong field.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Evaluate the command parser against labelled commands: core parse and each field.

    Example: appocc eval parses commands.jsonl --errors
    """
    from grounding.language import parse
    from grounding.language.evaluation import read_labelled_commands, score_parser

    result = score_parser(read_labelled_commands(labelled), lambda text: parse(text).query.to_dict())
    if as_json:
        emit(result.as_json())
    if errors:
        _list_errors(result)
    _show(result.as_json())


def _list_errors(result: ParseScores) -> None:
    for one in result.commands:
        wrong = one.errors()
        if wrong:
            say(("" if one.core_correct else "core: ") + one.label["command"])
        for field, labelled, read in wrong:
            say(f"    {field}: labelled {labelled}, read {read}")


def _show(answer: dict[str, Any]) -> None:
    """Print the figures as tables to stderr."""
    from rich.table import Table

    low, high = answer["wilson"]
    say(f"{answer['records']} commands, core parse right {_percent(answer['core_parse_right'])} %")
    say(f"95 % interval {_percent(low)}..{_percent(high)}, lenient {_percent(answer['lenient'])} %")
    say(f"false rejects {_percent(answer['false_rejects'])} %, reject recall {_percent(answer['reject_recall'])} %")
    console = wide_console(100)
    fields = Table("field")
    fields.add_column("right %", justify="right")
    for name, share in answer["per_field"].items():
        counted = " (F1)" if name in ("qualifiers", "secondary", "excluded") else ""
        fields.add_row(name + counted, _percent(share))
    groups = Table("category")
    for head in ("commands", "core right"):
        groups.add_column(head, justify="right")
    for name, group in answer["by_category"].items():
        groups.add_row(name, str(group["records"]), str(group["right"]))
    console.print(fields)
    if len(answer["by_category"]) > 1:
        console.print(groups)


def _percent(share: float | None) -> str:
    """Format a share in percent; a dash stands for None, nothing counted."""
    return f"{100 * share:.1f}" if share is not None else "-"

"""The command `appocc`: its subcommands, and the one place where an error becomes a line and an exit code."""

from __future__ import annotations

import sys

import typer

from appocc.errors import AppoccError
from cli.common import say
from cli.convert import convert
from cli.demo import demo
from cli.doctor import doctor
from cli.ground import ground
from cli.groundtruth import groundtruth
from cli.track import track

app = typer.Typer(
    name="appocc",
    help="Six cameras to a bird's-eye view of what is where and what colour it is; tracks; grounded commands.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.command()(demo)
app.command()(convert)
app.command()(doctor)
app.command()(groundtruth)
app.command()(track)
app.command()(ground)


def run() -> None:
    """Entry point of the console script."""
    try:
        app()
    except AppoccError as error:
        say(f"error: {error}")
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        say("interrupted")
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(141)


if __name__ == "__main__":
    run()

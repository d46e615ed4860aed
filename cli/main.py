"""The command `appocc`: registers the subcommands and turns errors into one line and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import Annotated

import typer

from appocc.errors import AppoccError
from appocc.version import __version__
from cli.ablate import ablate
from cli.check_rig import check_rig
from cli.common import Interrupted, say_always, say_error, set_verbosity
from cli.convert import app as convert_app
from cli.demo import demo
from cli.doctor import doctor
from cli.eval import app as eval_app
from cli.export import export
from cli.ground import ground
from cli.groundtruth import groundtruth
from cli.infer import infer
from cli.pack import pack
from cli.record import app as record_app
from cli.report.command import report
from cli.rig import app as rig_app
from cli.serve import serve
from cli.simulate import simulate
from cli.track import app as track_app
from cli.train import train
from cli.view import view
from cli.weights import app as weights_app

app = typer.Typer(
    name="appocc",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"appocc {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("-q", "--quiet", help="Print errors only: no results for people, no progress.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="With an error, also print where in the code it arose.")
    ] = False,
) -> None:
    """Six cameras to a bird's-eye view of occupancy and colour; vehicle tracks; grounded commands."""
    set_verbosity(quiet, verbose)


app.command()(demo)
app.command()(simulate)
app.add_typer(convert_app)
app.add_typer(record_app)
app.command()(doctor)
app.command()(groundtruth)
app.command()(infer)
app.command("check-rig")(check_rig)
app.add_typer(rig_app)
app.command()(train)
app.command()(ablate)
app.command()(export)
app.command()(pack)
app.add_typer(track_app)
app.command()(ground)
app.command()(serve)
app.command()(view)
app.command()(report)
app.add_typer(eval_app)
app.add_typer(weights_app)


def _raise_interrupted(number: int, frame: FrameType | None) -> None:
    raise Interrupted(number)


def run() -> None:
    """Run the console script."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:  # a shell lets its background jobs ignore Ctrl-C
            signal.signal(number, _raise_interrupted)
    # OpenCV and its FFmpeg print warnings about damaged images and videos to stderr; our errors report them already.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("RUST_LOG", "off")  # Rerun likewise
    try:
        app()
    except Interrupted as interruption:
        say_always(str(interruption))
        raise
    except AppoccError as error:
        say_error(error)
        sys.exit(error.exit_code)
    except OSError as error:  # no permission, no space left, name too long, ...
        say_error(f"{error.filename or 'the system'}: {error.strerror or error}")
        sys.exit(AppoccError.exit_code)
    except RuntimeError as error:
        if "cannot cache function" not in str(error):
            raise
        say_error("numba: expected a writable folder for compiled code, got none; set NUMBA_CACHE_DIR")
        sys.exit(AppoccError.exit_code)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    run()

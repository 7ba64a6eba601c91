"""The application with all of its commands."""

from typing import Annotated

import typer

from grabberd import __version__
from grabberd.cli import storage, token
from grabberd.cli.accuracy import accuracy
from grabberd.cli.analyse import analyse
from grabberd.cli.backup import backup, restore
from grabberd.cli.calibrate import calibrate
from grabberd.cli.capture import capture
from grabberd.cli.check import check
from grabberd.cli.check_config import check_config
from grabberd.cli.devices import devices
from grabberd.cli.diagnostics import diagnostics
from grabberd.cli.export import export
from grabberd.cli.measure import measure
from grabberd.cli.plan import plan
from grabberd.cli.points import points
from grabberd.cli.render import render
from grabberd.cli.reprocess import reprocess
from grabberd.cli.serve import serve
from grabberd.cli.status import status
from grabberd.cli.trigger import trigger
from grabberd.kernel import in_use, what_is_slower

app = typer.Typer(
    name="grabberd",
    help="A 50 Hz three-dimensional measuring instrument from a frame grabber and a camera behind mirrors.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"grabberd {__version__} ({in_use()})")
        if slower := what_is_slower():
            typer.echo(slower)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


# In the order of a rig's life, which is that of the help; typer lists groups of commands after them.
for command in (
    *(serve, status, points, capture, trigger, calibrate, measure, accuracy, analyse, check, plan, export),
    *(render, reprocess, devices, diagnostics, backup, restore, check_config),
):
    app.command()(command)
app.add_typer(token.commands, name="token")
app.add_typer(storage.commands, name="storage")

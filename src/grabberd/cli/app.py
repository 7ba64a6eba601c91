"""The application with all of its commands."""

from typing import Annotated

import typer

from grabberd import __version__
from grabberd.cli import (
    accuracy,
    analyse,
    backup,
    calibrate,
    capture,
    check,
    check_config,
    devices,
    diagnostics,
    export,
    measure,
    plan,
    render,
    reprocess,
    serve,
    status,
    storage,
    token,
    trigger,
)
from grabberd.kernel import in_use

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
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


for command in (
    serve,
    status,
    capture,
    trigger,
    calibrate,
    measure,
    accuracy,
    analyse,
    check,
    plan,
    export,
    render,
    reprocess,
    devices,
    diagnostics,
    token,
    storage,
    backup,
    check_config,
):
    command.register(app)

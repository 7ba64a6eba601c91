"""The application with the commands that are needed: a daemon runs for months and keeps all that it loads."""

from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from grabberd import __version__
from grabberd.core.kernel import in_use, what_is_slower
from grabberd.errors import said
from grabberd.extension import extensions, in_order

# In the order of a rig's life, which is that of the help; typer lists groups of commands after them.
COMMANDS: Mapping[str, str] = {
    "serve": "grabberd.cli.serve",
    "status": "grabberd.cli.status",
    "points": "grabberd.cli.points",
    "capture": "grabberd.cli.capture",
    "trigger": "grabberd.cli.capture",
    "inspect": "grabberd.cli.inspect",
    "frame": "grabberd.cli.frame",
    "calibrate": "grabberd.cli.calibrate",
    "measure": "grabberd.cli.measure",
    "accuracy": "grabberd.cli.accuracy",
    "check": "grabberd.cli.check",
    "plan": "grabberd.cli.plan",
    "export": "grabberd.cli.export",
    "devices": "grabberd.cli.devices",
    "logger": "grabberd.cli.devices",
    "diagnostics": "grabberd.cli.diagnostics",
    "backup": "grabberd.cli.backup",
    "restore": "grabberd.cli.backup",
    "check-config": "grabberd.cli.check_config",
    "schema": "grabberd.cli.schema",
    "new": "grabberd.cli.new",
}
"""The program's own commands, by name, and the modules in which they are."""
GROUPS: Mapping[str, str] = {
    "jobs": "grabberd.cli.jobs",
    "token": "grabberd.cli.token",
    "storage": "grabberd.cli.storage",
}
"""Its own groups of commands, a module each."""


def commands() -> dict[str, str]:
    """All commands, those of extensions at their places."""
    return in_order(COMMANDS.items(), (one for extension in extensions() for one in extension.commands))


def groups() -> dict[str, str]:
    """All groups of commands, those of extensions at their places."""
    return in_order(GROUPS.items(), (one for extension in extensions() for one in extension.groups))


def is_own(name: str) -> bool:
    """True for a command or group of the program's own, which need not wait for extensions to be found."""
    return name in COMMANDS or name in GROUPS


class _Commands(TyperGroup):
    """The commands; what is wrong with a value is said without the words of what checks it."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that is named."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = said(error.message)
            raise


def application(*only: str) -> typer.Typer:
    """Make the application, with all of its commands or only those that are named."""
    app = typer.Typer(
        name="grabberd",
        cls=_Commands,
        help="A 50 Hz three-dimensional measuring instrument from a frame grabber and a camera behind "
        "mirrors.",
        epilog="First steps: 'grabberd serve' starts the daemon on a simulated grabber, for the browser at "
        "http://127.0.0.1:8050; 'grabberd capture --fields 64 --out liner.grab' records without a daemon.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_options)
    own = bool(only) and all(map(is_own, only))
    for name, module in (COMMANDS if own else commands()).items():
        if not only or name in only:
            app.command(name)(getattr(import_module(module), name.replace("-", "_")))
    for name, module in (GROUPS if own else groups()).items():
        if not only or name in only:
            app.add_typer(import_module(module).commands, name=name)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"grabberd {__version__} ({in_use()})")
        if slower := what_is_slower():
            typer.echo(slower)
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass

"""`grabberd backup` and `grabberd restore`: what the capture files do not know, in one file and back."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from grabberd import __version__
from grabberd.cli.options import ConfigOption, JsonOption, load, print_json


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command("backup")(backup)
    app.command("restore")(restore)


def backup(
    out: Annotated[Path, typer.Argument(help="The file to write, e.g. barn-2026-03-01.zip.")],
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Write settings, tokens, pins, notes and calibrations into one file; the daemon may run meanwhile.

    Captures are not in it: they are files of their own. Keep it as you keep a password.

    Example: grabberd backup --config /etc/grabberd/grabberd.yaml barn-2026-03-01.zip
    """
    from grabberd.service.clock import iso_utc  # noqa: PLC0415
    from grabberd.storage.state.backup import back_up  # noqa: PLC0415

    info = back_up(load(config).state_directory, out, iso_utc(datetime.now(UTC)), __version__)
    if json:
        print_json({"file": str(out), **info._asdict()})
    else:
        typer.echo(f"{out}: state and {info.calibrations} calibrations")


def restore(
    file: Annotated[Path, typer.Argument(help="A file that grabberd backup wrote.")],
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Put a backup in place; stop the daemon first, and run it as the daemon's own user.

    What is replaced is kept in a folder replaced-TIME. Captures stay as they are.

    Example: grabberd restore --config /etc/grabberd/grabberd.yaml barn-2026-03-01.zip
    """
    from grabberd.storage.state.backup import restore as put_back  # noqa: PLC0415

    now = f"{datetime.now(UTC):%Y%m%dT%H%M%S%fZ}"
    info, replaced = put_back(load(config).state_directory, file, now)
    if json:
        print_json({**info._asdict(), "replaced": str(replaced) if replaced else None})
        return
    typer.echo(f"restored state and {info.calibrations} calibrations of {info.created_utc}")
    if replaced:
        typer.echo(f"what was there before is in {replaced}")

"""`grabberd token`: manages the tokens that grant access to the daemon."""

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from grabberd.cli.options import ConfigOption, JsonOption, load, print_json
from grabberd.cli.terminal import console
from grabberd.documents.enums import Role

if TYPE_CHECKING:
    from grabberd.archive.access import Access

commands = typer.Typer(
    help="Create, list and remove access tokens. Run it as the daemon's user.", no_args_is_help=True
)
NameArgument = Annotated[str, typer.Argument(help="Name of the owner or purpose, e.g. tablet-north.")]


@commands.command()
def add(
    name: NameArgument,
    role: Annotated[
        Role, typer.Option(help="viewer: read only; operator: capture and calibrate; admin: everything.")
    ],
    days: Annotated[
        int | None, typer.Option(min=1, max=3650, help="Days until it expires; default: never.")
    ] = None,
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Create a token and print it; only its hash is stored, so it cannot be shown again.

    Example: grabberd token add tablet-north --role operator

    Example: grabberd token add visitor --role viewer --days 7
    """
    access = _access(config)
    secret = access.add(name, role, None if days is None else timedelta(days=days))
    if json:
        expires_utc = next(row.expires_utc for row in access.list() if row.name == name)
        print_json({"name": name, "role": role, "token": secret, "expires_utc": expires_utc})
        return
    # Beside standard output, which holds the secret alone, so that a script can store it.
    typer.echo("This token is shown only once; keep it as safe as a password:", err=True)
    typer.echo(secret)


@commands.command("list")
def list_tokens(config: ConfigOption = None, json: JsonOption = False) -> None:
    """List the tokens, without their secrets.

    Example: grabberd token list
    """
    rows = _access(config).list()
    if json:
        print_json([row._asdict() for row in rows])
        return
    from grabberd.runtime import SystemClock, iso_utc  # noqa: PLC0415 - loads numpy

    now_utc = iso_utc(SystemClock().utc_now())
    table = Table("name", "role", "created", "expires", "sessions")
    for row in rows:
        table.add_row(
            row.name, row.role, _minute(row.created_utc), _until(row.expires_utc, now_utc), str(row.sessions)
        )
    console.print(table)


@commands.command()
def remove(name: NameArgument, config: ConfigOption = None) -> None:
    """Remove a token; it and its sessions end immediately, without a restart.

    Example: grabberd token remove tablet-north
    """
    _access(config).remove(name)
    typer.echo(f"token {name} and its sessions have ended")


def _until(expires_utc: str | None, now_utc: str) -> str:
    if expires_utc is None:
        return "valid until revoked"
    return f"{_minute(expires_utc)} (expired)" if expires_utc <= now_utc else _minute(expires_utc)


def _minute(moment_utc: str) -> str:
    """Shorten a time to minutes, so that the table fits a terminal."""
    return f"{moment_utc[:16]}Z"


def _access(config: Path | None) -> "Access":
    from grabberd.archive.access import Access  # noqa: PLC0415
    from grabberd.archive.state.state_keeper import StateBackups  # noqa: PLC0415

    directory = load(config).state_directory
    StateBackups(directory).check()
    access = Access(directory)
    access.open()
    return access

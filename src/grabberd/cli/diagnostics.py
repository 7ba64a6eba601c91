"""`grabberd diagnostics`: one file to send to whoever helps."""

from pathlib import Path
from typing import Annotated

import typer

from grabberd.cli.options import DEFAULT_URL, TokenFileOption, UrlOption, warn
from grabberd.errors import NotReady, StorageError


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("diagnostics")(diagnostics)


def diagnostics(
    out: Annotated[Path, typer.Option(help="The ZIP file to write; never overwritten.")],
    words: Annotated[bool, typer.Option("--words", help="With labels, notes and the site's name.")] = False,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
) -> None:
    """Put what a helper has to know into one file: versions, devices, ledgers, log; nothing secret.

    Where no daemon answers, only what is known of the computer. The file is plain text: look into it first.

    Example: grabberd diagnostics --out barn.zip
    """
    from grabberd.cli.remote import download  # noqa: PLC0415
    from grabberd.service.diagnostics import bundle, machine_parts  # noqa: PLC0415

    if out.exists():
        raise StorageError(f"{out} exists already", "name another file; nothing is overwritten")
    try:
        download(url, f"/api/v1/diagnostics?words={'true' if words else 'false'}", out, token_file)
    except NotReady as error:
        warn([f"{error.message}: the file says how this computer is, not how the daemon is"])
        _write(out, bundle(machine_parts()))
    typer.echo(f"{out}: look into it, then send it")


def _write(out: Path, content: bytes) -> None:
    try:
        out.write_bytes(content)
    except OSError as error:
        raise StorageError(f"{out} cannot be written: {error.strerror}", "name another file") from error

"""`grabberd diagnostics`: one file to send to whoever helps."""

import os
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import typer

from grabberd.cli.options import DEFAULT_URL, ConfigOption, TokenFileOption, UrlOption, load, warn
from grabberd.errors import GrabberdError, NotReady, StorageError

HINT = (
    "run it as root or as the daemon's own user, with the daemon's --config and STATE_DIRECTORY, "
    "or with the token of an admin (--token-file)"
)
LOOPBACK = ("localhost", "127.0.0.1", "::1")


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("diagnostics")(diagnostics)


def diagnostics(
    out: Annotated[Path, typer.Option(help="The ZIP file to write; never overwritten.")],
    words: Annotated[bool, typer.Option("--words", help="With labels, notes and the site's name.")] = False,
    config: ConfigOption = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
) -> None:
    """Put what a helper has to know into one file: versions, devices, ledgers, log; nothing secret.

    A daemon on this computer gives it to its own user and to root, who need no token but its configuration;
    elsewhere it takes the token of an admin. Where no daemon answers, only what is known of the computer. The
    file is plain text: look into it first.

    Example: grabberd diagnostics --out barn.zip

    Example: sudo grabberd diagnostics --config /etc/grabberd/grabberd.yaml --out barn.zip
    """
    from grabberd.cli.remote.client import download  # noqa: PLC0415
    from grabberd.service.diagnostics import bundle, machine_parts  # noqa: PLC0415

    if out.exists():
        raise StorageError(f"{out} exists already", "name another file; nothing is overwritten")
    try:
        token = token_file or _key_of_the_machine(config, url)
        download(url, f"/api/v1/diagnostics?words={'true' if words else 'false'}", out, token)
    except NotReady as error:
        warn([f"{error.message}: the file says how this computer is, not how the daemon is"])
        _write(out, bundle(machine_parts()))
    except GrabberdError as error:
        if token_file:
            raise
        raise GrabberdError(error.message, HINT) from error
    typer.echo(f"{out}: look into it, then send it")


def _key_of_the_machine(config: Path | None, url: str) -> Path | None:
    """The file with the daemon's own key, which is not taken to another computer."""
    from grabberd.service.machine_key import readable_key  # noqa: PLC0415

    if os.environ.get("GRABBERD_TOKEN") or urlsplit(url).hostname not in LOOPBACK:
        return None
    return readable_key(load(config).state_directory)


def _write(out: Path, content: bytes) -> None:
    try:
        out.write_bytes(content)
    except OSError as error:
        raise StorageError(f"{out} cannot be written: {error.strerror}", "name another file") from error

"""`grabberd diagnostics`: collects everything support needs into one file."""

import os
import socket
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

import typer

from grabberd.cli import options
from grabberd.errors import GrabberdError, NotReady

HINT = (
    "run it as root or as the daemon's user, with the daemon's --config and STATE_DIRECTORY, "
    "or with an admin's token (--token-file)"
)
LOOPBACK = ("localhost", "127.0.0.1", "::1")


def diagnostics(
    out: Annotated[Path, options.out_file("a ZIP file")],
    words: Annotated[
        bool, typer.Option("--words", help="Include labels, notes and the name of the site.")
    ] = False,
    config: options.ConfigOption = None,
    url: options.ConfiguredUrlOption = None,
    token_file: options.TokenFileOption = None,
) -> None:
    """Collect versions, devices, ledgers and log into one file for support; contains no secrets.

    The daemon is asked at the address in the configuration. On the daemon's own computer, root and the
    daemon's user need no token, only that configuration; elsewhere an admin's token is required. If no daemon
    answers, the file describes the computer only. It is plain text: review it before sending.

    Example: grabberd diagnostics --out barn.zip

    Example: sudo grabberd diagnostics --config /etc/grabberd/grabberd.yaml --out barn.zip
    """
    from grabberd.client.daemon import Daemon  # noqa: PLC0415
    from grabberd.files.disk import storage_errors  # noqa: PLC0415
    from grabberd.server.daemon.diagnostics import bundle, machine_parts  # noqa: PLC0415

    options.check_absent(out)
    try:
        address = options.daemon_url(url, config)
        key = token_file or _key_of_the_machine(config, address, configured=url is None)
        daemon = Daemon(address, key)
        daemon.download(f"/api/v1/diagnostics?words={str(words).lower()}", out)
    # Support also needs the computer's facts if the daemon does not run, so this is no failure.
    except NotReady as error:
        options.warn([f"{error.message}: the file describes this computer, not the daemon"])
        content = bundle(machine_parts())
        with storage_errors(out):
            out.write_bytes(content)
    except GrabberdError as error:
        if token_file:
            raise
        raise GrabberdError(error.message, HINT) from error
    typer.echo(f"{out}: review it, then send it")


def _key_of_the_machine(config: Path | None, url: str, *, configured: bool = False) -> Path | None:
    """File with the key of a local daemon; never sent to another computer.

    Args:
        config: The daemon's configuration.
        url: Its address.
        configured: True if it comes from the configuration, and so may be any address of this computer.
    """
    from grabberd.archive.access import readable_key  # noqa: PLC0415

    host = urlsplit(url).hostname
    is_here = host in LOOPBACK or (configured and host is not None and _is_of_this_computer(host))
    if os.environ.get("GRABBERD_TOKEN") or not is_here:
        return None
    return readable_key(options.load(config).state_directory)


def _is_of_this_computer(host: str) -> bool:
    """True if every address of the host is one of this computer: no other can be bound."""
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)
        for family, kind, _, _, address in found:
            with socket.socket(family, kind) as one:
                one.bind(address)
    except OSError:
        return False
    return bool(found)

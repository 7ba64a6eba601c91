"""`grabberd serve`: the daemon."""

import ipaddress
import logging
import sys
from pathlib import Path
from typing import Annotated

import typer

from grabberd.cli.options import ConfigOption, load
from grabberd.config import default_config_file
from grabberd.errors import ConfigError, Problem

SWITCH_INTERVAL_S = 0.001
"""The capture thread must not wait five milliseconds for the interpreter."""


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("serve")(serve)


def serve(
    config: ConfigOption = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default=False)] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port to listen on.", show_default=False)
    ] = None,
) -> None:
    """Run the daemon: the devices stream, the API serves.

    Without a configuration it runs on the simulated grabber and needs nothing else.

    Example: grabberd serve --config /etc/grabberd/grabberd.yaml
    """
    import uvicorn  # noqa: PLC0415

    from grabberd.api import create_app  # noqa: PLC0415
    from grabberd.service.service import Service  # noqa: PLC0415
    from grabberd.service.setup import set_up  # noqa: PLC0415

    sys.setswitchinterval(SWITCH_INTERVAL_S)
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    settings = load(config)
    file: Path = config or default_config_file()
    address = host or settings.http.host
    if not _is_loopback(address):
        message = f"{address} is no loopback address, and there are no tokens that say who may use the daemon"
        raise ConfigError([Problem(str(file), "http.host", message)])
    service = Service.from_config(settings, set_up(settings, file))
    service.start()  # before the server, so that what keeps it from starting is said plainly
    uvicorn.run(
        create_app(service),
        host=address,
        port=settings.http.port if port is None else port,
        access_log=False,
        timeout_graceful_shutdown=5,
    )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"

"""`grabberd serve`: runs the daemon; at a terminal, tells where everything is, and what is lacking."""

import importlib.util
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from grabberd import __version__
from grabberd.cli import EX_IOERR, complain
from grabberd.cli.options import ConfigOption, load
from grabberd.core.kernel import in_use
from grabberd.errors import StorageError

SWITCH_INTERVAL_S = 0.001
"""Longest wait for the interpreter lock; at Python's default of 5 ms the capture thread loses fields."""


def serve(
    config: ConfigOption = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.", show_default=False)] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port to listen on.", show_default=False)
    ] = None,
) -> None:
    """Run the daemon: capture from all devices and serve the API and the page.

    Without a configuration it runs on the simulated grabber. It serves other computers only if there are
    tokens: grabberd token add.

    Example: grabberd serve --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.config import default_config_file  # noqa: PLC0415
    from grabberd.instrument.channels.logger_setup import set_up_loggers  # noqa: PLC0415
    from grabberd.instrument.setup import set_up  # noqa: PLC0415
    from grabberd.memory import freeze_loaded, keep_freed_memory  # noqa: PLC0415
    from grabberd.server.api import create_app, serving  # noqa: PLC0415
    from grabberd.server.api.guard.front import Front, bind, check_private, inherited, is_private, to_open  # noqa: PLC0415
    from grabberd.server.daemon.descriptors import affordable_connections, raise_limit  # noqa: PLC0415
    from grabberd.server.daemon.diagnostics import set_up_logging  # noqa: PLC0415
    from grabberd.server.daemon.service import Service  # noqa: PLC0415
    from grabberd.server.daemon.systemd import Heartbeat, Notifier  # noqa: PLC0415

    notifier = Notifier.from_environment(os.environ)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    keep_freed_memory()
    for_person = set_up_logging()
    descriptors = raise_limit()
    settings = load(config)
    file: Path = config or default_config_file()
    http = settings.http
    # All that can be wrong with the configuration is checked before a socket or a device is opened.
    context = None if http.tls is None else serving.tls_context(http.tls, file)
    service = Service.from_config(settings, set_up(settings, file), set_up_loggers(settings, file), file)
    freeze_loaded()  # before fields come
    # Bound before any device starts: an address in use ends the command at once.
    listening = inherited(os.environ) or bind(host or http.host, http.port if port is None else port)
    try:
        # Without tokens only this computer is served, and only the open database tells if there are any.
        service.open()
        check_private(listening, service.access.needs_token(), file)
        service.start()  # before the server, so that a failure to start is reported in plain words
    except StorageError as error:
        if error.__cause__ is None:  # not a fault of the disk: another program still holds the folder
            raise
        complain(error)
        raise typer.Exit(EX_IOERR) from error
    most = affordable_connections(http.limits.connections, descriptors)
    limits = http.limits.model_copy(update={"connections": most})
    front = Front.from_config(http.model_copy(update={"limits": limits}), all(map(is_private, listening)))
    heartbeat = Heartbeat(notifier, service.liveness)
    server = serving.server_of(create_app(service, front), front, context, heartbeat)
    address = to_open(listening, "https" if context else "http", http.hosts)
    if for_person and address:
        captures = (settings.storage.directory or settings.state_directory) / "captures"
        server.greeting = first_words(address, file, config is None, captures)
    if not serving.run(server, listening):
        raise typer.Exit(1)


PARTS = {
    "report": ("matplotlib", "figures in reports"),
    "parquet": ("pyarrow", "tables as Parquet"),
    "hdf5": ("h5py", "points as HDF5"),
    "mqtt": ("aiomqtt", "publishing to a broker"),
}
"""What is optional, by the extra that brings it: a module that tells, and what it is for."""


def is_installed(module: str) -> bool:
    """Tell whether a module can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def first_words(address: str, config: Path, is_default: bool, captures: Path) -> str:
    """A few lines: documentation, configuration, captures, what is not installed, the address to open."""
    lines = [f"grabberd {__version__} ({in_use()})", f"  documentation  {address}/docs"]
    of_default = " (the simulated grabber; for a real one, copy v4l2.yaml beside it and give --config)"
    lines.append(f"  configuration  {config}{of_default if is_default else ''}")
    lines.append(f"  captures       {captures}")
    missing = [extra for extra, (module, _) in PARTS.items() if not is_installed(module)]
    if missing:
        lacking = ", ".join(PARTS[extra][1] for extra in missing)
        lines.append(f"  not installed  {lacking}: pip install 'grabberd[{','.join(missing)}]'")
    return "\n".join([*lines, "Ctrl-C ends it.", f"Open {address}"])

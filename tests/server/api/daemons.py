"""A daemon that serves on a loopback port, for clients that are programs of their own."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from running import PATIENCE_S, wait_until_it_accepts

from grabberd.server.api import create_app
from grabberd.server.api.guard.front import Front, bind
from grabberd.server.api.serving import server_of
from grabberd.server.daemon.service import Service
from server.api.conftest import service_in


class Daemon(NamedTuple):
    """Its address, and what runs in it."""

    url: str
    service: Service


@contextmanager
def serving(folder: Path, **options: object) -> Iterator[Daemon]:
    """On the simulated grabber."""
    with served(service_in(folder, **options)) as daemon:
        wait_until_it_accepts(daemon.service)
        yield daemon


@contextmanager
def served(service: Service) -> Iterator[Daemon]:
    """Any service; its devices may not stream yet."""
    server = server_of(create_app(service), Front())
    sockets = bind("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, args=(sockets,))
    thread.start()
    try:
        yield Daemon(f"http://127.0.0.1:{sockets[0].getsockname()[1]}", service)
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)

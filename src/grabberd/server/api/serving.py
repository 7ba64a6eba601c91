"""The server: runs the application on sockets, with TLS and limits, notifies systemd, and ends in time.

A thread may hang in the kernel, on a missing disk or in a driver, and Python would wait for it. So the
process is ended by force some seconds after the signal to end, whatever its threads are doing.
"""

import asyncio
import contextlib
import logging
import os
import select
import socket
import ssl
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import uvicorn
from fastapi import FastAPI

from grabberd.config import TlsConfig
from grabberd.errors import ConfigError, Problem
from grabberd.server.api.guard.front import Front, describe
from grabberd.server.api.guard.limits import connection_class
from grabberd.server.api.streams.feeds import Feeds
from grabberd.server.daemon.descriptors import AT_ONCE, exhaustion
from grabberd.server.daemon.service import Service
from grabberd.server.daemon.systemd import Heartbeat

log = logging.getLogger(__name__)

LEFT_S = 9.0
"""Time from the signal to the forced end."""
EX_TEMPFAIL = 75
"""Exit status of a forced end."""
_LOGGED_S = 0.5


class ForcedEnd:
    """Ends the process by force if it has not ended some time after the signal.

    Args:
        left_s: Time from the signal to the forced end.
        end: Ends the process; returns only in tests.
    """

    def __init__(self, left_s: float = LEFT_S, end: Callable[[], None] | None = None) -> None:
        self._left_s = left_s
        self._end = end or end_now
        self._reading, self._writing = os.pipe()
        self._thread = threading.Thread(target=self._wait, name="forced-end", daemon=True)
        self._signalled = False

    def start(self) -> None:
        """Starts waiting for the signal."""
        self._thread.start()

    def signal_received(self) -> None:
        """Starts the countdown; for a signal handler, which must not take a lock. May be called twice."""
        if not self._signalled:
            self._signalled = True
            os.write(self._writing, b"!")

    def close(self) -> None:
        """Stops waiting in a process that continues; does nothing once the countdown has started."""
        if not self._signalled:
            os.close(self._writing)
            self._thread.join()

    def _wait(self) -> None:
        signalled = os.read(self._reading, 1)
        if signalled:
            select.select([], [], [], self._left_s)
            self._end()
        else:
            os.close(self._reading)


def end_now() -> None:
    """Ends the process without waiting for anything; its child processes notice and end as well."""
    # In a thread: logging may hang, too.
    logged = threading.Thread(target=_log, daemon=True)
    logged.start()
    logged.join(_LOGGED_S)
    os._exit(EX_TEMPFAIL)


def _log() -> None:
    names = ", ".join(sorted(one.name for one in threading.enumerate() if one.is_alive()))
    log.critical(
        "not everything has ended %g s after the signal to end, so it is ended by force: a capture that is "
        "not sealed yet is sealed at the next start; threads left: %s",
        LEFT_S,
        names,
    )


HEAD_BYTES = 32_768
WEBSOCKET_BYTES = 65_536
"""Enough for any client message: clients have nothing to send on the preview's WebSocket."""
SHUTDOWN_S = 3
"""Time for responses to complete; captures are sealed meanwhile."""
GREETING_AFTER_S = 3.0
WAITING = 1024
"""Length of the kernel's queue of connections to be accepted."""


def tls_context(tls: TlsConfig, file: Path) -> ssl.SSLContext:
    """The TLS context with the certificate, TLS 1.2 or later.

    Raises:
        ConfigError: the files cannot be read, are not PEM, or do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(tls.certificate, tls.key, password="")  # None would prompt on the terminal
    except (OSError, ssl.SSLError) as error:
        reason = getattr(error, "reason", None) or error.strerror or "no PEM"
        message = f"{tls.certificate} and {tls.key} cannot be used: {reason}"
        raise ConfigError([Problem(str(file), "http.tls", message)]) from error
    return context


class BeatingServer(uvicorn.Server):
    """A server that notifies systemd of start and stop, and sends a heartbeat while its event loop runs."""

    def __init__(self, config: uvicorn.Config, heartbeat: Heartbeat | None) -> None:
        super().__init__(config)
        self._heartbeat = heartbeat
        self.forced_end: ForcedEnd | None = None
        self.greeting = ""
        """Line for the person who started the daemon, printed once the devices have had time to start."""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Handles a signal to end."""
        if self.forced_end is not None:
            self.forced_end.signal_received()
        super().handle_exit(sig, frame)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts to serve, with the kernel's queue of connections at its full length again."""
        await super().startup(sockets)
        for one in sockets or ():
            one.listen(WAITING)

    async def main_loop(self) -> None:
        """Serves until asked to stop."""
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(_explain)
        if self.greeting:
            say = partial(print, self.greeting, file=sys.stderr, flush=True)
            loop.call_later(GREETING_AFTER_S, say)
        if self._heartbeat is None:
            await super().main_loop()
            return
        self._heartbeat.notifier.ready()
        beating = asyncio.create_task(_beat(self._heartbeat))
        try:
            await super().main_loop()
        finally:
            beating.cancel()
            self._heartbeat.notifier.stopping()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Ends captures and live streams, then the server, which waits for all responses to complete."""
        state = getattr(self.config.app, "state", None)
        service: Service | None = getattr(state, "service", None)
        feeds: Feeds | None = getattr(state, "feeds", None)
        if service is not None:
            # Not in the server's thread pool, whose threads may all be blocked.
            threading.Thread(target=service.end_captures, name="end-captures", daemon=True).start()
        if feeds is not None:
            feeds.close()
        await super().shutdown(sockets)


def _explain(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Counts failures for lack of descriptors, such as accepting a client; logs everything else."""
    if not exhaustion.explains(context.get("exception")):
        loop.default_exception_handler(context)


async def _beat(heartbeat: Heartbeat) -> None:
    """Beats by the event loop's clock; uvicorn's callback_notify uses the time of day, which can jump."""
    while True:
        heartbeat.beat(asyncio.get_running_loop().time())
        await asyncio.sleep(heartbeat.every_s)


def server_of(
    app: FastAPI, front: Front, context: ssl.SSLContext | None = None, heartbeat: Heartbeat | None = None
) -> BeatingServer:
    """The server of an application; proxy headers are left to the gate."""
    config = uvicorn.Config(
        app,
        http=connection_class(front),
        ssl_context_factory=None if context is None else lambda *_: context,
        h11_max_incomplete_event_size=HEAD_BYTES,
        ws_max_size=WEBSOCKET_BYTES,
        ws_per_message_deflate=False,  # messages are deflated once for all clients
        proxy_headers=False,
        server_header=False,
        access_log=False,
        # uvicorn accepts so many in one round, before the limit of connections counts any of them.
        backlog=AT_ONCE,
        log_config=None,  # logging is configured in the daemon's own format
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    return BeatingServer(config, heartbeat)


def run(server: BeatingServer, sockets: list[socket.socket]) -> bool:
    """Serves until a signal ends it; returns True if it had started.

    Whatever has not ended some seconds after the signal is ended by force, with the process.
    """
    scheme = "https" if server.config.is_ssl else "http"
    log.info("listening on %s", ", ".join(describe(one, scheme) for one in sockets))
    server.forced_end = forced_end = ForcedEnd()
    forced_end.start()
    with contextlib.suppress(KeyboardInterrupt):
        server.run(sockets)
    forced_end.close()
    return server.started

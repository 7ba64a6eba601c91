"""The server: an application on sockets, with or without a certificate, within its limits."""

import contextlib
import logging
import socket
import ssl
from pathlib import Path

import uvicorn
from fastapi import FastAPI

from grabberd.api.connections import connection_class
from grabberd.api.front import Front
from grabberd.api.sockets import describe
from grabberd.config import TlsConfig
from grabberd.errors import ConfigError, Problem

log = logging.getLogger(__name__)

HEAD_BYTES = 32_768
WEBSOCKET_BYTES = 65_536
"""No client has more than a word to say on a WebSocket."""
SHUTDOWN_S = 5


def tls_context(tls: TlsConfig, file: Path) -> ssl.SSLContext:
    """What the certificate is shown with, TLS 1.2 or later.

    Raises:
        ConfigError: the files cannot be read, are none, or do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(tls.certificate, tls.key, password="")  # without one, it asks the terminal
    except (OSError, ssl.SSLError) as error:
        reason = getattr(error, "reason", None) or error.strerror or "no PEM"
        message = f"{tls.certificate} and {tls.key} cannot be used: {reason}"
        raise ConfigError([Problem(str(file), "http.tls", message)]) from error
    return context


def server_of(app: FastAPI, front: Front, context: ssl.SSLContext | None = None) -> uvicorn.Server:
    """The server of an application; what a proxy says of its clients is not believed."""
    config = uvicorn.Config(
        app,
        http=connection_class(front.limits),
        ssl_context_factory=None if context is None else lambda *_: context,
        h11_max_incomplete_event_size=HEAD_BYTES,
        ws_max_size=WEBSOCKET_BYTES,
        proxy_headers=False,
        server_header=False,
        access_log=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    return uvicorn.Server(config)


def run(server: uvicorn.Server, sockets: list[socket.socket]) -> bool:
    """Serves until a signal ends it; returns whether it has started at all."""
    scheme = "https" if server.config.is_ssl else "http"
    log.info("listening on %s", ", ".join(describe(one, scheme) for one in sockets))
    with contextlib.suppress(KeyboardInterrupt):
        server.run(sockets)
    return server.started

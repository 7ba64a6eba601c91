"""A connection to an MQTT broker that only publishes. Nothing is subscribed to, so nothing can be ordered.

MQTT 5, whose acknowledgements say whether the broker has taken a message; those of 3.1.1 say nothing.
"""

import asyncio
import json
import logging
import ssl
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any

import aiomqtt
from paho.mqtt.reasoncodes import ReasonCode

from grabberd.config.mqtt import MqttConfig, MqttTlsConfig
from grabberd.errors import NotReady
from grabberd.service.mqtt.messages import Message

ACKNOWLEDGED_S = 10.0
FAREWELL_S = 2.0
QOS = 1
_HINT = "check mqtt in the configuration and the broker's log; under systemd install the drop-in egress.conf"

_silent = logging.getLogger(f"{__name__}.client")
_silent.setLevel(logging.CRITICAL)  # what goes wrong is said by us, once


class Connection:
    """Publishes one message after the other, each until it is acknowledged."""

    def __init__(self, client: "_Client") -> None:
        self._client = client

    async def publish(self, message: Message, timeout_s: float = ACKNOWLEDGED_S) -> None:
        """Returns once the broker has taken it.

        Raises:
            NotReady: it has not: it is gone, does not answer, or refuses it.
        """
        text = json.dumps(message.content, ensure_ascii=False, separators=(",", ":"))
        self._client.refusal = None
        try:
            await self._client.publish(message.topic, text, QOS, message.retained, timeout=timeout_s)
        except aiomqtt.MqttError as error:
            raise _not_ready(error) from error
        if self._client.refusal is not None:
            words = f"the broker refuses {message.topic}: {self._client.refusal}"
            raise NotReady(
                words, "let the daemon's user publish below its prefix, in the broker's access list"
            )

    async def during(self, work: Coroutine[Any, Any, None]) -> None:
        """Does some work as long as the connection lasts.

        Raises:
            NotReady: it was lost.
        """
        working = asyncio.ensure_future(work)
        lasting = asyncio.ensure_future(self._last())
        try:
            done, _ = await asyncio.wait((working, lasting), return_when=asyncio.FIRST_COMPLETED)
            for one in done:
                one.result()
        finally:
            for one in (working, lasting):
                one.cancel()
            await asyncio.gather(working, lasting, return_exceptions=True)

    async def _last(self) -> None:
        try:
            async for _ in self._client.messages:  # none ever comes; it ends with the connection
                pass
        except aiomqtt.MqttError as error:
            raise NotReady(f"the broker is gone: {error.__cause__}", _HINT) from error


class Broker:
    """The broker of a configuration.

    Args:
        config: where it is, and who we are to it.
        client_id: our name.
        context: of TLS, if it is spoken.
    """

    def __init__(self, config: MqttConfig, client_id: str, context: ssl.SSLContext | None) -> None:
        self._config = config
        self._client_id = client_id
        self._context = context

    @asynccontextmanager
    async def connected(self, farewell: Message) -> AsyncIterator[Connection]:
        """A connection for the block.

        Args:
            farewell: is said at its end, by us or, where it breaks, by the broker as our last will.

        Raises:
            NotReady: the broker is not there, refuses us, or was lost.
        """
        client = self._client(farewell)
        try:
            async with client:
                connection = Connection(client)
                try:
                    yield connection
                finally:
                    with suppress(NotReady):
                        await connection.publish(farewell, FAREWELL_S)
        except aiomqtt.MqttError as error:
            raise _not_ready(error) from error
        finally:
            client.hang_up()

    def _client(self, farewell: Message) -> "_Client":
        host, port = self._config.address
        return _Client(
            host,
            port,
            username=self._config.user,
            password=self._password(),
            identifier=self._client_id,
            protocol=aiomqtt.ProtocolVersion.V5,
            will=aiomqtt.Will(farewell.topic, json.dumps(farewell.content), QOS, farewell.retained),
            clean_start=True,
            keepalive=self._config.keepalive_s,
            timeout=ACKNOWLEDGED_S,
            tls_context=self._context,
            logger=_silent,
        )

    def _password(self) -> str | None:
        file = self._config.password_file
        if file is None:
            return None
        try:
            return file.read_text(encoding="utf-8").rstrip("\r\n")
        except (OSError, UnicodeDecodeError) as error:
            raise NotReady(f"{file} cannot be read: {error}", "let the daemon's user read it") from error


class _Client(aiomqtt.Client):
    """Also hears what an acknowledgement says."""

    refusal: ReasonCode | None = None

    def _on_publish(
        self, client: Any, userdata: Any, mid: int, reason_code: ReasonCode, properties: Any
    ) -> None:
        if reason_code.is_failure:
            self.refusal = reason_code
        super()._on_publish(client, userdata, mid, reason_code, properties)

    def hang_up(self) -> None:
        """Closes what is left open with a broker that never answered."""
        self._client._sock_close()  # aiomqtt does not


def tls_context(tls: MqttTlsConfig) -> ssl.SSLContext:
    """What the broker is known by, TLS 1.2 or later, its name checked.

    Raises:
        OSError: a file cannot be read, is none, or does not belong to the other.
    """
    context = ssl.create_default_context(cafile=tls.ca)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if tls.certificate is not None:
        context.load_cert_chain(tls.certificate, tls.key, password="")  # without one, it asks the terminal
    return context


def _not_ready(error: aiomqtt.MqttError) -> NotReady:
    cause = error.__cause__
    words = f"{error}: {cause}" if cause else str(error)
    return NotReady(f"the broker cannot be reached: {words}", _HINT)

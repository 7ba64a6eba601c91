"""A connection to an MQTT broker that only publishes.

It speaks MQTT 5: its acknowledgements say whether the broker took a message or its access list refused it.
Those of 3.1.1 are the same either way, so that a refused summary would count as delivered.
"""

import asyncio
import json
import logging
import ssl
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from grabberd.config.daemon import MqttConfig, MqttTlsConfig
from grabberd.errors import NotReady
from grabberd_mqtt.messages import Message

ACKNOWLEDGED_S = 10.0
FAREWELL_S = 2.0
QOS = 1
"""At least once: a receiver tells a repeated summary by its `capture_id`."""
LARGEST_PACKET = 1 << 16
"""Bytes of a packet from the broker, which only acknowledges; by itself the library collects 256 MB."""
_PUBLISH = 0x30
"""Type of a message's packet, in the upper half of its first byte."""
_HINT = "check mqtt in the configuration and the broker's log; under systemd install the drop-in egress.conf"

_silent = logging.getLogger(f"{__name__}.client")
_silent.setLevel(logging.CRITICAL)  # the publisher logs failures, once for each cause


class Connection:
    """Publishes one message after the other and waits for each acknowledgement."""

    def __init__(self, client: "_Client") -> None:
        self._client = client

    async def publish(self, message: Message, timeout_s: float = ACKNOWLEDGED_S) -> None:
        """Publishes a message and returns once the broker has taken it.

        Raises:
            NotReady: The broker is gone, does not answer, or refuses the message.
        """
        text = _text(message)
        self._client.refusal = None
        try:
            await self._client.publish(message.topic, text, QOS, message.retained, timeout=timeout_s)
        except aiomqtt.MqttError as error:
            raise self._client.not_ready(error) from error
        if self._client.refusal is not None:
            words = f"the broker refuses {message.topic}: {self._client.refusal}"
            raise NotReady(
                words, "let the daemon's user publish below its prefix, in the broker's access list"
            )

    async def during(self, work: Coroutine[Any, Any, None]) -> None:
        """Runs some work for as long as the connection lasts.

        Raises:
            NotReady: The connection was lost.
        """
        working = asyncio.ensure_future(work)
        connected = asyncio.ensure_future(self._until_lost())
        try:
            done, _ = await asyncio.wait((working, connected), return_when=asyncio.FIRST_COMPLETED)
            for one in done:
                one.result()
        finally:
            for one in (working, connected):
                one.cancel()
            await asyncio.gather(working, connected, return_exceptions=True)

    async def _until_lost(self) -> None:
        # Nothing is subscribed to, so no message ever comes: the iteration ends with the connection, also
        # while nothing is being published.
        try:
            async for _ in self._client.messages:
                pass
        except aiomqtt.MqttError as error:
            raise NotReady(f"the broker is gone: {self._client.excess or error.__cause__}", _HINT) from error


class Broker:
    """The broker named in the configuration.

    Args:
        config: Address and credentials.
        client_id: MQTT client id.
        context: TLS context; None to connect without TLS.
    """

    def __init__(self, config: MqttConfig, client_id: str, context: ssl.SSLContext | None) -> None:
        self._config = config
        self._client_id = client_id
        self._context = context

    @asynccontextmanager
    async def connected(self, farewell: Message) -> AsyncIterator[Connection]:
        """Connects for the length of a block.

        Args:
            farewell: Published at its end: by us or, if the connection breaks, by the broker as last will.

        Raises:
            NotReady: The broker cannot be reached, refuses us, or was lost.
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
            raise client.not_ready(error) from error
        finally:
            client.close_socket()

    def _client(self, farewell: Message) -> "_Client":
        host, port = self._config.address
        return _Client(
            host,
            port,
            username=self._config.user,
            password=self._password(),
            identifier=self._client_id,
            protocol=aiomqtt.ProtocolVersion.V5,
            will=aiomqtt.Will(farewell.topic, _text(farewell), QOS, farewell.retained),
            clean_start=True,
            keepalive=self._config.keepalive_s,
            properties=_largest_packet(),
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
    """Keeps the reason code of an acknowledgement, which aiomqtt ignores.

    It ends the connection at the first bytes of what an honest broker never sends: a message, as nothing is
    subscribed to, or a packet that announces more than an acknowledgement can have.

    Attributes:
        refusal: Reason code of the last acknowledgement, if it is a refusal.
        excess: What the broker sent and why the connection was ended for it; None if it sent nothing of that.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.refusal: ReasonCode | None = None
        self.excess: str | None = None
        self._receive = self._client._sock_recv
        self._client._sock_recv = self._receive_bounded  # type: ignore[method-assign]

    def not_ready(self, error: aiomqtt.MqttError) -> NotReady:
        """The exception to be raised for an error of this connection."""
        cause = self.excess or error.__cause__
        words = f"{error}: {cause}" if cause else str(error)
        return NotReady(f"the broker cannot be reached: {words}", _HINT)

    def _receive_bounded(self, bufsize: int) -> bytes:
        packet = self._client._in_packet
        if packet["command"] & 0xF0 == _PUBLISH:
            self.excess = "it sends a message, although nothing is subscribed to"
        elif packet["remaining_length"] > LARGEST_PACKET:
            self.excess = f"it announces a packet of more than {LARGEST_PACKET} bytes"
        else:
            return self._receive(bufsize)
        raise ConnectionError(self.excess)

    def _on_publish(
        self, client: Any, userdata: Any, mid: int, reason_code: ReasonCode, properties: Any
    ) -> None:
        if reason_code.is_failure:
            self.refusal = reason_code
        super()._on_publish(client, userdata, mid, reason_code, properties)

    def close_socket(self) -> None:
        """Closes the socket, which aiomqtt leaves open if the broker never answered."""
        self._client._sock_close()


def tls_context(tls: MqttTlsConfig) -> ssl.SSLContext:
    """Creates a TLS context, 1.2 or later, that checks the broker's certificate and host name.

    Raises:
        OSError: A file cannot be read or is invalid, or the certificate and the key do not match.
    """
    context = ssl.create_default_context(cafile=tls.ca)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if tls.certificate is not None:
        context.load_cert_chain(tls.certificate, tls.key, password="")  # else ssl prompts on the terminal
    return context


def _text(message: Message) -> str:
    if message.content is None:
        return ""
    return json.dumps(message.content, ensure_ascii=False, separators=(",", ":"))


def _largest_packet() -> Properties:
    properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    properties.MaximumPacketSize = LARGEST_PACKET
    return properties

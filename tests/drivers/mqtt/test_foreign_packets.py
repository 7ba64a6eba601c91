"""What a broker sends without being asked: it is refused by its first bytes, and never collected."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest
from running import PATIENCE_S

pytest.importorskip("aiomqtt", reason="pip install 'grabberd[mqtt]'")

import asyncio

from grabberd.config import MqttConfig
from grabberd.errors import NotReady
from grabberd_mqtt.broker import Broker
from grabberd_mqtt.messages import Message

ACCEPTED = bytes([0x20, 3, 0, 0, 0])
BODY = 60_000_000
FAREWELL = Message("grabberd/barn/online", {"online": False}, retained=True)


def head(packet: int, length: int) -> bytes:
    """The first bytes of an MQTT packet."""
    found = bytearray([packet])
    while True:
        length, digit = divmod(length, 128)
        found.append(digit | (128 if length else 0))
        if not length:
            return bytes(found)


class Talker:
    """A broker that accepts one client and then sends what it likes; `sent` counts the bytes of a body."""

    def __init__(self, first: bytes, body: int) -> None:
        self.sent, self.asked = 0, b""
        self._first, self._body = first, body
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self.thread = threading.Thread(target=self._serve)
        self.thread.start()

    def close(self) -> None:
        self._server.close()
        self.thread.join(PATIENCE_S)

    def _serve(self) -> None:
        with suppress(OSError):
            client, _ = self._server.accept()
            with client:
                client.settimeout(PATIENCE_S)
                self.asked = client.recv(1 << 16)
                client.sendall(ACCEPTED)
                client.recv(1 << 16)
                client.sendall(self._first)
                while self.sent < self._body:
                    self.sent += client.send(bytes(1 << 16))


@contextmanager
def talker(first: bytes, body: int) -> Iterator[Talker]:
    one = Talker(first, body)
    try:
        yield one
    finally:
        one.close()


def until_lost(port: int) -> str:
    """Connects and publishes; the words for what becomes of that."""

    async def connect() -> None:
        broker = Broker(MqttConfig(host="127.0.0.1", port=port), "grabberd-test", None)
        async with broker.connected(FAREWELL) as connection:
            await connection.publish(FAREWELL)

    with pytest.raises(NotReady) as refused:
        asyncio.run(connect())
    return refused.value.message


def test_a_message_that_nobody_subscribed_to_ends_the_connection_before_its_body() -> None:
    with talker(head(0x34, BODY) + b"\x00\x01a\x00\x01\x00", BODY) as broker:
        words = until_lost(broker.port)
    assert broker.sent < BODY / 2
    assert "it sends a message, although nothing is subscribed to" in words


def test_an_acknowledgement_is_refused_by_the_length_that_it_announces() -> None:
    with talker(head(0x40, BODY), BODY) as broker:
        words = until_lost(broker.port)
    assert broker.sent < BODY / 2
    assert "it announces a packet of more than 65536 bytes" in words


def test_an_honest_broker_is_told_the_longest_packet() -> None:
    with talker(head(0x34, 4), 0) as broker:
        until_lost(broker.port)
    assert bytes([0x27, *(1 << 16).to_bytes(4, "big")]) in broker.asked

"""Attacks on the HTTP front: what a hostile or broken client does, for as long as it is let."""

import base64
import os
import select
import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.synchronize import Event
from typing import NamedTuple

SMALL = 4096
"""Receive buffer of a client that never reads."""
PAUSE_S = 0.02
TIMEOUT_S = 20.0


class Target(NamedTuple):
    """A daemon under attack, and a capture that takes long to read."""

    port: int
    capture_id: str


Answers = Counter[str]
"""Answers by their status; `hung up` counts connections that ended without one."""
Attack = Callable[[Target, Event, Answers], None]


def address(number: int) -> str:
    """Address of its own on loopback for each of many clients."""
    return f"127.1.{1 + number // 200}.{1 + number % 200}"


def nobody(_: Target, over: Event, __: Answers) -> None:
    """Nobody does anything."""
    over.wait()


def streams_never_read(target: Target, over: Event, answers: Answers) -> None:
    """Fifty clients of the events and twenty of the preview, none of whom reads."""
    key = base64.b64encode(os.urandom(16)).decode()
    upgrade = ("Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}")
    preview = _request("GET /api/v1/preview", *upgrade, "Sec-WebSocket-Version: 13")
    with ExitStack() as stack:
        for number in range(70):
            client = stack.enter_context(_connected(target, address(number), SMALL))
            client.sendall(_request("GET /api/v1/events") if number < 50 else preview)
        over.wait()
        answers["streams held"] += 70


def idle_of_one(target: Target, over: Event, answers: Answers) -> None:
    """Three hundred connections of one client that says nothing, renewed as they end."""
    _held(target, over, answers, [address(0)] * 300, b"")


def slow_heads(target: Target, over: Event, answers: Answers) -> None:
    """Two hundred clients, each of which sends the head of its request a byte at a time."""
    _held(target, over, answers, [address(number) for number in range(200)], b"X")


def a_thousand(target: Target, over: Event, answers: Answers) -> None:
    """A thousand clients with a connection each, which they keep."""
    _held(target, over, answers, [address(number) for number in range(1000)], b"")


def endless_bodies(target: Target, over: Event, answers: Answers) -> None:
    """Twenty clients, each of which sends a body in chunks that has no end."""
    head = _request("POST /api/v1/captures", "Content-Type: application/json", "Transfer-Encoding: chunked")
    chunk = b"8000\r\n" + b" " * 0x8000 + b"\r\n"

    def one(number: int) -> None:
        while not over.is_set():
            with suppress(OSError), _connected(target, address(number)) as client:
                client.sendall(head)
                while not over.is_set() and not _answered(client, answers):
                    client.sendall(chunk)

    _at_once(one, 20)


def reads_that_are_left(target: Target, over: Event, answers: Answers) -> None:
    """Forty-five clients ask for all points of a long capture again and again, and leave after .3 s."""
    request = _request(f"GET /api/v1/captures/{target.capture_id}/points?max_points=200000")

    def one(number: int) -> None:
        while not over.is_set():
            with suppress(OSError), _connected(target, address(number)) as client:
                client.sendall(request)
                if select.select([client], [], [], 0.3)[0]:
                    _answered(client, answers)
                else:
                    answers["left"] += 1

    _at_once(one, 45)


def downloads_never_read(target: Target, over: Event, answers: Answers) -> None:
    """Forty-five clients ask for a long CSV file and do not read it."""
    request = _request(f"GET /api/v1/captures/{target.capture_id}/points.csv")
    with ExitStack() as stack:
        for number in range(45):
            client = stack.enter_context(_connected(target, address(number), SMALL))
            client.sendall(request)
        over.wait()
        answers["downloads held"] += 45


def wrong_words(target: Target, over: Event, answers: Answers) -> None:
    """Ten clients send what is no HTTP, host names and pages of others, and wrong tokens."""
    requests = (
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
        b"GET /api/v1/state HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        _request("GET /api/v1/state", "Origin: https://evil.example"),
        _request("GET /api/v1/state", "Authorization: Bearer wrong"),
        _request("GET /api/v1/captures?since=0001-01-01T00:00:00%2B14:00"),
        _request("GET /api/v1/state", *(f"X-{n}: {'x' * 1000}" for n in range(60))),
    )

    def one(number: int) -> None:
        while not over.is_set():
            for request in requests:
                with suppress(OSError), _connected(target, address(number)) as client:
                    client.sendall(request)
                    select.select([client], [], [], TIMEOUT_S)
                    _answered(client, answers)
                over.wait(PAUSE_S)

    _at_once(one, 10)


def _held(target: Target, over: Event, answers: Answers, addresses: Sequence[str], drip: bytes) -> None:
    """Holds connections, opens those that end anew, and sends a byte of a head on each from time to time."""
    held: dict[str | tuple[str, int], socket.socket] = {}
    keys = [(one, number) for number, one in enumerate(addresses)]
    with ExitStack() as stack:
        while not over.is_set():
            for key in keys:
                if key not in held and not over.is_set():
                    with suppress(OSError):
                        held[key] = socket.create_connection(
                            ("127.0.0.1", target.port), TIMEOUT_S, (key[0], 0)
                        )
                        stack.callback(held[key].close)
                        held[key].sendall(b"GET / HTTP/1.1\r\n" if drip else b"")
            over.wait(0.5)
            for key, client in list(held.items()):
                with suppress(OSError):
                    client.sendall(drip)
                if _answered(client, answers):
                    client.close()
                    del held[key]


def _answered(client: socket.socket, answers: Answers) -> bool:
    """Whether a client has been answered, or hung up on; what it was told is counted."""
    if not select.select([client], [], [], 0)[0]:
        return False
    try:
        told = client.recv(SMALL)
    except OSError:
        told = b""
    answers[told.split(b" ", 2)[1].decode() if told.startswith(b"HTTP/1.1 ") else "hung up"] += 1
    return True


def _at_once(one: Callable[[int], None], count: int) -> None:
    threads = [threading.Thread(target=one, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _request(line: str, *headers: str) -> bytes:
    return "\r\n".join((f"{line} HTTP/1.1", "Host: 127.0.0.1", *headers, "", "")).encode()


@contextmanager
def _connected(target: Target, source: str, buffer: int | None = None) -> Iterator[socket.socket]:
    with socket.socket() as client:
        client.settimeout(TIMEOUT_S)
        if buffer is not None:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        client.bind((source, 0))
        client.connect(("127.0.0.1", target.port))
        yield client


ATTACKS: Mapping[str, Attack] = {
    "nobody": nobody,
    "50 clients of the events and 20 of the preview never read": streams_never_read,
    "one client holds 300 idle connections": idle_of_one,
    "200 clients send their heads a byte at a time": slow_heads,
    "1000 clients hold a connection each": a_thousand,
    "20 clients send endless chunked bodies": endless_bodies,
    "45 clients ask for all points of a long capture and leave": reads_that_are_left,
    "45 clients ask for a long CSV and never read": downloads_never_read,
    "10 clients send no HTTP, foreign names and pages, wrong tokens": wrong_words,
}

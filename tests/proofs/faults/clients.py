"""Faults of clients: too many of them, and those that never read."""

import base64
import os
import select
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from .daemon import PATIENCE_S
from .finding import Finding, nothing_lost, unless
from .machine import Machine

CLIENTS = 200
WRITE_TIMEOUT_S = 2.0
"""How long a client may read nothing, in these tests."""
SMALL = 4096


def clients_at_once(machine: Machine) -> Finding:
    """Two hundred follow the events while a capture runs."""
    daemon = machine.daemon
    capture_id = daemon.start_capture()
    begin_s = time.monotonic()
    with connected(daemon.port, CLIENTS, "/api/v1/events") as sockets:
        told = answered(sockets, b"event: change", begin_s + PATIENCE_S)
        all_told_s = time.monotonic() - begin_s
        begin_s = time.monotonic()
        health = daemon.ask("/healthz").status
        asked_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    problems = unless(
        (told == CLIENTS, f"{told} of {CLIENTS} were told of a change"),
        (health == 200, f"who asks meanwhile is answered by {health}"),
    )
    behaviour = f"all see changes within {all_told_s:.1f} s; other requests take {asked_s:.2f} s"
    return Finding(behaviour, None, None, (*problems, *nothing_lost(evidence), *machine.whole_capture()))


def clients_beyond_the_limit(machine: Machine) -> Finding:
    """More connections than the daemon may have."""
    daemon = machine.daemon
    begin_s = time.monotonic()
    with connected(daemon.port, 300, "/api/v1/events") as sockets:
        refused = answered(sockets, b"too-many-connections", begin_s + 2.0)
        noticed_s = time.monotonic() - begin_s
    begin_s = time.monotonic()
    while daemon.ask("/healthz").status != 200:
        assert time.monotonic() < begin_s + PATIENCE_S
        time.sleep(0.05)
    recovered_s = time.monotonic() - begin_s
    problems = unless((refused >= 300 - 256, f"{refused} of 300 were refused"))
    behaviour = f"{refused} of 300 are refused with a message (503); the others are served"
    return Finding(behaviour, noticed_s, recovered_s, (*problems, *machine.whole_capture()))


def takes_a_file_and_never_reads(machine: Machine) -> Finding:
    """A client asks for a large capture and takes nothing of it, while another capture runs."""
    daemon = machine.daemon
    large = daemon.sealed(daemon.start_capture(fields=100, bits=8))["id"]
    capture_id = daemon.start_capture()
    time.sleep(0.5)  # until the connections of before are closed
    before = _sockets(daemon.process.pid)
    with _silent(daemon.port, f"GET /api/v1/captures/{large}/file"):
        came = _until(lambda: _sockets(daemon.process.pid) > before)
        begin_s = time.monotonic()
        gone = came and _until(lambda: _sockets(daemon.process.pid) <= before)
        noticed_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    problems = unless((gone, f"after {noticed_s:.0f} s it is not hung up on"))
    behaviour = (
        f"is disconnected after reading nothing for http.limits.write_timeout_s, here {WRITE_TIMEOUT_S:g} s"
    )
    return Finding(behaviour, noticed_s, None, (*problems, *nothing_lost(evidence), *machine.whole_capture()))


def streams_and_never_reads(machine: Machine) -> Finding:
    """Clients ask for the events and for the preview and take nothing of them.

    What little comes a second fills their sockets slowly.
    """
    key = base64.b64encode(os.urandom(16)).decode()
    wanted = f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13"
    port, pid = machine.daemon.port, machine.daemon.process.pid
    with (
        _silent(port, "GET /api/v1/events"),
        _silent(port, "GET /api/v1/preview", "Upgrade: websocket", "Connection: Upgrade", wanted),
    ):
        before_kb = resident_kb(pid)
        capture_id = machine.daemon.start_capture()
        time.sleep(3.0)
        told = machine.daemon.stop_capture(capture_id)
        grown_kb = resident_kb(pid) - before_kb
    evidence = machine.evidence(told)
    problems = unless((grown_kb < 50_000, f"the daemon has grown by {grown_kb} kB"))
    behaviour = "nobody waits for them, and the daemon buffers nothing for them"
    return Finding(behaviour, None, None, (*problems, *nothing_lost(evidence), *machine.whole_capture()))


def idle_connections_of_one(machine: Machine) -> Finding:
    """One client holds three hundred connections and says nothing, while a capture runs."""
    daemon = machine.daemon
    capture_id = daemon.start_capture()
    begin_s = time.monotonic()
    with ExitStack() as held:
        for _ in range(300):
            held.enter_context(_from("127.0.7.7", daemon.port))
        noticed_s = time.monotonic() - begin_s
        with _from("127.0.7.7", daemon.port) as same:
            refused = _refused(same)
        begin_s = time.monotonic()
        health = daemon.ask("/healthz").status
        asked_s = time.monotonic() - begin_s
    evidence = machine.evidence(daemon.stop_capture(capture_id))
    problems = unless(
        (refused, "one connection more of the same client is accepted"),
        (health == 200, f"another client is answered by {health}"),
    )
    behaviour = (
        f"it gets http.limits.connections_per_client and no more (429); other requests take {asked_s:.2f} s"
    )
    return Finding(behaviour, noticed_s, None, (*problems, *nothing_lost(evidence), *machine.whole_capture()))


def _from(address: str, port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), PATIENCE_S, (address, 0))


def _refused(client: socket.socket) -> bool:
    """Whether a client is told that it has too many connections, or is hung up on."""
    with suppress(ConnectionError):
        client.sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        answer = client.recv(65536)
        return not answer or answer.startswith(b"HTTP/1.1 429")
    return True


@contextmanager
def connected(port: int, count: int, path: str) -> Iterator[list[socket.socket]]:
    """So many clients, each of an address of its own."""
    sockets = []
    try:
        for number in range(count):
            sockets.append(_from(f"127.0.{1 + number // 200}.{1 + number % 200}", port))
            sockets[-1].sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        for one in sockets:
            one.setblocking(False)
        yield sockets
    finally:
        for one in sockets:
            one.close()


def answered(sockets: Sequence[socket.socket], word: bytes, until_s: float) -> int:
    """How many are told a word in time."""
    heard = dict.fromkeys(sockets, b"")
    waiting = set(sockets)
    while waiting and (left_s := until_s - time.monotonic()) > 0:
        for one in select.select(list(waiting), [], [], left_s)[0]:
            with suppress(ConnectionError):
                heard[one] += (news := one.recv(65536))
                if not news or word in heard[one]:
                    waiting.discard(one)
                continue
            waiting.discard(one)
    return sum(word in said for said in heard.values())


@contextmanager
def _silent(port: int, request: str, *headers: str) -> Iterator[socket.socket]:
    """A client that asks and never reads."""
    with socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SMALL)
        client.connect(("127.0.0.1", port))
        lines = (f"{request} HTTP/1.1", "Host: 127.0.0.1", *headers, "", "")
        client.sendall("\r\n".join(lines).encode())
        yield client


def _until(so: Callable[[], bool]) -> bool:
    """Whether it becomes so."""
    end_s = time.monotonic() + PATIENCE_S / 3
    while not so():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.01)
    return True


def _sockets(pid: int) -> int:
    """How many a process has open."""
    links = []
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            links.append(os.readlink(entry))
    return sum(link.startswith("socket:") for link in links)


def resident_kb(pid: int) -> int:
    with open(f"/proc/{pid}/statm") as statm:
        return int(statm.read().split()[1]) * 4


FAULTS: Mapping[str, Callable[[Machine], Finding]] = {
    "two hundred clients at once": clients_at_once,
    "more clients than http.limits.connections": clients_beyond_the_limit,
    "one client holds three hundred idle connections": idle_connections_of_one,
    "a client requests a large file and never reads": takes_a_file_and_never_reads,
    "clients of events and preview never read": streams_and_never_reads,
}

"""Who can reach a socket is asked of the socket itself."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest

from grabberd.errors import ConfigError, Conflict
from grabberd.server.api.guard.front import (
    GONE_AFTER_MS,
    UNSENT_BYTES,
    bind,
    check_private,
    describe,
    inherited,
    is_private,
    to_open,
)

FILE = Path("barn.yaml")


@pytest.fixture
def unix(tmp_path: Path) -> Iterator[socket.socket]:
    with closing(socket.socket(socket.AF_UNIX)) as one:
        one.bind(str(tmp_path / "grabberd.sock"))
        yield one


@pytest.mark.parametrize(("host", "private"), [("127.0.0.1", True), ("127.9.9.9", True), ("0.0.0.0", False)])
def test_an_address_is_private_on_loopback_alone(host: str, private: bool) -> None:
    [one] = bind(host, 0)
    with closing(one):
        assert is_private(one) is private


def test_so_it_is_with_ipv6() -> None:
    for host, private in (("::1", True), ("::ffff:127.0.0.1", True), ("::", False)):
        with closing(socket.socket(socket.AF_INET6)) as one:
            one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            one.bind((host, 0))
            assert is_private(one) is private


def test_what_is_accepted_sends_at_once_and_gives_up_who_is_gone() -> None:
    [one] = bind("127.0.0.1", 0)
    one.settimeout(10)
    with closing(one), closing(socket.create_connection(one.getsockname())):
        accepted, _ = one.accept()
        with closing(accepted):
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == GONE_AFTER_MS
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT) == UNSENT_BYTES


def test_who_does_not_read_costs_the_kernel_little() -> None:
    [one] = bind("127.0.0.1", 0)
    one.settimeout(10)
    with closing(one), closing(socket.socket()) as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        silent.connect(one.getsockname())
        accepted, _ = one.accept()
        with closing(accepted):
            accepted.setblocking(False)
            sent = 0
            with suppress(BlockingIOError):
                while sent < 4_000_000:
                    sent += accepted.send(bytes(4096))
            assert sent < 2 * UNSENT_BYTES


@pytest.mark.parametrize(("mode", "private"), [(0o600, True), (0o660, True), (0o666, False), (0o602, False)])
def test_a_unix_socket_is_private_by_its_files_rights(unix: socket.socket, mode: int, private: bool) -> None:
    os.chmod(unix.getsockname(), mode)
    assert is_private(unix) is private


def test_a_unix_socket_without_a_file_is_not_private(unix: socket.socket) -> None:
    Path(unix.getsockname()).unlink()
    assert not is_private(unix)
    with (
        closing(socket.socket(socket.AF_UNIX)) as abstract,
        closing(socket.socket(socket.AF_UNIX)) as unnamed,
    ):
        abstract.bind(f"\0grabberd-test-{os.getpid()}")
        assert not is_private(abstract)
        assert not is_private(unnamed)


def test_what_others_reach_is_refused_without_tokens_and_named() -> None:
    listening = bind("127.0.0.1", 0) + bind("0.0.0.0", 0)
    try:
        check_private(listening[:1], needs_token=False, file=FILE)
        check_private(listening, needs_token=True, file=FILE)
        with pytest.raises(ConfigError) as caught:
            check_private(listening, needs_token=False, file=FILE)
        [problem] = caught.value.problems
        assert (problem.file, problem.key) == ("barn.yaml", "http.host")
        assert describe(listening[1]) in problem.message
        assert describe(listening[0]) not in problem.message
        assert "grabberd token add" in problem.message
    finally:
        for one in listening:
            one.close()


def test_an_address_that_is_taken_or_not_there_is_said_plainly() -> None:
    [taken] = bind("127.0.0.1", 0)
    with closing(taken):
        port = taken.getsockname()[1]
        with pytest.raises(Conflict, match=rf"port {port} of 127\.0\.0\.1 is in use") as caught:
            bind("127.0.0.1", port)
        assert "--port N" in caught.value.hint
        assert f":{port}" in caught.value.hint
        with pytest.raises(Conflict, match=r"192\.0\.2\.1"):
            bind("192.0.2.1", 0)


def test_a_person_opens_the_first_address_that_a_browser_reaches(unix: socket.socket) -> None:
    listening = bind("127.0.0.1", 0) + bind("0.0.0.0", 0)
    try:
        loopback, everywhere = (one.getsockname()[1] for one in listening)
        assert to_open([unix, *listening], "http") == f"http://127.0.0.1:{loopback}"
        assert to_open(listening[1:], "https") == f"https://127.0.0.1:{everywhere}"
        assert to_open(listening[1:], "https", ["barn.local"]) == f"https://barn.local:{everywhere}"
        assert to_open([unix], "http") is None
    finally:
        for one in listening:
            one.close()


def test_a_name_is_listened_on_at_all_its_addresses() -> None:
    listening = bind("localhost", 0)
    assert listening
    assert all(map(is_private, listening))
    for one in listening:
        one.close()


INHERITING = """
import os, sys
from grabberd.server.api.guard.front import describe, inherited, is_private
os.environ["LISTEN_PID"] = str(os.getpid())
print([(describe(one), is_private(one)) for one in inherited(os.environ)], "LISTEN_FDS" in os.environ)
"""


def test_what_systemd_hands_over_is_judged_as_it_is() -> None:
    [one] = bind("0.0.0.0", 0)
    with closing(one):
        expected = f"[({describe(one)!r}, False)] False"
        result = subprocess.run(
            ["bash", "-c", f'exec "$0" -c "$1" 3<&{one.fileno()}', sys.executable, INHERITING],
            env={**os.environ, "LISTEN_FDS": "1"},
            pass_fds=[one.fileno()],
            capture_output=True,
            text=True,
            check=True,
        )
    assert result.stdout.strip() == expected


@pytest.mark.parametrize("pid", ["1", "", "x"])
def test_what_was_meant_for_another_process_is_left_alone(pid: str) -> None:
    environment = {"LISTEN_PID": pid, "LISTEN_FDS": "1", "OTHER": "stays"}
    assert inherited(environment) == []
    assert environment == {"OTHER": "stays"}


def test_what_is_no_socket_is_said_plainly() -> None:
    code = "import os; from grabberd.server.api.guard.front import inherited\n"
    code += "inherited({'LISTEN_PID': str(os.getpid()), 'LISTEN_FDS': '1'})"
    command = ["bash", "-c", 'exec "$0" -c "$1" 3</dev/null', sys.executable, code]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "Conflict: the 1 sockets passed on by systemd cannot be used" in result.stderr

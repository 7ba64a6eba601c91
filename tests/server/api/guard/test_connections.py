"""Connections on real sockets: too many, too slow, with a certificate."""

import http.client
import json
import logging
import re
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from starlette.types import ASGIApp, Receive, Scope, Send

from grabberd.config import HttpLimits, TlsConfig
from grabberd.documents.enums import Role
from grabberd.errors import ConfigError
from grabberd.server.api.guard import limits
from grabberd.server.api.guard.front import Front, Proxies, bind
from grabberd.server.api.serving import server_of, tls_context
from grabberd.server.daemon.descriptors import AT_ONCE
from server.api.gates import Gated, inside

PATIENCE_S = 20.0


@contextmanager
def served(
    folder: Path, front: Front, context: ssl.SSLContext | None = None, app: ASGIApp = inside
) -> Iterator[Gated]:
    gated = Gated(folder, front=front, app=app)
    server = server_of(gated.app, front, context)
    server.config.lifespan = "off"
    [listening] = bind("127.0.0.1", 0)
    gated.address = listening.getsockname()
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    try:
        yield gated
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)


def state_of(gated: Gated) -> tuple[int, str, dict[str, str]]:
    """Status, kind and document of an answer."""
    with closing(http.client.HTTPConnection(*gated.address, timeout=PATIENCE_S)) as connection:
        connection.request("GET", "/api/v1/state", headers=gated.bearer(Role.VIEWER))
        answer = connection.getresponse()
        return answer.status, answer.headers["content-type"], json.load(answer)


def connected(gated: Gated) -> socket.socket:
    return socket.create_connection(gated.address, timeout=PATIENCE_S)


def other(gated: Gated) -> socket.socket:
    """A client of another address."""
    return socket.create_connection(gated.address, PATIENCE_S, ("127.0.7.7", 0))


def head(gated: Gated, request: str, role: Role) -> bytes:
    """A request's head without its end."""
    token = gated.secrets[role]
    return f"{request} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n".encode()


def asking(gated: Gated) -> socket.socket:
    """A client whose request is being received."""
    client = connected(gated)
    words = b"Content-Length: 10\r\nExpect: 100-continue\r\n\r\n"
    client.sendall(head(gated, "POST /api/v1/captures", Role.OPERATOR) + words)
    assert client.recv(65536).startswith(b"HTTP/1.1 100")
    return client


def is_closed(client: socket.socket) -> bool:
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True


def test_a_client_is_served(tmp_path: Path) -> None:
    with served(tmp_path, Front()) as gated:
        assert state_of(gated) == (200, "application/json", {"role": "viewer", "by": "token", "bytes": 0})


def test_one_connection_too_many_is_told_so_and_far_too_many_are_hung_up_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "IDLE_S", 3600.0)
    with served(tmp_path, Front(limits=HttpLimits(connections=4))) as gated:
        held = [connected(gated) for _ in range(4)]
        status, kind, document = state_of(gated)
        assert (status, kind) == (503, "application/problem+json")
        assert document["hint"]
        held += [connected(gated) for _ in range(5)]
        assert is_closed(held[-1])
        for client in held:
            client.close()


def test_a_new_connection_takes_the_place_of_the_one_that_has_been_idle_for_longest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "IDLE_S", 0.0)
    with served(tmp_path, Front(limits=HttpLimits(connections=4))) as gated:
        busy = [asking(gated) for _ in range(2)]
        oldest, newest = connected(gated), connected(gated)
        assert state_of(gated)[0] == 200
        assert is_closed(oldest)
        oldest.close()
        for client in (*busy, newest):
            client.setblocking(False)
            with pytest.raises(BlockingIOError):
                client.recv(1)
            client.close()


def test_where_none_is_idle_one_too_many_is_told_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "IDLE_S", 0.0)
    with served(tmp_path, Front(limits=HttpLimits(connections=4))) as gated:
        busy = [asking(gated) for _ in range(4)]
        assert state_of(gated)[0] == 503
        for client in busy:
            client.close()


def test_a_client_with_too_many_connections_is_told_so_and_shuts_nobody_out(tmp_path: Path) -> None:
    limits = HttpLimits(connections_per_client=4)
    with served(tmp_path, Front(limits=limits)) as gated:
        held = [connected(gated) for _ in range(4)]
        status, kind, document = state_of(gated)
        assert (status, kind) == (429, "application/problem+json")
        assert "connections_per_client" in document["hint"]
        held += [connected(gated) for _ in range(5)]
        assert is_closed(held[-1])
        with other(gated) as neighbour:
            neighbour.sendall(head(gated, "GET /api/v1/state", Role.VIEWER) + b"\r\n")
            assert neighbour.recv(65536).startswith(b"HTTP/1.1 200")
        for client in held:
            client.close()


def test_connections_that_have_ended_count_no_more(tmp_path: Path) -> None:
    with served(tmp_path, Front(limits=HttpLimits(connections_per_client=1))) as gated:
        for _ in range(3):
            with connected(gated) as client:
                client.sendall(head(gated, "GET /api/v1/state", Role.VIEWER) + b"Connection: close\r\n\r\n")
                answer = client.makefile("rb").read()
                assert answer.startswith(b"HTTP/1.1 200"), answer


def test_a_proxy_may_have_more_since_it_stands_for_many(tmp_path: Path) -> None:
    front = Front(limits=HttpLimits(connections_per_client=1), proxies=Proxies(("127.0.0.1",)))
    with served(tmp_path, front) as gated:
        held = [connected(gated) for _ in range(4)]
        assert state_of(gated)[0] == 200
        for client in held:
            client.close()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_clients_that_do_not_end_their_handshake_are_hung_up_on_as_well(
    tmp_path: Path, certificate: TlsConfig
) -> None:
    context = tls_context(certificate, tmp_path)
    with served(tmp_path, Front(tls=True, limits=HttpLimits(connections=4)), context) as gated:
        silent = [connected(gated) for _ in range(2 * 4 + 4 * AT_ONCE)]
        assert is_closed(connected(gated))
        for client in silent:
            client.close()


def test_a_head_that_does_not_come_is_not_waited_for(tmp_path: Path) -> None:
    with served(tmp_path, Front(limits=HttpLimits(head_timeout_s=0.1))) as gated:
        for words in (b"", b"GET /healthz HTTP/1.1\r\nHost: loc"):
            with connected(gated) as client:
                client.sendall(words)
                assert is_closed(client)


def test_neither_is_a_second_one_on_the_same_connection(tmp_path: Path) -> None:
    with served(tmp_path, Front(limits=HttpLimits(head_timeout_s=0.1))) as gated, connected(gated) as client:
        client.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert client.recv(65536).startswith(b"HTTP/1.1 200")
        client.sendall(b"GET /hea")
        while client.recv(65536):
            pass


def test_a_body_that_drips_after_its_answer_is_not_waited_for(tmp_path: Path) -> None:
    with served(tmp_path, Front(limits=HttpLimits(head_timeout_s=0.1))) as gated, connected(gated) as client:
        client.sendall(b"POST /api/v1/captures HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9000\r\n\r\n")
        assert client.recv(65536).startswith(b"HTTP/1.1 401")
        client.sendall(b"x")
        while client.recv(65536):
            pass


def test_a_connection_is_kept_from_one_request_to_the_next(tmp_path: Path) -> None:
    with (
        served(tmp_path, Front()) as gated,
        closing(http.client.HTTPConnection(*gated.address)) as connection,
    ):
        used = set()
        for _ in range(3):
            connection.request("POST", "/api/v1/captures", b"{}", gated.bearer(Role.OPERATOR))
            assert json.load(connection.getresponse())["bytes"] == 2
            used.add(connection.sock)
        assert len(used) == 1


def test_a_body_that_does_not_come_is_a_problem(tmp_path: Path) -> None:
    with served(tmp_path, Front(limits=HttpLimits(body_timeout_s=0.1))) as gated, connected(gated) as client:
        client.sendall(head(gated, "POST /api/v1/captures", Role.OPERATOR) + b"Content-Length: 10\r\n\r\nx")
        answer = client.makefile("rb").read()
        assert answer.startswith(b"HTTP/1.1 408")
        assert b"application/problem+json" in answer


def test_a_client_that_never_reads_is_hung_up_on(tmp_path: Path) -> None:
    limits = HttpLimits(write_timeout_s=0.1)
    with served(tmp_path, Front(limits=limits), app=flood_of(gone := threading.Event())) as gated:
        client = connected(gated)
        client.sendall(head(gated, "GET /api/v1/events", Role.VIEWER) + b"\r\n")
        assert gone.wait(PATIENCE_S)
        client.close()


def flood_of(gone: threading.Event) -> ASGIApp:
    async def flood(scope: Scope, receive: Receive, send: Send) -> None:
        await receive()
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for _ in range(1000):
            await send({"type": "http.response.body", "body": b"x" * 65536, "more_body": True})
        assert (await receive())["type"] == "http.disconnect"
        gone.set()

    return flood


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> TlsConfig:
    folder = tmp_path_factory.mktemp("tls")
    words = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2"
    words += " -subj /CN=localhost -addext subjectAltName=DNS:localhost,IP:127.0.0.1"
    words += f" -keyout {folder}/key.pem -out {folder}/cert.pem"
    subprocess.run(words.split(), check=True, capture_output=True)
    return TlsConfig(certificate=folder / "cert.pem", key=folder / "key.pem")


def test_with_a_certificate_it_speaks_tls_and_nothing_else(tmp_path: Path, certificate: TlsConfig) -> None:
    context = tls_context(certificate, Path("x.yaml"))
    with served(tmp_path, Front(tls=True), context) as gated:
        trusting = ssl.create_default_context(cafile=str(certificate.certificate))
        client = http.client.HTTPSConnection(*gated.address, timeout=PATIENCE_S, context=trusting)
        client.request("GET", "/healthz")
        assert client.getresponse().status == 200
        client.close()
        with connected(gated) as plain:
            plain.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert is_closed(plain)


@pytest.mark.parametrize("wrong", ["no PEM", "another key", "a directory", "a passphrase"])
def test_certificate_files_that_cannot_be_used_are_named(
    tmp_path: Path, certificate: TlsConfig, wrong: str
) -> None:
    key = tmp_path / "key.pem"
    if wrong == "no PEM":
        key.write_text("nothing")
    elif wrong == "a directory":
        key.mkdir()
    elif wrong == "another key":
        subprocess.run(
            ["openssl", "genpkey", "-algorithm", "ED25519", "-out", key], check=True, capture_output=True
        )
    else:
        words = ["openssl", "pkcs8", "-topk8", "-in", certificate.key, "-out", key, "-passout", "pass:secret"]
        subprocess.run(words, check=True, capture_output=True)
    with pytest.raises(ConfigError, match=r"http\.tls: .*key\.pem cannot be used"):
        tls_context(TlsConfig.model_construct(certificate=certificate.certificate, key=key), Path("x.yaml"))


def test_nothing_secret_is_logged_whatever_is_sent(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    caplog.set_level(logging.DEBUG)
    with served(tmp_path, Front()) as gated:
        state_of(gated)
        for request in ("GET /api/v1/state", "POST /healthz", "NONSENSE", "GET /api/v1/session"):
            with connected(gated) as client:
                client.sendall(
                    head(gated, request, Role.ADMIN) + b"Cookie: grabberd_session=wrong-one\r\n:\r\n\r\n"
                )
                client.recv(65536)
                client.sendall(b"Authorization: Bearer wrong-one\r\n\r\n")
        gated.access.remove("admin")
        with connected(gated) as client:
            client.sendall(head(gated, "GET /api/v1/state", Role.ADMIN) + b"\r\n")
            assert client.recv(65536).startswith(b"HTTP/1.1 401")
    told = caplog.text + "".join(capfd.readouterr())
    assert "invalid tokens" in told
    assert not any(secret in told for secret in [*gated.secrets.values(), "wrong-one"])


@pytest.mark.parametrize(
    "request_head",
    [
        "POST /api/v1/captures HTTP/1.1\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        "GET /healthz HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 5\r\n",
        "GET /healthz HTTP/1.0\r\nConnection: keep-alive\r\nTransfer-Encoding: chunked\r\n",
        "GET /healthz HTTP/1.1\r\nContent-Length: 5\r\nContent-Length: 6\r\n",
        "GET /healthz HTTP/1.1\r\nTransfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n",
        "GET /healthz HTTP/1.1\r\nContent-Length: +5\r\n",
        "GET /api/v1/preview HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
    ],
)
def test_a_body_of_two_lengths_is_refused_and_nothing_after_it_is_read(
    tmp_path: Path, request_head: str
) -> None:
    with served(tmp_path, Front()) as gated, connected(gated) as client:
        client.sendall(f"{request_head}Host: localhost\r\n\r\n0\r\n\r\nGET /healthz HTTP/1.1\r\n".encode())
        answer = everything(client)
        assert answer.startswith((b"HTTP/1.1 400 ", b"HTTP/1.0 400 ")), answer[:200]
        assert b"connection: close" in answer.lower()
        assert len(re.findall(rb"HTTP/1\.\d \d{3} ", answer)) == 1


def everything(client: socket.socket) -> bytes:
    """What comes until the other side closes."""
    return b"".join(iter(lambda: client.recv(65536), b""))

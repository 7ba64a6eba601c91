"""What a proxy reports about its clients is believed of the configured ones alone."""

from pathlib import Path

import pytest
from starlette.types import Scope

from grabberd.config import HttpConfig
from grabberd.server.api.guard.front import Front, Proxies
from server.api.gates import Gated

OURS = Proxies(("10.0.0.1", "192.168.7.0/24", "fd00::/8"))


def scope(
    peer: str | None, forwarded: str | list[str] | None = None, proto: str | None = None, kind: str = "http"
) -> Scope:
    lines = [forwarded] if isinstance(forwarded, str) else forwarded or []
    headers = [(b"x-forwarded-for", line.encode()) for line in lines]
    if proto is not None:
        headers.append((b"x-forwarded-proto", proto.encode()))
    client = None if peer is None else (peer, 4711)
    scheme = "http" if kind == "http" else "ws"
    return {"type": kind, "client": client, "headers": headers, "scheme": scheme}


def client(seen: Scope) -> str | None:
    return seen["client"] and seen["client"][0]


def test_nobody_else_is_believed() -> None:
    plain = scope("203.0.113.9", "198.51.100.1", "https")
    assert OURS.seen_through(plain) is plain
    assert Proxies().seen_through(plain) is plain


@pytest.mark.parametrize(
    ("forwarded", "found"),
    [
        ("198.51.100.1", "198.51.100.1"),
        ("1.1.1.1, 198.51.100.1", "198.51.100.1"),
        ("1.1.1.1, 198.51.100.1, 192.168.7.9", "198.51.100.1"),
        (["1.1.1.1", "198.51.100.1"], "198.51.100.1"),
        ("192.168.7.5, 192.168.7.9", "192.168.7.5"),
        ("2001:db8::7", "2001:db8::7"),
        ("::ffff:198.51.100.1", "198.51.100.1"),
        ("198.51.100.1, what?", "10.0.0.1"),
        ("198.51.100.1, what?, 192.168.7.9", "192.168.7.9"),
        ("", "10.0.0.1"),
        (None, "10.0.0.1"),
    ],
)
def test_the_nearest_address_that_is_no_proxy_is_the_client(
    forwarded: str | list[str] | None, found: str
) -> None:
    assert client(OURS.seen_through(scope("10.0.0.1", forwarded))) == found


@pytest.mark.parametrize("peer", ["10.0.0.1", "192.168.7.200", "fd00::5", "::ffff:10.0.0.1"])
def test_a_proxy_is_an_address_or_one_of_a_network(peer: str) -> None:
    assert client(OURS.seen_through(scope(peer, "198.51.100.1"))) == "198.51.100.1"


def test_a_unix_socket_has_to_be_named() -> None:
    through = scope(None, "198.51.100.1")
    assert client(OURS.seen_through(through)) is None
    assert client(Proxies(("unix",)).seen_through(through)) == "198.51.100.1"


@pytest.mark.parametrize(
    ("proto", "kind", "found"),
    [
        ("https", "http", "https"),
        ("https", "websocket", "wss"),
        ("http, https", "http", "https"),
        ("https, http", "http", "http"),
        ("gopher", "http", "http"),
        (None, "http", "http"),
    ],
)
def test_it_may_have_the_certificate(proto: str | None, kind: str, found: str) -> None:
    assert OURS.seen_through(scope("10.0.0.1", None, proto, kind))["scheme"] == found


@pytest.mark.parametrize("wrong", ["proxy.example", "10.0.0.1/24", "10.0.0.0/33", ""])
def test_what_is_no_address_is_refused(wrong: str) -> None:
    with pytest.raises(ValueError, match="neither an address nor a network"):
        HttpConfig(proxies=(wrong,))


def test_without_tokens_who_comes_through_a_proxy_is_not_at_the_machine(tmp_path: Path) -> None:
    gated = Gated(tmp_path, tokens=False, front=Front(proxies=Proxies(("127.0.0.1",))))
    through = gated.client(client=("127.0.0.1", 4711))
    assert through.get("/api/v1/state").json()["by"] == "socket"
    for far in ("198.51.100.1", "2001:db8::7"):
        assert through.get("/api/v1/state", headers={"X-Forwarded-For": far}).status_code == 401
    for near in ("127.0.0.1", "::1"):
        assert through.get("/api/v1/state", headers={"X-Forwarded-For": near}).json()["by"] == "socket"


def test_guessing_is_counted_to_the_socket_unless_a_proxy_says_otherwise(tmp_path: Path) -> None:
    def guess(gated: Gated, number: int) -> int:
        headers = {"Authorization": f"Bearer wrong-{number}", "X-Forwarded-For": f"198.51.100.{number}"}
        return gated.client(client=("127.0.0.1", 4711)).get("/api/v1/state", headers=headers).status_code

    plain = Gated(tmp_path / "plain")
    assert {guess(plain, number) for number in range(11)} == {401}
    assert guess(plain, 11) == 429
    proxied = Gated(tmp_path / "proxied", front=Front(proxies=Proxies(("127.0.0.1",))))
    assert {guess(proxied, number) for number in range(30)} == {401}

"""Names, pages and who made a request."""

from pathlib import Path

import pytest
from starlette.types import Scope

from grabberd.config import HttpConfig
from grabberd.documents.enums import Role
from grabberd.server.api.guard.front import Front, check_host
from grabberd.server.api.problems import Refusal
from server.api.gates import Gated, is_problem

STATE = "/api/v1/state"
CAPTURES = "/api/v1/captures"
PAGE = "http://localhost:8050"


@pytest.fixture
def gated(tmp_path: Path) -> Gated:
    return Gated(tmp_path)


LOOPBACK = Front()


def calls(
    hosts: list[str], server: tuple[str, int | None] = ("127.0.0.1", 8050), front: Front = LOOPBACK
) -> bool:
    headers = [(b"host", host.encode()) for host in hosts]
    scope: Scope = {"type": "http", "headers": headers, "server": server}
    try:
        check_host(scope, front)
    except Refusal:
        return False
    return True


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:8050", "127.0.0.1:8050", "[::1]:8050", "localhost.:1"]
)
def test_a_loopback_name_is_the_daemons_own_on_any_port(host: str) -> None:
    assert calls([host])


FOREIGN = """evil.example localhost.evil.example 127.0.0.1.evil.example localhost@evil ::1 [::1 192.168.1.4
[fe80::1] localhost: localhost:x 127.0.0.1:80:80"""


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:8050", "[::1]", "LOCALHOST"])
def test_a_loopback_name_is_foreign_on_another_address_unless_it_is_configured(host: str) -> None:
    for address in ("192.168.1.4", "2001:db8::7"):
        assert not calls([host], (address, 8050))
        named = Front.from_config(HttpConfig(hosts=("localhost", "127.0.0.1", "::1")), private=False)
        assert calls([host], (address, 8050), named)
    assert calls([host], ("/run/grabberd.sock", None))
    assert calls([host], ("::ffff:127.0.0.1", 8050))


@pytest.mark.parametrize("host", ["", "a b", *FOREIGN.split()])
def test_any_other_name_is_foreign(host: str) -> None:
    assert not calls([host])


def test_none_and_several_names_are_foreign() -> None:
    assert not calls([])
    assert not calls(["localhost", "localhost"])


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("192.168.1.4:8050", "192.168.1.4"),
        ("192.168.1.4", "::ffff:192.168.1.4"),
        ("[fe80::1]", "fe80::1%eth0"),
    ],
)
def test_the_address_that_a_connection_came_in_on_is_the_daemons_own(host: str, address: str) -> None:
    assert calls([host], (address, 8050))
    assert not calls([host], ("10.0.0.1", 8050))


def test_a_unix_socket_has_no_address_of_its_own() -> None:
    assert calls(["localhost"], ("/run/grabberd.sock", None))
    assert not calls(["192.168.1.4"], ("/run/grabberd.sock", None))


def test_configured_names_and_beyond_loopback_the_machines_own_are_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "Barn.farm")
    http = HttpConfig(hosts=("Rig.Example",))
    public, private = Front.from_config(http, private=False), Front.from_config(http, private=True)
    for host, everywhere in (("rig.example:80", True), ("barn.farm", False), ("barn.local:8050", False)):
        assert calls([host], front=public)
        assert calls([host], front=private) is everywhere


def test_the_daemons_own_page_may(gated: Gated) -> None:
    headers = {**gated.bearer(Role.OPERATOR), "Origin": PAGE, "Sec-Fetch-Site": "same-origin"}
    assert gated.client().post(CAPTURES, headers=headers).status_code == 200


@pytest.mark.parametrize(
    "origin", ["http://localhost:8050.evil.example", "ftp://localhost:8050", "http://127.0.0.1:8050"]
)
def test_a_page_that_only_looks_like_it_may_not(gated: Gated, origin: str) -> None:
    answer = gated.client().get(STATE, headers={**gated.bearer(Role.ADMIN), "Origin": origin})
    assert is_problem(answer, 403, "foreign-page")


def test_a_proxy_may_show_the_certificate_but_tls_has_no_plain_pages(tmp_path: Path) -> None:
    for tls, plain in ((False, 200), (True, 403)):
        gated = Gated(tmp_path / str(tls), front=Front(tls=tls))
        for scheme, status in (("https", 200), ("http", plain)):
            headers = {**gated.bearer(Role.VIEWER), "Origin": f"{scheme}://localhost:8050"}
            assert gated.client().get(STATE, headers=headers).status_code == status


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_a_foreign_page_may_link_to_the_daemon_and_include_nothing_of_it(gated: Gated, site: str) -> None:
    own = {**gated.bearer(Role.OPERATOR), "Sec-Fetch-Site": site}
    link = {**own, "Sec-Fetch-Mode": "navigate"}
    assert gated.client().get(STATE, headers=link).status_code == 200
    assert is_problem(
        gated.client().get(STATE, headers={**own, "Sec-Fetch-Mode": "no-cors"}), 403, "foreign-page"
    )
    assert is_problem(gated.client().post(CAPTURES, headers=link), 403, "foreign-page")


def test_no_page_of_another_site_can_show_an_answer(gated: Gated) -> None:
    headers = gated.client().get(STATE, headers=gated.bearer(Role.VIEWER)).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "access-control-allow-origin" not in headers

"""A browser trades its token for a session; at the machine itself there need be none."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from running import configuration
from starlette.testclient import WebSocketDenialResponse

from grabberd.config import default_config_file
from grabberd.documents.enums import Role
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.api.guard.front import Front
from grabberd.server.daemon.service import Service
from server.api.gates import Gated, is_problem

SESSION = "/api/v1/session"
JOB = "/api/v1/jobs/job-1"
PREVIEW = "ws://localhost:8050/api/v1/preview"
PAGE = {"Origin": "http://localhost"}


def client_of(folder: Path, front: Front | None = None, scheme: str = "http") -> TestClient:
    service = Service(set_up(configuration({"pace": "free"}), default_config_file()), folder)
    service.access.open()
    return TestClient(create_app(service, front), f"{scheme}://localhost")


@pytest.fixture
def browser(tmp_path: Path) -> TestClient:
    return client_of(tmp_path)


def token(client: TestClient, role: Role = Role.OPERATOR, name: str = "tablet") -> dict[str, str]:
    secret = client.app.state.service.access.add(name, role)  # type: ignore[attr-defined]
    return {"Authorization": f"Bearer {secret}"}


def signed_in(client: TestClient, role: Role = Role.OPERATOR) -> TestClient:
    answer = client.post(SESSION, headers={**token(client, role), **PAGE})
    assert answer.status_code == 201, answer.json()
    return client


def test_a_token_is_traded_for_a_cookie_that_no_page_can_read(browser: TestClient) -> None:
    answer = browser.post(SESSION, headers={**token(browser), **PAGE})
    assert answer.json() == {"role": "operator", "by": "session", "token": "tablet", "expires_utc": None}
    cookie = answer.headers["set-cookie"].lower()
    for part in ("httponly", "samesite=strict", "path=/", "max-age=2592000"):
        assert part in cookie
    assert "secure" not in cookie


def test_under_tls_the_cookie_is_secure(tmp_path: Path) -> None:
    client = client_of(tmp_path, Front(tls=True), "https")
    answer = client.post(SESSION, headers={**token(client), "Origin": "https://localhost"})
    assert "; secure" in answer.headers["set-cookie"].lower()


def test_the_session_says_what_its_token_may(browser: TestClient) -> None:
    signed_in(browser, Role.VIEWER)
    expected = {"role": "viewer", "by": "session", "token": "tablet", "expires_utc": None}
    assert browser.get(SESSION).json() == expected
    assert is_problem(browser.delete(JOB, headers=PAGE), 403, "role-not-enough")


def test_it_outlives_a_restart(browser: TestClient, tmp_path: Path) -> None:
    signed_in(browser)
    restarted = client_of(tmp_path)
    restarted.cookies = browser.cookies
    assert restarted.get(SESSION).json()["role"] == "operator"


def test_it_ends_with_its_token_and_the_browser_forgets_it(browser: TestClient) -> None:
    signed_in(browser)
    token(browser, Role.VIEWER, "other")
    browser.app.state.service.access.remove("tablet")  # type: ignore[attr-defined]
    answer = browser.get(SESSION)
    assert is_problem(answer, 401, "unauthorized")
    assert "max-age=0" in answer.headers["set-cookie"].lower()
    assert not browser.cookies


def test_it_ends_when_it_is_told_to(browser: TestClient) -> None:
    signed_in(browser)
    kept = dict(browser.cookies)
    assert browser.delete(SESSION, headers=PAGE).status_code == 204
    assert not browser.cookies
    browser.cookies.update(kept)
    assert browser.get(SESSION).status_code == 401


def test_a_change_needs_the_daemons_own_page(browser: TestClient) -> None:
    signed_in(browser)
    assert is_problem(browser.delete(JOB), 403, "foreign-page")
    assert is_problem(browser.delete(JOB, headers={"Origin": "http://evil.example"}), 403, "foreign-page")
    assert browser.delete(JOB, headers=PAGE).status_code == 404
    assert browser.get(SESSION).status_code == 200


def test_a_websocket_on_a_session_needs_it_too(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    who = gated.access.of_token(gated.secrets[Role.VIEWER])
    assert who
    client = gated.client(cookies={"grabberd_session": gated.access.open_session(who)})
    with pytest.raises(WebSocketDenialResponse) as caught, client.websocket_connect(PREVIEW):
        pass
    assert caught.value.status_code == 403
    with client.websocket_connect(PREVIEW, headers={"Origin": "http://localhost:8050"}) as socket:
        assert socket.receive_json() == {"role": "viewer", "by": "session"}


def test_only_a_token_is_traded(browser: TestClient) -> None:
    assert is_problem(browser.post(SESSION, headers=PAGE), 409, "conflict")
    signed_in(browser)
    assert is_problem(browser.post(SESSION, headers=PAGE), 409, "conflict")


def test_at_the_machine_without_tokens_everybody_is_an_operator(browser: TestClient) -> None:
    expected = {"role": "operator", "by": "socket", "token": None, "expires_utc": None}
    assert browser.get(SESSION).json() == expected


def test_the_first_token_shuts_the_door_at_once_and_the_last_one_opens_it(browser: TestClient) -> None:
    own = token(browser)
    assert is_problem(browser.get(SESSION), 401, "unauthorized")
    assert browser.get(SESSION, headers=own).json()["by"] == "token"
    browser.app.state.service.access.remove("tablet")  # type: ignore[attr-defined]
    assert browser.get(SESSION).json()["by"] == "socket"
    assert is_problem(browser.get(SESSION, headers=own), 401, "unauthorized")


def test_beyond_the_machine_nobody_is_anybody_without_a_token(tmp_path: Path) -> None:
    client = client_of(tmp_path, Front(private=False))
    answer = client.get(SESSION)
    assert is_problem(answer, 401, "unauthorized")
    assert answer.headers["www-authenticate"] == 'Bearer realm="grabberd"'
    assert client.get("/healthz").status_code == 200


def test_tokens_that_cannot_be_read_let_nobody_in(browser: TestClient, tmp_path: Path) -> None:
    own = token(browser, Role.ADMIN)
    (tmp_path / "state.sqlite").write_bytes(b"garbage " * 1000)
    for headers in ({}, own):
        assert is_problem(browser.get(SESSION, headers=headers), 507, "storage-error")
    assert browser.get("/healthz").status_code == 200


class Stream:
    """Goes on for as long as it is listened to; time passes while it does."""

    def __init__(self) -> None:
        self.sent = 0
        self.gated: Gated | None = None

    async def __call__(self, scope, receive, send) -> None:  # type: ignore[no-untyped-def]
        assert self.gated
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while self.sent < 100:
            self.sent += 1
            self.gated.clock.now_s += 1
            if self.sent == 25:
                self.gated.access.remove("viewer")
            await send({"type": "http.response.body", "body": b"x", "more_body": True})


def test_a_removed_token_ends_what_still_streams_to_it(tmp_path: Path) -> None:
    stream = Stream()
    gated = stream.gated = Gated(tmp_path, app=stream)
    gated.client(raise_server_exceptions=False).get("/api/v1/events", headers=gated.bearer(Role.VIEWER))
    assert 25 < stream.sent <= 36

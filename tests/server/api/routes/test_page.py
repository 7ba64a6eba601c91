"""The page over HTTP: open to everybody, the daemon's state only to who may see it."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from grabberd.documents.enums import Role
from grabberd.server.api import create_app
from server.api.conftest import service_in


def first_of(page: str) -> dict[str, Any]:
    found = re.search(r'id="first">(.*?)</script>', page)
    assert found
    document: dict[str, Any] = json.loads(found[1])
    return document


@pytest.fixture
def guarded(tmp_path: Path) -> tuple[TestClient, str]:
    """A client of a daemon with a token, which is not started, and the token."""
    service = service_in(tmp_path, pace="free")
    service.access.open()
    secret = service.access.add("tablet", Role.VIEWER)
    return TestClient(create_app(service), "http://localhost"), secret


def test_at_the_machine_the_first_sight_has_the_state(idle: TestClient) -> None:
    answer = idle.get("/")
    first = first_of(answer.text)
    assert first["session"]["role"] == "operator"
    assert first["state"]["devices"]["simulated"]["state"] == "ready"
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert answer.headers["cache-control"] == "no-store"


def test_a_stranger_sees_the_sign_in_and_nothing_of_the_daemon(guarded: tuple[TestClient, str]) -> None:
    first = first_of(guarded[0].get("/").text)
    assert first["session"] is None
    assert first["state"] is None


def test_a_session_sees_the_state_until_it_has_ended(guarded: tuple[TestClient, str]) -> None:
    client, secret = guarded
    client.post("/api/v1/session", headers={"Authorization": f"Bearer {secret}"})
    assert first_of(client.get("/").text)["session"]["role"] == "viewer"
    client.delete("/api/v1/session", headers={"Origin": "http://localhost"})
    assert first_of(client.get("/").text)["session"] is None


def test_a_session_that_has_ended_is_forgotten_by_the_browser(guarded: tuple[TestClient, str]) -> None:
    answer = guarded[0].get("/", headers={"Cookie": "grabberd_session=gone"})
    assert answer.status_code == 200
    assert "Max-Age=0" in answer.headers["set-cookie"]


def test_the_page_speaks_the_browsers_language(idle: TestClient) -> None:
    assert '<html lang="nb">' in idle.get("/", headers={"Accept-Language": "nb-NO"}).text


def test_files_are_kept_for_ever_under_their_version(idle: TestClient) -> None:
    address = re.search(r'href="(/static/\w+/page.css)"', idle.get("/").text)
    assert address
    answer = idle.get(address[1])
    assert answer.headers["content-type"].startswith("text/css")
    assert answer.headers["content-encoding"] == "gzip"
    assert "immutable" in answer.headers["cache-control"]
    plain = idle.get(address[1], headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.content == answer.content
    again = idle.get(address[1], headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304


@pytest.mark.parametrize("template", ["*", "W/{etag}", '"other", {etag}'])
def test_a_file_that_the_browser_has_is_not_sent_however_it_says_so(idle: TestClient, template: str) -> None:
    first = idle.get("/static/0000/page.css")
    known = {"If-None-Match": template.format(etag=first.headers["etag"])}
    again = idle.get("/static/0000/page.css", headers=known)
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    assert idle.get("/static/0000/page.css", headers={"If-None-Match": '"other"'}).content == first.content


def test_any_copy_does_not_stand_for_a_file_that_there_is_not(idle: TestClient) -> None:
    assert idle.get("/static/0000/nothing.js", headers={"If-None-Match": "*"}).status_code == 404


def test_an_address_of_another_version_is_served_but_not_kept(idle: TestClient) -> None:
    answer = idle.get("/static/0000/page.css")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-cache"


@pytest.mark.parametrize("path", ["nothing.js", "../page.html", "%2e%2e/page.html", "texts/xx.json"])
def test_there_is_nothing_but_the_pages_files(idle: TestClient, path: str) -> None:
    assert idle.get(f"/static/1/{path}").status_code == 404

"""The documentation at /docs: open to everybody, from this host alone, and only what belongs to it."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from grabberd.server.web import Site

PAGE = "<html><script>let a = 1;</script><script src='app.js'></script><p>Install it</p></html>"


@pytest.fixture
def site(idle: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installation with a small site."""
    folder = tmp_path / "site"
    (folder / "howto" / "install").mkdir(parents=True)
    (folder / "index.html").write_text(PAGE)
    (folder / "howto" / "install" / "index.html").write_text(PAGE)
    (folder / "app.js").write_text("let b = 2;")
    (tmp_path / "secret.txt").write_text("no")
    monkeypatch.setitem(idle.app.state._state, "site", Site(folder))  # type: ignore[attr-defined]
    return folder


@pytest.mark.usefixtures("site")
def test_its_first_page_is_at_docs(idle: TestClient) -> None:
    assert idle.get("/docs", follow_redirects=False).headers["location"] == "/docs/"
    assert "Install it" in idle.get("/docs/").text


@pytest.mark.usefixtures("site")
def test_a_page_allows_its_own_scripts_and_no_other_host(idle: TestClient) -> None:
    policy = idle.get("/docs/").headers["content-security-policy"]
    assert "script-src 'self' 'sha256-" in policy
    assert "unsafe" not in policy
    assert "http" not in policy


@pytest.mark.usefixtures("site")
def test_an_address_without_its_slash_leads_to_the_page(idle: TestClient) -> None:
    answer = idle.get("/docs/howto/install", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (307, "/docs/howto/install/")


@pytest.mark.usefixtures("site")
@pytest.mark.parametrize("path", ["none", "../secret.txt", "%2e%2e/secret.txt", "howto/"])
def test_what_is_not_of_the_site_is_not_found(idle: TestClient, path: str) -> None:
    answer = idle.get(f"/docs/{path}")
    assert answer.status_code == 404
    assert answer.text != "no"


@pytest.mark.usefixtures("site")
def test_a_known_file_is_not_sent_again(idle: TestClient) -> None:
    first = idle.get("/docs/app.js")
    assert first.headers["content-type"].startswith("text/javascript")
    again = idle.get("/docs/app.js", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304


def test_a_changed_page_is_read_again(idle: TestClient, site: Path) -> None:
    before = idle.get("/docs/").text
    (site / "index.html").write_text(before.replace("Install", "Remove"))
    assert "Remove it" in idle.get("/docs/").text


def test_without_a_site_docs_is_the_description_of_the_api(
    idle: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(idle.app.state._state, "site", Site(tmp_path / "none"))  # type: ignore[attr-defined]
    assert idle.get("/docs", follow_redirects=False).headers["location"] == "/api/v1/docs"
    problem = idle.get("/docs/howto/").json()
    assert "make site" in problem["hint"]

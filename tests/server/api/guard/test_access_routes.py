"""Every route there is, tried by everybody."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.routing import APIWebSocketRoute, iter_route_contexts
from fastapi.testclient import TestClient
from running import configuration
from starlette.testclient import WebSocketDenialResponse

from grabberd.archive.access import Identity
from grabberd.config import default_config_file
from grabberd.documents.enums import Role
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app
from grabberd.server.api.guard.authentication import least_roles
from grabberd.server.api.guard.gate import Gate
from grabberd.server.daemon.service import Service
from server.api.gates import Gated, is_problem


def application(folder: Path) -> FastAPI:
    """Not started: whoever comes through finds nothing there."""
    service = Service(set_up(configuration({"pace": "free"}), default_config_file()), folder)
    service.access.open()
    return create_app(service)


def routes_of(app: FastAPI) -> Iterator[str]:
    for context in iter_route_contexts(app.routes):
        websocket = isinstance(context.original_route, APIWebSocketRoute)
        for method in ["WEBSOCKET"] if websocket else sorted(context.methods or ["ANY"]):
            if method != "HEAD":
                yield f"{method} {context.path}"


@pytest.fixture(scope="module")
def routes(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return sorted({PREVIEW, *routes_of(application(tmp_path_factory.mktemp("routes")))})


@pytest.fixture(scope="module")
def gated(tmp_path_factory: pytest.TempPathFactory) -> Gated:
    return Gated(tmp_path_factory.mktemp("gate"))


PREVIEW = "WEBSOCKET /api/v1/preview"
"""Tried also as long as there is no such route: WebSockets are let in and refused in another way."""


def asked(gated: Gated, route: str, headers: dict[str, str]) -> tuple[int, str]:
    """Status and problem of a request for a route; 200 is whoever came through."""
    method, _, template = route.partition(" ")
    path = re.sub(r"\{[^}]*\}", "1", template)
    client = gated.client()
    if method == "WEBSOCKET":
        return _asked_for_socket(client, f"ws://localhost:8050{path}", headers)
    answer = client.request(method, path, headers=headers)
    return answer.status_code, answer.json().get("type", "").rpartition(":")[2]


def _asked_for_socket(client: TestClient, url: str, headers: dict[str, str]) -> tuple[int, str]:
    try:
        with client.websocket_connect(url, headers=headers) as socket:
            socket.receive_json()
            return 200, ""
    except WebSocketDenialResponse as denial:
        return denial.status_code, denial.json()["type"].rpartition(":")[2]


def test_every_route_declares_its_least_role(routes: list[str]) -> None:
    assert len(routes) > 20
    assert [route for route in routes if route not in least_roles()] == []


def test_only_the_page_the_liveness_and_the_documentation_are_open_to_everybody() -> None:
    documentation = ["GET /docs", "GET /docs/{path:path}"]
    everybody = ["GET /", "GET /static/{version}/{path:path}", "GET /healthz", *documentation]
    assert [route for route, least in least_roles().items() if least is None] == everybody


def test_what_changes_something_takes_more_than_a_viewer() -> None:
    own_session = {"POST /api/v1/session", "DELETE /api/v1/session"}
    for route, least in least_roles().items():
        if route.split()[0] in ("POST", "PUT", "PATCH", "DELETE") and route not in own_session:
            assert least in (Role.OPERATOR, Role.ADMIN), route


def test_nobody_comes_in_without_a_token(routes: list[str], gated: Gated) -> None:
    for route in routes:
        expected = (200, "") if least_roles()[route] is None else (401, "unauthorized")
        assert asked(gated, route, {}) == expected, route


@pytest.mark.parametrize("wrong", ["Bearer wrong", "bearer ", "Basic YTpi", "Bearer", "session"])
def test_nobody_comes_in_with_a_wrong_token_or_session(routes: list[str], gated: Gated, wrong: str) -> None:
    session = {"Cookie": "grabberd_session=wrong", "Origin": "http://localhost:8050"}
    headers = session if wrong == "session" else {"Authorization": wrong}
    for route in routes:
        gated.clock.now_s += 3600  # nobody has to wait after so many attempts
        expected = (200, "") if least_roles()[route] is None else (401, "unauthorized")
        assert asked(gated, route, headers) == expected, route


def test_every_described_route_is_tried(routes: list[str], idle: TestClient) -> None:
    paths = idle.get("/api/v1/openapi.json").json()["paths"]
    described = {f"{method.upper()} {path}" for path, methods in paths.items() for method in methods}
    assert described <= set(routes)


@pytest.mark.parametrize("role", Role)
def test_a_role_comes_as_far_as_its_routes(routes: list[str], gated: Gated, role: Role) -> None:
    for route in routes:
        least = least_roles()[route]
        may = least is None or Identity(role, "token").covers(least)
        expected = (200, "") if may else (403, "role-not-enough")
        assert asked(gated, route, gated.bearer(role)) == expected, route


def test_an_admin_on_a_foreign_page_is_refused_everywhere(routes: list[str], gated: Gated) -> None:
    for origin in ("https://evil.example", "http://localhost:3000", "null", "http://localhost"):
        for route in routes:
            headers = {**gated.bearer(Role.ADMIN), "Origin": origin}
            assert asked(gated, route, headers) == (403, "foreign-page"), (route, origin)


def test_an_admin_who_calls_the_daemon_by_a_foreign_name_is_refused_everywhere(
    routes: list[str], gated: Gated
) -> None:
    for route in routes:
        headers = {**gated.bearer(Role.ADMIN), "Host": "evil.example:8050"}
        assert asked(gated, route, headers) == (421, "foreign-host"), route


def test_foreign_names_and_pages_are_refused_without_tokens_too(routes: list[str], tmp_path: Path) -> None:
    gated = Gated(tmp_path, tokens=False)
    for route in routes:
        assert asked(gated, route, {"Host": "evil.example"}) == (421, "foreign-host"), route
        assert asked(gated, route, {"Origin": "https://evil.example"}) == (403, "foreign-page"), route


def test_the_whole_application_stands_behind_the_gate(tmp_path: Path) -> None:
    assert application(tmp_path).user_middleware[0].cls is Gate


def test_a_route_that_the_table_has_forgotten_is_for_an_admin_alone(tmp_path: Path) -> None:
    app = application(tmp_path)
    app.add_api_route("/api/v1/forgotten", lambda: {"done": True}, methods=["POST"])
    access = app.state.service.access
    client = TestClient(app, "http://localhost")
    for role in Role:
        headers = {"Authorization": f"Bearer {access.add(role.value, role)}"}
        answer = client.post("/api/v1/forgotten", headers=headers)
        if role is Role.ADMIN:
            assert answer.json() == {"done": True}
        else:
            assert is_problem(answer, 403, "undeclared-route")


def test_the_description_says_who_may(idle: TestClient) -> None:
    description = idle.get("/api/v1/openapi.json").json()
    assert set(description["components"]["securitySchemes"]) == {"token", "session"}
    assert description["security"] == [{"token": []}, {"session": []}]
    assert description["paths"]["/healthz"]["get"]["security"] == []
    order = description["paths"]["/api/v1/captures"]["post"]
    assert order["x-least-role"] == "operator"
    assert {"401", "403", "408", "413", "421", "429"} <= set(order["responses"])


TRAVERSALS = [
    "..",
    "../state.sqlite",
    "%2e%2e%2fstate.sqlite",
    "..%2f..%2fetc%2fpasswd",
    "/etc/passwd",
    "a%00b",
]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A client of an application with a folder of captures, and something secret beside it."""
    folder = tmp_path_factory.mktemp("stored")
    (folder / "captures").mkdir()
    (folder / "secret.grab").write_text("secret")
    app = application(folder)
    app.state.service.archive.open()
    app.state.service.open_stores()
    yield TestClient(app, "http://localhost", raise_server_exceptions=False)
    app.state.service.archive.close()


@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_no_path_of_a_request_reaches_the_file_system(
    routes: list[str], stored: TestClient, traversal: str
) -> None:
    for route in routes:
        method, _, template = route.partition(" ")
        if "{" in template and method != "WEBSOCKET":
            path = re.sub(r"\{[^}]*\}", traversal, template)
            answer = stored.request(method, path, json={})
            led_out = answer.url.path in {"/", "/docs/"}  # by the client itself; they are open to everybody
            assert led_out or answer.status_code in (404, 405, 409, 422), route

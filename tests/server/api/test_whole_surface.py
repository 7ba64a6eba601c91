"""Whatever is asked over HTTP is answered as described; the endless streams have tests of their own."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from running import PATIENCE_S, wait_until_it_accepts

from grabberd.documents.enums import Role
from grabberd.server.api import create_app
from grabberd.server.api.guard import authentication
from grabberd.server.api.guard.front import Front, bind
from grabberd.server.api.serving import server_of
from server.api.conftest import service_in

ENDLESS = ("/api/v1/events", "/api/v1/preview")
BEYOND_A_SCHEMA = (
    "GET /api/v1/captures",
    "GET /api/v1/captures.zip",
    "GET /api/v1/study",
    "POST /api/v1/captures",
    "POST /api/v1/capture-groups",
    "POST /api/v1/calibrations",
    "PUT /api/v1/settings",
    "POST /api/v1/profiles",
    "PUT /api/v1/profiles/{kind}/{name}",
)
"""What they take depends on several keys together, on the rig, or on the time zones there are, which a JSON
schema cannot say."""
UNREADY = "GET /readyz"
"""Answers 503 on a computer that is too busy to capture, as it has to."""
EXAMPLES = 5


@pytest.fixture
def daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, str]]:
    """Its address and the token of an admin; each operation is also asked with tokens that are none."""
    monkeypatch.setattr(authentication, "FREE_ATTEMPTS", 10_000)
    service = service_in(tmp_path, pace="real")
    service.open_stores()
    secret = service.access.add("tester", Role.ADMIN)
    server = server_of(create_app(service), Front())
    sockets = bind("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, args=(sockets,))
    thread.start()
    try:
        wait_until_it_accepts(service)
        yield f"http://127.0.0.1:{sockets[0].getsockname()[1]}", secret
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)


def findings(operation: Any, headers: dict[str, str]) -> str | None:
    """What is wrong with how an operation is answered, or None."""
    import schemathesis  # noqa: PLC0415
    from schemathesis.checks import not_a_server_error  # noqa: PLC0415
    from schemathesis.specs.openapi.checks import positive_data_acceptance  # noqa: PLC0415

    excluded = [positive_data_acceptance] if operation.label in BEYOND_A_SCHEMA else []
    excluded += [not_a_server_error] if operation.label == UNREADY else []

    @given(case=operation.as_strategy())
    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    def ask(case: Any) -> None:
        case.call_and_validate(headers=headers, timeout=PATIENCE_S, excluded_checks=excluded)

    try:
        ask()
    except BaseExceptionGroup as group:
        return "\n".join(str(error) for error in group.exceptions)
    except (AssertionError, schemathesis.errors.SchemathesisError) as error:
        return str(error)
    return None


@pytest.mark.slow
def test_every_operation_answers_as_it_is_described(daemon: tuple[str, str]) -> None:
    schemathesis = pytest.importorskip("schemathesis")  # takes a second, which every other run is spared
    url, secret = daemon
    headers = {"Authorization": f"Bearer {secret}"}
    schema = schemathesis.openapi.from_url(f"{url}/api/v1/openapi.json", headers=headers)
    operations = [result.ok() for result in schema.get_all_operations()]
    finite = [operation for operation in operations if operation.path not in ENDLESS]
    found = {one.label: wrong for one in finite if (wrong := findings(one, headers)) is not None}
    assert len(finite) > 25
    assert not found, "\n\n".join(f"{label}\n{wrong}" for label, wrong in found.items())

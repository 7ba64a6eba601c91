"""What fails is answered by a problem document with a hint."""

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from grabberd.server.api.problems import install


@pytest.mark.parametrize(
    ("error", "status", "name"),
    [
        (RuntimeError("can't start new thread"), 503, "too-many-threads"),
        (OSError(24, "Too many open files"), 503, "too-many-files"),
        (RuntimeError("two\nlines"), 500, "internal-error"),
    ],
)
def test_what_the_computer_lacks_is_told_from_an_error_of_the_program(
    error: Exception, status: int, name: str
) -> None:
    app = FastAPI()
    install(app)

    @app.get("/")
    def fail() -> None:
        raise error

    answer = TestClient(app, raise_server_exceptions=False).get("/")
    assert answer.status_code == status
    assert answer.json()["type"].endswith(name)
    assert answer.json()["hint"]

"""The diagnostics over HTTP; who may is told by the table of roles."""

import io
import zipfile

from fastapi.testclient import TestClient

from grabberd.documents.enums import Role
from grabberd.server.api.guard.authentication import least_roles


def test_they_are_for_administrators() -> None:
    assert least_roles()["GET /api/v1/diagnostics"] is Role.ADMIN


def test_they_are_one_zip_file_that_says_what_is_in_it(fast: TestClient) -> None:
    secret = fast.app.state.service.access.add("me", Role.ADMIN)  # type: ignore[attr-defined]
    answer = fast.get("/api/v1/diagnostics", headers={"Authorization": f"Bearer {secret}"})
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert {"README.txt", "state.json", "log.jsonl"} <= set(archive.namelist())

"""A token that has expired is refused with its reason; what still streams to it ends."""

import asyncio
from datetime import timedelta
from pathlib import Path

from grabberd.documents.enums import Role
from server.api.gates import Gated, is_problem

GONE = timedelta(microseconds=-1)


def test_it_is_refused_with_its_reason_and_its_day(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    secret = gated.access.add("visitor", Role.ADMIN, GONE)
    answer = gated.client().get("/api/v1/state", headers={"Authorization": f"Bearer {secret}"})
    assert is_problem(answer, 401, "token-expired")
    assert "visitor" in answer.json()["detail"]
    assert "expired at 20" in answer.json()["detail"]
    assert 'error="invalid_token"' in answer.headers["WWW-Authenticate"]


def test_who_comes_with_it_again_and_again_is_not_slowed_but_told(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    secret = gated.access.add("visitor", Role.ADMIN, GONE)
    for _ in range(15):
        answer = gated.client().get("/api/v1/state", headers={"Authorization": f"Bearer {secret}"})
        assert answer.status_code == 401


def test_one_that_is_still_good_comes_in(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    secret = gated.access.add("visitor", Role.VIEWER, timedelta(days=1))
    answer = gated.client().get("/api/v1/state", headers={"Authorization": f"Bearer {secret}"})
    assert answer.json()["role"] == "viewer"


def test_what_streams_to_it_is_asked_about_again(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    secret = gated.access.add("visitor", Role.VIEWER, GONE)
    scope = {"type": "http", "headers": [(b"authorization", f"Bearer {secret}".encode())]}
    still = gated.app._authenticator.still_is(scope, Role.VIEWER)
    assert asyncio.run(still) is False


def test_the_key_of_the_machine_opens_every_door(tmp_path: Path) -> None:
    gated = Gated(tmp_path, tokens=False)
    gated.access.key.make()
    secret = gated.access.key.path.read_text().strip()
    answer = gated.client().get("/api/v1/state", headers={"Authorization": f"Bearer {secret}"})
    assert answer.json() == {"role": "admin", "by": "machine", "bytes": 0}

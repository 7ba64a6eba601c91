"""Guided tests over HTTP: recipes, list, document, report, made by hand, their offers accepted."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from running import wait_until_it_accepts

from archive.liner_tests import FAILED, damage, stored_test, test_document
from archive.milkings import milking
from core.chain.milking import still
from grabberd.server.api import create_app
from grabberd.server.daemon.service import Service
from grabberd_liner.part import liner_of
from liner.chain.analysis.profiling import LINER, changed
from server.api.conftest import service_in

TESTS = "/api/v1/tests"
STIFFER = changed(LINER, "material.E_mpa", 3.4)
OFFER = {"profile": STIFFER, "after": 1, "changes": ["E_mpa: 3 becomes 3.4"]}


@pytest.fixture
def service(tmp_path: Path) -> Service:
    (tmp_path / "captures").mkdir()
    for name, liner in (("first", "A"), ("second", "A"), ("other", "B")):
        milking(tmp_path / "captures", still(3), name, labels={"liner": liner})
    return service_in(tmp_path, pace="free")


@pytest.fixture
def client(service: Service) -> Iterator[TestClient]:
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        service.job_runner.stop()  # what waits here is not done: its work has tests of its own
        yield client


@pytest.fixture
def made(service: Service, client: TestClient) -> str:
    """Id of a test with an offer for the first version of liner A's profile."""
    assert client.post("/api/v1/profiles", json={"profile": LINER}).status_code == 201
    return stored_test(liner_of(service).liner_tests.store, 1, offer=OFFER)


def is_problem(answer: Any, status: int, words: str) -> bool:
    problem = answer.json()
    kind = answer.headers["content-type"] == "application/problem+json"
    return bool(answer.status_code == status and kind and problem["hint"] and words in problem["detail"])


def test_the_recipes_say_what_to_do_and_how_long_it_takes(client: TestClient) -> None:
    recipes = {one["kind"]: one for one in client.get(f"{TESTS}/recipes").json()["recipes"]}
    assert list(recipes) == ["reference", "ramp", "milking", "artificial-teat", "overpressure", "wear"]
    assert (recipes["ramp"]["teat"], recipes["ramp"]["several"]) == (False, False)
    assert all(one["steps"] and one["duration_s"] > 0 and one["bits"] >= 1 for one in recipes.values())


def test_tests_are_listed_page_by_page_newest_first(client: TestClient, service: Service) -> None:
    ids = [stored_test(liner_of(service).liner_tests.store, n) for n in (1, 2, 3)]
    found, cursor = [], None
    while True:
        page = client.get(TESTS, params={"limit": 2, **({"cursor": cursor} if cursor else {})}).json()
        found += [row["id"] for row in page["tests"]]
        if (cursor := page["next"]) is None:
            break
    assert found == ids[::-1]


def test_a_list_is_narrowed_to_a_liner_and_a_recipe(client: TestClient, service: Service) -> None:
    store = liner_of(service).liner_tests.store
    ramp = stored_test(store, 1, liner="Blåros 2")
    failed = stored_test(store, 2, kind="reference", verdict="failed", checks=[FAILED])
    assert [row["id"] for row in client.get(TESTS, params={"liner": "Blåros 2"}).json()["tests"]] == [ramp]
    (row,) = client.get(TESTS, params={"kind": "reference"}).json()["tests"]
    assert (row["id"], row["verdict"], row["offers"]) == (failed, "failed", False)
    assert client.get(TESTS, params={"kind": "colour"}).status_code == 422


def test_a_test_is_read_as_it_was_stored_and_for_ever(client: TestClient, made: str) -> None:
    answer = client.get(f"{TESTS}/{made}")
    assert answer.json() == test_document(offer=OFFER).model_dump(mode="json", by_alias=True)
    etag = answer.headers["ETag"]
    assert client.get(f"{TESTS}/{made}", headers={"If-None-Match": etag}).status_code == 304


def test_its_report_is_a_page_that_loads_nothing(client: TestClient, made: str, service: Service) -> None:
    answer = client.get(f"{TESTS}/{made}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    without = stored_test(liner_of(service).liner_tests.store, 2, page=False)
    assert is_problem(client.get(f"{TESTS}/{without}/report"), 404, "has no test.html")


def test_what_does_not_exist_or_is_damaged_says_so(client: TestClient, made: str, service: Service) -> None:
    for path in (f"{TESTS}/job-7", f"{TESTS}/job-7/report"):
        assert is_problem(client.get(path), 404, "no test 'job-7'")
    assert is_problem(client.post(f"{TESTS}/job-7/accept"), 404, "no test 'job-7'")
    damage(liner_of(service).liner_tests.store, made)
    assert is_problem(client.get(f"{TESTS}/{made}"), 507, "cannot be read")
    assert is_problem(client.post(f"{TESTS}/{made}/accept"), 507, "cannot be read")
    (row,) = client.get(TESTS).json()["tests"]
    assert "cannot be read" in row["problem"]


def test_captures_that_are_named_are_tested_by_a_job(client: TestClient) -> None:
    body = {"kind": "artificial-teat", "captures": ["second", "first"]}
    answer = client.post(TESTS, json=body, headers={"Idempotency-Key": "once"})
    assert answer.status_code == 202
    job = answer.json()
    assert (job["kind"], job["state"], job["automatic"]) == ("test", "queued", False)
    assert answer.headers["Location"].endswith(f"/api/v1/jobs/{job['id']}")
    assert client.post(TESTS, json=body, headers={"Idempotency-Key": "once"}).json() == job
    for name in ("first", "second"):
        assert client.get(f"/api/v1/captures/{name}").json()["analysis"]["job"] == job["id"]
        assert client.delete(f"/api/v1/captures/{name}").status_code == 409


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        ({"kind": "ramp", "captures": ["first", "second"]}, 422, "is of one capture, and 2 are named"),
        ({"kind": "wear", "captures": ["first"]}, 422, "compares captures, and one is named"),
        ({"kind": "wear", "captures": ["first", "other"]}, 422, "several liners: A, B"),
        ({"kind": "wear", "captures": ["first", "first"]}, 422, "name one twice"),
        ({"kind": "ramp", "captures": ["gone"]}, 404, "gone"),
        ({"kind": "ramp", "captures": []}, 422, "captures"),
        ({"kind": "ramp", "captures": ["../x"]}, 422, "captures"),
        ({"kind": "squeeze", "captures": ["first"]}, 422, "kind"),
        ({"kind": "ramp", "captures": ["first"], "inputs": [1]}, 422, "inputs"),
        ({"kind": "ramp", "captures": ["first"], "liner": "A"}, 422, "liner"),
        ({"kind": "ramp"}, 422, "captures"),
    ],
)
def test_what_makes_no_test_is_refused_and_nothing_is_queued(
    client: TestClient, body: Any, status: int, words: str
) -> None:
    assert is_problem(client.post(TESTS, json=body), status, words)
    assert client.get("/api/v1/jobs").json()["jobs"] == []


def test_an_offer_is_stored_once(client: TestClient, made: str) -> None:
    answer = client.post(f"{TESTS}/{made}/accept")
    assert (answer.status_code, answer.json()["version"], answer.json()["profile"]) == (200, 2, STIFFER)
    assert client.post(f"{TESTS}/{made}/accept").json() == answer.json()
    assert client.get("/api/v1/profiles/liner/A").json() == answer.json()


def test_an_offer_that_came_too_late_or_is_none_is_refused(
    client: TestClient, made: str, service: Service
) -> None:
    changed_meanwhile = {"profile": changed(LINER, "note", "remounted"), "after": 1}
    assert client.put("/api/v1/profiles/liner/A", json=changed_meanwhile).status_code == 200
    assert is_problem(client.post(f"{TESTS}/{made}/accept"), 409, "version 2 of the liner profile A")
    nothing = stored_test(liner_of(service).liner_tests.store, 2)
    assert is_problem(client.post(f"{TESTS}/{nothing}/accept"), 409, "has nothing to offer")

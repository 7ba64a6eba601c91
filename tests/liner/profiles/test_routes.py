"""Profiles over HTTP, and the commands that ask for them there."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
import yaml
from fastapi.testclient import TestClient
from running import PATIENCE_S, wait_until_it_accepts
from typer.testing import CliRunner

from archive.milkings import milking
from core.chain.milking import still
from grabberd.cli.app import app
from grabberd.documents.enums import Role
from grabberd.server.api import create_app
from grabberd.server.api.guard.front import Front, bind
from grabberd.server.api.serving import server_of
from grabberd_liner.profiles.documents import ProfileDocument
from liner.chain.analysis.profiling import COW, CUP, LINER, changed
from server.api.conftest import service_in

PROFILES = "/api/v1/profiles"


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    (tmp_path / "captures").mkdir()
    milking(tmp_path / "captures", still(3), "resting", labels={"liner": "A"})
    service = service_in(tmp_path, pace="free")
    with TestClient(create_app(service), "http://localhost", raise_server_exceptions=False) as client:
        wait_until_it_accepts(service)
        yield client


def is_problem(answer: Any, status: int) -> bool:
    kind = answer.headers["content-type"] == "application/problem+json"
    return bool(answer.status_code == status and kind and answer.json()["hint"])


def test_a_profile_is_stored_read_and_listed(client: TestClient) -> None:
    answer = client.post(PROFILES, json={"profile": COW})
    assert (answer.status_code, answer.headers["Location"]) == (201, f"http://localhost{PROFILES}/cow/112")
    document = client.get(f"{PROFILES}/cow/112").json()
    assert document == answer.json()
    assert ProfileDocument.model_validate(document).profile == yaml.safe_load(document["yaml"]) == COW
    [row] = client.get(PROFILES).json()["profiles"]
    assert (row["kind"], row["name"], row["version"]) == ("cow", "112", 1)
    assert client.get(PROFILES, params={"kind": "liner"}).json() == {"profiles": [], "next": None}


def test_the_address_of_a_new_profile_can_be_asked_for_whatever_its_name(client: TestClient) -> None:
    answer = client.post(PROFILES, json={"profile": {"kind": "cow", "name": "Blåros 2"}})
    assert answer.headers["Location"] == f"http://localhost{PROFILES}/cow/Bl%C3%A5ros%202"
    assert client.get(answer.headers["Location"]).json() == answer.json()


def test_a_list_comes_page_by_page_whatever_the_names(client: TestClient) -> None:
    names = ["Blåros", "Stjerna 2", "112"]
    for name in names:
        assert client.post(PROFILES, json={"profile": {"kind": "cow", "name": name}}).status_code == 201
    found, cursor = [], None
    while True:
        page = client.get(PROFILES, params={"limit": 1, **({"cursor": cursor} if cursor else {})}).json()
        found += [row["name"] for row in page["profiles"]]
        if (cursor := page["next"]) is None:
            break
    assert sorted(found) == sorted(names)
    assert client.get(f"{PROFILES}/cow/{quote('Stjerna 2')}").json()["name"] == "Stjerna 2"


def test_a_list_is_narrowed_to_a_name(client: TestClient) -> None:
    for kind, name in (("cow", "1"), ("cow", "2"), ("cup", "1")):
        client.post(PROFILES, json={"profile": {"kind": kind, "name": name}})
    rows = client.get(PROFILES, params={"kind": "cow", "name": "1"}).json()["profiles"]
    assert [(row["kind"], row["name"]) for row in rows] == [("cow", "1")]
    assert len(client.get(PROFILES, params={"name": "1"}).json()["profiles"]) == 2
    assert is_problem(client.get(PROFILES, params={"name": "../x"}), 422)


def test_text_is_as_good_as_a_document(client: TestClient) -> None:
    answer = client.post(PROFILES, json={"yaml": "kind: cow\nname: '7'\nlactation: 3\n"})
    assert answer.json()["profile"] == {"kind": "cow", "name": "7", "lactation": 3}


def test_the_next_version_leaves_the_first_as_it_was(client: TestClient) -> None:
    address = f"{PROFILES}/cow/112"
    assert client.put(address, json={"profile": COW}).status_code == 201
    older = changed(COW, "lactation", 3)
    second = client.put(address, json={"profile": older, "after": 1})
    assert (second.status_code, second.json()["version"]) == (200, 2)
    assert client.put(address, json={"profile": older}).json()["version"] == 2
    versions = client.get(f"{address}/versions").json()["versions"]
    assert [(row["version"], row["newest"]) for row in versions] == [(2, 2), (1, 2)]
    first = client.get(f"{address}/versions", params={"limit": 1}).json()
    last = client.get(f"{address}/versions", params={"limit": 1, "cursor": first["next"]}).json()
    assert (first["versions"], last["versions"], last["next"]) == (versions[:1], versions[1:], None)
    assert client.get(f"{address}/versions/1").json()["profile"] == COW
    assert is_problem(client.get(f"{address}/versions/3"), 404)


def test_a_change_made_on_an_older_version_is_refused(client: TestClient) -> None:
    client.post(PROFILES, json={"profile": COW})
    address = f"{PROFILES}/cow/112"
    client.put(address, json={"profile": changed(COW, "lactation", 3), "after": 1})
    assert is_problem(client.put(address, json={"profile": changed(COW, "lactation", 4), "after": 1}), 409)
    assert is_problem(client.post(PROFILES, json={"profile": COW}), 409)


def test_a_retired_one_is_found_by_no_label_and_stays_readable(client: TestClient) -> None:
    client.post(PROFILES, json={"profile": COW})
    for _ in range(2):
        assert client.delete(f"{PROFILES}/cow/112").json()["retired_utc"]
    assert client.get(PROFILES).json()["profiles"] == []
    assert len(client.get(PROFILES, params={"retired": True}).json()["profiles"]) == 1
    assert client.get(f"{PROFILES}/cow/112/versions/1").json()["profile"] == COW
    assert is_problem(client.delete(f"{PROFILES}/cow/113"), 404)


def test_a_request_repeated_with_its_key_takes_effect_once(client: TestClient) -> None:
    key = {"Idempotency-Key": "5d0c"}
    first, again = (client.post(PROFILES, json={"profile": COW}, headers=key) for _ in range(2))
    assert (first.status_code, again.status_code, again.json()) == (201, 201, first.json())


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"profile": COW, "yaml": "kind: cow\nname: '7'\n"},
        {"yaml": "kind: ["},
        {"profile": {"kind": "bull", "name": "1"}},
        {"profile": {"kind": "cow", "name": "../x"}},
        {"profile": changed(COW, "flow_stop.sigma_kpa", None)},
        {"profile": COW, "after": -1},
    ],
)
def test_a_body_that_is_no_profile_is_refused(client: TestClient, body: dict[str, Any]) -> None:
    assert is_problem(client.post(PROFILES, json=body), 422)
    assert client.get(PROFILES, params={"retired": True}).json()["profiles"] == []


def test_every_problem_of_a_liner_is_said_at_once(client: TestClient) -> None:
    wrong = changed(changed(LINER, "material.E_sigma_mpa", None), "colour", "red")
    detail = client.post(PROFILES, json={"profile": wrong}).json()["detail"]
    assert "material.E_sigma_mpa: is missing" in detail
    assert "colour: unknown key" in detail


def test_a_profile_is_stored_at_its_own_address_alone(client: TestClient) -> None:
    assert is_problem(client.put(f"{PROFILES}/cow/113", json={"profile": COW}), 422)
    assert is_problem(client.put(f"{PROFILES}/cup/112", json={"profile": COW}), 422)
    assert is_problem(client.get(f"{PROFILES}/bull/112"), 422)


def test_an_analysis_takes_what_the_labels_find_and_its_record_names_the_version(client: TestClient) -> None:
    client.put(f"{PROFILES}/liner/A", json={"profile": LINER})
    stored = client.put(f"{PROFILES}/liner/A", json={"profile": changed(LINER, "age_milkings", 9)}).json()
    answer = client.post("/api/v1/captures/resting/analysis", json={"profiles": True})
    client.app.state.service.jobs.wait(answer.json()["id"], 4 * PATIENCE_S)  # type: ignore[attr-defined]
    [row] = client.get("/api/v1/captures/resting/analyses").json()["analyses"]
    assert row["profiles"] == [{"kind": "liner", "name": "A", "version": 2, "sha256": stored["sha256"]}]
    assert row["inputs"]["material"] == LINER["material"]
    document = client.get("/api/v1/captures/resting/analyses/1").json()
    assert document["inputs"]["sources"]["material"] == "liner profile A, version 2"
    client.delete(f"{PROFILES}/liner/A")
    assert client.get(f"{PROFILES}/liner/A/versions/2").json()["profile"]["age_milkings"] == 9


def test_a_contradiction_fails_the_job_with_all_of_it(client: TestClient) -> None:
    client.put(f"{PROFILES}/liner/A", json={"profile": changed(LINER, "material.radius_mm", 15.0)})
    client.put(f"{PROFILES}/cup/1", json={"profile": changed(CUP, "device", "south")})
    client.patch("/api/v1/captures/resting", json={"labels": {"cup": "1"}})
    answer = client.post("/api/v1/captures/resting/analysis", json={"profiles": True})
    client.app.state.service.jobs.wait(answer.json()["id"], 4 * PATIENCE_S)  # type: ignore[attr-defined]
    problem = client.get(answer.headers["Location"]).json()["problem"]
    assert "mm apart across the liner" in problem["message"]
    assert "it is of the device south" in problem["message"]


@pytest.fixture
def daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[Role, list[str]]]:
    """Options of a command for each role."""
    service = service_in(tmp_path / "daemon", pace="free")
    service.open_stores()
    files = {}
    for role in Role:
        files[role] = tmp_path / role.value
        files[role].write_text(service.access.add(role.value, role))
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "elsewhere"))
    server = server_of(create_app(service), Front())
    sockets = bind("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, args=(sockets,))
    thread.start()
    url = f"http://127.0.0.1:{sockets[0].getsockname()[1]}"
    try:
        wait_until_it_accepts(service)
        yield {role: ["--url", url, "--token-file", str(file)] for role, file in files.items()}
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)


def test_the_commands_reach_a_daemon_as_they_do_a_folder(
    daemon: dict[Role, list[str]], tmp_path: Path
) -> None:
    def run(*words: object, role: Role = Role.OPERATOR) -> str:
        result = CliRunner().invoke(app, ["profile", *map(str, words), *daemon[role]])
        return result.stdout if result.exit_code == 0 else f"{result.exception}"

    file = tmp_path / "cow.yaml"
    for lactation, said in ((2, "version 1"), (2, "version 1, unchanged"), (3, "version 2")):
        file.write_text(yaml.safe_dump({"kind": "cow", "name": "Blåros 2", "lactation": lactation}))
        assert run("add", file) == f"cow Blåros 2: {said}\n"
    assert "Blåros 2" in run("list", role=Role.VIEWER)
    assert yaml.safe_load(run("show", "cow", "Blåros 2", "--version", 1, role=Role.VIEWER))["lactation"] == 2
    assert "lactation: 2 → 3" in run("history", "cow", "Blåros 2", role=Role.VIEWER)
    assert "operator" in run("retire", "cow", "Blåros 2", role=Role.VIEWER)
    assert "is retired" in run("retire", "cow", "Blåros 2")
    assert "no cow profile 'Rosa'" in run("export", "cow", "Rosa")
    file.write_text("kind: cow\nname: 112\n")
    assert "in quotes" in run("add", file)

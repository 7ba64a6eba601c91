"""The library over HTTP: found and counted, seen at a glance, and handled several at once."""

import csv
import io
import zipfile
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.api.conftest import sealed

CAPTURES = "/api/v1/captures"


@pytest.fixture
def three(captured: tuple[TestClient, str]) -> tuple[TestClient, list[str]]:
    """Three captures, the oldest of cow 112, the others of cow 9 and 10."""
    client, first = captured
    ids = [first]
    for cow in ("9", "10"):
        answer = client.post(CAPTURES, json={"fields": 5, "labels": {"cow": cow, "teat": "front left"}})
        ids.append(answer.json()["id"])
        sealed(client, ids[-1])
    return client, ids


def listed(client: TestClient, **query: Any) -> Any:
    answer = client.get(CAPTURES, params=query)
    assert answer.status_code == 200, answer.json()
    return answer.json()


def values(facet: list[dict[str, Any]]) -> dict[str, int]:
    return {one["value"]: one["count"] for one in facet}


def test_captures_are_found_counted_and_sorted(three: tuple[TestClient, list[str]]) -> None:
    client, (oldest, nine, ten) = three
    page = listed(
        client, facets=True, zone="Europe/Oslo", label=["cow=9", "cow=10"], sort="label.cow", limit=1
    )
    assert ([one["id"] for one in page["captures"]], page["total"], page["in_all"]) == ([nine], 2, 3)
    assert values(page["facets"]["labels"]["cow"]) == {"112": 1, "9": 1, "10": 1}
    assert values(page["facets"]["verdict"]) == {"complete": 2}
    after = listed(client, label=["cow=9", "cow=10"], sort="label.cow", cursor=page["next"])
    assert ([one["id"] for one in after["captures"]], after["next"], after["facets"]) == ([ten], None, None)
    table = client.get(f"{CAPTURES}.csv", params={"sort": "time", "search": "112"}).text
    assert [row["id"] for row in csv.DictReader(table.splitlines())] == [oldest]


@pytest.mark.parametrize(
    ("query", "hint"),
    [
        ({"sort": "cow"}, "openapi.json"),
        ({"zone": "Mars/Base", "facets": True}, "Europe/Oslo"),
        ({"sort": "-length", "cursor": "now~a"}, "first page"),
        ({"verdict": "good"}, "openapi.json"),
        ({"label": "cow"}, "openapi.json"),
    ],
)
def test_a_question_that_means_nothing_is_refused_with_a_hint(
    kept: tuple[TestClient, str], query: dict[str, Any], hint: str
) -> None:
    answer = kept[0].get(CAPTURES, params=query)
    assert answer.status_code == 422
    assert hint in answer.json()["hint"]


def test_a_capture_is_seen_at_a_glance(kept: tuple[TestClient, str]) -> None:
    client, one = kept
    picture = client.get(f"{CAPTURES}/{one}/thumbnail.png")
    assert picture.content.startswith(b"\x89PNG")
    assert "immutable" in picture.headers["Cache-Control"]
    assert client.get(f"{CAPTURES}/nothing/thumbnail.png").status_code == 404
    widths = client.get(f"{CAPTURES}/{one}/widths").json()["widths_mm"]
    assert widths
    assert all(5 < width < 60 for width in widths)
    assert listed(client)["widths_mm"] == {one: widths}


def test_several_are_labelled_pinned_and_deleted_and_each_failure_says_why(
    three: tuple[TestClient, list[str]],
) -> None:
    client, (first, second, third) = three
    patch = {"captures": [first, second, "gone", first], "labels": {"liner": "L3"}}
    answer = client.patch(CAPTURES, json=patch).json()
    assert answer["done"] == [first, second]
    assert [(one["capture"], "lists all" in one["hint"]) for one in answer["failed"]] == [("gone", True)]
    assert listed(client, label="liner=L3")["total"] == 2
    client.patch(CAPTURES, json={"captures": [second], "pinned": True})
    assert listed(client, pinned=True)["total"] == 1
    answer = client.post(f"{CAPTURES}/deletion", json={"captures": [first, second, third]}).json()
    assert answer["done"] == [first, third]
    assert ["unpin it first" in one["hint"] for one in answer["failed"]] == [True]
    assert [one["id"] for one in listed(client)["captures"]] == [second]
    assert client.post(f"{CAPTURES}/deletion", json={"captures": []}).status_code == 422
    assert client.patch(CAPTURES, json={"captures": ["a"] * 101, "pinned": True}).status_code == 422


def test_several_are_queued_for_analysis(three: tuple[TestClient, list[str]]) -> None:
    client, (first, second, _) = three
    answer = client.post(f"{CAPTURES}/analysis", json={"captures": [first, "gone", second]})
    assert answer.status_code == 202
    assert answer.json()["done"] == [first, second]
    assert [one["capture"] for one in answer.json()["failed"]] == ["gone"]
    jobs = [client.get(f"/api/v1/jobs/{job}").json() for job in answer.json()["jobs"]]
    assert [(job["kind"], job["subject"]) for job in jobs] == [("analyse", first), ("analyse", second)]


def test_several_are_taken_home_as_one_archive(three: tuple[TestClient, list[str]]) -> None:
    client, (first, second, third) = three
    client.patch(CAPTURES, json={"captures": [third], "labels": {"cow": "9", "liner": "a/b"}})
    query = {"capture": [first, second, "gone", third], "zone": "Europe/Oslo"}
    answer = client.get(f"{CAPTURES}.zip", params=query)
    assert answer.headers["Content-Disposition"] == 'attachment; filename="captures.zip"'
    archive = zipfile.ZipFile(io.BytesIO(answer.content))
    assert archive.testzip() is None
    names = archive.namelist()
    assert names[0] == "captures.csv"
    assert names[1].endswith("cow 112.grab")
    assert names[2].endswith("cow 9 front left.grab")
    assert names[3].endswith("cow 9 front left liner a b.grab")
    assert archive.read("MISSING.txt").decode() == "capture gone: no capture 'gone'\n"
    file = client.get(f"{CAPTURES}/{second}/file").content
    assert archive.read(names[2]) == file

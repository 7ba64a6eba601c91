"""What is in a capture comes in parts, thinned out, and not twice."""

import math

import pytest
from fastapi.testclient import TestClient

CAPTURES = "/api/v1/captures"


def test_points_come_field_by_field_with_their_sigma(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    document = client.get(f"{CAPTURES}/{capture_id}/points").json()
    assert (document["capture"], document["run"], document["every"]) == (capture_id, 1, 1)
    assert [field["n"] for field in document["fields"]] == list(range(20))
    field = document["fields"][5]
    assert field["time_s"] == pytest.approx(0.1, abs=0.001)
    assert len({len(column) for column in field.values() if isinstance(column, list)}) == 1
    assert all(0 < sigma < 0.5 for sigma in field["sigma_z_mm"])
    assert all(map(math.isfinite, field["x_mm"]))


def test_they_are_chosen_by_field_and_target(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    query = {"first_n": 3, "end_n": 12, "every": 3, "target": [4, 5]}
    fields = client.get(f"{CAPTURES}/{capture_id}/points", params=query).json()["fields"]
    assert [field["n"] for field in fields] == [3, 6, 9]
    assert {target for field in fields for target in field["target"]} <= {4, 5}


def test_too_many_are_thinned_out_and_the_answer_says_so(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    everything = client.get(f"{CAPTURES}/{capture_id}/points").json()
    total = sum(len(field["target"]) for field in everything["fields"])
    assert total > 1000
    thinned = client.get(f"{CAPTURES}/{capture_id}/points", params={"max_points": 1000}).json()
    assert thinned["every"] == -(-total // 1000)
    every = [field for field in everything["fields"] if field["n"] % thinned["every"] == 0]
    assert thinned["fields"] == every
    assert sum(len(field["target"]) for field in every) <= 1000


def test_a_capture_without_such_points_is_a_problem(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    assert client.get(f"{CAPTURES}/{capture_id}/points?run=7").status_code == 404
    assert client.get(f"{CAPTURES}/{capture_id}/points?every=0").status_code == 422
    assert client.get(f"{CAPTURES}/{capture_id}/points?first_n=30").json()["fields"] == []


@pytest.mark.parametrize("what", ["file", "fields/3.png"])
def test_what_is_known_already_is_not_sent_again(kept: tuple[TestClient, str], what: str) -> None:
    client, capture_id = kept
    first = client.get(f"{CAPTURES}/{capture_id}/{what}")
    etag = first.headers["ETag"]
    for known in (etag, f'"other", W/{etag}', "*"):
        again = client.get(f"{CAPTURES}/{capture_id}/{what}", headers={"If-None-Match": known})
        assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", etag)
    assert client.get(f"{CAPTURES}/{capture_id}/{what}", headers={"If-None-Match": '"other"'}).content
    assert first.headers["Cache-Control"].startswith("private")


def test_a_field_never_changes(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    assert "immutable" in client.get(f"{CAPTURES}/{capture_id}/fields/3.png").headers["Cache-Control"]


def test_a_download_that_broke_off_goes_on(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    url = f"{CAPTURES}/{capture_id}/file"
    whole = client.get(url)
    size = len(whole.content)
    rest = client.get(url, headers={"Range": "bytes=1000-", "If-Range": whole.headers["ETag"]})
    assert (rest.status_code, rest.content) == (206, whole.content[1000:])
    assert rest.headers["Content-Range"] == f"bytes 1000-{size - 1}/{size}"
    other = client.get(url, headers={"Range": "bytes=1000-", "If-Range": '"other"'})
    assert (other.status_code, other.content) == (200, whole.content)
    assert client.get(url, headers={"Range": f"bytes={size}-"}).status_code == 416


def test_a_further_run_changes_the_files_tag(captured: tuple[TestClient, str]) -> None:
    client, capture_id = captured
    before = client.get(f"{CAPTURES}/{capture_id}/file").headers["ETag"]
    job = client.post(f"{CAPTURES}/{capture_id}/measure").json()["id"]
    service = client.app.state.service  # type: ignore[attr-defined]
    service.jobs.wait(job, 60)
    assert client.get(f"{CAPTURES}/{capture_id}/file").headers["ETag"] != before


def test_a_run_says_what_its_points_were_made_with(kept: tuple[TestClient, str]) -> None:
    client, capture_id = kept
    document = client.get(f"{CAPTURES}/{capture_id}/runs/1").json()
    made_with = document.pop("made_with")
    listed = client.get(f"{CAPTURES}/{capture_id}").json()["runs"][0]
    coverage, in_short = document.pop("coverage"), listed.pop("coverage")
    assert document == listed
    assert (coverage["verdict"], coverage["share"]) == (in_short["verdict"], in_short["share"])
    assert set(made_with["calibration"]["views"]) == {"left", "right"}
    assert len(made_with["object"]["targets"]) == 108
    assert made_with["settings"]["method"] == "centroid"
    assert client.get(f"{CAPTURES}/{capture_id}/runs/2").status_code == 404

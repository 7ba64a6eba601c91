"""Long lists come page by page, and what comes or goes meanwhile shifts no page."""

import csv
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from archive.captures import META, slots, write
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.api import create_app
from server.api.conftest import service_in
from server.api.gates import is_problem

CAPTURES = "/api/v1/captures"


def add(folder: Path, day: int, device: str = "teatcup", **changes: Any) -> None:
    write(
        folder,
        slots(2),
        name=f"c{day:02d}",
        id=f"c{day:02d}",
        created_utc=f"2026-03-{day:02d}T09:00:00.000Z",
        device={**META.device, "name": device},
        **changes,
    )


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven captures, of which nobody changes one."""
    folder = tmp_path_factory.mktemp("kept") / "captures"
    folder.mkdir()
    for day in range(1, 8):
        add(folder, day, "left" if day % 2 else "right", note=f"day {day}", labels={"cow": str(100 + day)})
    return folder


def serving(folder: Path) -> Iterator[TestClient]:
    with TestClient(create_app(service_in(folder.parent, pace="free")), "http://localhost") as client:
        yield client


@pytest.fixture(scope="module")
def client(kept: Path) -> Iterator[TestClient]:
    """Of a daemon that is only asked."""
    yield from serving(kept)


@pytest.fixture
def archive(kept: Path, tmp_path: Path) -> Path:
    """Copies to be changed."""
    return shutil.copytree(kept, tmp_path / "captures")


@pytest.fixture
def changing(archive: Path) -> Iterator[TestClient]:
    """Of a daemon of its own."""
    yield from serving(archive)


def listed(client: TestClient, **query: Any) -> tuple[list[str], str | None]:
    answer = client.get(CAPTURES, params=query)
    assert answer.status_code == 200, answer.json()
    return [capture["id"] for capture in answer.json()["captures"]], answer.json()["next"]


def test_pages_follow_each_other_to_the_end(client: TestClient) -> None:
    first, cursor = listed(client, limit=3)
    assert first == ["c07", "c06", "c05"]
    second, cursor = listed(client, limit=3, cursor=cursor)
    assert second == ["c04", "c03", "c02"]
    assert listed(client, limit=3, cursor=cursor) == (["c01"], None)


def test_a_page_that_ends_with_the_last_one_has_no_next(client: TestClient) -> None:
    assert listed(client, limit=7)[1] is None


def test_what_comes_or_goes_meanwhile_shifts_no_page(changing: TestClient, archive: Path) -> None:
    _, cursor = listed(changing, limit=3)
    add(archive, 20)
    changing.app.state.service.archive.index.add(archive / "c20.grab")  # type: ignore[attr-defined]
    for gone in ("c07", "c05", "c04"):
        assert changing.delete(f"{CAPTURES}/{gone}").status_code == 204
    assert listed(changing, limit=3, cursor=cursor)[0] == ["c03", "c02", "c01"]


def test_captures_are_looked_for_by_device_time_and_text(client: TestClient) -> None:
    assert listed(client, device="right")[0] == ["c06", "c04", "c02"]
    assert listed(client, since="2026-03-06T10:00:00+01:00")[0] == ["c07", "c06"]
    assert listed(client, since="2026-03-06T09:00:01")[0] == ["c07"]
    assert listed(client, search="DAY 3")[0] == ["c03"]
    assert listed(client, search="104")[0] == ["c04"]
    assert listed(client, device="left", search="day", limit=2)[0] == ["c07", "c05"]


def test_what_was_said_later_is_what_is_looked_for(changing: TestClient) -> None:
    changing.patch(f"{CAPTURES}/c03", json={"note": "slipped", "pinned": True})
    assert listed(changing, search="slip")[0] == ["c03"]
    assert listed(changing, search="day 3")[0] == []
    assert listed(changing, pinned=True)[0] == ["c03"]


@pytest.mark.parametrize("query", [{"limit": 0}, {"limit": 501}, {"cursor": "x"}, {"since": "yesterday"}])
def test_what_cannot_be_meant_is_refused(client: TestClient, query: Any) -> None:
    assert client.get(CAPTURES, params=query).status_code == 422


def test_they_come_as_a_table_with_the_same_filters(client: TestClient) -> None:
    answer = client.get(f"{CAPTURES}.csv", params={"limit": 3})
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    assert 'filename="captures.csv"' in answer.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    everything, _ = listed(client)
    assert [row["id"] for row in rows] == everything[:3]
    some = list(csv.DictReader(io.StringIO(client.get(f"{CAPTURES}.csv", params={"search": "day 3"}).text)))
    assert [row["id"] for row in some] == listed(client, search="day 3")[0]
    assert client.get(f"{CAPTURES}.csv", params={"limit": 10_001}).status_code == 422


def test_jobs_come_in_pages(changing: TestClient) -> None:
    made = [changing.post(f"{CAPTURES}/c0{day}/measure") for day in (1, 3, 5)]
    assert [answer.status_code for answer in made] == [404, 404, 404]  # no such device here
    service = changing.app.state.service  # type: ignore[attr-defined]
    nothing = MeasurementJob(subject="nothing", made_with={})
    ids = [service.jobs.submit(nothing).id for _ in range(11)]
    first = changing.get("/api/v1/jobs", params={"limit": 8}).json()
    second = changing.get("/api/v1/jobs", params={"limit": 8, "cursor": first["next"]}).json()
    assert [job["id"] for job in first["jobs"] + second["jobs"]] == ids[::-1]
    assert second["next"] is None


def test_calibrations_come_in_pages(client: TestClient) -> None:
    answer = client.get("/api/v1/calibrations", params={"limit": 1}).json()
    assert len(answer["calibrations"]) == 1
    assert answer["next"] is None


@pytest.mark.parametrize("end", ["since", "until"])
@pytest.mark.parametrize(
    "moment", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-12:00", "0001-01-01T00:30:00+01:00"]
)
def test_a_time_beyond_the_ends_of_the_calendar_is_refused(client: TestClient, end: str, moment: str) -> None:
    answer = client.get(CAPTURES, params={end: moment})
    assert is_problem(answer, 422, "bad-request")
    assert "outside the years 1 to 9999" in answer.json()["detail"]


def test_the_ends_of_the_calendar_are_times_like_others(client: TestClient) -> None:
    first, last = "0001-01-01T00:00:00", "9999-12-31T23:59:59.999Z"
    assert len(listed(client, since=first, until=last)[0]) == 7
    assert listed(client, since=last)[0] == listed(client, until=first)[0] == []

"""Values at the ends of their types, in any column of a capture: routes refuse them, and cut nothing off."""

import http.client
import json
import logging
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import pytest
from running import PATIENCE_S

from archive.captures import slots
from archive.readings import write_with_channels
from grabberd.archive.capture.digests import FORM_KEY
from server.api.conftest import service_in
from server.api.daemons import Daemon, served

EXTREMES = {"least": "-9223372036854775808", "greatest": "9223372036854775807", "bytes": "x'ff'"}
TABLES = ("fields", "pictures", "ledger", "runs", "points", "channels", "readings", "meta")
ROUTES = (
    *(
        "",
        "/ledger",
        "/runs/1",
        "/points",
        "/points.csv",
        "/points.ply",
        "/points.ply?field=1",
        "/points.c3d",
    ),
    *("/channels", "/channels.csv", "/fields/1.png", "/thumbnail.png", "/widths", "/replay/points"),
    *("/replay/pictures", "/file", "/analyses"),
)
OF_A_PROCESS = ("/points.parquet", "/points.mat")
"""Each takes a second."""
WHOLE = "whole"
FAULTS = (500, 502, 503, 504)


class Case(NamedTuple):
    """A column of a table, and what stands in one of its rows."""

    table: str
    column: str
    value: str

    @property
    def id(self) -> str:
        return f"{self.table}-{self.column}-{self.value}"


def columns_of(path: Path, table: str) -> list[str]:
    with closing(sqlite3.connect(path)) as connection:
        return [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]


def changed(whole: bytes, path: Path, case: Case | None) -> None:
    """The capture with that value in the last row of the table, and without digests, which would tell."""
    path.write_bytes(whole)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("INSERT INTO ledger VALUES (6, 1, 'lost', 'time gap')")
        connection.execute("DELETE FROM meta WHERE key = ?", (FORM_KEY,))
        connection.execute("UPDATE meta SET value = ? WHERE key = 'id'", (json.dumps(path.stem),))
        if case is None:
            return
        names = columns_of(path, case.table)[: 2 if case.table in ("points", "readings") else 1]
        which = " AND ".join(f"{name} = (SELECT max({name}) FROM {case.table})" for name in names)
        try:
            connection.execute(
                f"UPDATE {case.table} SET {case.column} = {EXTREMES[case.value]} WHERE {which}"
            )
        except sqlite3.Error:  # its type forbids it
            path.unlink()


@pytest.fixture(scope="module")
def extreme(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, list[str]]]:
    """A daemon over captures, each of which has one extreme value."""
    service = service_in(tmp_path_factory.mktemp("extreme"), pace="free")
    folder = service.archive.directory
    folder.mkdir(parents=True, exist_ok=True)
    whole = write_with_channels(tmp_path_factory.mktemp("whole"), slots(6), measured=range(6), name=WHOLE)
    cases = [
        Case(table, column, value)
        for table in TABLES
        for column in columns_of(whole, table)
        for value in EXTREMES
    ]
    for case in cases:
        changed(whole.read_bytes(), folder / f"{case.id}.grab", case)
    changed(whole.read_bytes(), folder / f"{WHOLE}.grab", None)
    with served(service) as daemon:
        yield daemon, [case.id for case in cases if (folder / f"{case.id}.grab").exists()]


def asked(daemon: Daemon, route: str, faults: Sequence[int] = FAULTS) -> str:
    """What is wrong with the answer; empty if nothing is."""
    host = daemon.url.removeprefix("http://")
    with closing(http.client.HTTPConnection(host, timeout=PATIENCE_S)) as client:
        client.request("GET", f"/api/v1{quote(route, safe='/?=&')}")
        answer = client.getresponse()
        try:
            text = answer.read()
        except http.client.IncompleteRead:
            return f"{answer.status}, cut off"
    return f"{answer.status}: {text[:300]!r}" if answer.status in faults else ""


def test_an_ordinary_capture_answers_all_of_these(extreme: tuple[Daemon, list[str]]) -> None:
    daemon, _ = extreme
    for route in (*ROUTES, *OF_A_PROCESS):
        assert not asked(daemon, f"/captures/{WHOLE}{route}", (*range(201, 600),)), route


def test_no_value_makes_an_answer_fail_or_end_early(
    extreme: tuple[Daemon, list[str]], caplog: pytest.LogCaptureFixture
) -> None:
    daemon, cases = extreme
    wrong = {}
    caplog.set_level(logging.ERROR)
    for case in cases:
        for route in ROUTES if "time_ns" not in case else (*ROUTES, *OF_A_PROCESS):
            if said := asked(daemon, f"/captures/{case}{route}"):
                wrong[f"{case}{route}"] = said
    for route in ("/captures?limit=500", "/captures.csv"):
        assert not asked(daemon, route)
    assert not wrong
    assert not [record for record in caplog.records if record.exc_info]

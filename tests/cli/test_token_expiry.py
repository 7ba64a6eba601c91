"""Tokens for some days, as a person types them."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.archive.access import Access
from grabberd.cli.app import app
from grabberd.documents.enums import Role


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setenv("COLUMNS", "200")
    return tmp_path


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["token", *map(str, words)])


def test_the_list_says_until_when_each_is_good(folder: Path) -> None:
    run("add", "visitor", "--role", "viewer", "--days", 7)
    run("add", "tablet", "--role", "operator")
    access = Access(folder)
    access.add("last-year", Role.VIEWER, timedelta(days=-1))
    rows = {row["name"]: row["expires_utc"] for row in json.loads(run("list", "--json").stdout)}
    assert rows["tablet"] is None
    left = datetime.fromisoformat(rows["visitor"]) - datetime.now(UTC)
    assert timedelta(days=6.9) < left <= timedelta(days=7)
    table = run("list").output
    assert table.count("(expired)") == 1
    assert f"{rows['visitor'][:16]}Z" in table


def test_the_day_is_told_to_scripts(folder: Path) -> None:
    made = json.loads(run("add", "visitor", "--role", "viewer", "--days", 7, "--json").stdout)
    identity = Access(folder).of_token(made["token"])
    assert identity is not None
    assert made["expires_utc"] == identity.expires_utc


@pytest.mark.parametrize("days", [0, -1, 3651, "soon"])
def test_days_that_cannot_be_meant_are_refused(days: object) -> None:
    assert run("add", "visitor", "--role", "viewer", "--days", days).exit_code == 2

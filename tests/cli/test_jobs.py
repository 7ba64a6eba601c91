"""Jobs of a running daemon, as a person looks after them."""

import json
from collections.abc import Iterator

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import MeasurementResult
from grabberd.errors import GrabberdError
from grabberd.library.jobs.measurement import MeasurementJob
from server.api.daemons import Daemon, serving


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Its jobs are not taken: they stay as they were put."""
    with serving(tmp_path_factory.mktemp("daemon"), pace="real") as running:
        running.service.job_runner.stop()
        yield running


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["jobs", *(str(word) for word in words)])


def test_without_jobs_it_says_so(daemon: Daemon) -> None:
    assert "no jobs are running or waiting" in run("list", "--url", daemon.url).stdout
    assert json.loads(run("list", "--url", daemon.url, "--json").stdout) == []


def test_they_are_listed_by_their_turn_shown_and_cancelled(daemon: Daemon) -> None:
    queue = daemon.service.jobs
    first, second, third = [queue.submit(MeasurementJob(subject=f"c{n}", made_with={})) for n in range(3)]
    queue.begin(int(first.id[4:]))
    queue.progress(int(first.id[4:]), 0.42)
    listed = json.loads(run("list", "--url", daemon.url, "--json").stdout)
    assert [(job["id"], job["position"]) for job in listed] == [
        (first.id, None),
        (second.id, 1),
        (third.id, 2),
    ]
    table = run("list", "--url", daemon.url).stdout
    assert "42 %" in table
    assert "position 2 in the queue" in run("show", third.id, "--url", daemon.url).stdout
    assert run("cancel", second.id, "--url", daemon.url).stdout == f"{second.id} is cancelled\n"
    assert queue.get(third.id).position == 1
    queue.end(int(first.id[4:]), JobState.DONE, result=MeasurementResult(run=2, fields=8, points=9))
    shown = run("show", first.id, "--url", daemon.url).stdout
    assert "ended" in shown
    assert "points: 9" in shown
    ended = json.loads(run("list", "--all", "--url", daemon.url, "--json").stdout)
    assert [job["id"] for job in ended] == [third.id, second.id, first.id]


def test_an_unknown_one_is_refused_with_a_hint(daemon: Daemon) -> None:
    for command in ("show", "cancel"):
        refused = run(command, "job-77", "--url", daemon.url)
        assert refused.exit_code == 1
        assert isinstance(refused.exception, GrabberdError)
        assert "no job 'job-77'" in refused.exception.message
        assert refused.exception.hint

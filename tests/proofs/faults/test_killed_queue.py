"""A daemon that is killed again and again while it works off its queue: no job is lost, none done twice."""

import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import default_config_file, load_config
from grabberd_liner.analyses.store import AnalysisStore

from .daemon import PATIENCE_S, Daemon

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
COMMAND = (sys.executable, "-c", "from grabberd.cli import main; main()")
JOBS = "/api/v1/jobs"
KILLS = 6
ENDED = ("done", "failed", "cancelled")


def configuration() -> dict[str, Any]:
    """The simulated grabber, with the quickest locator: what is measured is not the subject here."""
    config = load_config(default_config_file()).model_dump(mode="json", exclude_defaults=True)
    config["devices"]["simulated"]["location"] = {"method": "centroid"}
    return config


def started(folder: Path) -> Daemon:
    return Daemon(folder, configuration(), COMMAND, {})


def jobs_of(daemon: Daemon) -> dict[str, dict[str, Any]]:
    return {job["id"]: job for job in daemon.get(f"{JOBS}?limit=500")["jobs"]}


def ended_in(daemon: Daemon) -> int:
    return sum(job["state"] in ENDED for job in jobs_of(daemon).values())


def ordered(daemon: Daemon, capture: str) -> list[str]:
    """Jobs of both kinds that leave something behind, and one that is cancelled."""
    asked = [("measure", None), ("analysis", {"inputs": {"heights_mm": [0]}})] * 5
    answers = [daemon.ask(f"/api/v1/captures/{capture}/{path}", "POST", body) for path, body in asked]
    assert {answer.status for answer in answers} == {202}
    return [answer.document["id"] for answer in answers]


def killed_at_random(daemon: Daemon, lot: random.Random) -> None:
    """Kills it at some instant after another job has ended, so that each kill meets another one."""
    before, end_s = ended_in(daemon), time.monotonic() + PATIENCE_S
    while ended_in(daemon) == before:
        assert time.monotonic() < end_s, jobs_of(daemon)
        time.sleep(0.01)
    time.sleep(lot.random() * 0.7)
    daemon.process.kill()
    daemon.process.wait()


def test_every_job_is_done_and_none_twice(tmp_path: Path) -> None:
    lot = random.Random(20260301)
    daemon = started(tmp_path)
    daemon.wait_until_ready()
    capture = daemon.start_capture(fields=24)
    daemon.sealed(capture)
    ids = ordered(daemon, capture)
    cancelled = daemon.ask(f"{JOBS}/{ids.pop()}", "DELETE").document
    assert cancelled["state"] == "cancelled"
    for _ in range(KILLS):
        if ended_in(daemon) == len(ids) + 1:
            break
        killed_at_random(daemon, lot)
        daemon = started(tmp_path)
        assert set(jobs_of(daemon)) == {*ids, cancelled["id"]}, "none is lost"
    for job in ids:
        daemon.wait_for(f"{JOBS}/{job}", lambda document: document["state"] in ENDED)
    jobs = jobs_of(daemon)
    assert daemon.end() in (0, -15)
    assert Counter(job["state"] for job in jobs.values()) == {"done": len(ids), "cancelled": 1}, jobs
    assert max(job["attempts"] for job in jobs.values()) >= 2, "no kill has met a job"
    made = made_by(tmp_path / "state", capture)
    assert sorted(made) == sorted(ids), "each once"


def made_by(state: Path, capture: str) -> list[str]:
    """Ids of the jobs that have made something, as often as they have."""
    with CaptureReader(state / "captures" / f"{capture}.grab") as reader:
        runs = [run.made_with["settings"]["job"] for run in reader.runs[1:]]
    analyses = [record["job"] for record in AnalysisStore(state / "analyses").records(capture)]
    assert list((state / "analyses").glob(".*")) == []
    return [*runs, *analyses]

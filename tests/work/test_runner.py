"""The runner of jobs: one process, one job after the other, whatever becomes of either."""

import multiprocessing
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from queued_jobs import (
    OOM_SCORE,
    PATIENCE_S,
    SCARCE_BYTES,
    Add,
    BeKilled,
    BreakDown,
    Die,
    Hang,
    Jobs,
    Niceness,
    OomScore,
    Refuse,
    Simple,
    TakeMemory,
    counted_to,
    hang_in,
    jobs_in,
)

from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import JobDocument
from grabberd.errors import Cause, NotFound, StorageError
from grabberd.memory import KILLED_FIRST
from grabberd.work import job_runner as module
from grabberd.work.job_rows import MOST_ATTEMPTS
from grabberd.work.job_runner import NICENESS
from grabberd.work.job_spec import REPORTS, JobContext, JobSpec, counted, portion

pytestmark = pytest.mark.usefixtures("importable")


@pytest.fixture
def jobs(tmp_path: Path) -> Iterator[Jobs]:
    made = jobs_in(tmp_path)
    made.runner.start()
    yield made
    made.runner.stop()


def outcome(jobs: Jobs, spec: JobSpec) -> JobDocument:
    """The job once it has ended."""
    return jobs.queue.wait(jobs.queue.submit(spec).id, PATIENCE_S)


def runs(jobs: Jobs, job_id: str) -> bool:
    deadline = time.monotonic() + PATIENCE_S
    while jobs.queue.get(job_id).progress == 0 and time.monotonic() < deadline:
        time.sleep(0.01)
    return jobs.queue.get(job_id).state is JobState.RUNNING


def test_a_job_gives_its_result(jobs: Jobs) -> None:
    job = jobs.queue.submit(Add(subject="numbers", one=2, other=3))
    assert (job.kind, job.subject, job.state) == ("add", "numbers", JobState.QUEUED)
    done = jobs.queue.wait(job.id, PATIENCE_S)
    assert (done.state, done.result, done.progress, done.problem) == (JobState.DONE, counted_to(5), 1.0, None)
    assert (done.attempts, done.position) == (1, None)
    assert done.ended_utc is not None


def test_jobs_run_niced_so_that_they_never_disturb_a_capture(jobs: Jobs) -> None:
    assert outcome(jobs, Niceness()).result == counted_to(min(19, os.nice(0) + NICENESS))


@pytest.mark.skipif(not OOM_SCORE.exists(), reason="the kernel has no such file")
def test_where_memory_is_used_up_the_job_is_killed_before_the_daemon(jobs: Jobs) -> None:
    assert outcome(jobs, OomScore()).result == counted_to(KILLED_FIRST)


def test_what_a_job_refuses_it_says_with_its_hint(jobs: Jobs) -> None:
    failed = jobs.queue.wait(jobs.queue.submit(Refuse()).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert failed.problem == JobProblem(message="the file is empty", hint="name another one")
    assert failed.attempts == 1, "it would refuse again"


def test_a_fault_of_the_program_fails_one_job_only(jobs: Jobs) -> None:
    failed = jobs.queue.wait(jobs.queue.submit(BreakDown()).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert failed.problem
    assert "ZeroDivisionError" in failed.problem.message
    assert jobs.queue.wait(jobs.queue.submit(Add()).id, PATIENCE_S).result == counted_to(2)


def test_a_job_whose_process_dies_begins_again_before_the_next_one(jobs: Jobs, tmp_path: Path) -> None:
    diary = tmp_path / "diary"
    job = jobs.queue.submit(Die(diary=str(diary), survives=2))
    after = jobs.queue.submit(Add())
    done = jobs.queue.wait(job.id, PATIENCE_S)
    assert (done.state, done.attempts, done.result) == (JobState.DONE, 2, counted_to(2))
    assert diary.read_text().split() == [job.id, job.id]
    assert jobs.queue.wait(after.id, PATIENCE_S).state is JobState.DONE


def test_a_job_that_always_kills_its_process_fails_and_the_next_one_is_done(
    jobs: Jobs, tmp_path: Path
) -> None:
    diary = tmp_path / "diary"
    failed = jobs.queue.wait(jobs.queue.submit(Die(diary=str(diary))).id, PATIENCE_S)
    assert (failed.state, failed.attempts) == (JobState.FAILED, MOST_ATTEMPTS)
    assert len(diary.read_text().split()) == MOST_ATTEMPTS
    assert failed.problem
    assert failed.problem.message == "the job's process ended before the job was done, in each of 3 attempts"
    assert jobs.queue.wait(jobs.queue.submit(Add()).id, PATIENCE_S).result == counted_to(2)


def test_a_job_that_is_killed_is_told_as_what_that_mostly_is(jobs: Jobs) -> None:
    failed = jobs.queue.wait(jobs.queue.submit(BeKilled()).id, PATIENCE_S)
    assert failed.problem
    assert "where memory is used up" in failed.problem.hint


def test_a_job_that_wants_more_memory_than_it_may_have_says_so_and_the_next_one_is_done(
    tmp_path: Path,
) -> None:
    scarce = jobs_in(tmp_path, memory_bytes=SCARCE_BYTES)
    scarce.runner.start()
    failed = scarce.queue.wait(scarce.queue.submit(TakeMemory()).id, PATIENCE_S)
    assert failed.problem
    assert failed.problem.message == "the job needs more memory than a job may have, 1 GB"
    assert "fewer fields" in failed.problem.hint
    assert failed.attempts == 1, "it would want as much again"
    assert scarce.queue.wait(scarce.queue.submit(Add()).id, PATIENCE_S).result == counted_to(2)
    scarce.runner.stop()


def test_a_running_and_a_waiting_job_can_be_cancelled(jobs: Jobs) -> None:
    running, waiting = jobs.queue.submit(Hang()), jobs.queue.submit(Add())
    assert runs(jobs, running.id)
    assert jobs.queue.cancel(waiting.id).state is JobState.CANCELLED
    assert jobs.queue.cancel(running.id).state is JobState.CANCELLED
    assert jobs.queue.wait(jobs.queue.submit(Add(one=4, other=4)).id, PATIENCE_S).result == counted_to(8)
    assert jobs.queue.get(waiting.id).state is JobState.CANCELLED


def test_a_job_that_is_cancelled_before_the_process_has_it_is_not_done(tmp_path: Path) -> None:
    diary = tmp_path / "diary"

    def cancel(job: str, spec: JobSpec) -> JobContext:
        if isinstance(spec, Die):
            jobs.queue.cancel(job)
        return JobContext(job=job)

    jobs = jobs_in(tmp_path / "state", context=cancel)
    cancelled = jobs.queue.submit(Die(diary=str(diary), survives=1))
    jobs.runner.start()
    try:
        assert outcome(jobs, Add()).state is JobState.DONE
    finally:
        jobs.runner.stop()
    assert jobs.queue.get(cancelled.id).state is JobState.CANCELLED
    assert not diary.exists()


def test_to_cancel_one_job_never_costs_the_next_one_an_attempt(jobs: Jobs) -> None:
    for _ in range(5):
        hanging, after = jobs.queue.submit(Hang()), jobs.queue.submit(Add())
        assert runs(jobs, hanging.id)
        jobs.queue.cancel(hanging.id)
        assert jobs.queue.wait(after.id, PATIENCE_S).attempts == 1


def test_a_stop_ends_the_running_job_at_once_and_its_attempt_does_not_count(tmp_path: Path) -> None:
    before = jobs_in(tmp_path)
    job = before.queue.submit(Hang())
    before.runner.start()
    assert runs(before, job.id)
    before.runner.stop()
    assert not before.runner.alive
    after = jobs_in(tmp_path).queue.get(job.id)
    assert (after.state, after.attempts, after.position) == (JobState.QUEUED, 0, 1)


def test_what_waited_when_the_daemon_ended_is_done_after_its_next_start(tmp_path: Path) -> None:
    waiting = [jobs_in(tmp_path).queue.submit(Add(one=n)) for n in range(3)]
    after = jobs_in(tmp_path)
    assert [job.id for job in after.queue.list()] == [job.id for job in reversed(waiting)]
    after.runner.start()
    done = [after.queue.wait(job.id, PATIENCE_S) for job in waiting]
    after.runner.stop()
    assert [job.result for job in done] == [counted_to(n + 1) for n in range(3)]
    assert jobs_in(tmp_path).queue.get(waiting[0].id).result == counted_to(1)


def test_a_job_whose_capture_was_deleted_meanwhile_says_so(tmp_path: Path) -> None:
    def context(job: str, spec: JobSpec) -> JobContext:
        raise NotFound("no capture 'gone'", "GET /api/v1/captures lists all captures")

    jobs = jobs_in(tmp_path, context=context)
    jobs.runner.start()
    failed = jobs.queue.wait(jobs.queue.submit(Simple(subject="gone")).id, PATIENCE_S)
    jobs.runner.stop()
    assert failed.state is JobState.FAILED
    assert failed.problem
    assert failed.problem.message == "no capture 'gone'"


def test_jobs_wait_for_a_disk_that_cannot_be_written_and_a_fault_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "AGAIN_S", 0.01)
    jobs = jobs_in(tmp_path)
    job = jobs.queue.submit(Add())
    put, refused = jobs.store.put, [StorageError("queue.sqlite cannot be used: full", "make room")] * 3

    def write(*rows: object, **others: object) -> None:
        if refused:
            assert jobs.queue.get(job.id).attempts == 0, "nobody sees what the disk does not have"
            raise refused.pop()
        put(*rows, **others)  # type: ignore[arg-type]

    monkeypatch.setattr(jobs.store, "put", write)
    jobs.runner.start()
    done = jobs.queue.wait(job.id, PATIENCE_S)
    jobs.runner.stop()
    assert (done.state, done.attempts) == (JobState.DONE, 1)
    assert jobs.faults.counts[Cause.JOBS_UNWRITABLE] == 1
    assert not jobs.faults.has(Cause.JOBS_UNWRITABLE), "it is over"


def test_a_second_process_waits_until_the_first_has_ended(tmp_path: Path) -> None:
    first, second = jobs_in(tmp_path), jobs_in(tmp_path)
    hanging = first.queue.submit(Hang())
    first.runner.start()
    assert runs(first, hanging.id)
    added = second.queue.submit(Add())
    second.runner.start()
    assert second.queue.wait(added.id, 2.0).state is JobState.RUNNING, "two would write the same results"
    first.runner.stop()
    assert second.queue.wait(added.id, PATIENCE_S).state is JobState.DONE
    second.runner.stop()


def test_the_process_ends_with_the_daemon_however_that_ends(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    daemon = context.Process(target=hang_in, args=(tmp_path, theirs))
    daemon.start()
    assert ours.poll(PATIENCE_S)
    job_process: int = ours.recv()
    assert not ended(job_process, 0.5)
    daemon.kill()
    daemon.join()
    assert ended(job_process, PATIENCE_S)


def ended(pid: int, patience_s: float) -> bool:
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except FileNotFoundError:
            return True
        if state == "Z":  # whoever adopts it has not looked yet
            return True
        time.sleep(0.02)
    return False


@pytest.mark.parametrize("count", [0, 1, 16, 10_000])
def test_progress_is_reported_as_finely_as_it_is_shown(count: int) -> None:
    shares: list[float] = []
    assert list(counted(range(count), count, portion(shares.append, 0.5, 1.0))) == list(range(count))
    assert len(shares) == min(count, REPORTS)
    assert shares == sorted(shares)
    assert all(0.5 <= share < 1.0 for share in shares)


def test_a_job_that_its_process_cannot_read_fails_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONPATH")  # by which the process knows the jobs of the tests
    jobs = jobs_in(tmp_path)
    jobs.runner.start()
    failed = jobs.queue.wait(jobs.queue.submit(Simple()).id, PATIENCE_S)
    jobs.runner.stop()
    assert failed.problem
    assert "No module named 'queued_jobs'" in failed.problem.message
    assert (failed.state, failed.attempts) == (JobState.FAILED, 1)

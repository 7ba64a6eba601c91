"""Jobs: one process, one after the other."""

import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from slots import ManualClock

from grabberd.documents.problems import JobProblem
from grabberd.documents.results import MeasurementResult
from grabberd.errors import Conflict, InputError, NotFound
from grabberd.service.jobs.progress import REPORTS, Progress, counted, portion
from grabberd.service.jobs.runner import NICENESS, JobRunner, JobSpec, JobState
from grabberd.service.memory import KILLED_FIRST

OOM_SCORE = Path("/proc/self/oom_score_adj")

PATIENCE_S = 30.0
SCARCE_BYTES = 1_000_000_000


def counted_to(points: int) -> MeasurementResult:
    return MeasurementResult(run=1, fields=1, points=points)


@dataclass(frozen=True, slots=True, kw_only=True)
class TestJob(JobSpec):
    """A job of the tests, about nothing."""

    __test__ = False
    kind = "test"
    subject: str = ""

    def run(self, progress: Progress) -> MeasurementResult:
        return counted_to(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Add(TestJob):
    kind = "add"
    one: int
    other: int

    def run(self, progress: Progress) -> MeasurementResult:
        progress(0.5)
        return counted_to(self.one + self.other)


class Niceness(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        return counted_to(os.nice(0))


class OomScore(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        return counted_to(int(OOM_SCORE.read_text()))


class Refuse(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        raise InputError("the file is empty", "name another one")


class BreakDown(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        raise ZeroDivisionError("by nothing")


class Die(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        os._exit(1)


class TakeMemory(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        return counted_to(len(bytearray(3 * SCARCE_BYTES)))


class BeKilled(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


class Hang(TestJob):
    def run(self, progress: Progress) -> MeasurementResult:
        progress(0.1)
        time.sleep(PATIENCE_S)
        raise TimeoutError


@pytest.fixture
def jobs() -> Iterator[JobRunner]:
    runner = JobRunner(ManualClock())
    runner.start()
    yield runner
    runner.stop()


def test_a_job_gives_its_result(jobs: JobRunner) -> None:
    job = jobs.submit(Add(subject="numbers", one=2, other=3))
    assert (job.kind, job.subject, job.state) == ("add", "numbers", JobState.QUEUED)
    done = jobs.wait(job.id, PATIENCE_S)
    assert (done.state, done.result, done.progress, done.problem) == (JobState.DONE, counted_to(5), 1.0, None)


def test_jobs_run_niced_so_that_they_never_disturb_a_capture(jobs: JobRunner) -> None:
    done = jobs.wait(jobs.submit(Niceness()).id, PATIENCE_S)
    assert done.result == counted_to(min(19, os.nice(0) + NICENESS))


@pytest.mark.skipif(not OOM_SCORE.exists(), reason="the kernel has no such file")
def test_where_memory_is_used_up_the_job_is_killed_before_the_daemon(jobs: JobRunner) -> None:
    done = jobs.wait(jobs.submit(OomScore()).id, PATIENCE_S)
    assert done.result == counted_to(KILLED_FIRST)


def test_what_a_job_refuses_it_says_with_its_hint(jobs: JobRunner) -> None:
    failed = jobs.wait(jobs.submit(Refuse()).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert failed.problem == JobProblem(message="the file is empty", hint="name another one")


def test_a_fault_of_the_program_fails_one_job_only(jobs: JobRunner) -> None:
    failed = jobs.wait(jobs.submit(BreakDown()).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert failed.problem
    assert "ZeroDivisionError" in failed.problem.message
    assert jobs.wait(jobs.submit(Add(one=1, other=1)).id, PATIENCE_S).result == counted_to(2)


def test_a_process_that_dies_fails_its_job_and_is_replaced(jobs: JobRunner) -> None:
    assert jobs.wait(jobs.submit(Die()).id, PATIENCE_S).state is JobState.FAILED
    assert jobs.wait(jobs.submit(Add(one=1, other=1)).id, PATIENCE_S).result == counted_to(2)


@pytest.fixture
def scarce() -> Iterator[JobRunner]:
    """Jobs with little memory."""
    runner = JobRunner(ManualClock(), memory_bytes=SCARCE_BYTES)
    runner.start()
    yield runner
    runner.stop()


def test_a_job_that_wants_more_memory_than_it_may_have_says_so_and_the_next_one_is_done(
    scarce: JobRunner,
) -> None:
    failed = scarce.wait(scarce.submit(TakeMemory()).id, PATIENCE_S)
    assert failed.problem
    assert failed.problem.message == "the job needs more memory than a job may have, 1 GB"
    assert "fewer fields" in failed.problem.hint
    assert scarce.wait(scarce.submit(Add(one=1, other=1)).id, PATIENCE_S).result == counted_to(2)


def test_a_job_that_is_killed_is_told_as_what_that_mostly_is(jobs: JobRunner) -> None:
    failed = jobs.wait(jobs.submit(BeKilled()).id, PATIENCE_S)
    assert failed.problem
    assert "where memory is used up" in failed.problem.hint


def test_a_running_and_a_waiting_job_can_be_cancelled(jobs: JobRunner) -> None:
    running = jobs.submit(Hang())
    waiting = jobs.submit(Add(one=1, other=1))
    assert jobs.cancel(waiting.id).state is JobState.CANCELLED
    assert jobs.cancel(running.id).state is JobState.CANCELLED
    assert jobs.wait(jobs.submit(Add(one=4, other=4)).id, PATIENCE_S).result == counted_to(8)
    assert jobs.get(waiting.id).state is JobState.CANCELLED


def test_a_job_that_has_ended_stays_as_it_is(jobs: JobRunner) -> None:
    done = jobs.wait(jobs.submit(Add(one=2, other=3)).id, PATIENCE_S)
    assert jobs.cancel(done.id) == done


def test_jobs_are_listed_newest_first_and_unknown_ones_refused(jobs: JobRunner) -> None:
    ids = [jobs.submit(Add(one=1, other=n)).id for n in range(3)]
    assert [job.id for job in jobs.list()] == ids[::-1]
    with pytest.raises(NotFound):
        jobs.get("job-99")


def test_a_job_from_before_a_restart_is_no_other_one_after_it() -> None:
    clock = ManualClock()
    before = JobRunner(clock).submit(Add(one=1, other=1))
    clock.advance(1.0)
    assert JobRunner(clock).submit(Add(one=1, other=1)).id != before.id


def test_a_subject_is_busy_until_its_jobs_have_ended(jobs: JobRunner) -> None:
    job = jobs.submit(Hang(subject="c1"))
    assert jobs.busy_subjects() == {"c1"}
    with pytest.raises(Conflict, match=f"{job.id} .test. is working on capture c1"):
        jobs.check_idle("c1")
    jobs.cancel(job.id)
    assert jobs.busy_subjects() == set()
    jobs.check_idle("c1")


@pytest.mark.parametrize("count", [0, 1, 16, 10_000])
def test_progress_is_reported_as_finely_as_it_is_shown(count: int) -> None:
    shares: list[float] = []
    assert list(counted(range(count), count, portion(shares.append, 0.5, 1.0))) == list(range(count))
    assert len(shares) == min(count, REPORTS)
    assert shares == sorted(shares)
    assert all(0.5 <= share < 1.0 for share in shares)


class Sleep(TestJob):
    def run(self, progress: Progress) -> None:
        progress(0.25)
        time.sleep(10 * PATIENCE_S)


def test_a_job_waits_then_runs_and_a_stop_ends_it_at_once() -> None:
    runner = JobRunner(ManualClock())
    waiting = runner.submit(Sleep())
    assert (waiting.state, waiting.progress) == (JobState.QUEUED, 0.0)
    assert runner.cancel(runner.submit(Sleep()).id).state is JobState.CANCELLED, "there is no process yet"
    runner.start()
    deadline = time.monotonic() + PATIENCE_S
    while runner.get(waiting.id).progress == 0 and time.monotonic() < deadline:
        time.sleep(0.01)
    assert runner.get(waiting.id).state is JobState.RUNNING
    runner.stop()
    assert not runner._thread.is_alive()

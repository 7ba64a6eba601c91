"""Jobs: one process, one after the other."""

import os
import time
from collections.abc import Iterator

import pytest
from slots import ManualClock

from grabberd.errors import InputError, NotFound
from grabberd.service.jobs.job_runner import NICENESS, JobRunner, JobState, Progress

PATIENCE_S = 30.0


def add(progress: Progress, *, one: int, other: int) -> int:
    progress(0.5)
    return one + other


def niceness(progress: Progress) -> int:
    return os.nice(0)


def refuse(progress: Progress) -> None:
    raise InputError("the file is empty", "name another one")


def break_down(progress: Progress) -> None:
    raise ZeroDivisionError("by nothing")


def die(progress: Progress) -> None:
    os._exit(1)


def hang(progress: Progress) -> None:
    progress(0.1)
    time.sleep(PATIENCE_S)


@pytest.fixture
def jobs() -> Iterator[JobRunner]:
    runner = JobRunner(ManualClock())
    runner.start()
    yield runner
    runner.stop()


def test_a_job_gives_its_result(jobs: JobRunner) -> None:
    job = jobs.submit("add", "numbers", add, one=2, other=3)
    assert job.state is JobState.QUEUED
    done = jobs.wait(job.id, PATIENCE_S)
    assert (done.state, done.result, done.progress, done.problem) == (JobState.DONE, 5, 1.0, None)


def test_jobs_run_niced_so_that_they_never_disturb_a_capture(jobs: JobRunner) -> None:
    done = jobs.wait(jobs.submit("nice", "", niceness).id, PATIENCE_S)
    assert done.result == min(19, os.nice(0) + NICENESS)


def test_what_a_job_refuses_it_says_with_its_hint(jobs: JobRunner) -> None:
    failed = jobs.wait(jobs.submit("refuse", "", refuse).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert failed.problem == {"message": "the file is empty", "hint": "name another one"}


def test_a_fault_of_the_program_fails_one_job_only(jobs: JobRunner) -> None:
    failed = jobs.wait(jobs.submit("break", "", break_down).id, PATIENCE_S)
    assert failed.state is JobState.FAILED
    assert "ZeroDivisionError" in (failed.problem or {})["message"]
    assert jobs.wait(jobs.submit("add", "", add, one=1, other=1).id, PATIENCE_S).result == 2


def test_a_process_that_dies_fails_its_job_and_is_replaced(jobs: JobRunner) -> None:
    assert jobs.wait(jobs.submit("die", "", die).id, PATIENCE_S).state is JobState.FAILED
    assert jobs.wait(jobs.submit("add", "", add, one=1, other=1).id, PATIENCE_S).result == 2


def test_a_running_and_a_waiting_job_can_be_cancelled(jobs: JobRunner) -> None:
    running = jobs.submit("hang", "", hang)
    waiting = jobs.submit("add", "", add, one=1, other=1)
    assert jobs.cancel(waiting.id).state is JobState.CANCELLED
    assert jobs.cancel(running.id).state is JobState.CANCELLED
    assert jobs.wait(jobs.submit("add", "", add, one=4, other=4).id, PATIENCE_S).result == 8
    assert jobs.get(waiting.id).state is JobState.CANCELLED


def test_a_job_that_has_ended_stays_as_it_is(jobs: JobRunner) -> None:
    done = jobs.wait(jobs.submit("add", "", add, one=2, other=3).id, PATIENCE_S)
    assert jobs.cancel(done.id) == done


def test_jobs_are_listed_newest_first_and_unknown_ones_refused(jobs: JobRunner) -> None:
    ids = [jobs.submit("add", "", add, one=1, other=n).id for n in range(3)]
    assert [job.id for job in jobs.list()] == ids[::-1]
    with pytest.raises(NotFound):
        jobs.get("job-99")


def test_a_job_from_before_a_restart_is_no_other_one_after_it() -> None:
    clock = ManualClock()
    before = JobRunner(clock).submit("add", "", add, one=1, other=1)
    clock.advance(1.0)
    assert JobRunner(clock).submit("add", "", add, one=1, other=1).id != before.id

"""The queue of jobs: what is on the disk before anybody sees it, and what a next start makes of it."""

import sqlite3
from contextlib import closing
from datetime import timedelta
from pathlib import Path

import pytest
from queued_jobs import Add, Hang, Jobs, Simple, counted_to, jobs_in
from slots import ManualClock

from grabberd.archive.state.job_store import QUEUE
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.errors import Cause, Conflict, NotFound
from grabberd.library.jobs.calibration_jobs import CalibrationJob, IdentificationJob
from grabberd.library.jobs.measurement import MeasurementJob
from grabberd.server.daemon.jobs import KINDS, CheckJob
from grabberd.work import job_queue as module
from grabberd.work.job_queue import KEPT
from grabberd.work.job_rows import MOST_ATTEMPTS
from grabberd.work.job_spec import JobSpec
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.profiles.profiles import FoundProfiles

CALIBRATE = {
    "kind": "calibrate",
    "subject": "c1",
    "calibration_frame": {"targets": [{"id": 1, "x_mm": 0.1}]},
    "options": {"shared": ["b3"], "check_length": {"between": [1, 2], "length_mm": 12.5}},
    "device": "cup",
    "previous": {"views": {"left": {"x0_px": 180.123456789012345}}},
}
ONE_OF_EACH: list[JobSpec] = [
    AnalysisJob(subject="c1", inputs={"sought_kpa": float("nan"), "phases": 24}, bursts=("c2", "c3")),
    CalibrationJob.model_validate({key: value for key, value in CALIBRATE.items() if key != "kind"}),
    CheckJob(subject="c1", seconds=0.4, calibration_frame={}, calibration={"id": "k"}, in_place=True),
    IdentificationJob(subject="c1", calibration_frame={"name": "paper-108"}),
    LinerTestJob(
        subject="c2",
        test="artificial-teat",
        others=("c1",),
        profiles={"c1": FoundProfiles({"known_kpa": "2"}, []), "c2": FoundProfiles({}, [])},
    ),
    MeasurementJob(subject="c1", made_with={"settings": {"line_jitter_px": 0.1 + 0.2}}),
]


@pytest.fixture
def jobs(tmp_path: Path) -> Jobs:
    return jobs_in(tmp_path)


def begun(jobs: Jobs, spec: JobSpec | None = None) -> int:
    """The number of a job that runs."""
    job = jobs.queue.submit(spec or Simple())
    number = int(job.id.removeprefix("job-"))
    assert jobs.queue.begin(number)
    return number


@pytest.mark.parametrize("spec", ONE_OF_EACH, ids=lambda spec: spec.kind)
def test_every_kind_of_job_is_read_back_as_it_was_submitted(tmp_path: Path, spec: JobSpec) -> None:
    job = jobs_in(tmp_path).queue.submit(spec)
    entry = jobs_in(tmp_path).queue.first(lambda: False)
    assert entry is not None
    assert (entry.job.id, type(entry.spec)) == (job.id, type(spec))
    assert repr(entry.spec) == repr(spec), "not ==: NaN differs from itself"


def test_the_kinds_are_all_there_are() -> None:
    assert {spec.kind for spec in ONE_OF_EACH} == set(KINDS)


def test_a_job_knows_its_position_among_those_that_wait(jobs: Jobs) -> None:
    first, second, third = [jobs.queue.submit(Simple()) for _ in range(3)]
    assert [job.position for job in (first, second, third)] == [1, 2, 3]
    jobs.queue.begin(int(first.id.removeprefix("job-")))
    assert [jobs.queue.get(job.id).position for job in (first, second, third)] == [None, 1, 2]
    jobs.queue.cancel(second.id)
    assert [job.position for job in jobs.queue.list()] == [1, None, None]


def test_jobs_are_listed_newest_first_and_unknown_ones_refused(jobs: Jobs) -> None:
    ids = [jobs.queue.submit(Add(other=n)).id for n in range(3)]
    assert [job.id for job in jobs.queue.list()] == ids[::-1]
    for unknown in ("job-99", "job-", "job-x", "99", ""):
        with pytest.raises(NotFound):
            jobs.queue.get(unknown)


def test_a_job_that_has_ended_stays_as_it_is(jobs: Jobs) -> None:
    number = begun(jobs)
    jobs.queue.end(number, JobState.DONE, result=counted_to(3))
    done = jobs.queue.get(f"job-{number}")
    assert jobs.queue.cancel(done.id) == done
    jobs.queue.end(number, JobState.FAILED)
    jobs.queue.put_back(number)
    assert not jobs.queue.interrupted(number, "it ended", "try again")
    jobs.queue.progress(number, 0.5)
    assert jobs.queue.get(done.id) == done


def test_the_running_job_is_interrupted_once_it_is_cancelled_and_no_other(tmp_path: Path) -> None:
    interrupted: list[int] = []
    jobs = jobs_in(tmp_path, interrupt=interrupted.append)
    number, waiting = begun(jobs), jobs.queue.submit(Simple())
    jobs.queue.cancel(waiting.id)
    assert interrupted == []
    jobs.queue.cancel(f"job-{number}")
    jobs.queue.cancel(f"job-{number}")
    assert interrupted == [number]


def test_a_subject_is_busy_until_its_jobs_have_ended(jobs: Jobs) -> None:
    job = jobs.queue.submit(Hang(subject="c1"))
    assert jobs.queue.busy_subjects() == {"c1"}
    with pytest.raises(Conflict, match=f"{job.id} .hang. is working on capture c1"):
        jobs.queue.check_idle("c1")
    jobs.queue.cancel(job.id)
    assert jobs.queue.busy_subjects() == set()
    jobs.queue.check_idle("c1")


def test_so_are_the_other_captures_that_a_job_reads(jobs: Jobs) -> None:
    jobs.queue.submit(AnalysisJob(subject="c1", bursts=("c2",)))
    assert jobs.queue.busy_subjects() == {"c1", "c2"}
    with pytest.raises(Conflict, match="working on capture c2"):
        jobs.queue.check_idle("c2")


def test_a_job_that_ran_when_the_daemon_was_killed_is_the_first_of_those_that_wait(tmp_path: Path) -> None:
    before = jobs_in(tmp_path)
    number = begun(before)
    before.queue.submit(Simple())
    before.queue.progress(number, 0.7)
    after = jobs_in(tmp_path).queue.get(f"job-{number}")
    assert (after.state, after.position, after.attempts, after.progress) == (JobState.QUEUED, 1, 1, 0.0)


def test_a_job_that_took_the_daemon_with_it_in_every_attempt_fails(tmp_path: Path) -> None:
    number = begun(jobs_in(tmp_path))
    for _ in range(MOST_ATTEMPTS - 1):
        assert jobs_in(tmp_path).queue.begin(number)
    failed = jobs_in(tmp_path).queue.get(f"job-{number}")
    assert (failed.state, failed.attempts) == (JobState.FAILED, MOST_ATTEMPTS)
    assert failed.problem
    assert failed.problem.message.endswith("in each of 3 attempts")
    assert failed.problem.hint
    assert jobs_in(tmp_path).queue.get(failed.id) == failed


def test_the_capture_of_such_an_analysis_is_known_not_to_be_tried_again(tmp_path: Path) -> None:
    number = begun(jobs_in(tmp_path), AnalysisJob(subject="c1"))
    for _ in range(MOST_ATTEMPTS - 1):
        assert jobs_in(tmp_path).queue.begin(number)
    for _ in range(2):
        known = jobs_in(tmp_path).queue.unanalysed("c1")
        assert known is not None
        assert (known.state, "in each of 3 attempts" in known.problem) == ("failed", True)


def test_an_ended_job_keeps_its_result_and_not_its_parameters(tmp_path: Path) -> None:
    jobs = jobs_in(tmp_path)
    number = begun(jobs, AnalysisJob(subject="c1", vacuum_log="time_s\n" * 1000))
    jobs.queue.end(number, JobState.FAILED, problem=JobProblem(message="m", hint="h"))
    assert [(row.parameters, row.problem) for row in jobs.store.jobs()] == [
        (None, '{"message":"m","hint":"h"}')
    ]


def test_ended_jobs_are_known_for_a_month_and_a_thousand_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_KEPT", 3)
    clock = ManualClock()
    jobs = jobs_in(tmp_path, clock=clock)
    numbers = [begun(jobs) for _ in range(5)]
    waiting = jobs.queue.submit(Simple())
    for number in numbers:
        jobs.queue.end(number, JobState.DONE, result=counted_to(1))
    assert len(jobs.queue.list()) == 4, "those that wait do not count"
    clock.advance(KEPT / timedelta(seconds=1) + 1)
    assert [job.id for job in jobs_in(tmp_path, clock=clock).queue.list()] == [waiting.id]


def test_a_queue_without_end_is_refused(jobs: Jobs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_WAITING", 2)
    for _ in range(2):
        jobs.queue.submit(Simple())
    with pytest.raises(Conflict, match="2 jobs wait already"):
        jobs.queue.submit(Simple())


def test_the_parameters_of_all_that_wait_have_a_bound(
    jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_PARAMETERS", 2 << 20)
    logged = AnalysisJob(subject="c1", vacuum_log="7" * (3 << 20))
    first = jobs.queue.submit(logged)
    for queue in (jobs.queue, jobs_in(tmp_path).queue):
        with pytest.raises(Conflict, match="jobs with 3 MB of parameters wait already"):
            queue.submit(Simple())
    jobs.queue.cancel(first.id)
    jobs.queue.submit(Simple())


def test_a_job_of_a_queue_that_was_lost_is_no_other_one_afterwards(tmp_path: Path) -> None:
    clock = ManualClock()
    before = jobs_in(tmp_path / "lost", clock=clock).queue.submit(Simple())
    clock.advance(1.0)
    assert jobs_in(tmp_path / "new", clock=clock).queue.submit(Simple()).id != before.id


def test_two_jobs_of_one_second_and_of_a_clock_that_is_set_back_stay_in_order(tmp_path: Path) -> None:
    clock = ManualClock()
    first = [jobs_in(tmp_path, clock=clock).queue.submit(Simple()).id for _ in range(2)]
    clock.advance(-400 * 86_400)
    jobs = jobs_in(tmp_path, clock=clock)
    last = jobs.queue.submit(Simple())
    assert [job.id for job in jobs.queue.list()] == [last.id, *reversed(first)]


def test_a_job_that_this_program_does_not_know_fails_and_says_so(tmp_path: Path) -> None:
    jobs = jobs_in(tmp_path)
    unknown, damaged = jobs.queue.submit(Simple()), jobs.queue.submit(Add())
    with closing(sqlite3.connect(tmp_path / "jobs" / QUEUE)) as connection, connection:
        connection.execute("""UPDATE jobs SET parameters = '{"one": "two"}' WHERE kind = 'add'""")
        connection.execute("UPDATE jobs SET kind = 'dance' WHERE kind = 'simple'")
    after = jobs_in(tmp_path).queue
    for job, words in ((unknown, "knows no job 'dance'"), (damaged, "parameters cannot be read")):
        failed = after.get(job.id)
        assert failed.state is JobState.FAILED
        assert failed.problem
        assert words in failed.problem.message
    assert after.first(lambda: True) is None


def test_no_parameters_on_the_disk_name_a_file_outside_the_captures(tmp_path: Path) -> None:
    jobs_in(tmp_path).queue.submit(Simple())
    with closing(sqlite3.connect(tmp_path / "jobs" / QUEUE)) as connection, connection:
        connection.execute("""UPDATE jobs SET kind = 'check', parameters = '{"subject": "../../etc"}'""")
    failed = jobs_in(tmp_path).queue.list()[0]
    assert failed.state is JobState.FAILED


def test_a_capture_whose_analysis_came_to_nothing_is_known_until_it_is_analysed(tmp_path: Path) -> None:
    jobs = jobs_in(tmp_path)
    problem = JobProblem(message="the wall does not pulsate", hint="start the pulsator")
    jobs.queue.end(begun(jobs, AnalysisJob(subject="c1")), JobState.FAILED, problem=problem)
    jobs.queue.cancel(jobs.queue.submit(AnalysisJob(subject="c2")).id)
    jobs.queue.refuse("c3", JobProblem(message="it was not measured", hint="measure it"))
    jobs.queue.end(begun(jobs, MeasurementJob(subject="c4", made_with={})), JobState.FAILED, problem=problem)
    after = jobs_in(tmp_path)
    known = {name: after.queue.unanalysed(name) for name in ("c1", "c2", "c3", "c4")}
    assert {name: one and one.state for name, one in known.items()} == {
        "c1": "failed",
        "c2": "cancelled",
        "c3": "failed",
        "c4": None,
    }
    number = begun(after, AnalysisJob(subject="c1"))
    after.queue.end(number, JobState.DONE)
    after.queue.forget_capture("c2")
    last = jobs_in(tmp_path).queue
    assert [name for name in known if last.unanalysed(name)] == ["c3"]


def test_a_queue_that_is_damaged_while_it_runs_is_written_anew_from_memory(tmp_path: Path) -> None:
    jobs = jobs_in(tmp_path)
    job = jobs.queue.submit(Simple())
    jobs.store.path.write_bytes(b"no database at all" * 100)
    again = jobs.queue.submit(Simple())
    assert not jobs.faults.has(Cause.JOBS_LOST), "nothing is lost"
    assert [one.id for one in jobs_in(tmp_path).queue.list()] == [again.id, job.id]


def test_one_that_is_damaged_at_a_start_is_lost_and_a_fault_says_so(tmp_path: Path) -> None:
    jobs_in(tmp_path).queue.submit(Simple())
    (tmp_path / "jobs" / QUEUE).write_bytes(b"no database at all" * 100)
    after = jobs_in(tmp_path)
    assert after.queue.list() == []
    fault = after.faults.now[0]
    assert (fault.cause_code, fault.level) == (Cause.JOBS_LOST, "warning")
    assert f"it is kept as {QUEUE}.damaged-" in fault.message
    after.queue.submit(Simple())

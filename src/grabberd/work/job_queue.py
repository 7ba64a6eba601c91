"""The queue of jobs: what waits, runs and has ended, on the disk before anybody sees it."""

import logging
from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any

from grabberd import runtime
from grabberd.documents.document import JobProblem
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import JobDocument
from grabberd.errors import Cause, Conflict, NotFound
from grabberd.fault_board import FaultBoard
from grabberd.runtime import UtcClock, iso_utc
from grabberd.work.job_rows import Entry, JobStore, Kinds, Unanalysed, entry_of, id_of
from grabberd.work.job_spec import JobSpec

log = logging.getLogger(__name__)

MOST_WAITING = 1000
"""Number of jobs that may wait: more would be a program that asks without end."""
MOST_PARAMETERS = 32 << 20
"""Characters that the parameters of all of them may have: each may hold the text of a whole vacuum log."""
KEPT = timedelta(days=30)
MOST_KEPT = 1000
"""How long, and how many, ended jobs are known."""
_WAIT = "wait for some of them, or cancel them: grabberd jobs"
_CRASHED = "the daemon or the job's process ended before the job was done"
_SEE_JOURNAL = "see the journal for what ended it; ask for the job again once that is put right"


class JobQueue:
    """The jobs in the order in which they were submitted, from one start of the daemon to the next.

    Any thread may call. A job that was running when the daemon ended waits for its next attempt.

    Args:
        clock: Source of time.
        store: The jobs on disk.
        kinds: Classes of jobs by their kinds.
        faults: Where a lost queue is reported.
        ended: Called with every job that has ended, and the captures that it should have analysed.
        interrupt: Called with the number of a job that was cancelled while it ran.
    """

    def __init__(
        self,
        clock: UtcClock,
        store: JobStore,
        kinds: Kinds,
        faults: FaultBoard | None = None,
        ended: Callable[[JobDocument, Sequence[str]], None] = lambda job, captures: None,
        interrupt: Callable[[int], None] = lambda number: None,
    ) -> None:
        self._clock = clock
        self._ended = ended
        self._interrupt = interrupt
        self._store = store
        self._kinds = kinds
        self._faults = faults or FaultBoard(clock)
        self._entries: dict[int, Entry] = {}
        self._unfinished: dict[int, Entry] = {}
        self._unanalysed: dict[str, Unanalysed] = {}
        self._changed = runtime.condition()
        # Held over a change of the disk and of what is known; who only looks never waits for a disk.
        self._changing = runtime.rlock()

    def open(self) -> None:
        """Reads the queue from the disk.

        Raises:
            StorageError: It cannot be read or written.
        """
        with self._changing:
            self._store.open(self._write_again)
            with self._store.errors():
                found = [entry_of(row, self._kinds) for row in self._store.jobs()]
            entries = [self._after_a_crash(entry) for entry in found]
            both = zip(found, entries, strict=True)
            given_up = [one for before, after in both for one in before.unanalysed(after.job)]
            self._store.put(*(entry.row for entry in entries), unanalysed=given_up)
            self._unanalysed = {one.capture: one for one in self._store.unanalysed()}
            self._entries = {entry.number: entry for entry in entries}
            self._unfinished = {entry.number: entry for entry in entries if not entry.ended}
            self._prune()

    def submit(self, spec: JobSpec, *, automatic: bool = False) -> JobDocument:
        """Queues a job; it is on the disk when this returns.

        Args:
            spec: The job.
            automatic: True if the daemon itself asks for it.

        Raises:
            Conflict: Too many jobs wait already.
            StorageError: The disk cannot be written.
        """
        now, size = self._clock.utc_now(), len(spec.model_dump_json())
        with self._changing:
            if len(self._unfinished) >= MOST_WAITING:
                raise Conflict(f"{MOST_WAITING} jobs wait already", _WAIT)
            waiting = sum(one.size for one in self._unfinished.values())
            if self._unfinished and waiting + size > MOST_PARAMETERS:
                raise Conflict(f"jobs with {waiting >> 20} MB of parameters wait already", _WAIT)
            # Not below the time of day: a client that still polls a job of a queue that was lost gets 404,
            # and not somebody else's job.
            number = max(int(now.timestamp()), max(self._entries, default=0) + 1)
            job = JobDocument(
                id=id_of(number),
                kind=spec.kind,
                subject=spec.subject,
                automatic=automatic,
                state=JobState.QUEUED,
                created_utc=iso_utc(now),
                progress=0.0,
            )
            self._keep(Entry(number, job, spec, size))
        return self.get(job.id)

    def get(self, job_id: str) -> JobDocument:
        """Returns a job as it now stands.

        Raises:
            NotFound: No job has that id.
        """
        with self._changed:
            entry = self._entry(job_id)
            if not entry.waits:
                return entry.job
            before = sum(one.waits and one.number <= entry.number for one in self._unfinished.values())
            return entry.placed(before)

    def list(self) -> list[JobDocument]:
        """Returns all jobs, newest first."""
        with self._changed:
            entries = list(self._entries.values())
        waiting = {one.number: place + 1 for place, one in enumerate(one for one in entries if one.waits)}
        return [one.placed(waiting.get(one.number)) for one in reversed(entries)]

    def analysing(self, capture_id: str) -> JobDocument | None:
        """Returns the first job that waits or runs and analyses a capture; None if there is none."""
        with self._changed:
            entries = (one for one in self._unfinished.values() if capture_id in one.analyses)
            return next((one.job for one in entries), None)

    def busy_subjects(self) -> set[str]:
        """Returns the captures that the jobs which wait or run are about, or read."""
        with self._changed:
            return {capture for one in self._unfinished.values() for capture in one.captures}

    def check_idle(self, subject: str) -> None:
        """Refuses a subject that a job still needs.

        Raises:
            Conflict: A job for it is queued or running.
        """
        with self._changed:
            found = next((one.job for one in self._unfinished.values() if subject in one.captures), None)
        if found is not None:
            raise Conflict(
                f"{found.id} ({found.kind}) is working on capture {subject}",
                f"wait for it to end, or cancel it: DELETE /api/v1/jobs/{found.id}",
            )

    def cancel(self, job_id: str) -> JobDocument:
        """Cancels a queued or running job; one that has ended stays as it is.

        Raises:
            NotFound: No job has that id.
            StorageError: The disk cannot be written, so that it would begin again with the next start.
        """
        with self._changing:
            entry = self._entry(job_id)
            # Before the interruption: the end of the process would otherwise be taken for a failed attempt.
            self.end(entry.number, JobState.CANCELLED)
        if entry.job.state is JobState.RUNNING:
            self._interrupt(entry.number)
        return self.get(job_id)

    def wait(self, job_id: str, timeout_s: float) -> JobDocument:
        """Returns the job once it has ended, or as it stands after `timeout_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._entry(job_id).ended, timeout_s)
            return self.get(job_id)

    def first(self, given_up: Callable[[], bool]) -> Entry | None:
        """Waits for the job whose turn it is; None if it is given up, of which `wake` tells."""
        with self._changed:
            self._changed.wait_for(lambda: given_up() or self._first() is not None)
            return None if given_up() else self._first()

    def wake(self) -> None:
        """Lets whoever waits look again."""
        with self._changed:
            self._changed.notify_all()

    def begin(self, number: int) -> Entry | None:
        """Counts another attempt of a job; None if it was cancelled meanwhile.

        Raises:
            StorageError: The disk cannot be written; the job waits.
        """
        with self._changing:
            entry = self._entries[number]
            if not entry.waits:
                return None
            begun = entry.changed(state=JobState.RUNNING, attempts=entry.job.attempts + 1)
            self._keep(begun)
        return begun

    def progress(self, number: int, share: float) -> None:
        """Notes how far the running job is; the disk learns nothing of that."""
        with self._changed:
            if not self._entries[number].ended:
                self._show(self._entries[number].changed(progress=share))

    def end(self, number: int, state: JobState, **changes: Any) -> None:
        """Ends a job, with what that says of its capture; one that has ended stays as it is.

        Raises:
            StorageError: The disk cannot be written.
        """
        with self._changing:
            entry = self._entries[number]
            if entry.ended:
                return
            ended = entry.changed(state=state, ended_utc=iso_utc(self._clock.utc_now()), **changes)
            unanalysed = entry.unanalysed(ended.job)
            analysed = entry.analyses if state is JobState.DONE else ()
            self._keep(ended, unanalysed=unanalysed, analysed=analysed)
            known = {capture: one for capture, one in self._unanalysed.items() if capture not in analysed}
            self._unanalysed = known | {one.capture: one for one in unanalysed}
            self._prune()
        self._ended(ended.job, entry.analyses)

    def interrupted(self, number: int, words: str, hint: str) -> bool:
        """Lets a job whose process has ended wait again, or fail after enough attempts; True if it waits.

        Raises:
            StorageError: The disk cannot be written.
        """
        with self._changing:
            entry = self._entries[number]
            if entry.ended:
                return False
            if (problem := entry.had_all_attempts(words, hint)) is None:
                self._keep(entry.changed(state=JobState.QUEUED, progress=0.0))
                return True
        self.end(number, JobState.FAILED, problem=problem)
        return False

    def put_back(self, number: int) -> None:
        """Lets the running job wait again, as if it had not begun: the daemon itself has stopped it.

        Raises:
            StorageError: The disk cannot be written.
        """
        with self._changing:
            entry = self._entries[number]
            if not entry.ended:
                attempts = entry.job.attempts - 1
                self._keep(entry.changed(state=JobState.QUEUED, progress=0.0, attempts=attempts))

    def unanalysed(self, capture_id: str) -> Unanalysed | None:
        """Returns why the latest analysis of a capture came to nothing; None if none did."""
        return self._unanalysed.get(capture_id)

    def refuse(self, capture_id: str, problem: JobProblem) -> None:
        """Notes that a capture cannot be analysed, without a job.

        Raises:
            StorageError: The disk cannot be written.
        """
        with self._changing:
            refused = Unanalysed(capture_id, JobState.FAILED.value, problem.model_dump_json())
            self._store.put(unanalysed=[refused])
            self._unanalysed[capture_id] = refused

    def forget_capture(self, capture_id: str) -> None:
        """Forgets that a capture, which is deleted, could not be analysed.

        Raises:
            StorageError: The disk cannot be written.
        """
        with self._changing:
            if capture_id in self._unanalysed:
                self._store.forget_capture(capture_id)
                del self._unanalysed[capture_id]

    def _write_again(self, reason: str) -> None:
        """Writes a damaged queue anew from memory; if there is none, as at a start, says that it is lost."""
        with self._changing:
            if self._entries or self._unanalysed:
                rows = [one.row for one in self._entries.values()]
                self._store.put(*rows, unanalysed=self._unanalysed.values())
                log.warning("%s; the queue was written anew", reason)
                return
        hint = (
            "ask for what waited again: grabberd jobs shows what there is; this warning ends with a restart"
        )
        self._faults.report(Cause.JOBS_LOST, f"{reason}: jobs that waited are lost", hint, "warning")

    def _entry(self, job_id: str) -> Entry:
        number = int(job_id[4:]) if job_id.startswith("job-") and job_id[4:].isdecimal() else -1
        with self._changed:
            if number not in self._entries:
                raise NotFound(f"no job {job_id!r}", "GET /api/v1/jobs lists the jobs of the last month")
            return self._entries[number]

    def _first(self) -> Entry | None:
        return next((one for one in self._unfinished.values() if one.waits), None)

    def _keep(self, entry: Entry, **rows: Any) -> None:
        """Writes a job to the disk, then shows it."""
        self._store.put(entry.row, **rows)
        self._show(entry)

    def _show(self, entry: Entry) -> None:
        with self._changed:
            self._entries[entry.number] = entry
            if entry.ended:
                self._unfinished.pop(entry.number, None)
            else:
                self._unfinished[entry.number] = entry
            self._changed.notify_all()

    def _prune(self) -> None:
        """Forgets the oldest of the jobs that have ended."""
        oldest_utc = iso_utc(self._clock.utc_now() - KEPT)
        ended = [entry for entry in self._entries.values() if entry.ended]
        old = {one.number for one in ended[:-MOST_KEPT]}
        old |= {one.number for one in ended if (one.job.ended_utc or "") < oldest_utc}
        if old:
            self._store.remove(old)
            with self._changed:
                self._entries = {number: one for number, one in self._entries.items() if number not in old}

    def _after_a_crash(self, entry: Entry) -> Entry:
        if entry.job.state is not JobState.RUNNING:
            return entry
        problem = entry.had_all_attempts(_CRASHED, _SEE_JOURNAL)
        if problem is None:
            return entry.changed(state=JobState.QUEUED)
        now = iso_utc(self._clock.utc_now())
        return entry.changed(state=JobState.FAILED, problem=problem, ended_utc=now)

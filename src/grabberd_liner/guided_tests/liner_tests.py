"""The guided tests of a state directory, as HTTP, the page and messages show them."""

import logging
from collections.abc import Iterable, Sequence
from functools import lru_cache

from grabberd.archive.catalogue.archive import Archive
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import assembled
from grabberd.documents.enums import JobState
from grabberd.documents.jobs import JobDocument
from grabberd.errors import Conflict, GrabberdError, InputError, StorageError
from grabberd_liner.chain.guided_tests.recipes import RECIPES
from grabberd_liner.guided_tests.documents import (
    DeviceTest,
    LinerTestDocument,
    LinerTestRequest,
    LinerTestResult,
    LinerTestRow,
)
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.guided_tests.store import LinerTestStore
from grabberd_liner.profiles.documents import ProfileDocument
from grabberd_liner.profiles.profiles import Profiles, plain_name

log = logging.getLogger(__name__)

REMEMBERED = 4096
_LINER = "liner"


class LinerTests:
    """Lists the tests, declares those that are asked for, and stores what they offer.

    Args:
        store: The tests.
        archive: The captures.
        profiles: The profiles that labels name, and that tests offer versions of.

    Attributes:
        store: See above.
        latest: The test that ended last of each device, from memory: the state shows it, and never waits for
            a disk.
    """

    def __init__(self, store: LinerTestStore, archive: Archive, profiles: Profiles) -> None:
        self.store = store
        self.latest: dict[str, DeviceTest] = {}
        self._archive = archive
        self._profiles = profiles
        # A test never changes, and a list is asked for again and again.
        self._row = lru_cache(REMEMBERED)(self._read)

    def row(self, test_id: str, kind: str | None = None, liner: str | None = None) -> LinerTestRow | None:
        """A test as it is listed; with a kind or a liner None if it is of another one."""
        row, name = self._row(test_id), _named(liner)
        return row if kind in (None, row.kind) and name in (None, _named(row.liner)) else None

    def job(self, wanted: LinerTestRequest) -> LinerTestJob:
        """The declaration of a test that is asked for by hand.

        Raises:
            NotFound: A capture does not exist.
            Conflict: A capture is still running, or armed.
            InputError: The recipe does not evaluate these captures together.
        """
        for capture_id in wanted.captures:
            self._archive.sealed_path(capture_id)
        captures = [self._archive.document(capture_id) for capture_id in wanted.captures]
        _check_fit(wanted.kind, captures)
        *others, newest = sorted(captures, key=lambda one: (one.created_utc, one.id))
        return LinerTestJob(
            subject=newest.id,
            test=wanted.kind,
            others=tuple(one.id for one in others),
            inputs=wanted.inputs,
            profiles={one.id: self._profiles.of_labels(one.labels) for one in captures},
        )

    def accept(self, test_id: str) -> ProfileDocument:
        """Stores what a test offers as the next version of the liner's profile; safe twice.

        Raises:
            NotFound: There is no such test.
            Conflict: It offers nothing, or the profile was changed since.
            InputError: The offer is no profile that this program takes.
            StorageError: The test is damaged, or the state cannot be written.
        """
        document = self.store.document(test_id)
        if document.offer is None:
            raise Conflict(
                f"test {test_id} ({document.kind}) has nothing to offer to a profile",
                "see its checks: what failed or could not be checked says what to do",
            )
        offered = document.offer.profile
        try:
            return self._profiles.put(offered, after=document.offer.after).document
        except Conflict:
            newest = self._profiles.get(str(offered["kind"]), str(offered["name"]))
            if newest.profile == offered:  # the answer to the first request may have been lost
                return newest
            raise

    def open(self, jobs: Iterable[JobDocument]) -> None:
        """Learns which tests ended last, from the jobs that are known."""
        ended = [job for job in jobs if job.kind == LinerTestJob.kind and job.ended_utc is not None]
        for job in sorted(ended, key=lambda job: job.ended_utc or ""):
            self.ended(job)

    def ended(self, job: JobDocument) -> None:
        """Takes note of a job that has ended."""
        if job.kind != LinerTestJob.kind:
            return
        try:
            device = self._archive.index.get(job.subject).device
        except (GrabberdError, OSError) as error:  # deleted meanwhile, or its disk is gone
            log.info("the test of capture %s is not shown with its device: %s", job.subject, error)
            return
        done = job.state is JobState.DONE and isinstance(job.result, LinerTestResult)
        self.latest[device] = DeviceTest.model_validate(
            {
                "capture": job.subject,
                "state": job.state.value,
                "test": self._row(job.result.test) if done else None,  # type: ignore[union-attr]
                "problem": job.problem,
            }
        )

    def _read(self, test_id: str) -> LinerTestRow:
        try:
            return _row_of(test_id, self.store.document(test_id))
        except StorageError as error:
            nothing = {"captures": [], "quantities": [], "offers": False}
            unknown = dict.fromkeys(("kind", "liner", "created_utc", "verdict"))
            problem = f"{error.message}; {error.hint}"
            return LinerTestRow.model_validate({"id": test_id, **nothing, **unknown, "problem": problem})


def _row_of(test_id: str, document: LinerTestDocument) -> LinerTestRow:
    captures, offers = [one.id for one in document.captures], document.offer is not None
    return assembled(LinerTestRow, document, id=test_id, captures=captures, offers=offers)


def _named(liner: str | None) -> str | None:
    return None if liner is None else plain_name(liner)


def _check_fit(kind: str, captures: Sequence[CaptureDocument]) -> None:
    """Checks that a recipe evaluates captures together.

    Raises:
        InputError: It takes another number of them, or they are not of one liner.
    """
    if RECIPES[kind].several and len(captures) < 2:
        raise InputError(
            f"the test {kind} compares captures, and one is named", "name all captures that were taken for it"
        )
    if not RECIPES[kind].several and len(captures) > 1:
        raise InputError(
            f"the test {kind} is of one capture, and {len(captures)} are named", "ask for a test of each"
        )
    liners = sorted({_named(one.labels.get(_LINER)) or "none" for one in captures})
    if len(liners) > 1:
        raise InputError(
            f"the captures are of several liners: {', '.join(liners)}",
            "name captures of one liner alone, or correct their label liner",
        )

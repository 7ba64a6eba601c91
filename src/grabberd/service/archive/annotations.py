"""What people do with captures that are made: pin them, say something of them, delete them."""

from collections.abc import Mapping
from dataclasses import replace

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.named_types import MOST_LABELS
from grabberd.errors import Conflict, InputError
from grabberd.service.archive.archive import Archive
from grabberd.service.jobs.job_runner import ENDED, JobRunner
from grabberd.storage.state.analysis_store import AnalysisStore
from grabberd.storage.state.annotation_store import AnnotationStore


class CaptureAnnotations:
    """Pins, notes and labels stand in the state; the files stay as they were recorded."""

    def __init__(
        self,
        archive: Archive,
        annotations: AnnotationStore,
        jobs: JobRunner,
        analyses: AnalysisStore,
    ) -> None:
        self._archive = archive
        self._annotations = annotations
        self._jobs = jobs
        self._analyses = analyses

    def annotate(
        self,
        capture_id: str,
        *,
        pinned: bool | None = None,
        note: str | None = None,
        labels: Mapping[str, str | None] | None = None,
    ) -> None:
        """Changes what is given and leaves the rest.

        Args:
            capture_id: of the capture, which may be running.
            pinned: it is kept until it is unpinned.
            note: in place of the one before.
            labels: are added to those it has, in place of those of the same name; None takes one away.

        Raises:
            NotFound: there is none of that id.
            InputError: it would have too many labels.
            StorageError: the state cannot be written.
        """
        document = self._archive.document(capture_id)
        said = self._annotations.get(capture_id)
        if pinned is not None:
            said = replace(said, pinned=pinned)
        if note is not None:
            said = replace(said, note=note)
        if labels is not None:
            said = replace(said, labels=_merged(document, labels))
        self._annotations.put(capture_id, said)

    def spared(self) -> set[str]:
        """Ids of the captures that nothing removes by itself: the pinned ones, and those that a job works on.

        Raises:
            StorageError: the state cannot be read.
        """
        pinned = {capture_id for capture_id, said in self._annotations.all().items() if said.pinned}
        return pinned | {job.subject for job in self._jobs.list() if job.state not in ENDED}

    def delete(self, capture_id: str) -> None:
        """Deletes a capture for good: its file, its analyses, and what was said of it.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is running, pinned, or a job works on it.
            StorageError: the disk does not let it be deleted.
        """
        self._archive.sealed_path(capture_id)
        if self._annotations.get(capture_id).pinned:
            raise Conflict(f"capture {capture_id} is pinned", "unpin it first: PATCH it with pinned: false")
        for job in self._jobs.list():
            if job.subject == capture_id and job.state not in ENDED:
                raise Conflict(
                    f"{job.id} ({job.kind}) works on capture {capture_id}",
                    f"wait for its end, or cancel it: DELETE /api/v1/jobs/{job.id}",
                )
        self._archive.remove(capture_id)
        self._analyses.remove(capture_id)
        self._annotations.remove(capture_id)


def _merged(document: CaptureDocument, labels: Mapping[str, str | None]) -> dict[str, str]:
    merged = {**document.labels, **labels}
    kept = {name: value for name, value in merged.items() if value is not None}
    if len(kept) > MOST_LABELS:
        raise InputError(
            f"capture {document.id} would have {len(kept)} labels, the most are {MOST_LABELS}",
            "take some away first: a label that is null is removed",
        )
    return kept

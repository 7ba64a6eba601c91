"""The same for several captures: each by itself, so that one that fails keeps no other from it."""

from collections.abc import Callable, Iterable

from grabberd.documents.capture_library import BatchDocument, BatchFailure
from grabberd.errors import GrabberdError


def for_each(captures: Iterable[str], act: Callable[[str], str | None]) -> BatchDocument:
    """Does something with each capture, in order.

    Args:
        captures: Their ids; one that is named twice counts once.
        act: Called with each id; returns the id of a job that it has queued, if any.
    """
    done: list[str] = []
    failed: list[BatchFailure] = []
    jobs: list[str] = []
    for one in dict.fromkeys(captures):
        try:
            job = act(one)
        except GrabberdError as error:
            failed.append(BatchFailure(capture=one, detail=error.message, hint=error.hint))
            continue
        done.append(one)
        jobs += [] if job is None else [job]
    return BatchDocument(done=done, failed=failed, jobs=jobs)

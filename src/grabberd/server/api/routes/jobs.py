"""Jobs: the pattern for all long-running work."""

from typing import Annotated

from fastapi import APIRouter, Path

from grabberd.documents.jobs import JobDocument, JobList
from grabberd.server.api.responses import RenderedRoute
from grabberd.server.api.routes.dependencies import PROBLEMS, Cursor, Limit, ServiceOf, page_of

router = APIRouter(prefix="/jobs", tags=["jobs"], responses=PROBLEMS, route_class=RenderedRoute)

JobId = Annotated[str, Path(pattern=r"^job-[0-9]{1,12}$", description="Id of the job.")]


@router.get("", summary="List jobs")
def list_jobs(service: ServiceOf, limit: Limit = 100, cursor: Cursor = None) -> JobList:
    """Waiting and running jobs and those that ended within the last month, newest first, page by page. They
    outlive the daemon: jobs that waited or ran when it stopped are done after its next start.
    """
    page, following = page_of(service.jobs.list(), _by_number, lambda job: job, limit, cursor)
    return JobList(jobs=page, next=following)


@router.get("/{job_id}", summary="Look up a job")
def get_job(job_id: JobId, service: ServiceOf) -> JobDocument:
    """State, position in the queue and progress of a job."""
    return service.jobs.get(job_id)


@router.delete("/{job_id}", summary="Cancel a job")
def cancel_job(job_id: JobId, service: ServiceOf) -> JobDocument:
    """Cancel a queued or running job; a finished job stays as it is."""
    return service.jobs.cancel(job_id)


def _by_number(job: JobDocument) -> tuple[str, str]:
    """Sort position by number, because two jobs may be submitted in the same millisecond."""
    return job.id.removeprefix("job-").zfill(12), job.id

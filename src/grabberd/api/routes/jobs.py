"""Jobs: the one pattern for what takes long."""

from typing import Annotated

from fastapi import APIRouter, Path

from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import JobDocument, JobList
from grabberd.api.routes.paging import Cursor, Limit, page_of
from grabberd.service.jobs.runner import Job

router = APIRouter(prefix="/jobs", tags=["jobs"], responses=PROBLEMS)

JobId = Annotated[str, Path(pattern=r"^job-[0-9]{1,12}$", description="Id of the job.")]


@router.get("", response_model=JobList, summary="List jobs")
def list_jobs(service: ServiceOf, limit: Limit = 100, cursor: Cursor = None) -> object:
    """The jobs since the daemon started, the newest first, page by page."""
    page, following = page_of(service.jobs.list(), _place, limit, cursor)
    return {"jobs": [job_document(job) for job in page], "next": following}


@router.get("/{job_id}", response_model=JobDocument, summary="Look at a job")
def get_job(job_id: JobId, service: ServiceOf) -> object:
    """How far a job is."""
    return job_document(service.jobs.get(job_id))


@router.delete("/{job_id}", response_model=JobDocument, summary="Cancel a job")
def cancel_job(job_id: JobId, service: ServiceOf) -> object:
    """Cancel a job that waits or runs; one that has ended stays as it is."""
    return job_document(service.jobs.cancel(job_id))


def _place(job: Job) -> tuple[str, str]:
    """By number: two may be made in the same millisecond."""
    return job.id.removeprefix("job-").zfill(12), job.id

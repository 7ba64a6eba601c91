"""Parameters and responses that several routes share."""

from typing import Annotated, Any

from fastapi import Depends, Path, Request, Response

from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.service.jobs.runner import Job
from grabberd.service.service import Service


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


ServiceOf = Annotated[Service, Depends(_service)]

CaptureId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the capture.")]
DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]

PROBLEMS: dict[int | str, dict[str, Any]] = {
    code: {"model": Problem, "content": {"application/problem+json": {}}}
    for code in (404, 409, 422, 503, 507)
}
ANY_DOCUMENT = {"$ref": "#/components/schemas/JsonObject"}
REPORT_HEADERS = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}
"""A report loads nothing: its styles and pictures are inside it."""


def job_document(job: Job) -> JobDocument:
    """A job as a document."""
    return JobDocument.model_validate(job, from_attributes=True)


def accepted(job: Job, request: Request, response: Response) -> JobDocument:
    """The response to a request that queued a job: the job, and its address in Location."""
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)

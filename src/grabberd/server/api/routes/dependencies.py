"""Parameters and responses that several routes share."""

from typing import Annotated

from fastapi import Depends, Path, Request, Response

from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.server.api.etags import Responses
from grabberd.server.api.snapshots import Snapshots
from grabberd.server.daemon.service import Service


async def _service(request: Request) -> Service:
    # Async though it waits for nothing: FastAPI calls other dependencies in threads.
    service: Service = request.app.state.service
    return service


ServiceOf = Annotated[Service, Depends(_service)]


async def _snapshots(request: Request) -> Snapshots:
    snapshots: Snapshots = request.app.state.snapshots
    return snapshots


SnapshotsOf = Annotated[Snapshots, Depends(_snapshots)]

CaptureId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the capture.")]
DeviceName = Annotated[str, Path(max_length=32, description="Name of the device.")]

PROBLEMS: Responses = {
    code: {"model": Problem, "content": {"application/problem+json": {}}}
    for code in (404, 409, 422, 503, 507)
}
BUSY: Responses = {503: PROBLEMS[503]}
"""Of routes that read among the heavy reads and have no other problems."""
OF_A_FILE: Responses = {**PROBLEMS, 410: PROBLEMS[404]}
"""Of routes that open a capture's file, which may be damaged."""
REPORT_HEADERS = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}
"""A report loads nothing: its styles and pictures are inside it."""


def accepted(job: JobDocument, request: Request, response: Response) -> JobDocument:
    """The response to a request that queued a job: the job, and its address in Location."""
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job

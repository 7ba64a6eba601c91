"""How routes come by the service, and what several of them answer with."""

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import Depends, Request

from grabberd.api.problems import Problem
from grabberd.api.routes.models import JobDocument
from grabberd.service.jobs.runner import Job
from grabberd.service.service import Service


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


ServiceOf = Annotated[Service, Depends(_service)]

PROBLEMS: dict[int | str, dict[str, Any]] = {
    code: {"model": Problem, "content": {"application/problem+json": {}}}
    for code in (404, 409, 422, 503, 507)
}


def job_document(job: Job) -> JobDocument:
    """A job as it is shown."""
    return JobDocument.model_validate(asdict(job))

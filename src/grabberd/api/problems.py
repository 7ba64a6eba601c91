"""Every error as a problem document (RFC 9457) with a hint."""

import json
import logging
import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

from grabberd import errors
from grabberd.api.docs.examples import PROBLEM

log = logging.getLogger(__name__)

STATUS: dict[type[errors.GrabberdError], HTTPStatus] = {
    errors.NotFound: HTTPStatus.NOT_FOUND,
    errors.Conflict: HTTPStatus.CONFLICT,
    errors.InputError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.MeasurementError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.CaptureFileError: HTTPStatus.INTERNAL_SERVER_ERROR,
    errors.DeviceError: HTTPStatus.SERVICE_UNAVAILABLE,
    errors.StorageError: HTTPStatus.INSUFFICIENT_STORAGE,
    errors.ExtraMissing: HTTPStatus.NOT_IMPLEMENTED,
}
"""The nearest class in an error's family decides."""


KIND = "urn:grabberd:problem:"
"""What every problem's type begins with."""


class Problem(BaseModel):
    """A problem document; `hint` says what to do."""

    model_config = ConfigDict(json_schema_extra={"examples": [PROBLEM]})

    type: str = Field(description="Its kind, for programs.")
    title: str
    status: int
    detail: str
    hint: str


class ProblemResponse(JSONResponse):
    """A problem document as an answer."""

    media_type = "application/problem+json"

    def render(self, content: Any) -> bytes:
        """In ASCII, so that whatever stood in the request can be quoted."""
        return json.dumps(content).encode("ascii")


def install(app: FastAPI) -> None:
    """Has every error of the application answered with a problem document."""
    app.add_exception_handler(errors.GrabberdError, _of_grabberd)
    app.add_exception_handler(RequestValidationError, _of_request)
    app.add_exception_handler(HTTPException, _of_http)
    app.add_exception_handler(Exception, _of_fault)


def status_of(error: errors.GrabberdError) -> HTTPStatus:
    """The HTTP status that an error is answered with."""
    known = (STATUS[family] for family in type(error).__mro__ if family in STATUS)
    return next(known, HTTPStatus.INTERNAL_SERVER_ERROR)


def problem(
    status: int, name: str, detail: str, hint: str, extra: Mapping[str, Any] | None = None
) -> ProblemResponse:
    """A problem document; name in kebab case."""
    document = Problem(
        type=f"{KIND}{name}",
        title=name.replace("-", " "),
        status=status,
        detail=detail,
        hint=hint,
    )
    return ProblemResponse(document.model_dump() | dict(extra or {}), status)


def _of_grabberd(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, errors.GrabberdError)
    return problem(status_of(error), _name(error), error.message, error.hint, _extra(error))


def _name(error: errors.GrabberdError) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "-", type(error).__name__).lower()


def _extra(error: errors.GrabberdError) -> dict[str, Any]:
    """What a program has to know of it besides words."""
    if isinstance(error, errors.CaptureRunning):
        return {"capture_id": error.capture_id}
    if isinstance(error, errors.GroupRefused):
        return {"refusals": [_refusal(*pair) for pair in error.refusals.items()]}
    return {}


def _refusal(device: str, error: errors.GrabberdError) -> dict[str, Any]:
    kind = f"{KIND}{_name(error)}"
    return {"device": device, "type": kind, "detail": error.message, "hint": error.hint, **_extra(error)}


def _of_request(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, RequestValidationError)
    faults = [{"where": _place(fault["loc"]), "message": fault["msg"]} for fault in error.errors()]
    detail = "; ".join(f"{fault['where']}: {fault['message']}" for fault in faults)
    return problem(
        422,
        "bad-request",
        detail,
        "mend these values; /api/v1/openapi.json describes them",
        {"faults": faults},
    )


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)


def _of_http(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, HTTPException)
    name = HTTPStatus(error.status_code).phrase.lower().replace(" ", "-")
    return problem(error.status_code, name, str(error.detail), "/api/v1/openapi.json lists what there is")


def _of_fault(request: Request, error: Exception) -> ProblemResponse:
    log.error("%s %s failed", request.method, request.url.path, exc_info=error)
    hint = "this is a fault of the program; the journal has the details, please report it"
    return problem(500, "internal-error", f"{type(error).__name__} while answering", hint)

"""Problem documents (RFC 9457) with a hint, into which all errors are translated.

A `Refusal` rejects a request before, or while, a route handles it.
"""

import json
import logging
import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from grabberd import errors
from grabberd.documents.problems import (
    KIND,
    BadRequestProblem,
    CaptureRunningProblem,
    Fault,
    GroupRefusedProblem,
    Problem,
    RefusalWhileRunning,
)
from grabberd.documents.problems import Refusal as RefusalOfDevice
from grabberd.server.daemon.descriptors import exhaustion

log = logging.getLogger(__name__)

STATUS: dict[type[errors.GrabberdError], HTTPStatus] = {
    errors.NotFound: HTTPStatus.NOT_FOUND,
    errors.Conflict: HTTPStatus.CONFLICT,
    errors.InputError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.MeasurementError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.CaptureFileError: HTTPStatus.GONE,
    errors.LaterVersion: HTTPStatus.CONFLICT,
    errors.DeviceError: HTTPStatus.SERVICE_UNAVAILABLE,
    errors.StorageError: HTTPStatus.INSUFFICIENT_STORAGE,
    errors.IndexRebuilding: HTTPStatus.SERVICE_UNAVAILABLE,
    errors.ExtraMissing: HTTPStatus.NOT_IMPLEMENTED,
    errors.ReadingGivenUp: HTTPStatus.SERVICE_UNAVAILABLE,
}
"""The status of an error's nearest ancestor applies."""


_NO_THREAD = "can't start new thread"
"""Python's message when a limit on threads or memory is reached."""
RETRY_S = "10"
"""Time in seconds after which to retry a read that took too long."""


class ProblemResponse(JSONResponse):
    """A response with a problem document."""

    media_type = "application/problem+json"

    def render(self, content: Any) -> bytes:
        """Renders in ASCII, so that anything in the request can be quoted, lone surrogates included."""
        return json.dumps(content).encode("ascii")


def install(app: FastAPI) -> None:
    """Makes the application answer every error with a problem document."""
    app.add_exception_handler(errors.GrabberdError, _of_grabberd)
    app.add_exception_handler(RequestValidationError, _of_request)
    app.add_exception_handler(HTTPException, _of_http)
    app.add_exception_handler(Exception, _of_fault)
    app.add_exception_handler(Refusal, answer_refusal)


def status_of(error: errors.GrabberdError) -> HTTPStatus:
    """The HTTP status of an error."""
    # In method resolution order, the nearest ancestor comes first.
    known = (STATUS[family] for family in type(error).__mro__ if family in STATUS)
    return next(known, HTTPStatus.INTERNAL_SERVER_ERROR)


def problem(
    status: int, name: str, detail: str, hint: str, kind: type[Problem] = Problem, **extensions: Any
) -> ProblemResponse:
    """A problem document as a response.

    Args:
        status: HTTP status code.
        name: Machine-readable name in kebab case.
        detail: What failed, on what, with which values.
        hint: What to do about it.
        kind: Model of the document.
        extensions: Further keys of this model.
    """
    title = name.replace("-", " ")
    document = kind(type=f"{KIND}{name}", title=title, status=status, detail=detail, hint=hint, **extensions)
    return ProblemResponse(document.model_dump(mode="json"), status)


def _of_grabberd(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, errors.GrabberdError)
    common = status_of(error), _name(error), error.message, error.hint
    if isinstance(error, errors.CaptureRunning):
        return problem(*common, CaptureRunningProblem, capture_id=error.capture_id)
    if isinstance(error, errors.GroupRefused):
        refusals = [_refusal(device, cause) for device, cause in error.refusals.items()]
        return problem(*common, GroupRefusedProblem, refusals=refusals)
    answer = problem(*common)
    if isinstance(error, errors.ReadingGivenUp):
        answer.headers["Retry-After"] = RETRY_S
    return answer


def _name(error: errors.GrabberdError) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "-", type(error).__name__).lower()


def _refusal(device: str, error: errors.GrabberdError) -> RefusalOfDevice:
    known = {"device": device, "type": f"{KIND}{_name(error)}", "detail": error.message, "hint": error.hint}
    if isinstance(error, errors.CaptureRunning):
        return RefusalWhileRunning(**known, capture_id=error.capture_id)
    return RefusalOfDevice(**known)


def _of_request(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, RequestValidationError)
    faults = [Fault(where=_path(fault["loc"]), message=fault["msg"]) for fault in error.errors()]
    detail = "; ".join(f"{fault.where}: {fault.message}" for fault in faults)
    hint = "fix these values; /api/v1/openapi.json describes them"
    return problem(422, "bad-request", detail, hint, BadRequestProblem, faults=faults)


def _path(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)


def _of_http(_: Request, error: Exception) -> ProblemResponse:
    assert isinstance(error, HTTPException)
    name = HTTPStatus(error.status_code).phrase.lower().replace(" ", "-")
    return problem(error.status_code, name, str(error.detail), "/api/v1/openapi.json lists all routes")


def _of_fault(request: Request, error: Exception) -> ProblemResponse:
    if exhaustion.explains(error):
        hint = "try again in a moment; other clients have to close their connections"
        return problem(503, "too-many-files", f"the daemon has no file descriptor left: {error}", hint)
    if isinstance(error, RuntimeError) and _NO_THREAD in f"{error}":
        hint = "try again in a moment; raise TasksMax= of the unit if it happens again and again"
        return problem(503, "too-many-threads", "the daemon can start no further thread", hint)
    log.error("%s %s failed", request.method, request.url.path, exc_info=error)
    hint = "this is an internal error; the journal has the details, please report it"
    return problem(500, "internal-error", f"{type(error).__name__} while responding", hint)


class Refusal(HTTPException):
    """A request is refused.

    It is an HTTPException because FastAPI lets no other exception through while it reads a body.
    """

    def __init__(
        self, status: int, name: str, detail: str, hint: str, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(status, detail, dict(headers or {}))
        self.name = name
        self.hint = hint

    def response(self) -> ProblemResponse:
        """The refusal as a problem document."""
        answer = problem(self.status_code, self.name, str(self.detail), self.hint)
        answer.headers.update(self.headers or {})
        return answer


def answer_refusal(_: Request, error: Exception) -> Response:
    """The application's handler for refusals."""
    assert isinstance(error, Refusal)
    return error.response()

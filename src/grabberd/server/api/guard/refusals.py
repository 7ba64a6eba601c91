"""Refusals: requests that are turned away before, or while, a route handles them."""

from collections.abc import Mapping

from fastapi import Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from grabberd.server.api.problems import ProblemResponse, problem


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

"""Requests that are refused before, or while, a route sees them."""

from collections.abc import Mapping

from fastapi import HTTPException, Request
from fastapi.responses import Response

from grabberd.api.problems import ProblemResponse, problem


class Refusal(HTTPException):
    """A request is not served; `name` in kebab case, `hint` says what to do.

    An HTTPException, as that alone passes through FastAPI's reading of a body.
    """

    def __init__(
        self, status: int, name: str, detail: str, hint: str, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(status, detail, dict(headers or {}))
        self.name = name
        self.hint = hint

    def response(self) -> ProblemResponse:
        """What is answered."""
        answer = problem(self.status_code, self.name, str(self.detail), self.hint)
        answer.headers.update(self.headers or {})
        return answer


def answer_refusal(_: Request, error: Exception) -> Response:
    """The application's handler for refusals."""
    assert isinstance(error, Refusal)
    return error.response()

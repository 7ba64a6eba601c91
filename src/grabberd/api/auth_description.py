"""What the API's description says of who may: schemes, the least role, and the refusals of every route."""

from typing import Any

from fastapi import FastAPI

from grabberd.api.auth import COOKIE
from grabberd.api.problems import Problem
from grabberd.api.roles import LEAST_ROLE

SCHEMES = {
    "token": {"type": "http", "scheme": "bearer", "description": "As `grabberd token add` printed it."},
    "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "POST /api/v1/session."},
}
REFUSALS = {
    "401": "Nobody whom the daemon knows.",
    "403": "The role is not enough, or a foreign page asks.",
    "408": "The request's body took too long.",
    "413": "The request's body is too large.",
    "421": "The daemon is not called by this name.",
    "429": "Too many attempts or streams.",
}


def describe_access(app: FastAPI) -> None:
    """Has the application's description say who may."""
    plain = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            _complete(plain())
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _complete(description: dict[str, Any]) -> None:
    components = description.setdefault("components", {})
    components["securitySchemes"] = SCHEMES
    components.setdefault("schemas", {}).setdefault("Problem", Problem.model_json_schema())
    description["security"] = [{name: []} for name in SCHEMES]
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            _complete_operation(f"{method.upper()} {path}", operation)


def _complete_operation(key: str, operation: dict[str, Any]) -> None:
    least = LEAST_ROLE.get(key)
    if least is None and key in LEAST_ROLE:
        operation["security"] = []
    else:
        operation["x-least-role"] = least
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    for status, words in REFUSALS.items():
        operation["responses"].setdefault(status, {"description": words, "content": content})
    operation["responses"] = dict(sorted(operation["responses"].items()))

"""The OpenAPI description, completed with roles, refusals and binary content, and rendered as a page.

The page is self-contained: no scripts, no other files, no other hosts.
"""

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterator, Mapping, MutableMapping
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from grabberd.documents.problems import Problem
from grabberd.server.api.guard.authentication import COOKIE, least_roles

SCHEMES = {
    "token": {"type": "http", "scheme": "bearer", "description": "As `grabberd token add` printed it."},
    "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "POST /api/v1/session."},
}
REFUSALS = {
    "401": "The token or session is unknown.",
    "403": "The role is not sufficient, or a page of another site sent the request.",
    "408": "The request body took too long.",
    "413": "The request body is too large.",
    "421": "The daemon does not have this host name.",
    "429": "Too many attempts or streams.",
    "500": "An internal error.",
}
"""Refusals that every route can return."""
PROBLEM_DESCRIPTIONS = {
    **REFUSALS,
    "404": "There is nothing of that name.",
    "409": "The request conflicts with the present state.",
    "410": "The capture's file is damaged.",
    "422": "A value is invalid.",
    "501": "An optional part of grabberd that this requires is not installed.",
    "503": "The device is not delivering, or too much is asked at the same time, or it takes too long.",
    "507": "The disk is full, read-only or broken.",
}
PROBLEM_JSON = "application/problem+json"
BINARY = {"type": "string", "format": "binary"}
_PROBLEM = "#/components/schemas/Problem"
_OF_FASTAPI = ("HTTPValidationError", "ValidationError")
"""FastAPI's own error documents, which no route returns."""
Tree = MutableMapping[str, Any]


def describe(app: FastAPI) -> None:
    """Completes the application's description when it is first requested."""
    plain = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            _complete(plain())
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _complete(description: Tree) -> None:
    components = description.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    schemas["Problem"] = Problem.model_json_schema()
    for name in _OF_FASTAPI:
        schemas.pop(name, None)
    components["responses"] = {_name(status): _of_problem(status) for status in sorted(PROBLEM_DESCRIPTIONS)}
    components["securitySchemes"] = SCHEMES
    description["security"] = [{name: []} for name in SCHEMES]
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            _add_role(f"{method.upper()} {path}", operation)
            _add_refusals(operation)


def _add_role(key: str, operation: Tree) -> None:
    least = least_roles().get(key)
    if least is None and key in least_roles():
        operation["security"] = []
    else:
        operation["x-least-role"] = least


def _add_refusals(operation: Tree) -> None:
    responses = operation["responses"]
    responses.update({status: {} for status in REFUSALS})
    operation["responses"] = {status: _answer(status, responses[status]) for status in sorted(responses)}


def _answer(status: str, response: Tree) -> Tree:
    if status < "400":
        _mark_binary(response)
        return response
    if "text/plain" in response.get("content", {}):
        return response
    own = [schema for schema in _schemas(response) if schema.get("$ref") not in (None, _PROBLEM)]
    if status in PROBLEM_DESCRIPTIONS and (not own or own[0]["$ref"].endswith(_OF_FASTAPI)):
        return {"$ref": f"#/components/responses/{_name(status)}"}
    return {"description": response["description"], "content": {PROBLEM_JSON: {"schema": own[0]}}}


def _schemas(response: Tree) -> Iterator[Tree]:
    return (content["schema"] for content in response.get("content", {}).values() if "schema" in content)


def _mark_binary(response: Tree) -> None:
    for kind, content in response.get("content", {}).items():
        if not content and kind != "application/json":
            content["schema"] = {"type": "string"} if kind.startswith("text/") else BINARY


def _name(status: str) -> str:
    return f"Problem{status}"


def _of_problem(status: str) -> Tree:
    content = {PROBLEM_JSON: {"schema": {"$ref": _PROBLEM}}}
    return {"description": PROBLEM_DESCRIPTIONS[status], "content": content}


TEMPLATES = Path(__file__).parent / "templates"
STYLE = (TEMPLATES / "docs.css").read_text(encoding="utf-8")
_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
POLICY = f"default-src 'none'; style-src 'sha256-{_HASH}'; base-uri 'none'; form-action 'none'"
"""The page's content security policy."""
LIMITS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
    "maxLength": "at most {} characters",
    "maxItems": "at most {}",
    "maxProperties": "at most {}",
    "pattern": "like {}",
}
Json = Mapping[str, Any]
"""A part of an OpenAPI description."""


def page(description: Json) -> str:
    """The OpenAPI description as an HTML page."""
    from jinja2 import Environment, FileSystemLoader  # noqa: PLC0415 - rarely needed

    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True)
    environment.filters |= {"kind": type_in_words, "words": _text}
    environment.filters["written"] = lambda example: json.dumps(example, indent=1, ensure_ascii=False)
    operations = [
        {"method": method.upper(), "path": path, **operation}
        for path, methods in description["paths"].items()
        for method, operation in methods.items()
    ]
    tags = dict.fromkeys(one["tags"][0] for one in operations)
    groups = {tag: [one for one in operations if one["tags"][0] == tag] for tag in tags}
    template = environment.get_template("docs.html.jinja")
    return template.render(style=STYLE, groups=groups, **description)


def _text(words: str) -> str:
    """Escapes a text and turns backticks into code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(words))


def type_in_words(schema: Json) -> str:
    """A JSON schema's type in words, as HTML; a named type is a link."""
    if "$ref" in schema:
        name = html.escape(schema["$ref"].rpartition("/")[2])
        return f'<a href="#{name}">{name}</a>'
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(type_in_words(choice) for choice in choices)
    if values := schema.get("enum") or ([schema["const"]] if "const" in schema else None):
        return " or ".join(f"<code>{_json(value)}</code>" for value in values)
    return _plain_type(schema) + _limits(schema)


def _plain_type(schema: Json) -> str:
    if schema.get("type") == "array":
        return f"list of {type_in_words(schema.get('items', {}))}"
    inner = schema.get("additionalProperties")
    if schema.get("type") == "object" and isinstance(inner, Mapping):
        return f"object of {type_in_words(inner)}"
    return html.escape(str(schema.get("format") or schema.get("type") or "anything"))


def _limits(schema: Json) -> str:
    parts = [words.format(schema[key]) for key, words in LIMITS.items() if key in schema]
    return html.escape("".join(f", {part}" for part in parts))


def _json(value: object) -> str:
    return html.escape(json.dumps(value, ensure_ascii=False))

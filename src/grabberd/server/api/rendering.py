"""Rendering: documents become JSON in the thread that has made them."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any

from fastapi import Response
from fastapi.routing import APIRoute
from pydantic import BaseModel

JSON = "application/json"


def rendered(found: Any) -> Any:
    """A document as its response; anything else as it is."""
    if isinstance(found, BaseModel):
        return Response(found.model_dump_json(by_alias=True), media_type=JSON)
    return found


class RenderedRoute(APIRoute):
    """A route whose GET requests take one thread, once.

    FastAPI would validate the document again, in a thread a second time, and would make JSON of it in the
    event loop while everybody else waits: of a field's points, too, which are hundreds of numbers.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        only_gets = set(options.get("methods") or ()) == {"GET"}
        if only_gets and not inspect.iscoroutinefunction(endpoint):
            endpoint = _rendering(endpoint)
        super().__init__(path, endpoint, **options)


def _rendering(endpoint: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(endpoint)
    def render(*args: Any, **parameters: Any) -> Any:
        return rendered(endpoint(*args, **parameters))

    return render

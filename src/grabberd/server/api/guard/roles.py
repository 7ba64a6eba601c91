"""The minimum role for every route, in one table; the first match applies, and None means public.

Routes of extensions need no rows: GET requires a viewer, anything else an operator.
"""

import re
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import NamedTuple

from fastapi.requests import HTTPConnection
from starlette.routing import compile_path
from starlette.types import Scope

from grabberd.archive.access import Identity
from grabberd.documents.enums import Role
from grabberd.extension import extensions, load
from grabberd.server.api.problems import Refusal

_OWN: dict[str, Role | None] = {
    "GET /": None,
    "GET /static/{version}/{path:path}": None,
    "GET /healthz": None,
    "GET /readyz": Role.VIEWER,
    "GET /metrics": Role.VIEWER,
    "GET /docs": None,
    "GET /docs/{path:path}": None,
    "GET /api/v1/docs": Role.VIEWER,
    "GET /api/v1/openapi.json": Role.VIEWER,
    "GET /api/v1/session": Role.VIEWER,
    "POST /api/v1/session": Role.VIEWER,
    "DELETE /api/v1/session": Role.VIEWER,
    "GET /api/v1/state": Role.VIEWER,
    "GET /api/v1/events": Role.VIEWER,
    "WEBSOCKET /api/v1/preview": Role.VIEWER,
    "WEBSOCKET /api/v1/points/stream": Role.VIEWER,
    "WEBSOCKET /api/v1/curves/stream": Role.VIEWER,
    "GET /api/v1/preview.png": Role.VIEWER,
    "GET /api/v1/devices": Role.VIEWER,
    "GET /api/v1/devices/{name}": Role.VIEWER,
    "GET /api/v1/devices/{name}/points": Role.VIEWER,
    "GET /api/v1/devices/{name}/curves": Role.VIEWER,
    "GET /api/v1/devices/{name}/light": Role.VIEWER,
    "GET /api/v1/devices/{name}/object": Role.VIEWER,
    "POST /api/v1/devices/{name}/check": Role.OPERATOR,
    "GET /api/v1/captures": Role.VIEWER,
    "GET /api/v1/captures.csv": Role.VIEWER,
    "GET /api/v1/captures.zip": Role.VIEWER,
    "POST /api/v1/captures": Role.OPERATOR,
    "PATCH /api/v1/captures": Role.OPERATOR,
    "POST /api/v1/captures/deletion": Role.OPERATOR,
    "GET /api/v1/captures/{capture_id}": Role.VIEWER,
    "PATCH /api/v1/captures/{capture_id}": Role.OPERATOR,
    "DELETE /api/v1/captures/{capture_id}": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/stop": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/trigger": Role.OPERATOR,
    "POST /api/v1/captures/{capture_id}/measure": Role.OPERATOR,
    "POST /api/v1/capture-groups": Role.OPERATOR,
    "GET /api/v1/capture-groups/{group_id}": Role.VIEWER,
    "POST /api/v1/capture-groups/{group_id}/stop": Role.OPERATOR,
    "POST /api/v1/capture-groups/{group_id}/trigger": Role.OPERATOR,
    "GET /api/v1/captures/{capture_id}/file": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/runs/{run}": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.csv": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.ply": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.parquet": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.mat": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/points.c3d": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/channels": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/channels.csv": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/fields/{n}.png": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/thumbnail.png": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/widths": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/replay/points": Role.VIEWER,
    "GET /api/v1/captures/{capture_id}/replay/pictures": Role.VIEWER,
    "GET /api/v1/calibrations": Role.VIEWER,
    "POST /api/v1/calibrations": Role.OPERATOR,
    "PUT /api/v1/calibrations/active": Role.OPERATOR,
    "PUT /api/v1/calibrations/{calibration_id}/rejection": Role.OPERATOR,
    "GET /api/v1/calibrations/{calibration_id}": Role.VIEWER,
    "GET /api/v1/calibrations/{calibration_id}/report": Role.VIEWER,
    "GET /api/v1/calibrations/{calibration_id}/report.json": Role.VIEWER,
    "GET /api/v1/calibration-frames": Role.VIEWER,
    "POST /api/v1/captures/{capture_id}/identification": Role.OPERATOR,
    "GET /api/v1/jobs": Role.VIEWER,
    "GET /api/v1/jobs/{job_id}": Role.VIEWER,
    "DELETE /api/v1/jobs/{job_id}": Role.OPERATOR,
    "GET /api/v1/settings": Role.VIEWER,
    "PUT /api/v1/settings": Role.OPERATOR,
    "GET /api/v1/config": Role.ADMIN,
    "GET /api/v1/diagnostics": Role.ADMIN,
}


@cache
def least_roles() -> Mapping[str, Role | None]:
    """The minimum role by method and path, for the program and its extensions."""
    routes = [route for one in extensions() for place in one.routes for route in load(place.target).routes]
    added = [(method, route.path) for route in routes for method in route.methods]
    return _OWN | {
        f"{method} /api/v1{path}": Role.VIEWER if method == "GET" else Role.OPERATOR for method, path in added
    }


class _Row(NamedTuple):
    method: str
    path: re.Pattern[str]
    least: Role | None


def _row(key: str, least: Role | None) -> _Row:
    method, _, template = key.partition(" ")
    return _Row(method, compile_path(template)[0], least)


REMEMBERED = 1024
"""Number of cached paths; trying all rows takes longer than everything else in the gate."""
LONGEST_REMEMBERED = 200
"""Longest cached path in characters: the client is not yet known and may send 32 KB."""


def _find(scope: Scope) -> _Row | None:
    method = "WEBSOCKET" if scope["type"] == "websocket" else scope["method"]
    find = _row_of if len(scope["path"]) <= LONGEST_REMEMBERED else _row_of.__wrapped__
    return find("GET" if method == "HEAD" else method, scope["path"])


@cache
def _rows() -> tuple[_Row, ...]:
    return tuple(_row(key, least) for key, least in least_roles().items())


@lru_cache(REMEMBERED)
def _row_of(method: str, path: str) -> _Row | None:
    return next((row for row in _rows() if row.method == method and row.path.match(path)), None)


def is_declared(method: str, path: str) -> bool:
    """True if the table has a row for this method and path."""
    return _row_of(method, path) is not None


def least_role(scope: Scope) -> Role | None:
    """The role that a request requires; a viewer may learn that a path does not exist."""
    row = _find(scope)
    return Role.VIEWER if row is None else row.least


async def check_declared(connection: HTTPConnection) -> None:
    """Reserves routes that are missing from the table for admins; a dependency of every route.

    Raises:
        Refusal: 403, the route is missing from the table and the client is not an admin.
    """
    identity: Identity | None = getattr(connection.state, "identity", None)
    if _find(connection.scope) is None and (identity is None or not identity.covers(Role.ADMIN)):
        raise Refusal(
            403,
            "undeclared-route",
            f"no role is declared for {connection.url.path}",
            "this is an internal error, please report it",
        )

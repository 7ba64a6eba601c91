"""Captures of several devices together: start, arm, trigger, stop, look."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response, status

from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.routes.capture_group_models import CaptureGroup, CaptureGroupOrder
from grabberd.api.routes.captures import request_of
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd.errors import NotFound
from grabberd.service.service import Service

router = APIRouter(prefix="/capture-groups", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)

GroupId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the group.")]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureGroup,
    dependencies=[TAKES_KEY],
    summary="Start or arm captures of several devices together",
)
def start_capture_group(
    order: CaptureGroupOrder, service: ServiceOf, request: Request, response: Response
) -> object:
    """Start a capture of each device at the same moment, or arm them for one trigger. All of them or none:
    409 says in `refusals` which devices cannot begin and why, with the id of a capture that is running.
    """
    names = list(service.instruments) if order.devices == "all" else list(dict.fromkeys(order.devices))
    _check_named(order, names)
    requests = {name: request_of(order, service.rate_hz(name), order.labels_of.get(name)) for name in names}
    begin = service.capture_control.arm_group if order.armed else service.capture_control.start_group
    group_id = begin(requests)
    response.headers["Location"] = str(request.url_for("get_capture_group", group_id=group_id))
    return _shown(service, group_id)


@router.get("/{group_id}", response_model=CaptureGroup, summary="Look at captures made together")
def get_capture_group(group_id: GroupId, service: ServiceOf) -> object:
    """The captures of a group, each with its ledger, and the moment at which all of them began."""
    return _shown(service, group_id)


@router.post(
    "/{group_id}/trigger",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureGroup,
    dependencies=[TAKES_KEY],
    summary="Trigger armed captures together",
)
def trigger_capture_group(group_id: GroupId, service: ServiceOf) -> object:
    """Have the armed captures of a group record, all from the same moment; 409 if they are not armed."""
    service.capture_control.trigger_group(group_id)
    return _shown(service, group_id)


@router.post(
    "/{group_id}/stop",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=CaptureGroup,
    summary="Stop captures together",
)
def stop_capture_group(group_id: GroupId, service: ServiceOf) -> object:
    """Stop the running captures of a group at the same moment; of armed ones nothing is left."""
    before = _shown(service, group_id)
    service.capture_control.stop_group(group_id)
    if all(capture["state"] == "armed" for capture in before["captures"]):
        return {**before, "captures": [_disarmed(capture) for capture in before["captures"]]}
    return _shown(service, group_id)


def _check_named(order: CaptureGroupOrder, names: list[str]) -> None:
    """Labels of nobody would be lost.

    Raises:
        NotFound: some are of a device that is not asked for.
    """
    others = [name for name in order.labels_of if name not in names]
    if others:
        raise NotFound(
            f"labels_of names {', '.join(others)}, of which no capture is asked for",
            f"the devices are: {', '.join(names)}",
        )


def _disarmed(capture: dict[str, Any]) -> dict[str, Any]:
    return {**capture, "state": "disarmed", "ended_because": "stopped before it was triggered"}


def _shown(service: Service, group_id: str) -> dict[str, Any]:
    captures = service.capture_control.captures_of(group_id)
    group = captures[0]["group"]
    return {**group, "captures": captures}

"""Groups of captures of several devices: start, arm, trigger, stop, look up."""

from typing import Annotated

from fastapi import APIRouter, Path, Request, Response, status

from grabberd.documents.captures import CaptureGroup
from grabberd.documents.requests import NewCaptureGroup
from grabberd.errors import NotFound
from grabberd.server.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.server.api.reading.readings import reads
from grabberd.server.api.routes.captures import request_of
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf

router = APIRouter(prefix="/capture-groups", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)

GroupId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the group.")]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Start or arm a group of captures",
)
def start_capture_group(
    new: NewCaptureGroup, service: ServiceOf, request: Request, response: Response
) -> CaptureGroup:
    """Start a capture of each device at the same moment, or arm them for a common trigger. Either all of them
    start or none: 409 lists in `refusals` which devices cannot start and why, with the id of a running
    capture.
    """
    names = list(service.instruments) if new.devices == "all" else list(dict.fromkeys(new.devices))
    _check_labels(new, names)
    control = service.capture_control
    requests = {name: request_of(new, control.rate_hz(name), new.labels_of.get(name)) for name in names}
    start = control.arm_group if new.armed else control.start_group
    group_id = start(requests)
    response.headers["Location"] = str(request.url_for("get_capture_group", group_id=group_id))
    return control.group_document(group_id)


@router.get("/{group_id}", summary="Look up a group of captures")
@reads
def get_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """The captures of a group, each with its ledger, and the common moment of their start."""
    return service.capture_control.group_document(group_id)


@router.post(
    "/{group_id}/trigger",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Trigger an armed group",
)
def trigger_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """Start recording all armed captures of a group at the same moment. 409 if they are not armed."""
    service.capture_control.trigger_group(group_id)
    return service.capture_control.group_document(group_id)


@router.post("/{group_id}/stop", status_code=status.HTTP_202_ACCEPTED, summary="Stop a group of captures")
def stop_capture_group(group_id: GroupId, service: ServiceOf) -> CaptureGroup:
    """Stop the running captures of a group at the same moment. Nothing remains of armed captures."""
    before = service.capture_control.group_document(group_id)
    service.capture_control.stop_group(group_id)
    if all(capture.state == "armed" for capture in before.captures):
        return before.model_copy(update={"captures": [capture.disarmed for capture in before.captures]})
    return service.capture_control.group_document(group_id)


def _check_labels(new: NewCaptureGroup, names: list[str]) -> None:
    """Refuses labels of devices that are not part of the group, which would be lost.

    Raises:
        NotFound: some labels belong to no capture of the group.
    """
    others = [name for name in new.labels_of if name not in names]
    if others:
        raise NotFound(
            f"labels_of names {', '.join(others)}, but no capture of that name is requested",
            f"the devices are: {', '.join(names)}",
        )

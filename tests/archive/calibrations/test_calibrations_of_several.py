"""Every device has its own calibration, also where two of them have been given the same one."""

from pathlib import Path

import pytest
from calibrators import listed
from several import service_of

from grabberd.server.daemon.service import Service

OWN = "of-left"


@pytest.fixture
def service(tmp_path: Path) -> Service:
    """Two devices at rest, both configured with the same calibration; the left one has another beside it."""
    service = service_of(tmp_path, {"left": {}, "right": {}})
    service.open_stores()
    document = service.instrument("left").setup.documents["calibration"]
    service.import_calibration({**document, "id": OWN}, "left", "")
    return service


def active(service: Service) -> set[tuple[str, str]]:
    return {(row.id, row.device) for row in listed(service) if row.active}


def test_what_one_measures_with_is_active_for_that_one_alone(service: Service) -> None:
    same = service.instrument("left").setup.documents["calibration"]["id"]
    assert active(service) == {(same, "left"), (same, "right")}
    service.active.activate(OWN, service.instrument("left"))
    assert active(service) == {(OWN, "left"), (same, "right")}


def test_the_row_that_is_shown_is_that_of_the_device_in_question(service: Service) -> None:
    same = service.instrument("left").setup.documents["calibration"]["id"]
    service.active.activate(OWN, service.instrument("left"))
    assert service.active.row(same, "right").active
    assert not service.active.row(same, "left").active

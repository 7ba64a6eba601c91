"""Documents that are built without validation, or changed after it, are valid all the same."""

from collections.abc import Iterator

import pytest
from calibrators import listed
from running import sealed, standing

from grabberd.archive.export.page_documents import PointsQuery, points_json
from grabberd.documents.document import Document
from grabberd.documents.points_frame import PointsDocument
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.live.field_streams import newest_points, object_document
from grabberd.server.daemon.service import Service


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with standing(tmp_path_factory.mktemp("live")) as service:
        service.capture_control.start(None, CaptureRequest(fields=10))
        sealed(service)
        yield service


def check(document: Document) -> None:
    assert type(document).model_validate(document.model_dump()) == document


def test_points(service: Service) -> None:
    [capture] = service.archive.documents()
    points = PointsDocument.model_validate_json(points_json(service.archive.path(capture.id), PointsQuery()))
    assert [field.n for field in points.fields] == list(range(10))
    check(points)
    check(newest_points(service.instrument(None), service.clock))


def test_the_state(service: Service) -> None:
    state = service.state()
    check(state)
    assert state.devices["simulated"].live is not None
    check(object_document(service.instrument(None)))


def test_captures_whose_annotations_have_changed(service: Service) -> None:
    [capture] = service.archive.documents()
    service.annotations.annotate(capture.id, pinned=True, note="slipped", labels={"cow": "112"})
    annotated = service.archive.document(capture.id)
    assert (annotated.pinned, annotated.note, annotated.labels) == (True, "slipped", {"cow": "112"})
    check(annotated)


def test_the_calibration_in_force_is_the_active_one_of_the_list(service: Service) -> None:
    [row] = listed(service)
    check(row)
    assert row.active
    document = service.active.document(service.instrument(None))
    assert document is not None
    assert document.id == row.id

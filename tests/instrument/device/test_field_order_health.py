"""The sequence of a device's fields: what it shows, says and leaves in a capture."""

import logging
from pathlib import Path

import numpy as np
import pytest
from measured_fields import SETUP, measured_field
from running import running, sealed

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.core.reconstruction.field_order import FieldOrderFit, Order
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.device.field_watch import FieldOrderHealth
from grabberd.library.jobs.measurement import measure_file


def fit(order: Order, shift: float = 1.0) -> FieldOrderFit:
    return FieldOrderFit(order, shift, 0.03, 0.9 * shift, 60)


class Check:
    """Tells what it was given, block by block."""

    def __init__(self, *fits: FieldOrderFit) -> None:
        self.fits = list(fits)

    def add(self, *_: object) -> bool:
        return len(self.fits) > 1

    def fit(self) -> FieldOrderFit:
        return self.fits.pop(0)

    finish = fit


class Measured:
    n, points = 0, None


def health(*fits: FieldOrderFit) -> FieldOrderHealth:
    made = FieldOrderHealth("cup")
    made._check = Check(*fits, fit(Order.NO_MOVEMENT, np.nan))  # type: ignore[assignment]
    for _ in fits:
        made.see(Measured)  # type: ignore[arg-type]
    return made


def test_a_reversed_order_is_said_once_with_its_size_and_what_to_do(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        made = health(*[fit(Order.REVERSED)] * 3, fit(Order.UNCLEAR), fit(Order.REVERSED))
    assert len(caplog.messages) == 1
    assert "zigzag by 0.90 mm" in made.warnings[0]
    assert "--check-field-order" in made.warnings[0]


def test_progressive_pictures_have_no_order_and_leave_none_in_a_capture() -> None:
    made = health(fit(Order.REVERSED))
    made.begin(SETUP, capture=True, interlaced=False)
    for n in range(200):
        made.see(measured_field(n * 20_000_000))
    assert (made.document, made.warnings, made.findings()) == (None, (), {})


def test_a_grabber_that_shows_each_instant_twice_is_to_be_replaced() -> None:
    assert "use another one" in health(fit(Order.SAME_INSTANT, 0.5)).warnings[0]


def test_what_a_movement_told_holds_while_the_object_rests() -> None:
    made = health(fit(Order.NO_MOVEMENT, np.nan), fit(Order.REVERSED), fit(Order.UNCLEAR, np.nan))
    assert made.fit.order is Order.REVERSED
    assert health(fit(Order.REVERSED), fit(Order.RIGHT, 0.0)).warnings == ()


def test_that_the_sequence_is_right_again_is_said_too(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        health(fit(Order.REVERSED), fit(Order.RIGHT, 0.0))
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]


@pytest.mark.parametrize("order", [Order.RIGHT, Order.NO_MOVEMENT, Order.UNCLEAR])
def test_nothing_is_said_where_nothing_is_known_to_be_wrong(order: Order) -> None:
    assert health(fit(order)).warnings == ()


def test_a_capture_keeps_the_gravest_of_its_fits() -> None:
    made = health(fit(Order.RIGHT, 0.0), fit(Order.REVERSED), fit(Order.RIGHT, 0.0))
    assert made.findings()["field_order"]["order"] == "reversed"


def test_what_is_not_known_is_kept_as_nothing() -> None:
    assert health(fit(Order.NO_MOVEMENT, np.nan)).findings()["field_order"]["zigzag_mm"] is None


def test_a_capture_its_document_and_its_device_tell_that_the_order_is_right(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        service.capture_control.start(None, CaptureRequest(fields=300))
        recording = sealed(service)
        document = service.device_document(service.instrument(None))
    assert describe(recording.path).field_order.order is Order.RIGHT
    assert document.field_order.order is Order.RIGHT
    assert document.warnings == []


def test_measuring_a_capture_again_tells_its_order(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        service.capture_control.start(None, CaptureRequest(fields=300))
        path = sealed(service).path
    with CaptureReader(path) as reader:
        made_with = reader.runs[0].made_with
    result = measure_file(lambda _: None, path=path, made_with=made_with)
    assert result.field_order.order is Order.RIGHT
    assert result.warnings == []

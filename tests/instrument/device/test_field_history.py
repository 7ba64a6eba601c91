"""The last minutes of measured fields are kept in so many bytes, whoever looks, and gaps stay gaps."""

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from measured_fields import LINER, SETUP, measured_field

from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.reconstruction.section_width import facing_targets
from grabberd.instrument.device.field_watch import FIELDS, MOST_PAIRS, ROW, FieldHistory

FIELD_NS = 20_000_000


def filled(fields: int, count: int) -> FieldHistory:
    history = FieldHistory(fields)
    for n in range(count):
        history.see(measured_field(n * FIELD_NS), SETUP, 1_000_000)
    return history


def test_five_minutes_of_a_device_take_one_and_a_half_megabytes() -> None:
    assert FIELDS * FIELD_NS == 300e9
    assert FieldHistory()._rows.nbytes == FIELDS * ROW.itemsize < 1_500_000


@pytest.mark.parametrize(("rate_hz", "fields"), [(25.0, 7_500), (59.94, 17_982), (120.0, 36_000)])
def test_it_reaches_back_five_minutes_at_any_rate(rate_hz: float, fields: int) -> None:
    history = filled(8, 3)
    history.keep(rate_hz)
    assert history._rows.nbytes == fields * ROW.itemsize
    assert len(history.since(0).rows) == 0
    history.see(measured_field(9 * FIELD_NS), SETUP, 1_000_000)
    history.keep(rate_hz)
    assert len(history.since(0).rows) == 1, "the rate is the same"


def test_the_newest_fields_are_there_in_the_sequence_of_time_the_oldest_are_forgotten() -> None:
    history = filled(8, 21)
    assert history.since(0).rows["time_ns"].tolist() == [n * FIELD_NS for n in range(13, 21)]
    assert history.since(18 * FIELD_NS).rows["time_ns"].tolist() == [n * FIELD_NS for n in (18, 19, 20)]
    assert len(history.since(99 * FIELD_NS).rows) == 0


def test_a_field_that_was_not_measured_is_not_there() -> None:
    history = FieldHistory(8)
    for n in (0, 1, 5):
        history.see(measured_field(n * FIELD_NS), SETUP, 1_000_000)
    assert (np.diff(history.since(0).rows["time_ns"]) == [FIELD_NS, 4 * FIELD_NS]).all()


def test_a_capture_that_is_measured_anew_does_not_enter_a_field_twice() -> None:
    history = filled(8, 3)
    history.see(measured_field(FIELD_NS), SETUP, 1_000_000)
    assert len(history.since(0).rows) == 3


def test_widths_are_those_of_facing_targets_and_not_known_without_one_of_them() -> None:
    history = FieldHistory(4)
    history.see(measured_field(FIELD_NS), SETUP, 1_000_000)
    history.see(measured_field(2 * FIELD_NS, wider=1.1), SETUP, 1_000_000)
    history.see(measured_field(3 * FIELD_NS, without=[facing_targets(LINER)[0][0]]), SETUP, 1_000_000)
    found = history.since(0)
    assert found.pairs == facing_targets(LINER)[:MOST_PAIRS]
    first, wider, lacking = found.rows["width_mm"][:, 0]
    assert wider == pytest.approx(1.1 * first)
    assert np.isnan(lacking)


def test_with_another_object_it_begins_anew() -> None:
    history = filled(8, 3)
    other = replace(LINER, target=LINER.target + 1000)
    setup = SimpleNamespace(object_model=other, calibration=SETUP.calibration)
    history.see(measured_field(9 * FIELD_NS), cast("MeasureSetup", setup), 1_000_000)
    found = history.since(0)
    assert len(found.rows) == 1
    assert found.pairs[0][0] > 1000


def test_who_reads_while_fields_come_gets_whole_ones_in_order() -> None:
    history, ended = FieldHistory(64), threading.Event()

    def write() -> None:
        for n in range(3000):
            history.see(measured_field(n * FIELD_NS), SETUP, n * 1_000_000)
        ended.set()

    thread = threading.Thread(target=write)
    thread.start()
    while not ended.is_set():
        rows = history.since(0).rows
        assert (np.diff(rows["time_ns"]) == FIELD_NS).all()
        assert (rows["latency_ms"] == rows["time_ns"] // FIELD_NS).all()
    thread.join()

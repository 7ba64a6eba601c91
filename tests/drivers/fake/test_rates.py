"""The simulated camera at other rates than PAL's, and with progressive pictures."""

import numpy as np
import pytest

from grabberd.core.field import PROGRESSIVE, FieldOrder
from grabberd_fake import FakeGrabber, JumpingClock
from grabberd_fake.stamp import read_stamp

RATES_HZ = [25.0, 59.94, 60.0, 100.0, 120.0]


def taken(count, clock=None, pace="free", faults=(), **driver):
    grabber = FakeGrabber(pace=pace, clock=clock or JumpingClock(), driver=driver, faults=list(faults))
    info, fields = grabber.open(), []
    while len(fields) < count:
        with grabber.dequeue(1.0) as some:
            fields += [(one, one.field.luma.copy()) for one in some]
    return info, fields[:count]


@pytest.mark.parametrize("order", ["alternate", "progressive", "top_first"])
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_fields_come_at_the_rate_that_was_asked_for(rate_hz, order):
    info, fields = taken(12, rate_hz=rate_hz, order=order)
    assert info.rate_hz == rate_hz
    times_ns = [one.time_ns for one, _ in fields]
    assert np.diff(times_ns) == pytest.approx(1e9 / rate_hz, abs=1)
    assert [read_stamp(luma).number - read_stamp(fields[0][1]).number for _, luma in fields] == list(
        range(12)
    )


def test_progressive_pictures_have_all_lines_of_one_moment_and_no_standard():
    info, fields = taken(4, rate_hz=120.0, order="progressive")
    assert (info.field_order, info.field_rows, info.standard) == (FieldOrder.PROGRESSIVE, 576, "")
    assert {(one.field.parity, one.field.y0, one.field.y_step) for one, _ in fields} == {(PROGRESSIVE, 0, 1)}
    # Lines of both parities lie on one picture: each is nearly the mean of its neighbours, noise aside.
    luma = fields[0][1].astype(float)
    between = luma[1:-1] - (luma[:-2] + luma[2:]) / 2
    assert np.abs(between.mean()) < 0.2
    assert between.std() < 0.1 * luma.std() + 6


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_faults_in_seconds_last_for_as_many_fields_as_come_in_them(rate_hz):
    faults = [
        {"kind": "damage", "at_s": 0.2, "count": 1},
        {"kind": "no_signal", "at_s": 0.4, "duration_s": 0.2},
    ]
    _, fields = taken(round(0.8 * rate_hz), rate_hz=rate_hz, order="progressive", faults=faults)
    damaged = [n for n, (one, _) in enumerate(fields) if one.damage]
    dark = [n for n, (_, luma) in enumerate(fields) if luma.std() == 0]
    assert damaged == [np.ceil(0.2 * rate_hz - 1e-9)]
    assert [dark[0], len(dark)] == [np.ceil(0.4 * rate_hz - 1e-9), np.ceil(0.2 * rate_hz - 1e-9)]

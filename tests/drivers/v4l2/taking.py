"""Fields taken from a bench, until there are enough or none come any more."""

from dataclasses import replace

import pytest

from drivers.v4l2.fake_kernel import number_in
from instrument.acquisition.streams import numbers

SECOND_NS = 1_000_000_000


def take(bench, count=40, timeout_s=0.25):
    """The next fields with their pictures copied."""
    taken = []
    while len(taken) < count:
        with bench.grabber.dequeue(timeout_s) as fields:
            assert fields, "nothing came in time"
            taken += [one._replace(field=replace(one.field, luma=one.field.luma.copy())) for one in fields]
    return taken


def numbered(bench, fields):
    return numbers(fields, bench.info, bench.grabber.signal())


def first_picture(fields):
    return number_in(fields[0].field.luma)


def fails(bench, error, timeout_s=0.25):
    before_ns = bench.kernel.time_ns
    with pytest.raises(error) as caught, bench.grabber.dequeue(timeout_s):
        pass
    assert caught.value.hint
    assert bench.kernel.time_ns - before_ns <= SECOND_NS
    return caught.value


def until_it_fails(bench, seconds):
    """Takes fields and asks for the signal once a second, as the capture thread does."""
    end_ns = bench.kernel.time_ns + seconds * SECOND_NS
    asked_ns = 0
    while bench.kernel.time_ns < end_ns:
        take(bench, 1)
        if bench.kernel.time_ns - asked_ns >= SECOND_NS:
            asked_ns = bench.kernel.time_ns
            bench.grabber.signal()

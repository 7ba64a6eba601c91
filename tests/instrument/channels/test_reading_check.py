"""What a driver gives is checked before anybody relies on it."""

import numpy as np
import pytest
from scripted_loggers import INFO, STEP_NS, readings_at

from grabberd.errors import StreamFailed
from grabberd.instrument.channels.logger_thread import AHEAD_NS, NOT_FINITE, TIME_AHEAD, TIME_BACK, checked

NOW_NS = 1000 * STEP_NS


def looked_at(readings, last_ns=0):
    return checked(readings, INFO, last_ns, NOW_NS)


def reasons(readings):
    return [(one.reason, one.lost) for one in readings.anomalies]


def test_sound_readings_stay_as_they_are() -> None:
    given = readings_at(np.arange(900, 910) * STEP_NS)
    found = looked_at(given)
    np.testing.assert_array_equal(found.time_ns, given.time_ns)
    np.testing.assert_array_equal(found.values, given.values)
    assert found.anomalies == ()


def test_times_that_go_back_are_left_out_and_counted() -> None:
    found = looked_at(readings_at(np.array([900, 902, 901, 902, 903]) * STEP_NS))
    assert (found.time_ns // STEP_NS).tolist() == [900, 902, 903]
    assert reasons(found) == [(TIME_BACK, 2)]


def test_a_clock_that_was_set_back_between_two_reads_is_noticed() -> None:
    found = looked_at(readings_at(np.arange(900, 910) * STEP_NS), last_ns=904 * STEP_NS)
    assert (found.time_ns // STEP_NS).tolist() == [905, 906, 907, 908, 909]
    assert reasons(found) == [(TIME_BACK, 5)]


def test_a_time_far_ahead_does_not_spoil_those_after_it() -> None:
    found = looked_at(readings_at([900 * STEP_NS, NOW_NS + AHEAD_NS + 1, 901 * STEP_NS]))
    assert (found.time_ns // STEP_NS).tolist() == [900, 901]
    assert reasons(found) == [(TIME_AHEAD, 1)]


def test_infinity_is_no_reading() -> None:
    given = readings_at(np.arange(900, 903) * STEP_NS)
    given.values[1, 2] = np.inf
    found = looked_at(given)
    assert np.isnan(found.values[1, 2])
    assert np.isfinite(found.values[1, :2]).all()
    assert reasons(found) == [(NOT_FINITE, 1)]


def test_readings_of_other_columns_are_a_fault_of_the_driver() -> None:
    given = readings_at([900 * STEP_NS])
    with pytest.raises(StreamFailed, match="3 columns"):
        looked_at(given._replace(values=given.values[:, :2]))

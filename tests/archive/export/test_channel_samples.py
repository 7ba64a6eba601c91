"""Channels at a multiple of the fields' rate, for formats that know no times."""

import numpy as np
import pytest

from archive.captures import PERIOD_NS, START_NS, slot, slots, write
from archive.readings import STEP_NS, readings, write_with_channels
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.channels_export import channel_samples

FIELDS = 50


def samples_of(path, first_n=0, fields=FIELDS):
    with CaptureReader(path) as reader:
        return channel_samples(reader, first_n, fields)


def test_there_are_as_many_to_a_field_as_come_nearest_to_the_readings(tmp_path):
    made = samples_of(write_with_channels(tmp_path, slots(FIELDS)))
    assert made.per_field == PERIOD_NS // STEP_NS == 4
    assert made.values.shape == (4 * FIELDS, 2)
    assert [one.name for one in made.channels] == ["pulsation", "liner"]


def test_each_is_the_mean_of_the_readings_round_its_time(tmp_path):
    made = samples_of(write_with_channels(tmp_path, slots(FIELDS)))
    expected = 101.3 - 0.1 * readings(0, 4 * FIELDS).value
    np.testing.assert_allclose(made.values[:, 0], expected, rtol=1e-6)


def test_a_lost_field_has_its_samples_too(tmp_path):
    lost = 5
    taken = [*slots(10), *(slot(n, lost=lost if n == 10 + lost else 0) for n in range(10 + lost, FIELDS))]
    made = samples_of(write_with_channels(tmp_path, taken))
    expected = 101.3 - 0.1 * readings(0, 4 * FIELDS).value
    # A commit's readings begin with its first field: there are none for the last fields of the first commit.
    known = np.r_[0 : 4 * 25, 4 * 30 : 4 * FIELDS]
    np.testing.assert_allclose(made.values[known, 0], expected[known], rtol=1e-6)
    assert np.isnan(made.values[4 * 25 : 4 * 30]).all()


def test_a_step_without_a_reading_is_no_number_and_nothing_is_filled_in(tmp_path):
    taken = [*slots(10), *(slot(n, lost=20 if n == 30 else 0) for n in range(30, FIELDS))]
    made = samples_of(write_with_channels(tmp_path, taken))
    assert np.isfinite(made.values[: 4 * 25]).all()
    assert np.isnan(made.values[4 * 25 : 4 * 45]).all()
    assert np.isfinite(made.values[4 * 45 :]).all()


def test_readings_beyond_the_fields_are_left_out(tmp_path):
    path = write_with_channels(tmp_path, slots(FIELDS))
    made = samples_of(path, fields=20)
    assert made.values.shape == (80, 2)
    expected = 101.3 - 0.1 * readings(0, 80).value
    np.testing.assert_allclose(made.values[:, 0], expected, rtol=1e-6)


def test_a_capture_without_channels_or_fields_has_none(tmp_path):
    assert samples_of(write(tmp_path, slots(5))) is None
    assert samples_of(write_with_channels(tmp_path, slots(5), name="other"), fields=0) is None


@pytest.mark.parametrize("n", [0, 7])
def test_the_first_sample_of_a_field_is_at_the_fields_own_time(tmp_path, n):
    made = samples_of(write_with_channels(tmp_path, slots(FIELDS)))
    at = readings(4 * n, 1)
    assert at.time_ns[0] == START_NS + n * PERIOD_NS
    assert made.values[4 * n, 0] == pytest.approx(101.3 - 0.1 * at.value[0])

"""The channels of a capture as an analysis takes them."""

import numpy as np
import pytest

import archive.readings
from archive.captures import PERIOD_NS, slots, write
from archive.readings import SIGMA_NS, STEP_NS, readings, write_with_channels
from grabberd.core.channels import Dating, Quantity
from grabberd.errors import InputError
from grabberd_liner.analyses.source import channel_curves, recorded_channels

BOTH = {"vacuum": {"pulsation": "channel", "liner": "channel"}}
FIELDS = 60


def test_they_are_on_the_time_axis_of_the_points_in_kpa(tmp_path):
    found = channel_curves(write_with_channels(tmp_path, slots(FIELDS)), BOTH)
    expected = readings(0, FIELDS * PERIOD_NS // STEP_NS)
    pulsation = found["pulsation"]
    np.testing.assert_allclose(pulsation.time_s, (expected.time_ns - expected.time_ns[0]) / 1e9)
    np.testing.assert_allclose(pulsation.kpa, 101.3 - 0.1 * expected.value)
    assert pulsation.sigma_kpa == 0.2
    assert pulsation.time_sigma_s == pytest.approx(np.hypot(SIGMA_NS / 1e9, 0.0))


def test_their_origin_is_told_with_the_date_of_the_calibration(tmp_path):
    found = channel_curves(write_with_channels(tmp_path, slots(FIELDS)), BOTH)
    assert (
        found["pulsation"].origin == "channel pulsation of this capture (logger tank, calibrated 2026-02-03)"
    )
    assert found["liner"].origin == "channel liner of this capture (logger tank, never calibrated)"
    assert found["liner"].remark is None


def test_times_of_arrival_are_remarked_upon(tmp_path):
    path = write_with_channels(tmp_path, slots(FIELDS), dating=Dating.ARRIVAL)
    remark = channel_curves(path, BOTH)["pulsation"].remark
    assert "dated by their arrival" in remark
    assert "taken as 0 ms (σ 0)" in remark


def test_only_those_that_the_inputs_refer_to_are_read(tmp_path):
    path = write_with_channels(tmp_path, slots(FIELDS))
    one = {"vacuum": {"pulsation": "channel", "liner": {"kpa": 40, "sigma_kpa": 1}}}
    assert list(channel_curves(path, one)) == ["pulsation"]
    for inputs in ({}, {"vacuum": None}, {"vacuum": "channel"}, {"vacuum": {"pulsation": "log"}}):
        assert channel_curves(path, inputs) == {}


def test_milk_flow_is_read_where_the_inputs_say_what_it_means(tmp_path):
    # A capture without that channel has none, and the inputs' reader says so.
    path = write_with_channels(tmp_path, slots(FIELDS))
    assert channel_curves(path, {"milk_flow": "high"}) == {}
    assert list(channel_curves(path, {**BOTH, "milk_flow": "low"})) == ["pulsation", "liner"]


def test_a_capture_without_channels_has_none_to_give(tmp_path):
    with pytest.raises(InputError, match=r"vacuum\.pulsation is to come from the capture's own channel"):
        channel_curves(write(tmp_path, slots(3)), BOTH)


def test_what_was_recorded_is_told_without_the_inputs(tmp_path):
    found = recorded_channels(write_with_channels(tmp_path, slots(FIELDS)))
    assert found == {"pulsation": ("pulsation",), "liner": ("liner",)}


def test_a_channel_may_be_named(tmp_path):
    path = write_with_channels(tmp_path, slots(FIELDS))
    assert list(channel_curves(path, {"vacuum": {"liner": {"channel": "liner"}}})) == ["liner"]
    with pytest.raises(InputError, match="channel pulsation, and it has none"):
        channel_curves(path, {"vacuum": {"liner": {"channel": "pulsation"}}})


def test_nothing_was_recorded_without_channels(tmp_path):
    assert recorded_channels(write(tmp_path, slots(3))) == {}


def test_two_channels_of_milk_flow_are_refused_for_what_they_are(tmp_path, monkeypatch):
    both = tuple(one._replace(quantity=Quantity.FLOW) for one in archive.readings.CHANNELS)
    monkeypatch.setattr(archive.readings, "CHANNELS", both)
    path = write_with_channels(tmp_path, slots(FIELDS))
    with pytest.raises(InputError, match="milk_flow: the channels pulsation and liner of this capture"):
        channel_curves(path, {"milk_flow": "high"})

"""Channels of one capture: from its first field to its last, whatever loggers do, and never in its way."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording_rig import Rig, wait_until_written
from scripted_loggers import CHANNELS, COLUMNS, CONFIG, INFO, STEP_NS, ScriptedLogger, setup_of
from simulated_time import SimulatedClock
from slots import PERIOD_NS, slot

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.verification import verify
from grabberd.core.channels import Anomaly, Dating
from grabberd.documents.enums import DeviceState
from grabberd.errors import DeviceLost
from grabberd.instrument.channels.feed import (
    LAST_NS,
    MARGIN_NS,
    OTHER_CLOCK,
    OTHER_UNIT,
    UNKNOWN_UNIT,
    Part,
    calibration_of,
)
from grabberd.instrument.channels.loggers import Loggers

FIELDS = 50
LAST = 49 * PERIOD_NS // STEP_NS
BEGIN_N = 500
"""The stream's number of the first field."""
BEGIN_NS = BEGIN_N * PERIOD_NS


class Recorded:
    """A capture with the channels of one logger, whose readings the test gives."""

    def __init__(self, folder: Path, fields: int | None = FIELDS, *, same_clock: bool = True) -> None:
        self.loggers = Loggers({"tank": setup_of(ScriptedLogger(SimulatedClock()))}, SimulatedClock())
        self.one = self.loggers._loggers["tank"]
        self.one.board.opened(INFO)
        self.calibrations = tuple(calibration_of(one, CONFIG, INFO) for one in CHANNELS)
        self.same_clock = same_clock
        self.folder, self.fields = folder, fields

    def begin(self) -> None:
        channels = self.loggers.follow("simulated", same_clock=self.same_clock)
        assert channels is not None
        self.rig = Rig(self.folder, self.fields, 1000, measured=False, channels=channels)
        self.rig.recording.start()

    def put(self, first: int, count: int, *anomalies: Anomaly) -> None:
        """Readings from one on; reading 0 is taken with field 0."""
        steps = first + np.arange(count)
        time_ns = BEGIN_NS + steps * STEP_NS
        values = np.column_stack([steps, np.full(count, 42.0)])
        self.one.feed.put(Part(0, time_ns, values, values, self.calibrations, Dating.MONOTONIC, 9, anomalies))
        self.one.board.came(count, anomalies)

    def read(self):
        """Times of both channels in steps, the account, and the capture's verdict."""
        with self.rig.sealed() as reader:
            found = [steps_of(reader.channels.read(one.name)) for one in CHANNELS]
            return found, reader.channels.account, reader.meta.complete


def steps_of(readings):
    return ((readings.time_ns - BEGIN_NS) // STEP_NS).tolist()


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    return Recorded(tmp_path)


def fields_of(recorded: Recorded, count: int = FIELDS) -> None:
    recorded.rig.put(*(slot(BEGIN_N + n) for n in range(count)))


def test_the_readings_are_those_from_the_first_field_to_the_last_with_a_margin(recorded: Recorded) -> None:
    recorded.put(-300, 400)
    recorded.begin()
    recorded.put(100, 300)
    fields_of(recorded)
    (pulsation, liner), account, _ = recorded.read()
    assert pulsation == list(range(-MARGIN_NS // STEP_NS, LAST + MARGIN_NS // STEP_NS + 1))
    assert liner == pulsation
    assert account.in_words == "complete"
    assert verify(recorded.rig.recording.path).damages == []


def test_values_are_those_of_the_channels_columns(recorded: Recorded) -> None:
    recorded.begin()
    recorded.put(-30, 300)
    fields_of(recorded)
    with recorded.rig.sealed() as reader:
        assert reader.channels.read("pulsation").value[:2].tolist() == [-25.0, -24.0]
        assert set(reader.channels.read("liner").value) == {42.0}
        assert reader.channels.channel("pulsation").source["column"] in COLUMNS


def test_a_logger_that_stops_is_a_gap_of_the_channel_and_the_fields_are_complete(recorded: Recorded) -> None:
    recorded.begin()
    recorded.put(-30, 60)
    recorded.one.board.enter(DeviceState.ABSENT, DeviceLost("it was unplugged", ""))
    recorded.one.feed.put(Part.interrupted(BEGIN_NS + 30 * STEP_NS, "unplugged"))
    fields_of(recorded)
    _, account, complete = recorded.read()
    assert complete
    assert [(one.gap_count, one.gaps[0].reason) for one in account.channels] == [(1, "unplugged")] * 2
    assert account.verdict == "with gaps"


def test_a_logger_that_is_not_there_delays_nothing(recorded: Recorded) -> None:
    recorded.one.board.enter(DeviceState.ABSENT, DeviceLost("there is no such port", ""))
    recorded.begin()
    fields_of(recorded)
    (pulsation, _), account, complete = recorded.read()
    assert (pulsation, complete) == ([], True)
    assert account.channels[0].gaps[0].reason == "there is no such port"


def test_one_that_hangs_holds_the_seal_up_no_longer_than_its_deadline(recorded: Recorded) -> None:
    recorded.begin()
    recorded.put(0, 10)
    fields_of(recorded)
    wait_until_written(recorded.rig, FIELDS)
    assert not recorded.rig.recording.sealed.wait(0.3) or recorded.rig.clock.now_ns() > LAST_NS
    recorded.loggers._clock.sleep(LAST_NS / 1e9)
    _, account, complete = recorded.read()
    assert complete
    assert account.channels[0].gap_count == 1


def test_anomalies_of_the_capture_are_counted_and_earlier_ones_are_not(recorded: Recorded) -> None:
    recorded.put(-900, 1, Anomaly(BEGIN_NS - 900 * STEP_NS, "not a number", "old", 1))
    recorded.begin()
    recorded.put(-30, 300, Anomaly(BEGIN_NS + 3 * STEP_NS, "not a number", "4x2", 2))
    fields_of(recorded)
    _, account, _ = recorded.read()
    assert [one[:4] + one[5:] for one in account.anomalies] == [("tank", "not a number", 1, 2, "4x2")]
    assert account.in_words == "with gaps: tank: 1 × not a number"


def test_a_channel_without_a_value_is_not_filled_in(recorded: Recorded) -> None:
    recorded.begin()
    time_ns = BEGIN_NS + np.arange(-30, 300) * STEP_NS
    values = np.column_stack([np.where(np.arange(330) % 2, np.nan, 1.0), np.full(330, 42.0)])
    recorded.one.feed.put(Part(0, time_ns, values, values, recorded.calibrations, Dating.MONOTONIC, 9))
    recorded.one.board.came(330, ())
    fields_of(recorded)
    (pulsation, liner), account, _ = recorded.read()
    assert len(liner) == 2 * len(pulsation) or abs(len(liner) - 2 * len(pulsation)) == 1
    assert account.complete


def test_fields_of_another_clock_have_no_channels_and_it_is_said(tmp_path: Path) -> None:
    recorded = Recorded(tmp_path, same_clock=False)
    recorded.begin()
    recorded.put(-30, 300)
    fields_of(recorded)
    (pulsation, _), account, complete = recorded.read()
    assert (pulsation, complete) == ([], True)
    assert {one.gaps[0].reason for one in account.channels} == {OTHER_CLOCK}


def test_a_capture_that_has_ended_follows_no_longer(recorded: Recorded) -> None:
    recorded.begin()
    recorded.put(-30, 300)
    fields_of(recorded)
    recorded.rig.sealed().close()
    assert recorded.one.feed.followers == set()


def test_what_is_committed_holds_the_readings_too(tmp_path: Path) -> None:
    recorded = Recorded(tmp_path, fields=None)
    recorded.begin()
    recorded.put(-30, 300)
    fields_of(recorded)
    wait_until_written(recorded.rig, FIELDS)
    with CaptureReader(recorded.rig.recording.path) as reader:
        last = steps_of(reader.channels.read("pulsation"))[-1]
    assert last == LAST + MARGIN_NS // STEP_NS
    recorded.rig.recording.stop("stopped by the operator")
    recorded.rig.sealed().close()


def test_a_logger_that_comes_back_in_another_unit_is_not_mixed_with_what_was_there(
    recorded: Recorded,
) -> None:
    recorded.begin()
    recorded.put(-30, 130)
    was = recorded.calibrations
    recorded.calibrations = tuple(one._replace(unit="mbar", gain=0.1) for one in was)
    recorded.put(100, 200)
    fields_of(recorded)
    (pulsation, _), account, _ = recorded.read()
    assert pulsation[-1] == 99
    assert {(one.reason, one.example) for one in account.anomalies} == {(OTHER_UNIT, "pulsation: mbar")}
    assert account.verdict == "with gaps"


def test_a_unit_that_the_logger_states_later_is_that_of_the_channel(recorded: Recorded) -> None:
    setup = replace(recorded.one.setup, channels=tuple(replace(one, unit=None) for one in CHANNELS))
    recorded.one = recorded.loggers._loggers["tank"] = replace(recorded.one, setup=setup)
    recorded.one.board._status = replace(recorded.one.board.now, info=None)
    recorded.begin()
    assert recorded.rig.recording._channels.channels[0].calibration.unit == UNKNOWN_UNIT
    recorded.put(-30, 330)
    fields_of(recorded)
    with recorded.rig.sealed() as reader:
        assert [one.calibration.unit for one in reader.channels.all] == ["kPa", "kPa"]

"""All loggers of a service: what they tell, whose captures they belong to, and that they end in time."""

import threading
from dataclasses import replace

import numpy as np
from scripted_loggers import CHANNELS, INFO, ScriptedLogger, readings_at, setup_of
from simulated_time import SimulatedClock
from slots import ManualClock

from grabberd.core.channels import Anomaly, Dating
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause, DeviceAbsent
from grabberd.fault_board import FaultBoard
from grabberd.instrument.channels.feed import Part
from grabberd.instrument.channels.logger_board import DOUBTFUL_NS, STUCK, STUCK_S
from grabberd.instrument.channels.loggers import STOP_S, Loggers
from grabberd.runtime import SystemClock

ABSENT = DeviceAbsent("there is no such port", "plug it in")


def watched(*names):
    """Loggers in manual time, their boards, and what is told of them."""
    clock = ManualClock()
    faults = FaultBoard(clock)
    setups = {name: setup_of(ScriptedLogger(SimulatedClock()), name) for name in names}
    loggers = Loggers(setups, clock, faults)
    return clock, faults, loggers, [loggers._loggers[name].board for name in names]


def test_all_that_give_nothing_are_one_fault_with_what_to_do() -> None:
    _, faults, _, (tank, hose) = watched("tank", "hose")
    tank.enter(DeviceState.ABSENT, ABSENT)
    hose.enter(DeviceState.FAILED, DeviceAbsent("no such topic", "plug it in"))
    (fault,) = faults.now
    assert (fault.cause_code, fault.level) == (Cause.LOGGER_FAILED, "fault")
    assert fault.message == "no readings: tank: there is no such port; hose: no such topic"
    assert fault.hint == "plug it in; captures go on without these channels"
    tank.came(1, ())
    hose.came(1, ())
    assert faults.now == []


def test_doubtful_readings_are_a_warning_until_there_have_been_none_for_a_while() -> None:
    clock, faults, loggers, (tank,) = watched("tank")
    tank.came(1, (Anomaly(0, "not a number", "4x2", 1),))
    (fault,) = faults.now
    assert (fault.cause_code, fault.level) == (Cause.LOGGER_DOUBTFUL, "warning")
    assert fault.message == "doubtful readings: tank: not a number (4x2)"
    clock.advance(DOUBTFUL_NS / 1e9 + 1)
    tank.came(1, ())
    loggers.look()
    assert faults.now == []


def test_a_driver_that_does_not_return_is_found_by_looking() -> None:
    clock, faults, loggers, (tank,) = watched("tank")
    tank.came(1, ())
    clock.advance(STUCK_S + 1)
    loggers.look()
    assert [one.message for one in faults.now] == [f"no readings: tank: {STUCK}"]
    tank.came(1, ())
    loggers.look()
    assert faults.now == []


def test_the_document_has_the_mean_of_the_newest_readings_in_kpa() -> None:
    clock, _, loggers, (tank,) = watched("tank")
    tank.opened(INFO)
    for k, kpa in enumerate((30.0, 40.0, 41.0)):
        found = readings_at([k], kpa=kpa)
        time_ns = clock.now_ns() - (3_000_000_000 if k == 0 else 0)
        values = found.values[:, [1, 0]]
        loggers._loggers["tank"].feed.put(Part(time_ns, found.time_ns, values, values, (), INFO.dating, 0))
    tank.came(3, ())
    document = loggers.document()["tank"]
    assert (document.state, document.model, document.readings) == ("ready", "scripted logger", 3)
    assert {name: one.kpa for name, one in document.channels.items()} == {"pulsation": 41.5, "liner": 40.5}
    assert document.channels["liner"].calibrated == "2026-02-03"


def test_a_logger_is_unsettled_until_its_clock_is_known_to_the_wanted_sigma() -> None:
    _, _, loggers, (tank,) = watched("tank")
    own_clock = replace(INFO, dating=Dating.OWN_CLOCK)
    assert loggers.unsettled(1000) == ["tank"]
    tank.opened(own_clock)
    tank.came(1, ())
    assert loggers.unsettled(1000) == ["tank"]
    kpa = readings_at([1]).values[:, :2]
    for time_ns, sigma_ns, unsettled in ((1, 1001, ["tank"]), (2, 1000, [])):
        part = Part(time_ns, np.array([time_ns]), kpa, kpa, (), own_clock.dating, sigma_ns)
        loggers._loggers["tank"].feed.put(part)
        assert loggers.unsettled(1000) == unsettled


def test_waiting_settles_neither_a_logger_that_failed_nor_one_without_a_clock() -> None:
    _, _, loggers, (tank, hose) = watched("tank", "hose")
    tank.enter(DeviceState.ABSENT, ABSENT)
    hose.opened(replace(INFO, dating=Dating.ARRIVAL))
    hose.came(1, ())
    assert loggers.unsettled(1000) == []


def test_a_logger_that_gives_nothing_shows_no_old_value() -> None:
    clock, _, loggers, (tank,) = watched("tank")
    tank.opened(INFO)
    kpa = readings_at([1]).values[:, :2]
    loggers._loggers["tank"].feed.put(Part(clock.now_ns(), np.array([1]), kpa, kpa, (), INFO.dating, 0))
    tank.came(1, ())
    clock.advance(2)
    assert loggers.document()["tank"].channels["pulsation"].kpa is None


def test_captures_record_the_channels_of_their_device() -> None:
    clock = ManualClock()
    left = setup_of(None, "a", (replace(CHANNELS[0], devices=("left",)), CHANNELS[1]))
    right = setup_of(None, "b", (replace(CHANNELS[0], devices=("right",)),))
    loggers = Loggers({"a": left, "b": right}, clock)

    def recorded(device):
        found = loggers.follow(device, same_clock=True)
        return [(one.channel, one.name, one.logger) for one in found.channels]

    assert recorded("left") == [(0, "pulsation", "a"), (1, "liner", "a")]
    assert recorded("right") == [(0, "liner", "a"), (1, "pulsation", "b")]
    assert Loggers({}, clock).follow("left", same_clock=True) is None


def test_a_logger_that_hangs_holds_the_end_up_no_longer_than_its_deadline() -> None:
    hangs, opened = threading.Event(), threading.Event()

    class Hanging(ScriptedLogger):
        def open(self):
            opened.set()
            hangs.wait(30)
            return super().open()

    loggers = Loggers({"tank": setup_of(Hanging(SimulatedClock()))}, SystemClock())
    loggers.start()
    assert opened.wait(10)
    begin_ns = SystemClock().now_ns()
    loggers.stop()
    assert SystemClock().now_ns() - begin_ns < (STOP_S + 5) * 1e9
    hangs.set()

"""The wall and the vacuum of the last second have one clock, and a message that is missed leaves no gap."""

import json
from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from measured_fields import LINER, SETUP, measured_field
from scripted_loggers import CHANNELS, INFO, setup_of
from slots import ManualClock

from grabberd.instrument.channels.feed import Part
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.device.field_watch import FieldHistory
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import SPAN_NS, curves_document, curves_message

SECOND_NS = 1_000_000_000
FIELD_NS = 20_000_000


class Stage:
    """A device and its loggers in manual time; fields and readings are put in by hand."""

    def __init__(self, channels: Any = CHANNELS) -> None:
        self.clock = ManualClock(100 * SECOND_NS)
        self.loggers = Loggers({"tank": setup_of(None, "tank", channels)}, self.clock)
        self.history = FieldHistory()
        device = SimpleNamespace(name="left", worker=SimpleNamespace(history=self.history))
        self.device = cast("Instrument", device)

    def measured(self, time_ns: int, wider: float = 1.0, without: Iterable[int] = ()) -> None:
        self.history.see(measured_field(time_ns, wider, without), SETUP, 2_000_000)

    def read(self, time_ns: Iterable[int], kpa: Iterable[float]) -> None:
        """Readings of the first channel; the second shows half of them."""
        both = np.array(list(kpa))[:, None] * [1.0, 0.5]
        times = np.array(list(time_ns))
        part = Part(self.clock.now_ns(), times, both, both, (), INFO.dating, 0)
        self.loggers._loggers["tank"].feed.put(part)

    def message(self) -> dict[str, Any]:
        made = curves_message(self.device, self.loggers, self.clock)
        assert made is not None
        document = json.loads(made)
        assert isinstance(document, dict)
        return document


def test_the_width_of_every_field_stands_on_the_clock_of_the_readings() -> None:
    stage = Stage()
    now_ns = stage.clock.now_ns()
    stage.measured(now_ns - 2 * FIELD_NS)
    stage.measured(now_ns - FIELD_NS, wider=1.1)
    stage.read([now_ns - 15_000_000, now_ns - 11_000_000], [40.0, 42.0])
    message = stage.message()
    assert message["now_s"] == 100.0
    assert message["time_s"] == [99.96, 99.98]
    outermost = message["widths"][0]
    assert outermost["targets"] == [49, 54]
    assert outermost["width_mm"][1] == pytest.approx(1.1 * outermost["width_mm"][0], abs=2e-3)
    pulsation, liner = message["channels"]
    assert (pulsation["name"], pulsation["quantity"], pulsation["logger"]) == ("pulsation",) * 2 + ("tank",)
    assert (pulsation["time_s"], pulsation["kpa"]) == ([99.99], [41.0])
    assert liner["kpa"] == [20.5]


def test_a_target_that_was_not_found_leaves_its_width_out() -> None:
    stage = Stage()
    stage.measured(stage.clock.now_ns(), without=[54])
    first, second, *_ = stage.message()["widths"]
    assert first["width_mm"] == [None]
    assert second["width_mm"][0] > 0


def test_each_message_has_the_whole_last_second_so_that_one_may_be_missed() -> None:
    stage = Stage()
    for _ in range(60):
        stage.clock.ns += FIELD_NS
        stage.measured(stage.clock.now_ns())
        stage.read([stage.clock.now_ns()], [40.0])
    message = stage.message()
    times = message["time_s"]
    assert times == pytest.approx(np.arange(times[0], message["now_s"] + 1e-9, 0.02).tolist())
    assert message["now_s"] - times[0] == pytest.approx(SPAN_NS / 1e9)
    assert len(message["channels"][0]["kpa"]) >= 50


def test_a_time_without_readings_has_no_entry() -> None:
    stage = Stage()
    now_ns = stage.clock.now_ns()
    stage.read([now_ns - 500_000_000, now_ns - 490_000_000, now_ns - 10_000_000], [40.0, np.nan, 41.0])
    pulsation = stage.message()["channels"][0]
    assert (pulsation["time_s"], pulsation["kpa"]) == ([99.51, 99.99], [40.0, 41.0])


def test_nothing_is_sent_while_nothing_comes() -> None:
    stage = Stage()
    assert curves_message(stage.device, stage.loggers, stage.clock) is None
    stage.measured(stage.clock.now_ns())
    assert curves_message(stage.device, stage.loggers, stage.clock) is not None
    stage.clock.advance(1.5)
    assert curves_message(stage.device, stage.loggers, stage.clock) is None


def test_channels_of_another_device_are_not_shown() -> None:
    stage = Stage((replace(CHANNELS[0], devices=("right",)), CHANNELS[1]))
    stage.read([stage.clock.now_ns()], [40.0])
    assert [one["name"] for one in stage.message()["channels"]] == ["liner"]


def test_a_capture_that_is_measured_from_its_first_field_on_does_not_go_back_in_time() -> None:
    stage = Stage()
    now_ns = stage.clock.now_ns()
    for time_ns in (now_ns - FIELD_NS, now_ns - 5 * FIELD_NS, now_ns):
        stage.measured(time_ns)
    assert stage.message()["time_s"] == [99.98, 100.0]


def test_each_field_has_its_targets_points_residual_and_latency() -> None:
    stage = Stage()
    stage.measured(stage.clock.now_ns(), without=[54])
    message = stage.message()
    count = len(LINER.target) - 1
    assert message["targets"] == {"left": [2], "right": [1]}
    assert (message["points"], message["residual_px"], message["latency_ms"]) == ([count], [0.25], [2.0])
    assert message["now_utc_s"] == stage.clock.utc_now().timestamp()
    assert message["widths"][1]["sigma_mm"][0] == pytest.approx(0.0141, abs=1e-4)


def test_the_last_minutes_are_there_for_who_looks_later() -> None:
    stage = Stage()
    for _ in range(90):
        stage.clock.advance(1.0)
        stage.measured(stage.clock.now_ns())
        stage.read([stage.clock.now_ns()], [40.0])
    curves = curves_document(stage.device, stage.loggers, stage.clock, 60 * SECOND_NS)
    assert (curves.time_s[0], curves.time_s[-1]) == (130.0, 190.0)
    assert curves.channels[0].kpa == [40.0] * len(curves.time_s)

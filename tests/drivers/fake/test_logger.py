"""The simulated logger: the simulated grabber's vacuum, by a clock of its own, with its faults."""

import numpy as np
import pytest

from grabberd.core.channels import Anomaly
from grabberd.core.channels.dating import CLOCK_JUMPED, MISSING
from grabberd.errors import DeviceAbsent, DeviceLost
from grabberd.testing import ManualClock
from grabberd_fake import FakeLogger, FakeOptions
from grabberd_fake.vacuum import pulsation_kpa

S = 1_000_000_000


class Run:
    """A logger that was read for a while."""

    def __init__(self, seconds: float, **options: object) -> None:
        self.clock = ManualClock()
        self.start_ns = self.clock.time_ns
        self.logger = FakeLogger(clock=self.clock, **options)
        self.info = self.logger.open()
        parts = []
        while self.clock.time_ns < self.start_ns + seconds * S:
            parts.append(self.logger.read(0.1))
        self.time_ns = np.concatenate([part.time_ns for part in parts])
        self.values = np.concatenate([part.values for part in parts])
        self.sigma_ns = np.concatenate([np.full(len(part.time_ns), part.time_sigma_ns) for part in parts])
        self.anomalies: list[Anomaly] = [one for part in parts for one in part.anomalies]

    def after(self, seconds: float) -> np.ndarray:
        return self.time_ns >= self.start_ns + seconds * S


def test_it_measures_the_vacuum_that_moves_the_simulated_wall() -> None:
    liner = {"period_s": 0.8, "vacuum": {"system_kpa": 40.0, "liner_kpa": 41.0}}
    run = Run(3, dating="monotonic", noise_kpa=0.0, liner=liner)
    truth = pulsation_kpa(FakeOptions.read({"liner": liner}).liner, run.time_ns / 1e9)
    assert np.abs(run.values[:, 0] - truth).max() < 1e-6
    assert set(run.values[:, 1]) == {41.0}
    assert run.info.channels == ("pulsation", "liner", "mouthpiece", "milk_line")


def test_its_rate_is_what_was_asked_for() -> None:
    run = Run(5, rate_hz=400, dating="monotonic")
    assert len(run.time_ns) == pytest.approx(2000, abs=20)


def test_two_of_one_seed_say_the_same_and_two_seeds_do_not() -> None:
    first, again, other = (Run(1, seed=seed).values for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[: len(other)], other[: len(first)])


def test_its_own_clock_is_found_in_spite_of_packets_and_drift() -> None:
    run = Run(60, clock_drift_ppm=200, noise_kpa=0.0)
    late = run.after(20)
    # On a slope of 42 kPa in 120 ms, a time that is off shows as a vacuum that is off. The shortest way has
    # 2 ms, and 1 ms more, since no packet ends with a reading that was taken as it was closed.
    truth = run.logger.truth_kpa(run.time_ns - 3_000_000)[:, 0]
    assert np.abs(run.values[late, 0] - truth[late]).max() < 42 / 120 * 0.3
    assert run.sigma_ns[late].max() < 300_000
    assert run.anomalies == []


def test_gain_and_offset_are_those_of_a_sensor_that_is_not_calibrated() -> None:
    plain = Run(1, dating="monotonic", noise_kpa=0.0)
    volts = Run(1, dating="monotonic", noise_kpa=0.0, gain=0.05, offset_kpa=-10)
    assert np.abs(volts.values - (plain.values + 10) * 0.05).max() < 1e-9


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"drop_out": 0.02}, MISSING),
        ({"nonsense": 0.02}, "not a number"),
        ({"faults": [{"kind": "clock_set", "at_s": 10, "by_s": 3}]}, CLOCK_JUMPED),
        ({"faults": [{"kind": "drop_out", "at_s": 10, "for_s": 1, "share": 0.5}]}, MISSING),
        ({"faults": [{"kind": "silent", "at_s": 10, "for_s": 1}]}, MISSING),
    ],
)
def test_what_goes_wrong_is_named(options: dict, reason: str) -> None:
    run = Run(15, **options)
    assert {anomaly.reason for anomaly in run.anomalies} >= {reason}


def test_all_that_is_lost_is_counted() -> None:
    run = Run(20, drop_out=0.03, packet_ms=0)
    lost = sum(anomaly.lost for anomaly in run.anomalies)
    assert lost == pytest.approx(0.03 * 4000, abs=60)
    assert len(run.time_ns) + lost == pytest.approx(4000, abs=12)


def test_it_changes_its_unit_without_a_word() -> None:
    run = Run(4, dating="monotonic", faults=[{"kind": "other_unit", "at_s": 2, "for_s": 9, "factor": 10}])
    assert run.values[run.after(2.1), 1].mean() == pytest.approx(420, abs=1)
    assert run.anomalies == []


def test_it_is_unplugged_and_comes_back() -> None:
    clock = ManualClock()
    logger = FakeLogger(clock=clock, faults=[{"kind": "unplugged", "at_s": 1, "for_s": 2}])
    logger.open()
    clock.sleep(1)
    with pytest.raises(DeviceLost):
        logger.read(0.02)
    logger.close()
    with pytest.raises(DeviceAbsent):
        logger.open()
    clock.sleep(2)
    logger.open()
    assert len(logger.read(1.0).time_ns)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"rate_hz": 0}, "rate_hz"),
        ({"gain": 0}, "shows nothing"),
        ({"dating": "guess"}, "dating"),
        ({"faults": [{"kind": "fire", "at_s": 1}]}, "kind"),
        ({"liner": {"vacuum": {"system_kpa": -3}}}, "liner.vacuum.system_kpa"),
    ],
)
def test_options_that_cannot_be_used_are_named(options: dict, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        FakeLogger(**options)


def test_milk_flows_while_the_difference_is_below_the_one_that_stops_it() -> None:
    run = Run(3, dating="monotonic", noise_kpa=0.0, flow_stop_kpa=34.0, flow_delay_ms=100.0)
    assert run.info.channels[-1] == "flow"
    assert run.info.units[-1] is None
    vacuum_kpa = pulsation_kpa(FakeOptions.read({}).liner, run.time_ns / 1e9 - 0.1)
    assert np.array_equal(run.values[:, -1] == 1, 42.0 - vacuum_kpa < 34.0)

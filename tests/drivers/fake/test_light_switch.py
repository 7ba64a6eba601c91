"""Who switches the simulated lamp: the clock is read before and after, and the picture changes in between."""

import numpy as np
import pytest

from grabberd.core.channels import LoggerInfo, Readings
from grabberd.errors import DeviceAbsent, DeviceLost
from grabberd.testing import ManualClock
from grabberd_fake import FakeLight, FakeLogger
from grabberd_fake.light_options import LightOptions, lit

LAMP = {"diameter_px": 9.0, "seed": 7}
S = 1_000_000_000


def read_for(
    seconds: float, logger: FakeLight | FakeLogger, clock: ManualClock
) -> tuple[LoggerInfo, Readings]:
    """What it said in that time, in one."""
    info, end_ns, parts = logger.open(), clock.time_ns + round(seconds * S), []
    while clock.time_ns < end_ns:
        parts.append(logger.read(0.1))
    return info, Readings(
        np.concatenate([part.time_ns for part in parts]), np.concatenate([part.values for part in parts])
    )


def true_switchings_ns(begin_ns: int, end_ns: int) -> np.ndarray:
    bit_ns = 92_361_000
    bits = np.arange(begin_ns // bit_ns + 1, end_ns // bit_ns + 1) * bit_ns
    options = LightOptions(**LAMP)
    return bits[lit(options, bits) != lit(options, bits - 1)]


def test_the_lamp_of_the_picture_switches_between_two_readings() -> None:
    clock = ManualClock()
    begin_ns = clock.time_ns
    _, told = read_for(20.0, FakeLight(clock=clock, light=LAMP, bracket_ms=2.0), clock)
    changes = np.flatnonzero(np.diff(told.values[:, 0]))
    before, after = told.time_ns[changes], told.time_ns[changes + 1]
    truth = true_switchings_ns(begin_ns, int(told.time_ns[-1]))
    assert len(truth) > 60
    assert len(truth) == len(changes)
    assert ((before < truth) & (truth <= after)).all()
    assert (after - before).max() <= 2_000_001
    assert (np.diff(told.time_ns) > 0).all()
    assert np.diff(told.time_ns).max() < 16_000_000


def test_it_knows_what_all_its_times_have_in_common() -> None:
    info = FakeLight(clock=ManualClock()).open()
    assert (info.channels, info.delay_sigma_ns) == (("light",), 0)


def test_it_can_be_unplugged_and_comes_again() -> None:
    clock = ManualClock()
    light = FakeLight(clock=clock, faults=[{"kind": "unplugged", "at_s": 1, "for_s": 2}])
    light.open()
    clock.time_ns += S
    with pytest.raises(DeviceLost):
        light.read(0.1)
    light.close()
    with pytest.raises(DeviceAbsent):
        light.open()
    clock.time_ns += 3 * S
    assert light.open().driver == "fake_light"


def test_the_simulated_logger_records_the_lamp_of_the_picture_too() -> None:
    clock = ManualClock()
    info, told = read_for(5.0, FakeLogger(clock=clock, dating="monotonic", light=LAMP, gain=3.0), clock)
    assert info.channels == ("pulsation", "liner", "mouthpiece", "milk_line", "light")
    assert info.units[-1] is None
    assert (told.values[:, 4] == lit(LightOptions(**LAMP), told.time_ns)).all()


def test_options_that_there_are_not_are_named() -> None:
    with pytest.raises(ValueError, match="bracket_ms"):
        FakeLight(bracket_ms=100)

"""The switch of the lamp in the simulated picture, seen through the logger contract."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from grabberd.core.channels import Anomaly, Dating, LoggerInfo, Readings
from grabberd_fake.grabber import Clock
from grabberd_fake.light_options import LightOptions, lit
from grabberd_fake.logger import LoggerFault, ScriptedLogger, Unplugged
from grabberd_fake.reading import Group, ListOf, OneOfKinds, by, integer, number, read, ruled

_STEP_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class OtherHand(LoggerFault):
    """Somebody else switches it, too."""


FAULTS: Mapping[str, type] = {"unplugged": Unplugged, "other_hand": OtherHand}


@dataclass(frozen=True, slots=True)
class FakeLightOptions:
    """All options of the simulated switch.

    It switches the lamp of a `FakeGrabber` with the same option `light`, on the same clock: the clock is read
    before and after each switching, which happens in between.

    Attributes:
        light: the lamp, see `LightOptions`.
        bracket_ms: longest time between both; it is another one each time, as is the moment within it.
        seed: seed of these.
        faults: `unplugged`, or `other_hand`, with `at_s` after it was first opened and `for_s`.
    """

    light: LightOptions = field(default_factory=LightOptions, metadata=by(Group(LightOptions)))
    bracket_ms: float = number(1.0, 0.001, 20)
    seed: int = integer(0, 0, 2**32 - 1)
    faults: tuple[Any, ...] = ruled(ListOf(OneOfKinds(FAULTS)), ())

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "FakeLightOptions":
        """Reads the `options` of a configuration.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        return read(cls, values)


class FakeLight(ScriptedLogger):
    """The switch of the simulated lamp; `FakeLightOptions` lists its options."""

    _model = "simulated light"
    _replug = "plug it in again; grabberd retries automatically"

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock of the simulated world, as that of its `FakeGrabber`; by default the machine's.
            options: see `FakeLightOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        self.options = FakeLightOptions.read(options)
        super().__init__(self.options.faults, clock)
        self._bit_ns = round(self.options.light.bit_ms * 1e6)
        self._bit = self._told_ns = 0

    def open(self) -> LoggerInfo:
        """Starts with the next switching.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open already.
        """
        self._told_ns = self._begin()
        self._bit = self._told_ns // self._bit_ns + 1
        return LoggerInfo(
            driver="fake_light",
            model=self._model,
            channels=("light",),
            units=(None,),
            rate_hz=None,
            dating=Dating.MONOTONIC,
            time_sigma_ns=round(self.options.bracket_ms * 1e6 / np.sqrt(12)),
            delay_sigma_ns=0,
        )

    def read(self, timeout_s: float) -> Readings:
        """Waits for the next switching.

        Raises:
            DeviceLost: it is not open, or the script has it unplugged.
        """
        now_ns = self._clock.now_ns()
        until_ns = now_ns + round(timeout_s * 1e9)
        before_ns, after_ns = self._bracket()
        self._clock.sleep_until_ns(min(after_ns, until_ns))
        now_ns = self._clock.now_ns()
        self._check_plug(now_ns)
        if now_ns < after_ns:
            return Readings.none(1)
        times = [*range(self._told_ns + _STEP_NS, before_ns - _STEP_NS // 2, _STEP_NS), before_ns, after_ns]
        time_ns = np.array(times, np.int64)
        self._bit, self._told_ns = self._bit + 1, after_ns
        values = lit(self.options.light, time_ns).astype(np.float64)[:, None]
        other_hand = self._active(OtherHand, now_ns)
        anomalies = (Anomaly(now_ns, "it was switched by somebody else", "on"),) if other_hand else ()
        return Readings(time_ns, values, anomalies, round((after_ns - before_ns) / np.sqrt(12)))

    def _bracket(self) -> tuple[int, int]:
        """Times before and after the next switching, which is in between."""
        chance = np.random.default_rng([self.options.seed, self._bit % 2**32])
        length_ns, share = self.options.bracket_ms * 1e6 * chance.uniform(0.2, 1.0), chance.random()
        before_ns = self._bit * self._bit_ns - 1 - round(share * length_ns)
        return before_ns, before_ns + 1 + round(length_ns)

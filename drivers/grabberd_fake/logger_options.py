"""Options of the simulated data logger: what it measures, how its readings come, and what goes wrong."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from grabberd_fake.ellipse_options import EllipseOptions
from grabberd_fake.light_options import LightOptions
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.reading import (
    Group,
    ListOf,
    Number,
    OneOfKinds,
    Text,
    by,
    choice,
    integer,
    number,
    read,
    ruled,
)
from grabberd_fake.vacuum import Wave


@dataclass(frozen=True, slots=True)
class LoggerFault:
    """Something that goes wrong for a while, from `at_s` after the logger was first opened, for `for_s`."""

    at_s: float = ruled(Number(0, 1e6))
    for_s: float = number(1.0, 0, 1e6)

    def is_on(self, since_s: float) -> bool:
        """True for a time since the first opening at which it happens."""
        return self.at_s <= since_s < self.at_s + self.for_s


@dataclass(frozen=True, slots=True)
class Silent(LoggerFault):
    """It takes no readings."""


@dataclass(frozen=True, slots=True)
class Unplugged(LoggerFault):
    """It is not there."""


@dataclass(frozen=True, slots=True)
class Nonsense(LoggerFault):
    """A share of its readings are nonsense."""

    share: float = number(1.0, 0, 1)


@dataclass(frozen=True, slots=True)
class DropOut(LoggerFault):
    """A share of its readings are lost."""

    share: float = number(1.0, 0, 1)


@dataclass(frozen=True, slots=True)
class OtherUnit(LoggerFault):
    """Its numbers are in another unit."""

    factor: float = number(10.0, 1e-6, 1e6)


@dataclass(frozen=True, slots=True)
class ClockSet:
    """Its clock is set, forward if `by_s` is positive."""

    at_s: float = ruled(Number(0, 1e6))
    by_s: float = number(0.5, -1e5, 1e5)


LOGGER_FAULTS: Mapping[str, type] = {
    "silent": Silent,
    "unplugged": Unplugged,
    "nonsense": Nonsense,
    "drop_out": DropOut,
    "other_unit": OtherUnit,
    "clock_set": ClockSet,
}


@dataclass(frozen=True, slots=True)
class FakeLoggerOptions:
    """All options of the simulated logger.

    It measures the vacuum that moves the wall of a `FakeGrabber` with the same scene and the same options of
    `liner` or `ellipse`, on the same clock.

    Attributes:
        scene: `liner` or `ellipse`, whose options give the vacuum.
        liner: see `LinerOptions`; `ellipse`: see `EllipseOptions`.
        light: the lamp of that grabber, see `LightOptions`; with one there is a further column `light`.
        mouthpiece_kpa: vacuum in the mouthpiece chamber; `milk_line_kpa`: in the milk line, both constant.
        rate_hz: readings per second.
        noise_kpa: standard deviation of each reading.
        gain: what the logger shows for 1 kPa; `offset_kpa`: vacuum at which it shows 0.
        dating: `own_clock`: its readings carry its own time; `monotonic`: they are dated when they are
            taken; `arrival`: they carry no time.
        clock_offset_s: its own clock less that of the grabber; `clock_drift_ppm`: how much faster it runs.
        packet_ms: readings are delivered together that often, as USB adapters do; 0: each at once.
        delay_ms: shortest way from a reading to the program; `late_ms`: more on average, exponentially.
        drop_out: share of readings that are lost; `nonsense`: share that are no numbers.
        seed: seed of noise, delays and losses.
        faults: what goes wrong; each has a `kind` out of `LOGGER_FAULTS` and `at_s`.
        stage: file that replaces the liner's vacuum, see `FakeOptions`.
    """

    CHANNELS: ClassVar[tuple[str, ...]] = ("pulsation", "liner", "mouthpiece", "milk_line")

    scene: str = choice("liner", "ellipse")
    liner: LinerOptions = field(default_factory=LinerOptions, metadata=by(Group(LinerOptions)))
    ellipse: EllipseOptions = field(default_factory=EllipseOptions, metadata=by(Group(EllipseOptions)))
    light: LightOptions = field(default_factory=LightOptions, metadata=by(Group(LightOptions)))
    mouthpiece_kpa: float = number(18.0, 0, 80)
    milk_line_kpa: float = number(44.0, 0, 80)
    rate_hz: float = number(200.0, 1, 2000)
    noise_kpa: float = number(0.1, 0, 20)
    gain: float = number(1.0, -1000, 1000)
    offset_kpa: float = number(0.0, -200, 200)
    dating: str = choice("own_clock", "monotonic", "arrival")
    clock_offset_s: float = number(-1234.5, -1e7, 1e7)
    clock_drift_ppm: float = number(40.0, -20000, 20000)
    packet_ms: float = number(16.0, 0, 1000)
    delay_ms: float = number(2.0, 0, 1000)
    late_ms: float = number(1.0, 0, 1000)
    drop_out: float = number(0.0, 0, 1)
    nonsense: float = number(0.0, 0, 1)
    seed: int = integer(0, 0, 2**32 - 1)
    faults: tuple[Any, ...] = ruled(ListOf(OneOfKinds(LOGGER_FAULTS)), ())
    stage: str | None = ruled(Text(), None)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "FakeLoggerOptions":
        """Reads the `options` of a configuration.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        return read(cls, values, "")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what it measures."""
        return (*self.CHANNELS, "light") if self.light.diameter_px else self.CHANNELS

    @property
    def wave(self) -> Wave:
        """The vacuum that moves the wall."""
        return self.liner.wave if self.scene == "liner" else self.ellipse.wave

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.gain == 0:
            yield "gain: 0 shows nothing"
        if self.stage is not None and self.scene != "liner":
            yield f"stage: given, but the scene is {self.scene!r}, not 'liner'"

"""The simulated data logger and its options: the vacuum that moves the simulated wall, seen through the
logger contract, how its readings come, and what goes wrong.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels import (
    Anomaly,
    ArrivalDating,
    ClockRelation,
    Dated,
    Dating,
    LoggerInfo,
    MissingReadings,
    Readings,
)
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused
from grabberd_fake.grabber import Clock, RealClock
from grabberd_fake.light_options import LightOptions, lit
from grabberd_fake.liner_options import EllipseOptions, LinerOptions
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
from grabberd_fake.stage import Stage
from grabberd_fake.vacuum import Array, Wave, pulsation_kpa


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
        flow_stop_kpa: pressure difference across the wall below which milk flows, with a further column
            `flow`, 1 while it does; 0: nothing shows it. `flow_delay_ms`: the milk's way to the sensor.
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
    flow_stop_kpa: float = number(0.0, 0, 80)
    flow_delay_ms: float = number(80.0, 0, 1000)

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "FakeLoggerOptions":
        """Reads the `options` of a configuration.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        return read(cls, values)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what it measures."""
        flow = ("flow",) if self.flow_stop_kpa else ()
        return (*self.CHANNELS, *flow, *(("light",) if self.light.diameter_px else ()))

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


Times = NDArray[np.int64]
Kind = TypeVar("Kind", bound=LoggerFault)

_STAMP_SIGMA_NS = 1_000
_SETTLED_SIGMA_NS = 300_000


class _Packet(NamedTuple):
    """Readings that are delivered together.

    Attributes:
        taken_ns: (K,) when its readings were taken, without those that are lost.
        values: (K, C) what the logger shows.
        nonsense: number of readings among those lost that arrived as nonsense.
    """

    taken_ns: Times
    values: Array
    nonsense: int


class ScriptedLogger:
    """A simulated logger of any kind, which its script may unplug.

    Args:
        faults: The script.
        clock: Clock of the simulated world; None: the machine's.
    """

    _model: ClassVar[str]
    _replug: ClassVar[str]

    def __init__(self, faults: Sequence[object], clock: Clock | None) -> None:
        self._faults = faults
        self._clock = clock or RealClock()
        self._origin_ns: int | None = None
        self._is_open = False

    def close(self) -> None:
        """Stops reading."""
        self._is_open = False

    def _begin(self) -> int:
        """Opens it; returns the time."""
        if self._is_open:
            raise DeviceRefused(f"the {self._model} is open already", "close it first")
        now_ns = self._clock.now_ns()
        self._origin_ns = now_ns if self._origin_ns is None else self._origin_ns
        if self._active(Unplugged, now_ns):
            raise DeviceAbsent(f"there is no {self._model}: the script has it unplugged", self._replug)
        self._is_open = True
        return now_ns

    def _check_plug(self, now_ns: int) -> None:
        if not self._is_open:
            raise DeviceLost(f"the {self._model} is not open", "open it first")
        if self._active(Unplugged, now_ns):
            raise DeviceLost(f"the {self._model} is gone: the script has unplugged it", self._replug)

    def _active(self, kind: type[Kind], time_ns: float) -> Kind | None:
        since_s = (time_ns - (self._origin_ns or 0)) / 1e9
        faults = (fault for fault in self._faults if isinstance(fault, kind))
        return next((fault for fault in faults if fault.is_on(since_s)), None)


class FakeLogger(ScriptedLogger):
    """A logger of the vacuum round the simulated liner; `FakeLoggerOptions` lists its options."""

    _model = "simulated logger"
    _replug = "plug the logger in again; grabberd retries automatically"

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock of the simulated world, as that of its `FakeGrabber`; by default the machine's.
            options: see `FakeLoggerOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        self.options = FakeLoggerOptions.read(options)
        super().__init__(self.options.faults, clock)
        self._stage = Stage(self.options.stage, self.options.liner)
        self._period_ns = 1e9 / self.options.rate_hz
        self._packet_ns = self.options.packet_ms * 1e6 or self._period_ns
        self._dating = Dating(self.options.dating)
        self._next = self._arrives_ns = 0

    def open(self) -> LoggerInfo:
        """Starts with the next packet.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open already, or there is no stage.
        """
        self._follow_stage()
        self._follow_with(math.ceil(self._begin() / self._packet_ns))
        self._relation, self._arrivals, self._missing = ClockRelation(), ArrivalDating(), MissingReadings()
        return self._info()

    def read(self, timeout_s: float) -> Readings:
        """Waits for the next packet.

        Raises:
            DeviceLost: it is not open, or the script has it unplugged.
        """
        deadline_ns = self._clock.now_ns() + round(timeout_s * 1e9)
        while True:
            # A gauge reads on when somebody switches the vacuum off.
            self._follow_stage()
            now_ns = self._clock.now_ns()
            self._check_plug(now_ns)
            found = self._due(now_ns)
            if found is not None or now_ns >= deadline_ns:
                return found or Readings.none(len(self.options.columns))
            self._clock.sleep_until_ns(min(self._arrives_ns, deadline_ns))

    def truth_kpa(self, time_ns: Times) -> Array:
        """(K, 4) true vacuum of the channels below atmosphere."""
        options = self.options
        chamber = pulsation_kpa(options, time_ns / 1e9)
        constant = (options.wave.liner_kpa, options.mouthpiece_kpa, options.milk_line_kpa)
        return np.column_stack([chamber, *(np.full(len(time_ns), kpa) for kpa in constant)])

    def own_ns(self, taken_ns: Times) -> Times:
        """The logger's own clock at these times."""
        options = self.options
        since_ns = taken_ns - (self._origin_ns or 0)
        own_ns = taken_ns + np.round(since_ns * options.clock_drift_ppm * 1e-6 + options.clock_offset_s * 1e9)
        for fault in options.faults:
            if isinstance(fault, ClockSet):
                own_ns += np.where(since_ns >= fault.at_s * 1e9, round(fault.by_s * 1e9), 0)
        return own_ns.astype(np.int64)

    def _follow_stage(self) -> None:
        if self._stage.follow():
            self.options = replace(self.options, liner=self._stage.liner)

    def _follow_with(self, packet: int) -> None:
        """Notes which packet is the next, and when it arrives."""
        self._next, self._arrives_ns = packet, self._arrival_ns(packet)

    def _arrival_ns(self, packet: int) -> int:
        options = self.options
        complete_ns = (packet + (1 if options.packet_ms else 0)) * self._packet_ns
        late_ms = options.delay_ms + self._chance(packet).exponential(options.late_ms)
        return math.ceil(complete_ns + late_ms * 1e6)

    def _chance(self, packet: int) -> np.random.Generator:
        return np.random.default_rng([self.options.seed, packet % 2**32])

    def _due(self, now_ns: int) -> Readings | None:
        """Readings of the packets that have arrived; None if nothing has."""
        parts = []
        while self._arrives_ns <= now_ns:
            packet = self._packet(self._next)
            self._follow_with(self._next + 1)
            if len(packet.taken_ns) or packet.nonsense:
                parts.append(packet)
        if not parts:
            return None
        taken_ns = np.concatenate([part.taken_ns for part in parts])
        values = np.concatenate([part.values for part in parts])
        spoilt = sum(part.nonsense for part in parts)
        # Where readings have a time, the gap in it counts what is lost.
        lost = spoilt if self._dating is Dating.ARRIVAL else 0
        nonsense = [Anomaly(now_ns, "not a number", "3,-,\ufffd7", lost)] if spoilt else []
        if not len(taken_ns):
            return Readings.none(values.shape[1], nonsense)
        dated, missing = self._date(taken_ns, now_ns)
        return Readings(dated.time_ns, values, (*nonsense, *dated.anomalies, *missing), dated.sigma_ns)

    def _packet(self, number: int) -> _Packet:
        options, chance = self.options, self._chance(number)
        begin, end = (
            math.ceil((number + more) * self._packet_ns / self._period_ns - 1e-9) for more in (0, 1)
        )
        taken_ns = np.round(np.arange(begin, end) * self._period_ns).astype(np.int64)
        chance.exponential()  # the packet's lateness
        noise = chance.normal(0.0, options.noise_kpa, (len(taken_ns), len(options.CHANNELS)))
        lost, spoilt = chance.random((2, len(taken_ns)))
        start_ns = number * self._packet_ns
        drop_out, nonsense = self._active(DropOut, start_ns), self._active(Nonsense, start_ns)
        gone = lost < max(options.drop_out, drop_out.share if drop_out else 0.0)
        gone |= bool(self._active(Silent, start_ns))
        bad = ~gone & (spoilt < max(options.nonsense, nonsense.share if nonsense else 0.0))
        unit = self._active(OtherUnit, start_ns)
        shown = (self.truth_kpa(taken_ns) + noise - options.offset_kpa) * options.gain
        shown *= unit.factor if unit else 1.0
        if options.flow_stop_kpa:
            shown = np.column_stack([shown, self._flows(taken_ns)])
        if options.light.diameter_px:
            shown = np.column_stack([shown, lit(options.light, taken_ns)])
        good = ~gone & ~bad
        return _Packet(taken_ns[good], shown[good], int(bad.sum()))

    def _flows(self, taken_ns: Times) -> NDArray[np.bool_]:
        """(K,) True while milk is at the sensor."""
        options = self.options
        came_s = taken_ns / 1e9 - options.flow_delay_ms / 1e3
        return options.wave.liner_kpa - pulsation_kpa(options, came_s) < options.flow_stop_kpa

    def _date(self, taken_ns: Times, now_ns: int) -> tuple[Dated, tuple[Anomaly, ...]]:
        if self._dating is Dating.MONOTONIC:
            return Dated(taken_ns, _STAMP_SIGMA_NS), self._missing.look(taken_ns, now_ns)
        if self._dating is Dating.ARRIVAL:
            return self._arrivals.date(len(taken_ns), now_ns), ()
        own_ns = self.own_ns(taken_ns)
        dated = self._relation.date(own_ns, now_ns)
        if dated.anomalies:
            self._missing.begin_anew()
        return dated, self._missing.look(own_ns, now_ns)

    def _info(self) -> LoggerInfo:
        packet_ns = self._packet_ns / math.sqrt(12)
        sigma_ns = {Dating.MONOTONIC: _STAMP_SIGMA_NS, Dating.OWN_CLOCK: _SETTLED_SIGMA_NS}
        return LoggerInfo(
            driver="fake",
            model=self._model,
            channels=self.options.columns,
            units=tuple("kPa" if name in self.options.CHANNELS else None for name in self.options.columns),
            rate_hz=self.options.rate_hz,
            dating=self._dating,
            time_sigma_ns=sigma_ns.get(self._dating, round(packet_ns)),
            details={"scene": self.options.scene},
        )

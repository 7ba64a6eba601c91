"""The simulated data logger: the vacuum that moves the simulated wall, seen through the logger contract."""

import math
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

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
from grabberd_fake.light_options import lit
from grabberd_fake.logger_options import (
    ClockSet,
    DropOut,
    FakeLoggerOptions,
    LoggerFault,
    Nonsense,
    OtherUnit,
    Silent,
    Unplugged,
)
from grabberd_fake.stage import STAGE_HINT, Stage
from grabberd_fake.vacuum import pulsation_kpa

Array = NDArray[np.float64]
Times = NDArray[np.int64]
Kind = TypeVar("Kind", bound=LoggerFault)

_STAMP_SIGMA_NS = 1_000
_SETTLED_SIGMA_NS = 300_000
_REPLUG = "plug the logger in again; grabberd retries automatically"


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


class FakeLogger:
    """A logger of the vacuum round the simulated liner; `FakeLoggerOptions` lists its options."""

    def __init__(self, *, clock: Clock | None = None, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock of the simulated world, as that of its `FakeGrabber`; by default the machine's.
            options: see `FakeLoggerOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        self.options = FakeLoggerOptions.read(options)
        self._stage = Stage(self.options.stage, self.options.liner)
        self._clock = clock or RealClock()
        self._period_ns = 1e9 / self.options.rate_hz
        self._packet_ns = self.options.packet_ms * 1e6 or self._period_ns
        self._dating = Dating(self.options.dating)
        self._origin_ns: int | None = None
        self._next = self._arrives_ns = 0
        self._is_open = False

    def open(self) -> LoggerInfo:
        """Starts with the next packet.

        Raises:
            DeviceAbsent: the script has it unplugged.
            DeviceRefused: it is open already, or there is no stage.
        """
        if self._is_open:
            raise DeviceRefused("the simulated logger is open already", "close it first")
        self._follow_stage()
        now_ns = self._clock.now_ns()
        self._origin_ns = now_ns if self._origin_ns is None else self._origin_ns
        if self._active(Unplugged, now_ns):
            raise DeviceAbsent("there is no simulated logger: the script has it unplugged", _REPLUG)
        self._follow_with(math.ceil(now_ns / self._packet_ns))
        self._relation, self._arrivals, self._missing = ClockRelation(), ArrivalDating(), MissingReadings()
        self._is_open = True
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

    def close(self) -> None:
        """Stops reading."""
        self._is_open = False

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
        try:
            if self._stage.follow():
                self.options = replace(self.options, liner=self._stage.liner)
        except ValueError as error:
            raise DeviceRefused(f"there is no stage: {error}", STAGE_HINT) from error

    def _check_plug(self, now_ns: int) -> None:
        if not self._is_open:
            raise DeviceLost("the simulated logger is not open", "open it first")
        if self._active(Unplugged, now_ns):
            raise DeviceLost("the simulated logger is gone: the script has unplugged it", _REPLUG)

    def _active(self, kind: type[Kind], time_ns: float) -> Kind | None:
        since_s = (time_ns - (self._origin_ns or 0)) / 1e9
        faults = (fault for fault in self.options.faults if isinstance(fault, kind))
        return next((fault for fault in faults if fault.is_on(since_s)), None)

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
        if options.light.diameter_px:
            shown = np.column_stack([shown, lit(options.light, taken_ns)])
        good = ~gone & ~bad
        return _Packet(taken_ns[good], shown[good], int(bad.sum()))

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
            model="simulated logger",
            channels=self.options.columns,
            units=tuple(None if name == "light" else "kPa" for name in self.options.columns),
            rate_hz=self.options.rate_hz,
            dating=self._dating,
            time_sigma_ns=sigma_ns.get(self._dating, round(packet_ns)),
            details={"scene": self.options.scene},
        )

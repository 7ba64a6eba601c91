"""The vacuum on both sides of the wall at the fields' times, from the inputs."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.geometry import Reading
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.load.pressure import ChamberVacuum
from grabberd_liner.analysis.pulsation.phases import Phases, iso_phases
from grabberd_liner.analysis.pulsation.pulsation import Pulsation
from grabberd_liner.analysis.vacuum.light_clock import FoundLight
from grabberd_liner.analysis.vacuum.milk_flow import DifferenceCurve
from grabberd_liner.analysis.vacuum.vacuum import (
    ChannelCurve,
    ConstantVacuum,
    LoggedVacuum,
    Offset,
    PulsatorWave,
    VacuumSource,
    WallLag,
    find_offset,
)
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, read_vacuum_log, reading_noise
from grabberd_liner.chain.analysis.inputs import BY_LIGHT, CHAMBERS, CHANNEL, missing

# Least reach of a slope: with one clock the offset's σ is 0, and the difference quotient needs some width.
_SLOPE_S = 0.002
_LEAST_READINGS = 10
_WAVE_KEYS = tuple(field.name for field in fields(PulsatorWave))


class Vacuum(NamedTuple):
    """Both chambers' vacuum.

    Attributes:
        pulsation: source of the pulsation chamber's vacuum; `liner`: of the vacuum inside the liner.
        time_sigma_s: σ of the offset between the clocks; 0 if there is only one clock.
        offset: offset found from the wall's movement, or None.
        light: light in the picture that related the clocks, or None.
        lag: with a light or recorded channels, how far the wall is behind the vacuum: the shifts of an
            `Offset`; or None.
        phases: ISO phases a, b, c, d; None unless the chamber's vacuum is a curve with a whole cycle.
        remarks: what to know of it, as sentences.
    """

    pulsation: VacuumSource
    liner: VacuumSource
    time_sigma_s: float
    offset: Offset | None
    phases: Phases | None
    light: FoundLight | None = None
    lag: Offset | None = None
    remarks: tuple[str, ...] = ()

    @property
    def is_curve(self) -> bool:
        """True if the chamber's vacuum is known as it changes."""
        return not isinstance(self.pulsation, ConstantVacuum)

    def at(self, time_s: Array) -> list[ChamberVacuum]:
        """Vacuum at every field; the offset's σ is common to all fields and stays separate (`time_sigma_s`).

        Raises:
            InputError: a log does not cover the fields.
        """
        pulsation, liner = self.pulsation.at(time_s), self.liner.at(time_s)
        slopes = [self._slope(source, time_s) for source in (self.pulsation, self.liner)]
        columns = (pulsation.value, liner.value, pulsation.sigma, liner.sigma, *slopes)
        rows = np.column_stack([*columns, np.full(len(time_s), self.time_sigma_s)])
        return [ChamberVacuum(*map(float, row)) for row in rows]

    @property
    def gauge_sigma_kpa(self) -> float:
        """σ of the zero of the pressure difference, which is the same at all times."""
        return float(np.hypot(self.pulsation.sigma_kpa, self.liner.sigma_kpa))

    def difference(self, first_s: float, last_s: float) -> DifferenceCurve:
        """The pressure difference at the chamber's readings between two times of the camera's clock.

        Raises:
            InputError: the chamber's vacuum was not measured then, or the liner's is not known.
        """
        chamber = self.pulsation
        if not isinstance(chamber, LoggedVacuum):
            raise InputError(
                "the pulsation chamber's vacuum was not measured, and milk flow is laid on its curve",
                "record it with the capture, or add the logger's file",
            )
        time_s = chamber.log.time_s + chamber.offset_s
        inside = (time_s >= first_s) & (time_s <= last_s)
        noise_kpa = reading_noise(chamber.kpa)
        if isinstance(self.liner, LoggedVacuum):
            first_s, last_s = self.liner.log.time_s[[0, -1]] + self.liner.offset_s
            inside &= (time_s >= first_s) & (time_s <= last_s)
            noise_kpa = float(np.hypot(noise_kpa, reading_noise(self.liner.kpa)))
        if inside.sum() < _LEAST_READINGS:
            raise InputError(
                f"vacuum and milk flow have {inside.sum()} readings in common", "record both with the capture"
            )
        liner_kpa = self.liner.at(time_s[inside]).value
        difference_kpa = liner_kpa - chamber.kpa[inside]
        return DifferenceCurve(
            time_s[inside], chamber.kpa[inside], difference_kpa, noise_kpa, self.gauge_sigma_kpa
        )

    def _slope(self, source: VacuumSource, time_s: Array) -> Array:
        """(F,) slope in kPa/s over ± the offset's σ; one-sided at the first and last field."""
        reach_s = max(self.time_sigma_s, _SLOPE_S)
        # Clipped to the fields' span, since a log need not reach beyond it.
        ahead, behind = (np.clip(time_s + way * reach_s, time_s.min(), time_s.max()) for way in (1, -1))
        return (source.at(ahead).value - source.at(behind).value) / np.maximum(ahead - behind, 1e-9)


def read_vacuum(
    document: Mapping[str, Any],
    pulsation: Pulsation | None,
    time_s: Array,
    light: FoundLight | None = None,
    channels: Mapping[str, ChannelCurve] | None = None,
) -> Vacuum | None:
    """The vacuum that the inputs describe; None where they lack one of the chambers.

    Args:
        document: the inputs' `vacuum`.
        pulsation: of the wall, or None if none was found.
        time_s: (F,) the fields' times.
        light: the light in the picture, where the inputs leave the clocks to it.
        channels: what was recorded with the capture itself, by name.

    Raises:
        InputError, AnalysisError: the vacuum cannot be used, or does not belong to this capture.
    """
    if not set(CHAMBERS) <= set(document):
        return None
    if CHANNEL in (document["pulsation"], document["liner"]):
        return recorded_vacuum(document, pulsation, time_s, channels or {}, light)
    log = read_vacuum_log(document["log"]) if "log" in document else None
    if document.get("offset") == BY_LIGHT:
        return _by_light(document, log, pulsation, time_s, light)
    wave = _wave(document["pulsation"])
    offset = _found_offset(document, log, wave, pulsation)
    clock = _clock(document, log, wave, offset)
    return Vacuum(
        pulsation=_on_camera_clock(wave, clock)
        if wave
        else _source("pulsation", document["pulsation"], log, clock),
        liner=_source("liner", document["liner"], log, clock),
        time_sigma_s=clock[1] if clock else 0.0,
        offset=offset,
        phases=_phases(log, wave, time_s),
    )


def _by_light(
    document: Mapping[str, Any],
    log: VacuumLog | None,
    pulsation: Pulsation | None,
    time_s: Array,
    light: FoundLight | None,
) -> Vacuum:
    if log is None or light is None:
        raise missing("a vacuum.log with a column light", "vacuum.offset: light is for the log of a logger")
    log = replace(log, time_s=light.clock.camera_s(log.time_s))
    clock = (0.0, light.clock.sigma_s(time_s))
    return Vacuum(
        pulsation=_source("pulsation", document["pulsation"], log, clock),
        liner=_source("liner", document["liner"], log, clock),
        time_sigma_s=clock[1],
        offset=None,
        phases=_phases(log, None, time_s),
        light=light,
        lag=_lag(log, pulsation),
    )


def _lag(log: VacuumLog, pulsation: Pulsation | None) -> Offset | None:
    """Lag of the wall behind a vacuum whose clock is known; None where one of them has no cycle."""
    if pulsation is None:
        return None
    try:
        return find_offset(log, pulsation, None, 0.0)
    except AnalysisError:
        return None


def recorded_vacuum(
    document: Mapping[str, Any],
    pulsation: Pulsation | None,
    time_s: Array,
    channels: Mapping[str, ChannelCurve],
    light: FoundLight | None = None,
) -> Vacuum:
    """The vacuum of which at least one chamber was recorded with the capture itself.

    Args:
        document: the inputs' `vacuum`.
        pulsation: of the wall, or None if none was found.
        time_s: (F,) the fields' times.
        channels: what was recorded, by name.
        light: the light in the picture that dates the channels by the fields, or None.

    Raises:
        InputError: there is no such channel, or another input does not go with it.
    """
    if other := next((key for key in ("log", "lag") if key in document), None):
        raise InputError(
            f"vacuum.{other} is given beside a recorded channel, whose clock is that of the fields",
            f"leave out {other}; vacuum.offset corrects the clock of the channels, if need be",
        )
    curves = {name: recorded_channel(name, channels) for name in CHAMBERS if document[name] == CHANNEL}
    curves = {name: _on_clock_of_fields(curve, document, time_s, light) for name, curve in curves.items()}
    wave = _wave(document["pulsation"])
    sources: dict[str, VacuumSource] = {
        name: curve.source(0.0, channel_sigma_kpa(document, curve)) for name, curve in curves.items()
    }
    if wave is not None:
        sources["pulsation"] = _on_camera_clock(wave, None)
    for name in CHAMBERS:
        if name not in sources:
            sources[name] = _source(name, document[name], None, None)
    sigmas_s = [curve.time_sigma_s for curve in curves.values()]
    sigmas_s += [wave.start_sigma_s] if wave else []
    log = curves["pulsation"].log() if "pulsation" in curves else None
    return Vacuum(
        pulsation=sources["pulsation"],
        liner=sources["liner"],
        time_sigma_s=max(sigmas_s),
        offset=None,
        phases=_phases(log, wave, time_s),
        light=light,
        lag=None if log is None else _lag(log, pulsation),
        remarks=()
        if "offset" in document
        else tuple(curve.remark for curve in curves.values() if curve.remark),
    )


def _on_clock_of_fields(
    curve: ChannelCurve, document: Mapping[str, Any], time_s: Array, light: FoundLight | None
) -> ChannelCurve:
    """A channel with its times as the fields have them: by the light, by an offset, or as it is."""
    if document.get("offset") == BY_LIGHT:
        if light is None:
            raise missing("a channel light", "vacuum.offset: light is for captures that have recorded one")
        own_s = light.clock.camera_s(curve.time_s)
        return replace(curve, time_s=own_s, time_sigma_s=light.sigma_s(curve, time_s))
    offset_s, sigma_s = read_offset(document) or (0.0, 0.0)
    return replace(
        curve, time_s=curve.time_s + offset_s, time_sigma_s=float(np.hypot(curve.time_sigma_s, sigma_s))
    )


def recorded_channel(name: str, channels: Mapping[str, ChannelCurve]) -> ChannelCurve:
    """A channel by its name.

    Raises:
        InputError: the capture has none of that name.
    """
    if name not in channels:
        known = ", ".join(channels) or "none"
        raise InputError(
            f"vacuum.{name} is to come from the capture's own channel {name}, and it has none",
            f"its channels are: {known}; give the vacuum as a log or a constant",
        )
    return channels[name]


def channel_sigma_kpa(document: Mapping[str, Any], curve: ChannelCurve) -> float:
    """σ of a channel's gauge: as given in the inputs, or else by its calibration.

    Raises:
        InputError: it is not a number.
    """
    if "gauge_sigma_kpa" not in document:
        return curve.sigma_kpa
    reading = Reading("vacuum")
    given = reading.number(document, "gauge_sigma_kpa", positive=True)
    reading.finish("give the σ of the gauge in kPa")
    return given


def needs_pulsation(document: Mapping[str, Any]) -> bool:
    """True if the clock of the vacuum is to be found from the wall's pulsation."""
    curve = "log" in document or _wave(document.get("pulsation")) is not None
    return "lag" in document and "liner" in document and curve


def _on_camera_clock(wave: PulsatorWave, clock: tuple[float, float] | None) -> PulsatorWave:
    """The wave with its start on the camera's clock."""
    start_s = clock[0] if clock else wave.start_s
    # Its σ is carried once for both chambers, in `Vacuum.time_sigma_s`; kept here too, it would count twice.
    return replace(wave, start_s=start_s, start_sigma_s=0.0)


def _wave(value: object) -> PulsatorWave | None:
    return read_wave(value) if isinstance(value, Mapping) and "rate_per_min" in value else None


def read_wave(value: Mapping[str, Any]) -> PulsatorWave:
    """The vacuum of the pulsation chamber from a pulsator's settings.

    Raises:
        InputError: a setting is missing, unknown, not a number, or impossible.
    """
    reading = Reading("vacuum.pulsation")
    reading.keys("", value, _WAVE_KEYS)
    needed = _WAVE_KEYS[:-2]  # the start and its σ are optional: `lag` can give them
    numbers = {key: reading.number(value, key) for key in _WAVE_KEYS if key in needed or key in value}
    reading.finish("give all of the pulsator's settings, from its test report")
    return PulsatorWave(**numbers)


def _source(
    name: str, value: object, log: VacuumLog | None, clock: tuple[float, float] | None
) -> VacuumSource:
    if value == "log":
        return _logged(name, log, clock)
    if not isinstance(value, Mapping):
        raise InputError(
            f"vacuum.{name} is {value!r}",
            "give {kpa: …, sigma_kpa: …}, a pulsator's settings, log, or channel",
        )
    return read_constant(name, value)


def read_constant(name: str, value: Mapping[str, Any]) -> ConstantVacuum:
    """A vacuum that does not change, of the chamber `name`.

    Raises:
        InputError: a key is missing or unknown, or a value is impossible.
    """
    reading = Reading(f"vacuum.{name}")
    reading.keys("", value, ("kpa", "sigma_kpa"))
    kpa, sigma = reading.number(value, "kpa"), reading.number(value, "sigma_kpa")
    reading.finish("a constant vacuum has kpa below atmosphere and sigma_kpa")
    return ConstantVacuum(kpa, sigma)


def _logged(name: str, log: VacuumLog | None, clock: tuple[float, float] | None) -> LoggedVacuum:
    if log is None:
        raise missing(f"vacuum.log, which vacuum.{name} refers to", "add the logger's file")
    if clock is None:
        raise missing("vacuum.offset or vacuum.lag", "the logger's clock has to be related to the camera's")
    kpa = log.pulsation_kpa if name == "pulsation" else log.liner_kpa
    if kpa is None:
        raise InputError(f"the vacuum log has no column for vacuum.{name}", "give it as a constant")
    return LoggedVacuum(log, kpa, clock[0], 0.0)


def _clock(
    document: Mapping[str, Any], log: VacuumLog | None, wave: PulsatorWave | None, offset: Offset | None
) -> tuple[float, float] | None:
    """Camera's time minus the other clock's, or the time at which a wave begins; with its σ."""
    if offset is not None:
        return offset.offset_s + (wave.start_s if wave else 0.0), offset.sigma_s
    if wave is not None:
        return wave.start_s, wave.start_sigma_s
    return None if log is None else read_offset(document)


def read_offset(document: Mapping[str, Any]) -> tuple[float, float] | None:
    """The camera's time less the logger's, with its σ; None where it is not given.

    Raises:
        InputError: one of them is missing, or a key is unknown.
    """
    if "offset" not in document:
        return None
    reading = Reading("vacuum.offset")
    given = reading.mapping(document, "offset")
    reading.keys("", given, ("s", "sigma_s"))
    clock = reading.number(given, "s"), reading.number(given, "sigma_s")
    reading.finish("give the camera's time minus the logger's, in s, with its σ")
    return clock


def _found_offset(
    document: Mapping[str, Any],
    log: VacuumLog | None,
    wave: PulsatorWave | None,
    pulsation: Pulsation | None,
) -> Offset | None:
    """Offset from the wall's movement, if its lag behind the vacuum is given."""
    if "lag" not in document or (log is None and wave is None):
        return None
    if pulsation is None:
        raise missing("a pulsation in the capture", "it is needed to find the offset; give vacuum.offset")
    lag, near_s = read_lag(document)
    curve = log or _as_log(wave, pulsation, near_s)
    return find_offset(curve, pulsation, lag, near_s)


def read_lag(document: Mapping[str, Any]) -> tuple[WallLag, float]:
    """The wall's lag behind the vacuum, and roughly how far the clocks differ, in s.

    Raises:
        InputError: one of them is missing, or a key is unknown.
    """
    reading = Reading("vacuum.lag")
    given = reading.mapping(document, "lag")
    reading.keys("", given, (*WallLag._fields, "near_s"))
    lag = WallLag(*(reading.number(given, key) for key in WallLag._fields))
    near_s = reading.number(given, "near_s")
    reading.finish("give the wall's lag behind the vacuum, with its σ, and roughly how far the clocks differ")
    return lag, near_s


def _as_log(wave: PulsatorWave | None, pulsation: Pulsation, near_s: float) -> VacuumLog:
    assert wave is not None
    first = min(run.first_s for run in pulsation.runs) - near_s - wave.period_s
    return wave.log(first, max(run.last_s for run in pulsation.runs) - near_s + wave.period_s)


def _phases(log: VacuumLog | None, wave: PulsatorWave | None, time_s: Array) -> Phases | None:
    if log is not None:
        try:
            return iso_phases(log)
        except AnalysisError:  # a slow ramp, or less than a cycle
            return None
    if wave is None:
        return None
    # Every cycle of a wave is the same; three leave at least one whole one wherever the first begins.
    return iso_phases(wave.log(float(time_s[0]), float(time_s[0]) + 3 * wave.period_s))

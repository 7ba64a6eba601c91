"""Listening to a logger for `grabberd logger`, and printing what was heard."""

from collections import Counter
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from rich.text import Text

from grabberd.cli.options import print_json
from grabberd.cli.terminal import console
from grabberd.config import Config, default_config_file
from grabberd.core.channels import Anomaly, Dating, Logger, LoggerInfo, Readings
from grabberd.core.channels.vacuum import Channel, VacuumChannels
from grabberd.errors import ConfigError, DriverMissing, InputError, Problem
from grabberd.instrument.acquisition import LOGGERS
from grabberd.instrument.channels.logger_setup import set_up_loggers
from grabberd.runtime import Clock, SystemClock

_WAIT_S = 0.2
_MAIN_OPTIONS = {
    "serial": "port",
    "csv": "path",
    "iio": "device",
    "rts": "port",
    "fake": None,
    "fake_light": None,
}
"""The option that stands behind the colon, by driver."""
_DATINGS = {
    Dating.ARRIVAL: "by the arrival of each reading, which may be late",
    Dating.OWN_CLOCK: "by the logger's own clock",
    Dating.MONOTONIC: "by the computer's clock, when each was taken",
}
_SHOWN = 5
"""Anomalies of which an example is shown."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """A logger to listen to, its channels as configured, and how late it is."""

    name: str
    logger: Logger
    channels: tuple[Channel, ...] = ()
    delay_ns: int = 0


@dataclass(slots=True)
class Heard:
    """All that a logger has said for a while.

    Attributes:
        name: Its name.
        info: The logger as found.
        seconds: For how long.
        parts: Its readings, in turn.
        vacuum: Its channels, if some are configured and the logger has them.
        problem: Reason why it cannot be measured as configured, or None.
    """

    name: str
    info: LoggerInfo
    seconds: float
    parts: list[Readings] = field(default_factory=list)
    vacuum: VacuumChannels | None = None
    problem: InputError | None = None

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Times of the readings."""
        return np.concatenate([np.empty(0, np.int64), *(part.time_ns for part in self.parts)])

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the readings."""
        return np.concatenate([np.empty((0, len(self.info.channels))), *(part.values for part in self.parts)])

    @property
    def anomalies(self) -> list[Anomaly]:
        """Anomalies, also of the vacuum."""
        if self.vacuum is None:
            return [one for part in self.parts for one in part.anomalies]
        return [one for part in self.parts for one in self.vacuum.vacuum(part).anomalies]

    @property
    def rate_hz(self) -> float | None:
        """Readings per second."""
        time_ns = self.time_ns
        return (len(time_ns) - 1) * 1e9 / int(time_ns[-1] - time_ns[0]) if len(time_ns) > 1 else None

    @property
    def time_sigma_ms(self) -> float | None:
        """Standard deviation of the newest times."""
        sigmas = [part.time_sigma_ns for part in self.parts if len(part.time_ns)]
        return sigmas[-1] / 1e6 if sigmas else None


def chosen(settings: Config, file: Path | None, name: str | None) -> Chosen:
    """The logger that is meant.

    Raises:
        ConfigError: It is not clear from the name, or its options cannot be used.
    """
    known, where = settings.loggers, str(file or default_config_file())
    driver, colon, rest = (name or "").partition(":")
    if colon and driver in _MAIN_OPTIONS:
        option = _MAIN_OPTIONS[driver]
        try:
            return Chosen(str(name), LOGGERS.create(driver, {option: rest} if option else {}))
        except (ValueError, DriverMissing) as error:
            raise ConfigError([Problem(str(name), "options", str(error))]) from error
    if name is None and len(known) == 1:
        name = next(iter(known))
    if name not in known:
        listed = ", ".join(known) or "none"
        what = f"no logger {name!r}" if name else "several loggers" if known else "no logger"
        raise ConfigError([Problem(where, "loggers", f"{what} to listen to; configured are: {listed}")])
    assert name is not None
    setup = set_up_loggers(settings.model_copy(update={"loggers": {name: known[name]}}), Path(where))[name]
    return Chosen(name, setup.logger, setup.channels, setup.config.delay_ns)


def listen(one: Chosen, seconds: float, clock: Clock | None = None) -> Heard:
    """Listen to a logger.

    Raises:
        DeviceError: It cannot be opened, or went away.
    """
    clock = clock or SystemClock()
    with closing(one.logger) as logger:
        heard = Heard(one.name, logger.open(), seconds)
        try:
            heard.vacuum = VacuumChannels(one.channels, heard.info, one.delay_ns) if one.channels else None
        except InputError as error:
            heard.problem = error
        end_ns = clock.now_ns() + round(seconds * 1e9)
        while (left_ns := end_ns - clock.now_ns()) > 0:
            heard.parts.append(logger.read(min(left_ns / 1e9, _WAIT_S)))
    return heard


def print_heard(heard: Heard, json: bool) -> None:
    """Print it; as JSON for scripts."""
    if json:
        print_json(document(heard))
        return
    info = heard.info
    console.print(Text(f"{heard.name}: {info.model} ({info.driver})", style="bold"))
    for key, words in info.details.items():
        _print(f"  {key}: {words}")
    _print(f"  dated {_DATINGS[info.dating]}")
    rate = f"{heard.rate_hz:.1f} readings/s" if heard.rate_hz else "no readings"
    sigma = f", σ of their times {heard.time_sigma_ms:.2f} ms" if heard.time_sigma_ms is not None else ""
    _print(f"  {rate} in {heard.seconds:g} s{sigma}")
    for remark in info.remarks:
        _print(f"  note: {remark}")
    _print_columns(heard)
    if heard.vacuum is not None:
        _print_channels(heard, heard.vacuum)
    if heard.problem is not None:
        _print(f"\nThe configuration does not fit: {heard.problem.message}\n{heard.problem.hint}")
    _print_anomalies(heard)


def document(heard: Heard) -> dict[str, Any]:
    """Document of what was heard, for scripts."""
    info = heard.info
    columns = zip(info.channels, info.units, heard.values.T, strict=True)
    return {
        "name": heard.name,
        "driver": info.driver,
        "model": info.model,
        "details": info.details,
        "remarks": list(info.remarks),
        "dating": info.dating.value,
        "seconds": heard.seconds,
        "readings": len(heard.time_ns),
        "rate_hz": heard.rate_hz,
        "time_sigma_ms": heard.time_sigma_ms,
        "columns": {name: {"unit": unit} | _summary(values) for name, unit, values in columns},
        "channels": _channels(heard),
        "problem": heard.problem and heard.problem.message,
        "anomalies": {reason: count for reason, (count, _, _) in _counted(heard.anomalies).items()},
        "lost": sum(anomaly.lost for anomaly in heard.anomalies),
    }


def _channels(heard: Heard) -> dict[str, Any]:
    vacuum = heard.vacuum
    if vacuum is None:
        return {}
    kpa = np.concatenate(
        [np.empty((0, len(vacuum.channels))), *(vacuum.vacuum(part).kpa for part in heard.parts)]
    )
    return {
        channel.name: {
            "quantity": channel.quantity.value,
            "column": channel.column,
            "sigma_kpa": channel.sigma_kpa,
            "calibrated": channel.calibrated,
            "kpa" if channel.quantity.is_vacuum else "level": _summary(values),
        }
        for channel, values in zip(vacuum.channels, kpa.T, strict=True)
    }


def _summary(values: NDArray[np.float64]) -> dict[str, float | int | None]:
    """Least, mean, greatest and newest value, noise, and how many there are; None where there is none."""
    good = values[np.isfinite(values)]
    if not len(good):
        return {"count": 0, "least": None, "mean": None, "greatest": None, "newest": None, "noise": None}
    return {
        "count": len(good),
        "least": float(good.min()),
        "mean": float(good.mean()),
        "greatest": float(good.max()),
        "newest": float(good[-1]),
        "noise": _noise(good),
    }


def _noise(values: NDArray[np.float64]) -> float | None:
    """σ of a value, from its departure from the mean of its neighbours."""
    if len(values) < 10:
        return None
    bend = values[1:-1] - (values[:-2] + values[2:]) / 2
    # The median ignores slopes' corners; 1.4826 turns it into σ, and √1.5 is the σ of such a departure.
    return float(1.4826 * np.median(np.abs(bend)) / np.sqrt(1.5))


def _counted(anomalies: list[Anomaly]) -> dict[str, tuple[int, int, str]]:
    """Number, lost readings and newest example of the anomalies, by reason, the most frequent first."""
    times = Counter(anomaly.reason for anomaly in anomalies)
    lost: Counter[str] = Counter()
    examples: dict[str, str] = {}
    for anomaly in anomalies:
        lost[anomaly.reason] += anomaly.lost
        examples[anomaly.reason] = anomaly.example
    return {reason: (count, lost[reason], examples[reason]) for reason, count in times.most_common()}


def _print_columns(heard: Heard) -> None:
    table = Table("column", "unit", "least", "mean", "greatest", "newest", "noise (σ)")
    for name, unit, values in zip(heard.info.channels, heard.info.units, heard.values.T, strict=True):
        table.add_row(Text(name), Text(unit or "–"), *_cells(_summary(values)))
    console.print(table)


def _print_channels(heard: Heard, vacuum: VacuumChannels) -> None:
    table = Table("channel", "unit", "least", "mean", "greatest", "newest", "noise (σ)")
    for name, about in _channels(heard).items():
        unit, summary = ("kPa", about["kpa"]) if "kpa" in about else ("–", about["level"])
        table.add_row(name, unit, *_cells(summary))
    _print("In kPa below atmosphere, as configured; a light as it is:")
    console.print(table)
    for channel in vacuum.channels:
        if not channel.quantity.is_vacuum:
            _print(f"  {channel.name}: column {channel.column}, a light")
            continue
        day = f"calibrated on {channel.calibrated}" if channel.calibrated else "never calibrated"
        _print(f"  {channel.name}: column {channel.column}, σ {channel.sigma_kpa:g} kPa, {day}")


def _cells(summary: Mapping[str, float | int | None]) -> list[str]:
    shown = (summary[key] for key in ("least", "mean", "greatest", "newest", "noise"))
    return ["–" if value is None else f"{value:.4g}" for value in shown]


def _print_anomalies(heard: Heard) -> None:
    counted = _counted(heard.anomalies)
    if not counted:
        _print(
            "No anomalies."
            if len(heard.time_ns)
            else "Nothing was received: is it switched on and measuring?"
        )
    for reason, (count, lost, example) in list(counted.items())[:_SHOWN]:
        gone = f", {lost} readings lost" if lost else ""
        _print(f"{count} × {reason}{gone}, such as: {example}")


def _print(text: str) -> None:
    # Text from loggers may contain anything: without markup, brackets stay brackets.
    console.print(text, highlight=False, markup=False, soft_wrap=True)

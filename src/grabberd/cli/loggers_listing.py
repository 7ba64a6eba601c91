"""Loggers in the output of `grabberd devices`: those configured, and what else may be one."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table
from rich.text import Text

from grabberd.cli.devices_text import one_line, print_device, print_plain
from grabberd.cli.terminal import console
from grabberd.config import Config
from grabberd.instrument.acquisition import LOGGERS, discover
from grabberd.instrument.acquisition.discovery import LOGGER_SEARCH, FoundDevice


def loggers_document(settings: Config) -> dict[str, Any]:
    """Drivers, configured and found loggers, for scripts."""
    configured = {
        name: {"driver": one.driver, "options": one.options} for name, one in settings.loggers.items()
    }
    found = [
        asdict(one) | {"configured_as": _configured_as(settings, one)} for one in discover(LOGGER_SEARCH)
    ]
    return {"logger_drivers": LOGGERS.available(), "loggers": configured, "found_loggers": found}


def print_loggers(settings: Config) -> None:
    """Print the serial ports and sensors found, and the configured loggers."""
    found = discover(LOGGER_SEARCH)
    if found or settings.loggers:
        print_plain("Data loggers, or what may be one:\n")
    for device in found:
        print_device(device, _configured_as(settings, device))
    if settings.loggers:
        _print_configured(settings, found)
    print_plain(f"Drivers of loggers: {', '.join(LOGGERS.available())}.")
    new = next((one for one in found if not _configured_as(settings, one)), None)
    if new is not None:
        way = next(iter(new.options.values()))
        print_plain(f"To listen to one: grabberd logger {new.driver}:{one_line(str(way))}")
    print_plain("")


def _configured_as(settings: Config, found: FoundDevice) -> list[str]:
    """Names of the configured loggers that match a found one."""
    return [name for name, one in settings.loggers.items() if found.is_meant_by(one.driver, one.options)]


def _print_configured(settings: Config, found: Sequence[FoundDevice]) -> None:
    table = Table("logger", "driver", "found", "channels", title="Configured loggers", title_justify="left")
    for name, logger in settings.loggers.items():
        there = [one.card for one in found if one.is_meant_by(logger.driver, logger.options)]
        known = any(one.driver == logger.driver for one in found)
        words = ", ".join(map(one_line, there)) or ("not found" if known else "–")
        table.add_row(name, logger.driver, Text(words), ", ".join(logger.channels))
    console.print(table)

"""Setup of the loggers: from the configuration to drivers and channels, with all problems at once."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grabberd.config import Config, LoggerConfig
from grabberd.core.channels import Logger
from grabberd.core.channels.vacuum import Channel
from grabberd.errors import ConfigError, DriverMissing, Problem
from grabberd.instrument.acquisition import LOGGERS


@dataclass(frozen=True, slots=True)
class LoggerSetup:
    """Parts of a logger.

    Attributes:
        name: Name of the logger.
        config: The logger's part of the configuration.
        logger: The logger, not opened yet.
        channels: The channels that it measures.
    """

    name: str
    config: LoggerConfig
    logger: Logger
    channels: tuple[Channel, ...]


def set_up_loggers(config: Config, file: Path) -> dict[str, LoggerSetup]:
    """Makes every logger's setup, by name.

    Raises:
        ConfigError: Some loggers have problems; it lists those of all.
    """
    problems: list[Problem] = []
    setups = [_logger(name, logger, file, problems) for name, logger in config.loggers.items()]
    problems += [Problem(str(file), key, words) for key, words in _conflicts(config)]
    if problems:
        raise ConfigError(problems)
    return {setup.name: setup for setup in setups if setup is not None}


def _logger(name: str, config: LoggerConfig, file: Path, problems: list[Problem]) -> LoggerSetup | None:
    logger = create_logger(name, (config.driver, config.options), file, problems)
    return None if logger is None else LoggerSetup(name, config, logger, config.measured())


def create_logger(
    name: str, driver: tuple[str, Mapping[str, Any]], file: Path, problems: list[Problem]
) -> Logger | None:
    """Creates a logger from the name of its driver and its options; adds to the problems if that fails."""
    key = "options"
    try:
        return LOGGERS.create(*driver)
    except DriverMissing as error:
        key, words = "driver", [f"{error.message}; {error.hint}"]
    except ValueError as error:
        words = str(error).splitlines()
    problems.extend(Problem(str(file), f"loggers.{name}.{key}", one) for one in words)
    return None


def _conflicts(config: Config) -> Iterator[tuple[str, str]]:
    """Keys and problems of channels that belong to no device, or whose device has another for the same."""
    taken: dict[tuple[str, str], str] = {}
    for name, logger in config.loggers.items():
        for channel in logger.measured():
            key = f"loggers.{name}.channels.{channel.name}"
            unknown = [device for device in channel.devices if device not in config.devices]
            if unknown:
                known = ", ".join(config.devices)
                yield f"{key}.devices", f"there is no device {', '.join(unknown)}; known are: {known}"
            for device in channel.devices or tuple(config.devices):
                other = taken.setdefault((device, channel.quantity), key)
                if other != key:
                    yield key, f"device {device} has its {channel.quantity} from {other} already"

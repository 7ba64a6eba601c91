"""Calibrations of an open logger's channels, as captures keep them."""

import numpy as np

from grabberd.archive.capture.channels.reading_groups import ChannelCalibration
from grabberd.config import LoggerConfig
from grabberd.core.channels import LoggerInfo
from grabberd.core.channels.vacuum import Channel

UNKNOWN_UNIT = "not stated yet"
LEVEL = "level"
"""Unit of a light whose logger states none."""
DELAY_SIGMA_MS = 5.0
"""σ of the delay of a logger whose shortest way nobody has measured: that of an adapter on USB."""


def calibration_of(channel: Channel, config: LoggerConfig, info: LoggerInfo | None) -> ChannelCalibration:
    """The calibration of a channel: two readings tell a straight line.

    Args:
        channel: The channel as configured.
        config: Its logger's part of the configuration.
        info: The logger as found, which may state the unit; None before it was opened.
    """
    unit = channel.unit or (None if info is None else channel.stated_unit(info))
    if unit is None and info is not None and not channel.quantity.is_vacuum:
        unit = LEVEL
    known = (channel.sigma_kpa, channel.calibrated, config.delay_ms, _delay_sigma_ms(config, info))
    if unit is None:
        return ChannelCalibration(UNKNOWN_UNIT, 1.0, 0.0, *known)
    at_0, at_1 = channel.kpa(np.array([0.0, 1.0]), unit).tolist()
    return ChannelCalibration(unit, at_1 - at_0, at_0, *known)


def _delay_sigma_ms(config: LoggerConfig, info: LoggerInfo | None) -> float:
    """The σ of the delay as configured, or as the driver knows it."""
    if config.delay_sigma_ms is not None:
        return config.delay_sigma_ms
    known_ns = None if info is None else info.delay_sigma_ns
    return DELAY_SIGMA_MS if known_ns is None else known_ns / 1e6

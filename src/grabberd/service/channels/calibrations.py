"""Calibrations of an open logger's channels, as captures keep them."""

import numpy as np

from grabberd.acquisition.channels import LoggerInfo
from grabberd.acquisition.channels.vacuum import Channel
from grabberd.config import LoggerConfig
from grabberd.storage.capture.channels.reading_groups import ChannelCalibration

UNKNOWN_UNIT = "not stated yet"


def calibration_of(channel: Channel, config: LoggerConfig, info: LoggerInfo | None) -> ChannelCalibration:
    """The calibration of a channel: two readings tell a straight line.

    Args:
        channel: The channel as configured.
        config: Its logger's part of the configuration.
        info: The logger as found, which may state the unit; None before it was opened.
    """
    unit = channel.unit or (None if info is None else channel.stated_unit(info))
    known = (channel.sigma_kpa, channel.calibrated, config.delay_ms, config.delay_sigma_ms)
    if unit is None:
        return ChannelCalibration(UNKNOWN_UNIT, 1.0, 0.0, *known)
    at_0, at_1 = channel.kpa(np.array([0.0, 1.0]), unit).tolist()
    return ChannelCalibration(unit, at_1 - at_0, at_0, *known)

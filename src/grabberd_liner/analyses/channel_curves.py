"""The channels of a capture as an analysis takes them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grabberd.archive import CaptureReader
from grabberd.archive.capture.channels.recorded_channels import ChannelReadings
from grabberd.core.channels import Dating
from grabberd_liner.analysis.vacuum.channel_curve import ChannelCurve
from grabberd_liner.chain.analysis.inputs import CHANNEL


def wanted_channels(inputs: Mapping[str, Any]) -> list[str]:
    """Quantities of the channels that the inputs of an analysis refer to."""
    vacuum = inputs.get("vacuum")
    if not isinstance(vacuum, Mapping):
        return []
    return [name for name in ("pulsation", "liner") if vacuum.get(name) == CHANNEL]


def recorded_quantities(path: Path) -> frozenset[str]:
    """Quantities of which a capture has readings, whether or not it has them for every field.

    Raises:
        CaptureFileError: The capture does not exist, or a channel is damaged.
    """
    with CaptureReader(path) as reader:
        channels = [one for one in reader.channels.all if len(reader.channels.read(one.name).time_s)]
        return frozenset(str(one.quantity) for one in channels)


def channel_curves(path: Path, inputs: Mapping[str, Any]) -> dict[str, ChannelCurve]:
    """The channels that the inputs refer to, by quantity, as far as the capture has them.

    Raises:
        CaptureFileError: The capture does not exist, or a channel is damaged.
    """
    if not (wanted := wanted_channels(inputs)):
        return {}
    with CaptureReader(path) as reader:
        by_quantity = {str(one.quantity): one.name for one in reader.channels.all}
        return {
            quantity: _curve(quantity, reader.channels.read(by_quantity[quantity]))
            for quantity in wanted
            if quantity in by_quantity
        }


def _curve(quantity: str, readings: ChannelReadings) -> ChannelCurve:
    channel, calibration = readings.channel, readings.channel.calibration
    delay_sigma_s = calibration.delay_sigma_ms / 1e3
    calibrated = f"calibrated {calibration.calibrated}" if calibration.calibrated else "never calibrated"
    return ChannelCurve(
        name=quantity,
        time_s=readings.time_s,
        kpa=readings.kpa,
        sigma_kpa=calibration.sigma_kpa,
        time_sigma_s=math.hypot(float(readings.time_sigma_ns.max(initial=0)) / 1e9, delay_sigma_s),
        origin=f"channel {channel.name} of the logger {channel.logger}, {calibrated}",
        remark=_remark(readings),
        delay_sigma_s=delay_sigma_s,
        logger=channel.logger,
    )


def _remark(readings: ChannelReadings) -> str | None:
    if Dating.ARRIVAL not in readings.datings:
        return None
    calibration = readings.channel.calibration
    return (
        f"the readings of channel {readings.channel.name} are dated by their arrival; their way to the "
        f"computer is taken as {calibration.delay_ms:g} ms (σ {calibration.delay_sigma_ms:g}), as it is "
        "configured: 10 ms are 3 kPa on a flank; vacuum.offset corrects it"
    )

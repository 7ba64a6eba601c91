"""Configuration sections of one data logger and its channels."""

from datetime import date
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.config.section import Section
from grabberd.core.channels import Quantity
from grabberd.core.channels.vacuum import Channel, Reference

Unit = Literal["kPa", "mbar", "hPa", "Pa", "bar", "mmHg", "Torr", "inHg", "psi", "V", "mV", "mA", "counts"]
ChannelName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]


class ChannelConfig(Section):
    """One channel: a column of the logger as a vacuum, as the light in the picture, or as the milk's flow.

    Pressure in kPa is number × unit × gain + offset_kpa. Light and flow have nothing but column and devices.
    """

    quantity: Quantity | None = Field(
        None, description="what it measures; default: the channel's name, if that is a quantity"
    )
    column: str = Field(min_length=1, description="the logger's column; `grabberd logger NAME` lists them")
    unit: Unit | None = Field(None, description="unit of the readings; default: as stated by the logger")
    gain: float | None = Field(
        None,
        allow_inf_nan=False,
        description="default for pressures: 1; required for V, mV, mA and counts: kPa per V, mA or count",
    )
    offset_kpa: float = Field(0.0, allow_inf_nan=False, description="pressure at 0")
    sigma_kpa: float | None = Field(
        None, gt=0, le=20, description="σ of the calibration, common to all readings; not for light and flow"
    )
    calibrated: date | None = Field(None, description="day of the calibration; default: never")
    reference: Reference = Field(Reference.VACUUM, description="what the sensor measures relative to")
    atmosphere_kpa: float | None = Field(
        None, ge=50, le=110, description="air pressure, not reduced to sea level; required for absolute"
    )
    devices: tuple[str, ...] = Field((), description="grabbers it belongs to; default: all")

    @model_validator(mode="after")
    def _gain_is_not_zero(self) -> Self:
        if self.gain == 0:
            raise ValueError("gain 0 makes every reading the same")
        return self

    @model_validator(mode="after")
    def _absolute_needs_the_atmosphere(self) -> Self:
        if (self.reference is Reference.ABSOLUTE) != (self.atmosphere_kpa is not None):
            raise ValueError("reference absolute requires atmosphere_kpa, and only absolute takes it")
        return self

    @model_validator(mode="after")
    def _signals_need_a_gain(self) -> Self:
        if self.unit in ("V", "mV", "mA", "counts") and self.gain is None:
            raise ValueError(f"unit {self.unit} requires gain, in kPa for each V, mA or count")
        return self


class LoggerConfig(Section):
    """One data logger, and the quantities that it measures on the fields' clock."""

    driver: str = Field(description="name of the driver, such as serial, csv, mqtt or iio")
    options: dict[str, Any] = Field(default_factory=dict, description="the driver's own options")
    delay_ms: float = Field(
        0.0, ge=-1000, le=1000, description="delay of all readings, by filters and cables"
    )
    delay_sigma_ms: float | None = Field(
        None,
        ge=0,
        le=1000,
        description="its σ; default: as known by the driver, else 5 ms, as for an adapter whose shortest "
        "delay has not been measured",
    )
    channels: dict[ChannelName, ChannelConfig] = Field(min_length=1, description="the channels, by name")

    @model_validator(mode="after")
    def _quantities_are_named(self) -> Self:
        nameless = [
            name for name, one in self.channels.items() if one.quantity is None and name not in _QUANTITIES
        ]
        if nameless:
            raise ValueError(
                f"channel {', '.join(nameless)}: 'quantity' is missing; give one of {', '.join(_QUANTITIES)}"
            )
        return self

    @model_validator(mode="after")
    def _a_vacuum_is_calibrated_and_a_level_is_not(self) -> Self:
        problems = []
        for name, one in self.channels.items():
            if _quantity(name, one).is_vacuum and one.sigma_kpa is None:
                problems.append(f"channel {name}: 'sigma_kpa' is missing, the σ of its calibration")
            given = sorted(one.model_fields_set & _OF_A_VACUUM)
            if not _quantity(name, one).is_vacuum and given:
                problems.append(f"channel {name}: a {_quantity(name, one)} has no {', '.join(given)}")
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def delay_ns(self) -> int:
        """Time by which all readings are late."""
        return round(self.delay_ms * 1e6)

    def measured(self) -> tuple[Channel, ...]:
        """The channels, as the readings are turned into vacuum by."""
        return tuple(_channel(name, config) for name, config in self.channels.items())


_QUANTITIES = tuple(quantity.value for quantity in Quantity)
_OF_A_VACUUM = frozenset(ChannelConfig.model_fields) - {"quantity", "column", "devices"}


def _quantity(name: str, config: ChannelConfig) -> Quantity:
    return config.quantity or Quantity(name)


def _channel(name: str, config: ChannelConfig) -> Channel:
    own = {
        "name": name,
        "quantity": _quantity(name, config),
        "sigma_kpa": config.sigma_kpa or 0.0,
        "calibrated": config.calibrated and config.calibrated.isoformat(),
    }
    return Channel(**{**dict(config), **own})

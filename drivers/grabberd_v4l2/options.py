"""Every option of the driver, with its default and its range.

V4l2Grabber(device="/dev/v4l/by-path/…")
V4l2Grabber(usb="05e1:0408", port="1-2.3", input="S-Video", field_order="interlaced")
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from grabberd.field import BOTTOM, TOP
from grabberd_v4l2 import standards
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import FORMATS
from grabberd_v4l2.identity import Identity
from grabberd_v4l2.profiles import DIRECTORY

FIELD_ORDERS = tuple(a.name.lower() for a in Arrangement if a not in (Arrangement.ANY, Arrangement.NONE))


class V4l2Options(BaseModel):
    """All options; one of `device` and `usb` is required.

    Attributes:
        device: node or link to it, preferably in /dev/v4l/by-path.
        usb: "VENDOR:PRODUCT"; `serial` and `port` tell identical ones apart.
        input: input by name or number; by default the first that is no tuner.
        standard: video standard, see `standards.NAMES`.
        format: pixel formats, the preferred first; one or a list.
        field_order: field order to request; by default the best for this card.
        older_field: "top" or "bottom": older field of a frame, if the card's profile is wrong.
        exposure_ms: exposure time of the camera's shutter; by default a camera without shutter is assumed.
        buffers: number of buffers to request of the kernel.
        profiles: directory of the installer's own card profiles.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: Path | None = None
    usb: Any = None
    serial: Any = None
    port: Any = None
    input: int | str | None = None
    standard: str = "PAL"
    format: tuple[str, ...] = tuple(FORMATS)
    field_order: str | None = None
    older_field: Literal["top", "bottom"] | None = None
    exposure_ms: float | None = Field(None, ge=0, le=20)
    buffers: int = Field(16, ge=8, le=16, strict=True)
    profiles: Path = DIRECTORY

    @property
    def identity(self) -> Identity:
        """Identity of the grabber."""
        return Identity.from_options(self.device, self.usb, self.serial, self.port)

    @property
    def arrangement(self) -> Arrangement | None:
        """Field order to request, or None."""
        return None if self.field_order is None else Arrangement[self.field_order.upper()]

    @property
    def older(self) -> int | None:
        """Parity of the older field, or None."""
        return None if self.older_field is None else {"top": TOP, "bottom": BOTTOM}[self.older_field]

    @property
    def exposure_ns(self) -> int | None:
        """Exposure time of the camera, or None."""
        return None if self.exposure_ms is None else round(self.exposure_ms * 1e6)

    @field_validator("standard")
    @classmethod
    def _known_standard(cls, standard: str) -> str:
        standards.bits(standard)
        return standard

    @field_validator("format", mode="before")
    @classmethod
    def _known_formats(cls, given: Any) -> Any:
        wanted = (given,) if isinstance(given, str) else given
        if not isinstance(wanted, list | tuple) or not wanted or any(one not in FORMATS for one in wanted):
            raise ValueError(f"{given!r} is neither one nor a list of {', '.join(FORMATS)}")
        return tuple(wanted)

    @field_validator("field_order")
    @classmethod
    def _known_order(cls, given: str | None) -> str | None:
        if given is not None and given not in FIELD_ORDERS:
            raise ValueError(f"{given!r} is not one of {', '.join(FIELD_ORDERS)}")
        return given

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "V4l2Options":
        """Reads the `options` of a configuration.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        names = {key: values.get(key) for key in ("device", "usb", "serial", "port")}
        problems = list(_problems(lambda: Identity.from_options(**names)))
        problems += _problems(lambda: cls(**values))
        if problems:
            raise ValueError("\n".join(problems))
        return cls(**values)


def _problems(make: Callable[[], object]) -> Iterator[str]:
    try:
        make()
    except ValidationError as error:
        for one in error.errors():
            yield f"{one['loc'][0]}: {_in_words(one['type'], one['msg'])}"
    except (ValueError, TypeError) as error:
        yield str(error)


def _in_words(kind: str, message: str) -> str:
    if kind == "extra_forbidden":
        return f"unknown option; known are {', '.join(V4l2Options.model_fields)}"
    return message.removeprefix("Value error, ")

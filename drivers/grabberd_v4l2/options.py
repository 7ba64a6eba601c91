"""Every option of the driver, with its default and its range.

V4l2Grabber(device="/dev/v4l/by-path/…")
V4l2Grabber(usb="05e1:0408", port="1-2.3", input="S-Video", field_order="interlaced")
V4l2Grabber(usb="046d:0825", size="1280x720", rate_hz=30)
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from grabberd.bounded_documents import as_written
from grabberd.core.field import PARITIES
from grabberd.errors import said
from grabberd_v4l2 import formats
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.devices import Identity
from grabberd_v4l2.formats import FORMATS, LEAST_HZ, MOST_HZ
from grabberd_v4l2.profiles import DIRECTORY

FIELD_ORDERS = tuple(a.name.lower() for a in Arrangement if a is not Arrangement.ANY)
_SIZE = re.compile(r"([1-9]\d{0,4})[x×]([1-9]\d{0,4})")


class V4l2Options(BaseModel):
    """All options; one of `device` and `usb` is required.

    Attributes:
        device: Node or link to it, preferably in /dev/v4l/by-path.
        usb: "VENDOR:PRODUCT"; `serial` and `port` distinguish identical devices.
        input: Input by name or number; by default the first that is not a tuner.
        standard: Video standard, see `formats.NAMES`; by default PAL if the card has standards.
        size: "COLUMNSxLINES" of a frame or a progressive picture; by default that of the standard, or the
            largest with a sufficient rate.
        rate_hz: Progressive pictures per second; by default the highest. Fields have the standard's rate.
        format: Pixel formats, the preferred first; one or a list.
        field_order: Field order to request, "none" for progressive pictures; by default the best for this
            card.
        older_field: "top" or "bottom": older field of a frame, if the card's profile is wrong.
        exposure_ms: Exposure time of the camera's shutter; by default a camera without shutter is assumed.
        buffers: Number of buffers to request from the kernel.
        profiles: Directory of the installer's own card profiles.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    _as_written = field_validator("*", mode="wrap")(as_written)

    device: Path | None = None
    usb: Any = None
    serial: Any = None
    port: Any = None
    input: int | str | None = None
    standard: str | None = None
    size: str | None = None
    rate_hz: float | None = Field(None, ge=LEAST_HZ, le=MOST_HZ)
    format: tuple[str, ...] = tuple(FORMATS)
    field_order: str | None = None
    older_field: Literal["top", "bottom"] | None = None
    exposure_ms: float | None = Field(None, ge=0, le=1000)
    buffers: int = Field(16, ge=8, le=32, strict=True)
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
    def columns_lines(self) -> tuple[int, int] | None:
        """Size of a frame or a progressive picture, or None."""
        found = None if self.size is None else _SIZE.fullmatch(self.size)
        return None if found is None else (int(found[1]), int(found[2]))

    @property
    def older(self) -> int | None:
        """Parity of the older field, or None."""
        return None if self.older_field is None else PARITIES[self.older_field]

    @property
    def exposure_ns(self) -> int | None:
        """Exposure time of the camera, or None."""
        return None if self.exposure_ms is None else round(self.exposure_ms * 1e6)

    @field_validator("standard")
    @classmethod
    def _known_standard(cls, standard: str | None) -> str | None:
        if standard is not None:
            formats.bits(standard)
        return standard

    @field_validator("size")
    @classmethod
    def _known_size(cls, given: str | None) -> str | None:
        if given is not None and not _SIZE.fullmatch(given):
            raise ValueError(f"{given!r} is not COLUMNSxLINES, such as 1280x720")
        return given

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
            ValueError: An option is unknown or not allowed; the message has a line for each.
        """
        problems = []
        try:
            Identity.from_options(**{key: values.get(key) for key in ("device", "usb", "serial", "port")})
        except (ValueError, TypeError) as error:
            problems.append(str(error))
        try:
            options = cls(**values)
        except ValidationError as error:
            problems += [f"{one['loc'][0]}: {_in_words(one)}" for one in error.errors()]
        if problems:
            raise ValueError("\n".join(problems))
        return options


def _in_words(problem: Any) -> str:
    if problem["type"] == "extra_forbidden":
        return f"unknown option; known are {', '.join(V4l2Options.model_fields)}"
    message, given = said(problem["msg"]), repr(problem["input"])
    return message if given in message else f"{message}, not {given}"

"""Every error that grabberd raises on purpose.

    GrabberdError                 message and hint; nobody raises it bare
    ├── ConfigError               the configuration cannot be used: all problems at once (exit 78)
    ├── DeviceError               the grabber does not do what is asked of it
    │   ├── DriverMissing         no such driver, or its dependency is not installed
    │   ├── DeviceAbsent          it is not there (yet): worth trying again
    │   ├── DeviceLost            it went away while it streamed: close, then open again
    │   ├── StreamFailed          it is there, but streams no more: restart, open again, reset
    │   ├── DeviceRefused         it is there and says no (busy, rights, standard): a person has to act
    │   └── StreamEnded           a recording has no further field; what came before is good
    ├── InputError                a file or value from outside is not what it should be
    │   ├── PictureError          a picture: missing, truncated, of another size
    │   ├── CaptureFileError      a capture file: damaged, not a capture
    │   │   └── LaterVersion      written by a later version: nothing is wrong with it, leave it alone
    │   └── CalibrationMismatch   a calibration that belongs to another picture size, glass or rig
    ├── NotFound                  no capture, run, field or job of that name
    ├── Conflict                  it cannot be done now
    │   ├── CaptureRunning        a capture is running: carries its id
    │   └── NotReady              the device does not stream, or there is no calibration
    ├── RingOverrun               a reader that may miss nothing was overtaken: its capture ends
    ├── AccessExpired             a token has been good until a day that has passed
    ├── StorageError              the disk is full, read-only or broken
    ├── ExtraMissing              an optional part of grabberd is not installed: carries its name
    └── MeasurementError          the data do not determine what is asked of them
        ├── RankDeficient         some unknowns only together: names them
        └── AnalysisError         the points do not give the surface, strain or pressure asked of them

A class exists because somebody reacts differently to it. A message says what failed, on what, with which
values; the hint says what to do.
"""

from collections.abc import Sequence
from typing import NamedTuple


class GrabberdError(Exception):
    """What failed, on what, with which values; `hint` says what the operator can do."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class Problem(NamedTuple):
    """One thing that is wrong in a configuration."""

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.key}: {self.message}"


class ConfigError(GrabberdError):
    """The configuration cannot be used; `problems` has all of them."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        count = f"{len(problems)} problem" + ("" if len(problems) == 1 else "s")
        listing = "\n".join(f"  {problem}" for problem in problems)
        super().__init__(
            f"the configuration has {count}:\n{listing}",
            "mend these keys; 'grabberd check-config FILE' checks without starting anything",
        )
        self.problems = tuple(problems)


class DeviceError(GrabberdError):
    """The grabber does not do what is asked of it."""


class DriverMissing(DeviceError):
    """No such driver, or what it needs is not installed."""


class DeviceAbsent(DeviceError):
    """The grabber is not there (yet)."""


class DeviceLost(DeviceError):
    """The grabber went away while it streamed."""


class StreamFailed(DeviceError):
    """The grabber is there, but streams no more."""


class DeviceRefused(DeviceError):
    """The grabber is there and says no."""


class StreamEnded(DeviceError):
    """A recording has no further field."""


class InputError(GrabberdError):
    """A file or a value from outside is not what it should be."""


class PictureError(InputError):
    """A picture is missing, truncated or of another size."""


class CaptureFileError(InputError):
    """A capture file is damaged, or no capture at all."""


class LaterVersion(CaptureFileError):
    """A capture file was written by a later version: nothing is wrong with it."""


class CalibrationMismatch(InputError):
    """A calibration belongs to another picture size, glass or rig."""


class NotFound(GrabberdError):
    """No capture, run, field or job of that name."""


class Conflict(GrabberdError):
    """It cannot be done now."""


class CaptureRunning(Conflict):
    """A capture is running already; `capture_id` names it."""

    def __init__(self, capture_id: str) -> None:
        super().__init__(
            f"capture {capture_id} is running", f"stop it first: POST /api/v1/captures/{capture_id}/stop"
        )
        self.capture_id = capture_id


class NotReady(Conflict):
    """The device does not stream, or there is no calibration."""


class RingOverrun(GrabberdError):
    """The ring has overtaken a reader that may miss nothing: `count` fields from `first_n` on are gone."""

    def __init__(self, first_n: int, count: int) -> None:
        super().__init__(
            f"{count} fields from number {first_n} on were overwritten in the ring before they were read",
            "the computer was too busy: lighten its load, use a longer ring, or capture with overrun 'count'",
        )
        self.first_n = first_n
        self.count = count


class AccessExpired(GrabberdError):
    """A token has been good until a day that has passed."""


class StorageError(GrabberdError):
    """The disk is full, read-only or broken."""


class ExtraMissing(GrabberdError):
    """What is asked for needs an optional part of grabberd that is not installed; `extra` names it."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(
            f"{what} needs an optional part of grabberd that is not installed: {extra}",
            f"install it: pip install 'grabberd[{extra}]'",
        )
        self.extra = extra


class MeasurementError(GrabberdError):
    """The data do not determine what is asked of them."""


class RankDeficient(MeasurementError):
    """The data determine some unknowns only together; `parameters` names them."""

    def __init__(self, message: str, hint: str, parameters: Sequence[str]) -> None:
        super().__init__(message, hint)
        self.parameters = tuple(parameters)


class AnalysisError(MeasurementError):
    """The points or inputs do not give the surface, strain, pressure or cycle that is asked of them."""

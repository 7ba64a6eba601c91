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
    │   ├── GroupRefused          captures cannot all begin together, so none does: carries why, by device
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

from collections.abc import Mapping, Sequence
from enum import StrEnum
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


class Cause(StrEnum):
    """Why the instrument cannot do its work, in a word that programs and the page's texts go by."""

    NOT_OPENED = "not_opened"
    """The daemon has only just started."""
    DRIVER_MISSING = "driver_missing"
    DEVICE_ABSENT = "device_absent"
    DEVICE_LOST = "device_lost"
    STREAM_FAILED = "stream_failed"
    DEVICE_BUSY = "device_busy"
    """Another program has it."""
    NO_RIGHTS = "no_rights"
    NO_BANDWIDTH = "no_bandwidth"
    """Its USB bus has no room for its stream."""
    WRONG_STANDARD = "wrong_standard"
    """What comes is no PAL."""
    SEVERAL_DEVICES = "several_devices"
    """More than one is what the configuration asks for."""
    DEVICE_REFUSED = "device_refused"
    """It says no for another reason."""
    RECORDING_ENDED = "recording_ended"
    RECORDING_DAMAGED = "recording_damaged"
    FAULT = "fault"
    """Of this program."""
    NO_SIGNAL = "no_signal"
    """The grabber says that there is no camera."""
    NO_PICTURE = "no_picture"
    """What comes is made up by the grabber."""
    NO_CALIBRATION = "no_calibration"
    NO_OBJECT = "no_object"
    CALIBRATION_MISFIT = "calibration_misfit"
    DISK_MISSING = "disk_missing"
    DISK_READ_ONLY = "disk_read_only"
    DISK_FAILED = "disk_failed"


class DeviceError(GrabberdError):
    """The grabber does not do what is asked of it; `cause` is why."""

    cause = Cause.DEVICE_REFUSED


class DriverMissing(DeviceError):
    """No such driver, or what it needs is not installed."""

    cause = Cause.DRIVER_MISSING


class DeviceAbsent(DeviceError):
    """The grabber is not there (yet)."""

    cause = Cause.DEVICE_ABSENT


class DeviceLost(DeviceError):
    """The grabber went away while it streamed."""

    cause = Cause.DEVICE_LOST


class StreamFailed(DeviceError):
    """The grabber is there, but streams no more."""

    cause = Cause.STREAM_FAILED


class DeviceRefused(DeviceError):
    """The grabber is there and says no."""

    def __init__(self, message: str, hint: str, cause: Cause = Cause.DEVICE_REFUSED) -> None:
        super().__init__(message, hint)
        self.cause = cause


class StreamEnded(DeviceError):
    """A recording has no further field."""

    cause = Cause.RECORDING_ENDED


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


class GroupRefused(Conflict):
    """Captures cannot all begin together, so none does; `refusals` says why, by device."""

    def __init__(self, refusals: Mapping[str, GrabberdError]) -> None:
        said = "; ".join(f"{device}: {error.message}" for device, error in refusals.items())
        hints = dict.fromkeys(error.hint for error in refusals.values())
        super().__init__(
            f"they cannot all begin together, so none does: {said}",
            f"{'; '.join(hints)}; or leave these devices out: {', '.join(refusals)}",
        )
        self.refusals = dict(refusals)


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

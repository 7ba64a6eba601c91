"""Every error that grabberd raises on purpose.

    GrabberdError                 message and hint; never raised itself
    ├── ConfigError               the configuration is invalid: lists all problems at once (exit 78)
    ├── DeviceError               the grabber does not do what it was asked to
    │   ├── DriverMissing         unknown driver, or its dependency is not installed
    │   ├── DeviceAbsent          not plugged in (yet): worth trying again
    │   ├── DeviceLost            disappeared while streaming: close, then open again
    │   ├── StreamFailed          present, but no longer streaming: restart, reopen, reset
    │   ├── DeviceRefused         present, but busy, not permitted or misconfigured: a person has to act
    │   └── StreamEnded           end of a recording; everything before it is good
    ├── InputError                a file or value from outside is invalid
    │   ├── PictureError          a picture is missing, truncated or of the wrong size
    │   ├── CaptureFileError      a capture file is damaged, or not a capture file
    │   │   └── LaterVersion      written by a later version: not damaged, leave it alone
    │   └── CalibrationMismatch   a calibration of another picture size, glass or rig
    ├── NotFound                  no capture, run, field or job of that name
    ├── Conflict                  not possible in the present state
    │   ├── CaptureRunning        another capture is running: carries its id
    │   ├── GroupRefused          not all captures of a group can start, so none does: carries the refusals
    │   └── NotReady              the device does not stream, or has no calibration
    ├── RingOverrun               a reader that must not miss anything was overtaken: its capture ends
    ├── ReadingGivenUp            nobody waits any longer for what is being read; says nothing of the file
    ├── AccessExpired             the token has expired
    ├── StorageError              the disk is full, read-only or broken, or its folder is gone
    │   └── IndexRebuilding       the list of captures is being made anew: worth trying again
    ├── ExtraMissing              an optional dependency is not installed: carries the extra's name
    └── MeasurementError          the data do not determine the result
        ├── AmbiguousView         several hypotheses explain a view of the calibration frame
        ├── MirroredPicture       a view is seen mirrored, or the views swapped, unlike the configured rig
        ├── RankDeficient         some unknowns are determined only in combination: names them
        └── AnalysisError         the points do not determine the surface, strain, pressure or cycle

A class exists only where a caller reacts differently to it. A message says what failed, on what, with which
values; the hint says what to do about it.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple


def count_of(count: int, one: str, several: str = "") -> str:
    """A number with its noun, as messages have it: "1 field", "2 fields"; `several` if it adds no s."""
    return f"{count} {one if count == 1 else several or f'{one}s'}"


class GrabberdError(Exception):
    """Base class; `message` says what failed, on what, with which values, `hint` what the operator can do."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.add_note(f"hint: {hint}")  # tracebacks and notebooks show it


class Problem(NamedTuple):
    """One problem in a configuration file."""

    file: str
    key: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.key}: {self.message}"


WHOLE_FILE = "(file)"
"""Key of a problem that the file has as a whole."""


class ConfigError(GrabberdError):
    """The configuration is invalid; `problems` lists everything that is wrong with it."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        count = count_of(len(problems), "problem")
        listing = "\n".join(f"  {problem}" for problem in problems)
        hint = "fix these keys; 'grabberd check-config FILE' checks without starting anything"
        if all(problem.key == WHOLE_FILE for problem in problems):
            hint = "name a configuration file (YAML); 'grabberd check-config FILE' checks one"
        super().__init__(f"the configuration has {count}:\n{listing}", hint)
        self.problems = tuple(problems)


class Cause(StrEnum):
    """Machine-readable code of the reason why an instrument cannot work; the page has a text for each."""

    NOT_OPENED = "not_opened"
    """The daemon has only just started."""
    DRIVER_MISSING = "driver_missing"
    DEVICE_ABSENT = "device_absent"
    DEVICE_LOST = "device_lost"
    STREAM_FAILED = "stream_failed"
    DEVICE_BUSY = "device_busy"
    """Another program holds the device."""
    NO_RIGHTS = "no_rights"
    NO_BANDWIDTH = "no_bandwidth"
    """The USB bus has too little bandwidth left for the stream."""
    WRONG_STANDARD = "wrong_standard"
    """The signal is not PAL."""
    SEVERAL_DEVICES = "several_devices"
    """More than one device matches the configuration."""
    DEVICE_REFUSED = "device_refused"
    """The device refused for another reason."""
    RECORDING_ENDED = "recording_ended"
    RECORDING_DAMAGED = "recording_damaged"
    FAULT = "fault"
    """An unexpected error in grabberd itself."""
    CAPTURE_STUCK = "capture_stuck"
    """The thread that takes the fields does not go on: it hangs in the kernel's driver or in the program."""
    COMPUTER_BUSY = "computer_busy"
    """The program waited for a processor, or was busy itself, and fields were lost."""
    PROGRAM_STOPPED = "program_stopped"
    """The program was stopped for a while, and fields were lost."""
    DRIVER_HUNG = "driver_hung"
    """The kernel's driver did not return from a call for a while, and fields were lost."""
    NO_SIGNAL = "no_signal"
    """The grabber reports that no camera is connected."""
    NO_PICTURE = "no_picture"
    """The grabber delivers a picture of its own: blue, bars, snow."""
    NO_CALIBRATION = "no_calibration"
    NO_OBJECT = "no_object"
    CALIBRATION_MISFIT = "calibration_misfit"
    DISK_MISSING = "disk_missing"
    DISK_READ_ONLY = "disk_read_only"
    DISK_FAILED = "disk_failed"
    CAPTURES_MISSING = "captures_missing"
    """The folder of captures was renamed, deleted or unmounted."""
    CAPTURES_REPLACED = "captures_replaced"
    """Another folder stands in the place of the folder of captures."""
    INDEX_REBUILDING = "index_rebuilding"
    """The list of captures was damaged and is being made anew from their files."""
    INDEX_FAILED = "index_failed"
    """The list of captures is damaged and cannot be made anew."""
    CAPTURE_UNSEALED = "capture_unsealed"
    """A capture has ended, but its file could not be sealed yet."""
    CAPTURE_CHANGED = "capture_changed"
    """A sealed capture is no longer what was written: the disk has changed it."""
    LOGGER_FAILED = "logger_failed"
    """A data logger gives no readings."""
    LOGGER_DOUBTFUL = "logger_doubtful"
    """A data logger says what is no reading, or what no vacuum can be."""
    SETTINGS_RESTORED = "settings_restored"
    """The settings were damaged and come from a backup."""
    SETTINGS_LOST = "settings_lost"
    """The settings were damaged, and there is no good backup."""
    SETTINGS_UNREADABLE = "settings_unreadable"
    """The settings cannot be read or backed up now."""
    JOBS_LOST = "jobs_lost"
    """The queue of jobs was damaged, and an empty one has begun."""
    JOBS_UNWRITABLE = "jobs_unwritable"
    """The queue of jobs cannot be written, so that jobs wait."""


class DeviceError(GrabberdError):
    """The grabber does not do what it was asked to; `cause` is the reason code."""

    cause = Cause.DEVICE_REFUSED


class DriverMissing(DeviceError):
    """The driver is unknown, or a dependency of it is not installed."""

    cause = Cause.DRIVER_MISSING


class DeviceAbsent(DeviceError):
    """The grabber is not plugged in (yet)."""

    cause = Cause.DEVICE_ABSENT


class DeviceLost(DeviceError):
    """The grabber disappeared while it was streaming."""

    cause = Cause.DEVICE_LOST


class StreamFailed(DeviceError):
    """The grabber is present, but no longer streaming."""

    cause = Cause.STREAM_FAILED


class DeviceRefused(DeviceError):
    """The grabber is present, but cannot be used until a person acts."""

    def __init__(self, message: str, hint: str, cause: Cause = Cause.DEVICE_REFUSED) -> None:
        super().__init__(message, hint)
        self.cause = cause


class StreamEnded(DeviceError):
    """The end of a recording was reached."""

    cause = Cause.RECORDING_ENDED


class InputError(GrabberdError):
    """A file or a value from outside is invalid."""


class PictureError(InputError):
    """A picture is missing, truncated or of the wrong size."""


class CaptureFileError(InputError):
    """A capture file is damaged, or not a capture file at all."""


class LaterVersion(CaptureFileError):
    """A capture file was written by a later version of grabberd; it is not damaged."""


class CalibrationMismatch(InputError):
    """A calibration was made for another picture size, glass or rig."""


class NotFound(GrabberdError):
    """No capture, run, field or job of that name."""


class Conflict(GrabberdError):
    """The request conflicts with the present state."""


class CaptureRunning(Conflict):
    """Another capture is already running; `capture_id` names it."""

    def __init__(self, capture_id: str) -> None:
        super().__init__(
            f"capture {capture_id} is running", f"stop it first: POST /api/v1/captures/{capture_id}/stop"
        )
        self.capture_id = capture_id


class GroupRefused(Conflict):
    """Not all captures of a group can start, so none does; `refusals` has the reasons by device."""

    def __init__(self, refusals: Mapping[str, GrabberdError]) -> None:
        reasons = "; ".join(f"{device}: {error.message}" for device, error in refusals.items())
        hints = dict.fromkeys(error.hint for error in refusals.values())
        super().__init__(
            f"not all captures of the group can start, so none was started: {reasons}",
            f"{'; '.join(hints)}; or leave out these devices: {', '.join(refusals)}",
        )
        self.refusals = dict(refusals)


class NotReady(Conflict):
    """The device does not stream, or has no calibration."""


class RingOverrun(GrabberdError):
    """The ring overtook a reader that must not miss anything: `count` fields from `first_n` on are lost."""

    def __init__(self, first_n: int, count: int) -> None:
        super().__init__(
            f"{count_of(count, 'field')} from number {first_n} on overwritten in the ring before being read",
            "the computer was too busy: reduce its load, use a longer ring, or capture with overrun 'count'",
        )
        self.first_n = first_n
        self.count = count


class ReadingGivenUp(GrabberdError):
    """Nobody waits any longer for what is being read: its time is over, or the client has left.

    It says nothing of the file: no StorageError, so that nothing calls the file damaged or tries again.
    """


class AccessExpired(GrabberdError):
    """The token has expired."""


class StorageError(GrabberdError):
    """The disk is full, read-only or broken, or its folder is gone; `cause` is the reason code, or None."""

    def __init__(self, message: str, hint: str, cause: Cause | None = None) -> None:
        super().__init__(message, hint)
        self.cause = cause


NO_PERMISSION = (
    "run it as the user whose folder that is, such as the daemon's: sudo -u grabberd grabberd …; or use a "
    "folder of your own (storage.directory in the configuration, or STATE_DIRECTORY)"
)
"""Hint where a file or folder belongs to another user."""


class IndexRebuilding(StorageError):
    """The index of captures is being rebuilt at this moment."""


class ExtraMissing(GrabberdError):
    """An optional dependency is not installed; `extra` names the extra of grabberd that brings it."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(
            f"{what} needs an optional part of grabberd that is not installed: {extra}",
            f"install it: pip install 'grabberd[{extra}]'",
        )
        self.extra = extra


class MeasurementError(GrabberdError):
    """The data do not determine the result that was asked for."""


class AskedTarget(NamedTuple):
    """Target of the calibration frame that is sought in a picture.

    Attributes:
        id: Of the target.
        places_px: Its possible places in the left view, frame pixels.
    """

    id: int
    places_px: tuple[tuple[float, float], ...]


class AmbiguousView(MeasurementError):
    """More than one hypothesis explains a view of the calibration frame.

    Attributes:
        asks: Targets whose places in the picture decide.
        added_mm: Places of further targets that would decide every picture of the frame.
        turns: By each turn in degrees that an unmirrored picture may show, what it shows then.
    """

    def __init__(
        self,
        message: str,
        hint: str,
        asks: Sequence[AskedTarget] = (),
        added_mm: Sequence[tuple[float, ...]] = (),
        turns: Mapping[int, str] | None = None,
    ) -> None:
        super().__init__(message, hint)
        self.asks = tuple(asks)
        self.turns = dict(turns or {})
        self.added_mm = tuple(added_mm)


class MirroredPicture(MeasurementError):
    """The picture shows a view mirrored, or the views swapped, against the rig's configuration."""


class RankDeficient(MeasurementError):
    """The data determine some unknowns only in combination; `parameters` names them."""

    def __init__(self, message: str, hint: str, parameters: Sequence[str]) -> None:
        super().__init__(message, hint)
        self.parameters = tuple(parameters)


class AnalysisError(MeasurementError):
    """The points or inputs do not determine the surface, strain, pressure or cycle that was asked for."""


def said(words: str) -> str:
    """Returns what a check of a value says, without the words that pydantic puts before it."""
    return words.removeprefix("Value error, ")

"""Translation of the kernel's error numbers to errors with hints for the operator."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import Cause, DeviceAbsent, DeviceError, DeviceLost, DeviceRefused, StreamFailed

GONE = frozenset({errno.ENODEV, errno.ENXIO, errno.ENOENT})
"""Error numbers of calls on a missing device."""


class _Meaning(NamedTuple):
    """Meaning of an error number; without a cause the device is malfunctioning."""

    cause: Cause | None
    what: str
    hint: str

    def error(self, message: str, path: Path) -> DeviceError:
        hint = self.hint.format(path=path)
        return StreamFailed(message, hint) if self.cause is None else DeviceRefused(message, hint, self.cause)


_RIGHTS = _Meaning(
    Cause.NO_RIGHTS,
    "may not be opened by this user",
    "add grabberd's user to the group 'video', or install the driver's udev rule; then log in again, or "
    "restart the service",
)
_HUNG = _Meaning(
    None,
    "does not respond properly",
    "grabberd retries; if this persists, unplug it and plug it in again",
)
_MEANINGS = {
    errno.EBUSY: _Meaning(
        Cause.DEVICE_BUSY,
        "is in use by another program",
        "end that program; 'fuser -v {path}' shows which it is",
    ),
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.EISDIR: _Meaning(Cause.DEVICE_REFUSED, "is a directory", "name a node such as /dev/video0"),
    errno.ENOTTY: _Meaning(
        Cause.DEVICE_REFUSED,
        "is not a video device, or lacks a required function",
        "'grabberd devices' lists the available devices",
    ),
    errno.ENOSPC: _Meaning(
        Cause.NO_BANDWIDTH,
        "finds no bandwidth left on its USB bus",
        "PAL takes 20.7 MB/s: one dongle per USB 2.0 bus, none at USB 1.1 speed; plug it into another bus, "
        "or ask a digital camera for a smaller 'size' or 'rate_hz', or for 'format: MJPG'",
    ),
    errno.ENOMEM: _Meaning(
        Cause.DEVICE_REFUSED,
        "gets no memory for its buffers",
        "reduce the option 'buffers'; 8 are enough",
    ),
    # Returned by a USB dongle with hung firmware; a reset of its port often revives it.
    errno.EIO: _HUNG,
    errno.EPIPE: _HUNG,
    errno.EPROTO: _HUNG,
    errno.ETIMEDOUT: _HUNG,
}
_OTHERWISE = _Meaning(
    Cause.DEVICE_REFUSED, "refuses a request", "'v4l2-ctl -d {path} --all' and 'dmesg' show details"
)


def failure(error: OSError, path: Path, gone: type[DeviceError]) -> DeviceError:
    """The device error for a kernel error.

    Args:
        error: Kernel error; its `filename`, if any, is the name of the failed call.
        path: Path of the node.
        gone: Class of the error for a missing device.
    """
    answer = f"{error.filename or 'open'}: {os.strerror(error.errno or 0)}"
    if error.errno in GONE:
        return gone(f"{path} is not there ({answer})", "plug the grabber in; grabberd retries automatically")
    meaning = _MEANINGS.get(error.errno or 0, _OTHERWISE)
    return meaning.error(f"{path} {meaning.what} ({answer})", path)


def stream_failure(error: OSError, path: Path, hint: str = "") -> DeviceError:
    """The device error for a kernel error while streaming: DeviceLost or StreamFailed.

    Args:
        error: Kernel error; see `failure`.
        path: Path of the node.
        hint: Hint of a StreamFailed; by default that of the error number.
    """
    found = failure(error, path, DeviceLost)
    return found if isinstance(found, DeviceLost) else StreamFailed(found.message, hint or found.hint)


@contextmanager
def opening(path: Path) -> Iterator[None]:
    """Translates errors while a device is being opened; if it is missing, to DeviceAbsent."""
    try:
        yield
    except OSError as error:
        raise failure(error, path, DeviceAbsent) from error


@contextmanager
def restarting(path: Path) -> Iterator[None]:
    """Translates errors while a stream is being restarted."""
    try:
        yield
    except OSError as error:
        raise stream_failure(error, path) from error

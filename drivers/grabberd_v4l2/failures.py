"""Meaning of the kernel's error numbers, and what a person can do about them."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from grabberd.errors import Cause, DeviceAbsent, DeviceError, DeviceLost, DeviceRefused, StreamFailed

GONE = frozenset({errno.ENODEV, errno.ENXIO, errno.ENOENT})
"""What calls answer on a device that is not there."""


class _Meaning(NamedTuple):
    """Meaning of an error number; without a cause the device misbehaves."""

    cause: Cause | None
    what: str
    hint: str

    def error(self, message: str, path: Path) -> DeviceError:
        hint = self.hint.format(path=path)
        return StreamFailed(message, hint) if self.cause is None else DeviceRefused(message, hint, self.cause)


_RIGHTS = _Meaning(
    Cause.NO_RIGHTS,
    "may not be opened with these rights",
    "add the user that grabberd runs as to the group 'video', or install the driver's udev rule; then log in "
    "or start the service again",
)
_HUNG = _Meaning(
    None,
    "does not answer as it should",
    "it is tried again; if it stays so, unplug it and plug it in",
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
        "is no video device, or one that cannot do what is needed",
        "'grabberd devices' lists those there are",
    ),
    errno.ENOSPC: _Meaning(
        Cause.NO_BANDWIDTH,
        "finds no bandwidth left on its USB bus",
        "PAL takes 20.7 MB/s: only one dongle a USB 2.0 bus, none at USB 1.1 speed; plug it into another bus",
    ),
    errno.ENOMEM: _Meaning(
        Cause.DEVICE_REFUSED,
        "gets no memory for its buffers",
        "ask for fewer: option 'buffers'; 8 are enough",
    ),
    errno.EIO: _HUNG,
    errno.EPIPE: _HUNG,
    errno.EPROTO: _HUNG,
    errno.ETIMEDOUT: _HUNG,
}
_OTHERWISE = _Meaning(
    Cause.DEVICE_REFUSED, "refuses what is asked of it", "'v4l2-ctl -d {path} --all' and 'dmesg' tell more"
)


def failure(error: OSError, path: Path, gone: type[DeviceError]) -> DeviceError:
    """The kernel's answer in this program's words.

    Args:
        error: its `filename`, where it has one, is the call that failed.
        path: the node.
        gone: what to make of a device that is not there.
    """
    answer = f"{error.filename or 'open'}: {os.strerror(error.errno or 0)}"
    if error.errno in GONE:
        return gone(f"{path} is not there ({answer})", "plug the grabber in; it is tried again by itself")
    meaning = _MEANINGS.get(error.errno or 0, _OTHERWISE)
    return meaning.error(f"{path} {meaning.what} ({answer})", path)


@contextmanager
def opening(path: Path) -> Iterator[None]:
    """While a device is being opened: one that is not there is absent."""
    try:
        yield
    except OSError as error:
        raise failure(error, path, DeviceAbsent) from error


@contextmanager
def restarting(path: Path) -> Iterator[None]:
    """While an open device's stream is started again: one that is not there is lost, all else has failed."""
    try:
        yield
    except OSError as error:
        told = failure(error, path, DeviceLost)
        raise told if isinstance(told, DeviceLost) else StreamFailed(told.message, told.hint) from error

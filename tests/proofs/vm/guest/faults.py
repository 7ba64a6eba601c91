"""What can happen to the kernel's test device, by name."""

import os
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from proofs.vm.guest import instrument, vivid
from proofs.vm.guest.shell import run


class Fault(NamedTuple):
    """Something that happens, and how it ends, `after_s` later; without an end it is over at once."""

    happen: Callable[[], None]
    heal: Callable[[], None] | None = None
    after_s: float = 0.0


def _control(name: str, value: int, *, then: int | None = None, after_s: float = 0.0) -> Fault:
    heal = None if then is None else lambda: vivid.set_controls(**{name: then})
    return Fault(lambda: vivid.set_controls(**{name: value}), heal, after_s)


def _restart_that_fails(button: str) -> Fault:
    return Fault(lambda: vivid.set_controls(**{button: 1, "inject_fatal_streaming_error": 1}))


def _restart_with(name: str) -> Fault:
    """The control takes effect with the next start of the stream."""

    def happen() -> None:
        vivid.set_controls(**{name: 1, "inject_fatal_streaming_error": 1})

    return Fault(happen, lambda: vivid.set_controls(**{name: 0}), 4.0)


def _stand_still(seconds: float) -> None:
    """The whole process, as when the computer has something else to do."""
    run(f"kill -STOP {os.getpid()}; sleep {seconds}; kill -CONT {os.getpid()}")


FAULTS: Mapping[str, Fault] = {
    "buffer flagged damaged": _control("inject_v4l2_buf_flag_error", 1),
    "one buffer in five dropped": _control("percentage_of_dropped_buffers", 20, then=0, after_s=2.0),
    "all buffers dropped": _control("percentage_of_dropped_buffers", 100, then=0, after_s=3.0),
    "requeueing fails once": _control("inject_vidioc_qbuf_error", 1),
    "fatal streaming error": _control("inject_fatal_streaming_error", 1),
    "fatal error, then STREAMON fails": _restart_that_fails("inject_vidioc_streamon_error"),
    "fatal error, then REQBUFS fails": _restart_that_fails("inject_vidioc_reqbufs_error"),
    "disconnected": _control("disconnect", 1),
    "unplugged for 5 s": Fault(vivid.unplug, vivid.plug_in, 5.0),
    "no signal": _control("standard_signal_mode", 1, then=0, after_s=3.0),
    "no lock": _control("standard_signal_mode", 2, then=0, after_s=3.0),
    "another standard": _control("standard_signal_mode", 4, then=0, after_s=3.0),
    "a standard that changes all the time": _control("standard_signal_mode", 5, then=0, after_s=3.0),
    "times of the future": _control("timestamp_source", 0, then=1, after_s=3.0),
    "sequence near its wrap": _restart_with("wrap_sequence_number"),
    "times near their wrap, 64 bits": _restart_with("wrap_timestamp"),
    "process stopped for 0.2 s": Fault(lambda: _stand_still(0.2)),
    "process stopped for 0.6 s": Fault(lambda: _stand_still(0.6)),
    "black picture": _control("test_pattern", 5, then=4, after_s=3.0),
    "blue picture": _control("test_pattern", 9, then=4, after_s=3.0),
    "noise for a picture": _control("test_pattern", 21, then=4, after_s=3.0),
}


def happen(name: str) -> None:
    """Does it to the device that the installed service has, and waits until it is over."""
    fault = FAULTS[name]
    fault.happen()
    if fault.heal is not None:
        time.sleep(fault.after_s)
        fault.heal()


def suffer(name: str, return_s: float = instrument.RETURN_S, **options: Any) -> dict[str, Any]:
    """A capture through a fault, by a service that has seen no other."""
    instrument.start(**options)
    try:
        return instrument.capture_through(*FAULTS[name], return_s=return_s)
    finally:
        instrument.stop()


def quiet(seconds: float, **options: Any) -> dict[str, Any]:
    """A capture to which nothing happens."""
    instrument.start(**options)
    try:
        return instrument.capture_through(lambda: time.sleep(seconds), None, 0.0)
    finally:
        instrument.stop()


def comes_back_as_another_node(**options: Any) -> dict[str, Any]:
    """Another program holds the old node, so its number is not free."""
    instrument.start(**options)
    before = instrument.node()
    held = os.open(before, os.O_RDWR)
    try:
        result = instrument.capture_through(vivid.unplug, vivid.plug_in, 3.0)
        return {**result, "nodes": [before, instrument.node()]}
    finally:
        os.close(held)
        instrument.stop()

"""A service on the simulated grabber for tests: as fast as its reader goes, or at the camera's own pace."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from grabberd.config import Config, default_config_file, load_config
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.setup import set_up
from grabberd.runtime import SystemClock
from grabberd.server.daemon.service import Service
from grabberd_fake import FakeGrabber

PATIENCE_S = 120.0
# A grabber that has not waited for so long is closed; whether its thread has ended is looked at so often.
GONE_S, LOOK_S = 10.0, 0.05
T = TypeVar("T")


def configuration(options: Mapping[str, Any], **changes: Any) -> Config:
    """The simulated grabber's configuration, with other options and changes of the device's part.

    It has as many buffers as it may have: on a busy computer its reader is late.
    """
    config = load_config(default_config_file())
    device = config.devices["simulated"]
    changed = device.model_copy(update={"options": {**device.options, "buffers": 32, **options}, **changes})
    return config.model_copy(update={"devices": {"simulated": changed}})


class PatientClock(SystemClock):
    """Goes on only while all grabbers wait for their next fields: whoever takes them is never late."""

    def __init__(self) -> None:
        self._now_ns = super().now_ns()
        self._heeded_ns: dict[int, int] = {}
        self._heeds = threading.Condition()

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        """Goes on to this time once no other thread that slept here has something to do before."""
        own = threading.get_ident()
        with self._heeds:
            self._heeded_ns[own] = time_ns
            self._heeds.notify_all()
        self.pace(max(time_ns - self._now_ns, 0) / 1e9)
        with self._heeds:
            gone_s = time.monotonic() + GONE_S
            while self._somebody_is_behind(time_ns):
                if time.monotonic() > gone_s:
                    self._heeded_ns = {own: time_ns}
                self._heeds.wait(LOOK_S)
            self._now_ns = max(self._now_ns, time_ns)

    def _somebody_is_behind(self, time_ns: int) -> bool:
        living = {thread.ident for thread in threading.enumerate()}
        self._heeded_ns = {who: until for who, until in self._heeded_ns.items() if who in living}
        return min(self._heeded_ns.values()) < time_ns

    def pace(self, seconds: float) -> None:
        """Lets so much of this clock's time pass for the calling thread."""
        time.sleep(seconds)

    def pass_by(self, seconds: float) -> None:
        """Goes on by so much at once."""
        self._now_ns += round(seconds * 1e9)


@contextmanager
def running(folder: Path, options: Mapping[str, Any] | None = None, **changes: Any) -> Iterator[Service]:
    """A started service; fast, unless the options say otherwise."""
    config = configuration({"pace": "free", **(options or {})}, **changes)
    with started(Service(set_up(config, default_config_file()), folder)) as service:
        yield service


@contextmanager
def standing(folder: Path) -> Iterator[Service]:
    """A started, fast service whose own clock stands: what was measured last stays what is newest."""
    config = configuration({"pace": "free"})
    with started(Service(set_up(config, default_config_file()), folder, clock=PatientClock())) as service:
        yield service


def patient(folder: Path, options: Mapping[str, Any] | None = None, **changes: Any) -> Service:
    """A service at the camera's pace but without the computer's delays: every field comes in time."""
    config = configuration({"pace": "real", **(options or {})}, **changes)
    clock = PatientClock()
    setups = set_up(config, default_config_file())
    grabber = FakeGrabber(clock=clock, **config.devices["simulated"].options)
    setups["simulated"] = replace(setups["simulated"], grabber=grabber)
    return Service(setups, folder, clock=clock)


@contextmanager
def live(folder: Path, options: Mapping[str, Any] | None = None, **changes: Any) -> Iterator[Service]:
    """A patient service that has started."""
    with started(patient(folder, options, **changes)) as service:
        yield service


@contextmanager
def started(service: Service) -> Iterator[Service]:
    """It accepts captures; it is stopped at the end, whatever happens."""
    service.start()
    try:
        wait_until_it_accepts(service)
        yield service
    finally:
        service.stop()


def wait_until_it_accepts(service: Service) -> None:
    """The capture thread has opened the device."""
    board, captures = service.instrument(None).board, service.instrument(None).captures
    with board.changed:
        assert board.changed.wait_for(lambda: captures.accepts, PATIENCE_S), board.now


def until(found: Callable[[], T | None]) -> T:
    """What is found as soon as there is something."""
    end_s = time.monotonic() + PATIENCE_S
    while not (seen := found()):
        assert time.monotonic() < end_s, seen
        time.sleep(0.02)
    return seen


def sealed(service: Service) -> Recording:
    """The last capture, once its file is sealed."""
    recording = service.instrument(None).captures.recording
    assert recording is not None
    assert recording.sealed.wait(PATIENCE_S)
    return recording

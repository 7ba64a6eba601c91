"""A service on the simulated grabber for tests: as fast as its reader goes, or at the camera's own pace."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from grabberd.clock import SystemClock
from grabberd.config import Config, default_config_file, load_config
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service
from grabberd_fake import FakeGrabber

PATIENCE_S = 120.0
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
    """Goes on only while the grabber waits for its next field: whoever takes it is never late."""

    def __init__(self) -> None:
        self._now_ns = super().now_ns()

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        time.sleep(max(time_ns - self._now_ns, 0) / 1e9)
        self._now_ns = max(self._now_ns, time_ns)

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

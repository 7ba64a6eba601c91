"""The daemon for a browser: serve.py PORT OPTIONS. Its grabber waits for its reader.

OPTIONS are the simulated grabber's, as JSON; besides, `config` names a configuration file, `location` the
locator that all devices measure with, `idle_slowness` how slowly time passes while nothing is captured, and
`capture_slowness` while a capture of a set length is; `loggers` has those of the configuration read, too,
with the script `logger_faults`.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd.config import Config, LocationConfig, default_config_file, load_config
from grabberd.instrument.channels.logger_setup import set_up_loggers
from grabberd.instrument.setup import set_up
from grabberd.server.api import create_app, serving
from grabberd.server.api.guard.front import Front, bind
from grabberd.server.daemon.service import Service
from grabberd_fake import FakeGrabber, FakeLogger

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "support")]

from running import PatientClock  # noqa: E402 - a helper of the service's tests

# A page shows a few fields a second, and drawing and measuring all fifty took most of these tests' processor
# time. Busy computers are slower than this, so nothing here may depend on it.
IDLE_SLOWNESS = 20
# The first fields come quickly: until there are some, the daemon has no verdict on its grabber.
WARM_UP_S = 2.0
# What somebody waits for anyway need not take the camera's time: none is lost, since the grabber waits.
CAPTURE_SLOWNESS = 0.3
# Longest time that the clock keeps a pace after another one is due.
HEED_S = 0.05


class VaryingClock(PatientClock):
    """A patient clock that runs faster or slower than time does.

    Attributes:
        slowness: Tells how slow it is at the moment; 1 is the camera's pace.
    """

    def __init__(self) -> None:
        super().__init__()
        self.slowness: Callable[[], float] = lambda: 1.0
        self._warm_ns = self._now_ns + int(WARM_UP_S * 1e9)

    @property
    def is_warm(self) -> bool:
        """True once the first fields have been taken."""
        return self._now_ns >= self._warm_ns

    def pace(self, seconds: float) -> None:
        while seconds > 0:
            slowness = self.slowness()
            slept_s = min(seconds * slowness, HEED_S)
            time.sleep(slept_s)
            seconds -= slept_s / slowness


class WaitingClock:
    """The grabber's clock for a logger, which waits until that has gone on."""

    def __init__(self, clock: VaryingClock) -> None:
        self._clock = clock

    def now_ns(self) -> int:
        return self._clock.now_ns()

    def sleep_until_ns(self, time_ns: int) -> None:
        while self.now_ns() < time_ns:
            time.sleep(0.005)


def service_of(options: dict[str, Any]) -> Service:
    """A service whose simulated grabber loses nothing."""
    file = Path(options.pop("config", None) or default_config_file())
    config = located(load_config(file), options.pop("location", None))
    read = set_up_loggers(config, file) if options.pop("loggers", False) else {}
    faults = options.pop("logger_faults", [])
    idle, capture = (
        options.pop(name, usual)
        for name, usual in (("idle_slowness", IDLE_SLOWNESS), ("capture_slowness", CAPTURE_SLOWNESS))
    )
    clock = VaryingClock()
    setups = set_up(config, file)
    for name, device in config.devices.items():
        grabber = FakeGrabber(clock=clock, **{**device.options, "buffers": 32, **options})
        setups[name] = replace(setups[name], grabber=grabber)
    loggers = {
        name: replace(one, logger=FakeLogger(clock=WaitingClock(clock), faults=faults, **one.config.options))
        for name, one in read.items()
    }
    folder = Path(os.environ["STATE_DIRECTORY"])
    service = Service(setups, folder, loggers=loggers, config=(config, file), clock=clock)
    clock.slowness = lambda: slowness(service, idle if clock.is_warm else min(idle, capture), capture)
    return service


def slowness(service: Service, idle: float, capture: float) -> float:
    """How slowly time passes at the moment.

    A capture that waits for its trigger, or lasts until it is stopped, gets the camera's pace: somebody looks
    at it meanwhile.
    """
    running = [one.captures.running for one in service.instruments.values() if one.captures.running]
    if any(one.captures.armed for one in service.instruments.values()):
        return 1.0
    if not running:
        return idle
    return capture if all(one.recorder.length_fields for one in running) else 1.0


def located(config: Config, method: str | None) -> Config:
    """The configuration with this locator, if one is named."""
    if method is None:
        return config
    location = LocationConfig(method=method)
    devices = {name: one.model_copy(update={"location": location}) for name, one in config.devices.items()}
    return config.model_copy(update={"devices": devices})


def main(port: str, options: str) -> None:
    """Serves until it is told to end."""
    sys.setswitchinterval(0.001)
    service = service_of(json.loads(options))
    service.start()
    front = Front()
    serving.run(serving.server_of(create_app(service, front), front), bind("127.0.0.1", int(port)))


if __name__ == "__main__":
    main(*sys.argv[1:])

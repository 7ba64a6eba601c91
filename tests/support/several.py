"""A service with several simulated grabbers."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from running import PATIENCE_S, PatientClock, configuration

from grabberd.archive.catalogue.disk_guard import DiskGuard
from grabberd.config import LocationConfig, default_config_file
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service
from grabberd_fake import FakeGrabber

Options = Mapping[str, Any]
UNPLUGGED: Options = {"faults": [{"kind": "unplug", "at_s": 0, "back_after_s": 1e6}]}


def service_of(folder: Path, devices: Mapping[str, Options], disk: DiskGuard | None = None) -> Service:
    """As fast as their readers go, unless a device's options say otherwise: then without the computer's
    delays.
    """
    config = configuration({}, location=LocationConfig(method="centroid"))
    usual = config.devices["simulated"]
    parts = {
        name: usual.model_copy(update={"options": {**usual.options, "pace": "free", **options}})
        for name, options in devices.items()
    }
    setups = set_up(config.model_copy(update={"devices": parts}), default_config_file())
    clock = PatientClock()
    setups = {
        name: replace(setup, grabber=FakeGrabber(clock=clock, **setup.config.options))
        for name, setup in setups.items()
    }
    return Service(setups, folder, clock=clock, disk=disk)


def wait_until_they_accept(service: Service, *names: str) -> None:
    """All of them, or those of these names."""
    for name in names or service.instruments:
        instrument = service.instrument(name)
        with instrument.board.changed:
            ready = instrument.board.changed.wait_for(lambda one=instrument: one.captures.accepts, PATIENCE_S)
            assert ready, instrument.board.now


@contextmanager
def several(
    folder: Path, devices: Mapping[str, Options], *accepting: str, disk: DiskGuard | None = None
) -> Iterator[Service]:
    """A started service whose devices accept captures, or those that are named."""
    service = service_of(folder, devices, disk)
    service.start()
    try:
        wait_until_they_accept(service, *accepting)
        yield service
    finally:
        service.stop()


def sealed_all(service: Service) -> dict[str, Path]:
    """The files of the last captures by device, once they are sealed."""
    captures = {name: one.captures for name, one in service.instruments.items()}
    recordings = {name: one.recording for name, one in captures.items() if one.recording is not None}
    for recording in recordings.values():
        assert recording.sealed.wait(PATIENCE_S)
    return {name: recording.path for name, recording in recordings.items()}

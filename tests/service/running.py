"""A service on the simulated grabber for tests: as fast as its reader goes, or at the camera's own pace."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from grabberd.config import Config, default_config_file, load_config
from grabberd.service.service import Service
from grabberd.service.session import CaptureSession
from grabberd.service.setup import set_up

PATIENCE_S = 60.0


def configuration(options: Mapping[str, Any], **changes: Any) -> Config:
    """The simulated grabber's configuration, with other options and changes of the device's part."""
    config = load_config(default_config_file())
    device = config.devices["simulated"]
    changed = device.model_copy(update={"options": {**device.options, **options}, **changes})
    return config.model_copy(update={"devices": {"simulated": changed}})


@contextmanager
def running(folder: Path, options: Mapping[str, Any] | None = None, **changes: Any) -> Iterator[Service]:
    """A started service; fast, unless the options say otherwise."""
    config = configuration({"pace": "free", **(options or {})}, **changes)
    service = Service(set_up(config, default_config_file()), folder)
    service.start()
    try:
        wait_until_it_accepts(service)
        yield service
    finally:
        service.stop()


def wait_until_it_accepts(service: Service) -> None:
    """The capture thread has opened the device."""
    board = service.instrument(None).board
    with board.changed:
        assert board.changed.wait_for(lambda: service.instrument(None).accepts, PATIENCE_S), board.now


def sealed(service: Service) -> CaptureSession:
    """The last capture, once its file is sealed."""
    session = service.instrument(None).session
    assert session is not None
    assert session.sealed.wait(PATIENCE_S)
    return session

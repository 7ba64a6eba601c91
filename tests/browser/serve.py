"""The daemon for a browser: serve.py PORT OPTIONS. Its grabber waits for its reader.

OPTIONS are the simulated grabber's, as JSON; besides, `config` names a configuration file.
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd.api import create_app, serving, sockets
from grabberd.api.guard.front import Front
from grabberd.config import default_config_file, load_config
from grabberd.service.service import Service
from grabberd.service.setup import set_up
from grabberd_fake import FakeGrabber

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[1] / "service")]

from running import PatientClock  # noqa: E402 - a helper of the service's tests


def service_of(options: dict[str, Any]) -> Service:
    """A service whose simulated grabber loses nothing."""
    file = Path(options.pop("config", None) or default_config_file())
    config = load_config(file)
    clock = PatientClock()
    setups = set_up(config, file)
    for name, device in config.devices.items():
        grabber = FakeGrabber(clock=clock, **{**device.options, "buffers": 32, **options})
        setups[name] = replace(setups[name], grabber=grabber)
    return Service(setups, Path(os.environ["STATE_DIRECTORY"]), site=dict(config.site), clock=clock)


def main(port: str, options: str) -> None:
    """Serves until it is told to end."""
    sys.setswitchinterval(0.001)
    service = service_of(json.loads(options))
    service.start()
    front = Front()
    serving.run(serving.server_of(create_app(service, front), front), sockets.bind("127.0.0.1", int(port)))


if __name__ == "__main__":
    main(*sys.argv[1:])

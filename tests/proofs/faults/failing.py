"""The daemon on which the machine and its clients fail, and its limits."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from grabberd.config import shipped_configs

from .clients import WRITE_TIMEOUT_S
from .daemon import running
from .machine import QUEUE_S, Machine

INJECTED = (sys.executable, str(Path(__file__).with_name("injected.py")))


def configuration() -> dict[str, Any]:
    """One device that is measured, short queues and short patience."""
    configs = shipped_configs()
    cup = {
        "driver": "fake",
        "options": {"scene": "liner", "buffers": 32},
        "calibration": str(configs / "fake.calibration.json"),
        "object": str(configs / "objects" / "liner.yaml"),
    }
    return {
        "devices": {"cup": cup},
        "storage": {"queue_s": QUEUE_S},
        "http": {"limits": {"write_timeout_s": WRITE_TIMEOUT_S}},
    }


@contextmanager
def failing_machine(folder: Path, *limits: str) -> Iterator[Machine]:
    """A daemon whose disk and clock can be told to fail; `limits` are options of prlimit."""
    folder.mkdir(parents=True, exist_ok=True)
    controls = folder / "controls.json"
    controls.write_text("{}")
    variables = {"FAULTS_CONTROLS": str(controls)}
    with running(folder, configuration(), (*_limited(limits), *INJECTED), variables) as daemon:
        daemon.wait_until_ready()
        yield Machine(daemon, controls)


def _limited(limits: tuple[str, ...]) -> tuple[str, ...]:
    return ("prlimit", *limits) if limits else ()

"""The only imports of the program's inner modules that locks need: who moves one changes this file."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import typer
from fastapi import FastAPI

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.state.state_database import Outbox
from grabberd.cli import main
from grabberd.cli.app import app
from grabberd.cli.terminal import console
from grabberd.config import default_config_file, load_config
from grabberd.core.ledger import Slot
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.enums import Role
from grabberd.documents.examples import CAPTURE
from grabberd.instrument.setup import set_up
from grabberd.runtime import SystemClock
from grabberd.server.api import create_app
from grabberd.server.api.problems import STATUS
from grabberd.server.daemon.jobs import KINDS
from grabberd.server.daemon.service import Service
from grabberd_liner.analyses.documents import DeviceAnalysis
from grabberd_liner.messages import device_analysis
from grabberd_liner.part import liner_of
from grabberd_lsl.outlets import DeviceEvents, PointsLayout
from grabberd_mqtt.home_assistant import discovery
from grabberd_mqtt.messages import Topics, all_topics, capture_summary, device_state

__all__ = [
    "CAPTURE",
    "KINDS",
    "STATUS",
    "CaptureDocument",
    "CaptureReader",
    "CaptureWriter",
    "DeviceAnalysis",
    "DeviceEvents",
    "FastAPI",
    "Outbox",
    "PointsLayout",
    "Role",
    "Service",
    "Slot",
    "Topics",
    "all_topics",
    "app",
    "capture_summary",
    "click_commands",
    "console",
    "create_app",
    "device_analysis",
    "device_state",
    "discovery",
    "liner_of",
    "main",
    "openapi",
    "opened",
    "service_in",
]


class FixedClock(SystemClock):
    """Shows one time of day for ever."""

    def __init__(self, utc: str) -> None:
        self._utc = datetime.fromisoformat(utc)

    def utc_now(self) -> datetime:
        """That time."""
        return self._utc


def service_in(folder: Path, now_utc: str | None = None) -> Service:
    """A service on the simulated grabber, by default by the computer's own clock."""
    file = default_config_file()
    clock = None if now_utc is None else FixedClock(now_utc)
    return Service(set_up(load_config(file), file), folder, clock=clock)


@contextmanager
def opened(folder: Path, now_utc: str) -> Iterator[Service]:
    """A service that has read its state directory; nothing of it runs."""
    service = service_in(folder, now_utc)
    service.open()
    try:
        service.archive.open()
        service.open_stores()
        yield service
    finally:
        service.processes.end()
        service.archive.close()
        service.state_keeper.close()


def openapi() -> dict[str, Any]:
    """Description of the HTTP API."""
    return create_app(service_in(Path("nowhere"))).openapi()


def click_commands() -> Mapping[str, Any]:
    """Commands and groups of commands, by name."""
    found: Mapping[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return found

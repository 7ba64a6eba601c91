"""The whole service on the kernel's test device: a capture runs, something happens, what then?"""

import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from grabberd.config import load_config
from grabberd.documents.enums import DeviceState
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service
from proofs.vm.guest import vivid
from proofs.vm.guest.shell import wait_for

PATIENCE_S = 60.0
RETURN_S = 15.0
EVERY_S = 0.02
_CONFIG = """
devices:
  vivid:
    driver: v4l2
    options: {options}
    threshold: {{kind: fixed, value: 128}}
    rig: {rig}
"""
_running: list[Service] = []
_warm: list[bool] = []


def start(rig: Mapping[str, Any] | None = None, **options: Any) -> dict[str, Any]:
    """Starts a service whose only device is the kernel's, found by its path, and fits the rig."""
    stop()
    folder = Path(tempfile.mkdtemp(prefix="grabberd-", dir="/dev/shm"))
    file = folder / "vivid.yaml"
    whole = {"device": vivid.BY_PATH, "input": vivid.S_VIDEO, **options}
    file.write_text(_CONFIG.format(options=whole, rig=dict(rig or {})))
    service = Service(set_up(load_config(file), file), folder)
    service.start()
    _running.append(service)
    wait_for(lambda: service.instrument(None).captures.accepts, PATIENCE_S)
    if not _warm:
        _warm_up(service)
        start(rig, **options)
    return status()


def _warm_up(service: Service) -> None:
    """Has the machine read what it will need: its disk is slow by its own clock."""
    service.capture_control.start(None, CaptureRequest(fields=5))
    recording = service.instrument(None).captures.recording
    assert recording is not None
    assert recording.sealed.wait(PATIENCE_S)
    vivid.unplug()
    wait_for(lambda: not service.instrument(None).captures.accepts, PATIENCE_S)
    vivid.plug_in()
    wait_for(lambda: service.instrument(None).captures.accepts, PATIENCE_S)
    vivid.show_picture()
    _warm.append(True)


def stop() -> None:
    """Ends it."""
    while _running:
        _running.pop().stop()


def status() -> dict[str, Any]:
    """The device's status."""
    now = _running[-1].instrument(None).board.now
    return {
        "state": str(now.state),
        "cause": now.cause,
        "signal": str(now.signal),
        "stream": None if now.stream is None else now.stream.details,
        "recoveries": {str(rung): count for rung, count in now.recoveries.items()},
        "openings": now.openings,
    }


def node() -> str:
    """The node that the device streams from."""
    stream = _running[-1].instrument(None).board.now.stream
    assert stream is not None
    return stream.details["node"]


def capture_through(
    happen: Callable[[], None],
    heal: Callable[[], None] | None,
    heal_after_s: float,
    *,
    return_s: float = RETURN_S,
) -> dict[str, Any]:
    """Captures; a second later something happens, and later it is over; two good seconds end it.

    Args:
        happen: what happens.
        heal: ends it, if it has an end.
        heal_after_s: from one to the other.
        return_s: how long fields are waited for after the end; on a machine that does not keep time, a busy
            host makes seconds of minutes.

    Returns:
        `noticed_s` from the happening, by state or ledger, None if never; `recovered_s` from its end to
        fields that are received again; the ledger in words and what the device's states were.
    """
    service = _running[-1]
    service.capture_control.start(None, CaptureRequest())
    recording = service.instrument(None).captures.recording
    assert recording is not None
    watched = _Watched(service, recording)
    watched.until(lambda: recording.recorder.ledger.received >= 50, PATIENCE_S)
    before = dict(status()["recoveries"])
    begun = watched.mark()
    happen()
    noticed_s = watched.until_noticed(max(heal_after_s, 1.5) if heal else 1.5, begun)
    if heal:
        watched.until(lambda: time.monotonic() > begun + heal_after_s, PATIENCE_S)
        begun = time.monotonic()
        heal()
    recovered_s = watched.until_received(begun, return_s)
    watched.until(lambda: False, 2.0)
    recording.stop("the test is over")
    assert recording.sealed.wait(PATIENCE_S)
    ledger = recording.recorder.ledger
    after = status()["recoveries"]
    return {
        "noticed_s": noticed_s,
        "recovered_s": recovered_s,
        "states": watched.states,
        "ledger": ledger.in_words(service.instrument(None).pipeline.rate_hz),
        "entries": [[e.count, str(e.outcome), e.reason] for e in ledger.entries],
        "received": ledger.received,
        "total": ledger.total,
        "ended": recording.recorder.ended_because,
        "steps": {rung: count for rung, count in after.items() if count > before.get(rung, 0)},
        "failure": recording.failure and recording.failure.message,
    }


class _Watched:
    """What a capture's device and ledger say while time goes by."""

    def __init__(self, service: Service, recording: Recording) -> None:
        self._board = service.instrument(None).board
        self._recording = recording
        self.states: list[str] = []
        self._entries = 0

    def mark(self) -> float:
        """From now on something is to be noticed."""
        self._look()
        self._entries = self._losses
        return time.monotonic()

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Looks on until a condition holds or the time is over; whether it holds."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self._look()
            time.sleep(EVERY_S)
        return True

    def until_noticed(self, seconds: float, since: float) -> float | None:
        """Seconds until the state or the ledger shows something."""
        good = (DeviceState.CAPTURING, DeviceState.READY)
        noticed = self.until(lambda: self._board.state not in good or self._losses > self._entries, seconds)
        return time.monotonic() - since if noticed else None

    def until_received(self, since: float, patience_s: float) -> float | None:
        """Seconds until fields are received again."""
        ledger = self._recording.recorder.ledger
        received = ledger.received

        def again() -> bool:
            return ledger.received > received + 1 and self._board.state is DeviceState.CAPTURING

        return time.monotonic() - since if self.until(again, patience_s) else None

    @property
    def _losses(self) -> int:
        return sum(entry.count for entry in self._recording.recorder.ledger.entries)

    def _look(self) -> None:
        now = self._board.now
        words = f"{now.state}: {now.cause}" if now.cause else str(now.state)
        if not self.states or self.states[-1] != words:
            self.states.append(words)

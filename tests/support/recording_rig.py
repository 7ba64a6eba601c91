"""A recording over a ring that the test fills."""

from dataclasses import replace
from pathlib import Path

from slots import STREAM, ManualClock, Source

from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.disk_guard import DiskGuard
from grabberd.core.ledger import Slot
from grabberd.instrument.acquisition import Backlog, Ring
from grabberd.instrument.capture.capture_request import CaptureRequest, NewCapture
from grabberd.instrument.capture.recorder import Recorder
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.channels.feed import ChannelRecording

PATIENCE_S = 30.0


def meta() -> CaptureMeta:
    device = {"name": "one", "driver": "fake", "options": {}, "stream": {}}
    return CaptureMeta(
        "one", "2026-01-01T00:00:00.000Z", 0, device, {}, {}, {}, "", 1, "field", 50.0, "0", extra={}
    )


class Rig:
    """A recording over a ring that the test fills."""

    def __init__(
        self,
        folder: Path,
        fields: int | None,
        capacity: int,
        *,
        measured: bool,
        ends_when_interrupted: bool = False,
        disk: DiskGuard | None = None,
        channels: ChannelRecording | None = None,
    ) -> None:
        self.ring = Ring(64)
        self.clock = ManualClock()
        self.told: list[Recording] = []
        backlog: Backlog[Slot] = Backlog(capacity)
        recorder = Recorder(self.ring.reader(), backlog, self.clock, STREAM, Source(), fields)
        recorded = channels.channels if channels else ()
        extra = {"on_interruption": "end" if ends_when_interrupted else "continue"}
        described = replace(meta(), extra=extra)
        writer = CaptureWriter.create(folder / "one.grab.part", described, channels=recorded)
        if measured:
            writer.begin_run(1, "live", "2026-01-01T00:00:00.000Z", "0", {})
        self.recording = Recording(
            NewCapture("one", CaptureRequest(), writer.path),
            recorder,
            self.clock,
            measured=measured,
            disk=disk,
            channels=channels,
            on_sealed=self.told.append,
        )
        self.recording.write_to(writer)

    def put(self, *slots: Slot) -> None:
        for one in slots:
            self.ring.put(one)
            self.clock.advance(0.02)

    def sealed(self) -> CaptureReader:
        assert self.recording.sealed.wait(PATIENCE_S)
        return CaptureReader(self.recording.path)


def wait_until_written(rig: Rig, count: int) -> None:
    """The writer has taken what there is: time passes, so that it commits."""
    backlog = rig.recording._backlog
    with backlog._changed:
        for _ in range(round(PATIENCE_S / 0.05)):
            rig.clock.advance(1.0)  # each time anew: it may have committed only a part
            if backlog._changed.wait_for(lambda: backlog._written >= count, 0.05):
                return
    raise AssertionError(f"only {backlog._written} of {count} are written")

"""What a capture is put together from when it begins: reader, file, queue, recorder."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from grabberd import __version__
from grabberd.acquisition import RingReader, Slot, StreamInfo
from grabberd.service.armed import Armed
from grabberd.service.backlog import Backlog
from grabberd.service.capture_meta import capture_meta
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.disk import DiskGuard, bytes_per_field
from grabberd.service.intake import Intake
from grabberd.service.recorder import CaptureRequest, Recorder
from grabberd.service.session import CaptureSession
from grabberd.service.setup import DeviceSetup
from grabberd.service.waiting import WaitingCapture
from grabberd.storage import CaptureWriter


@dataclass(frozen=True, slots=True)
class Attaching:
    """Of one device.

    Attributes:
        intake: its ring.
        clock: says when.
        disk: has room, or not.
        site: of the configuration.
        queue_s: how long the disk may stall.
        on_sealed: is told.
    """

    intake: Intake
    clock: Clock
    disk: DiskGuard
    site: Mapping[str, str]
    queue_s: float
    on_sealed: Callable[[CaptureSession], None]

    def attach(
        self,
        capture_id: str,
        setup: DeviceSetup,
        stream: StreamInfo,
        request: CaptureRequest,
        part: Path,
        waiting: WaitingCapture | None = None,
    ) -> CaptureSession:
        """A capture that can be started; its first slot is determined at this moment.

        Raises:
            StorageError: the file cannot be created, or the disk has no room for the capture.
        """
        armed = self.intake.armed
        duration_s = request.fields / stream.rate_hz if request.fields else None
        self.disk.check_fits(part.parent, stream.rate_hz * ring_bytes_per_field(setup, armed), duration_s)
        # The reader comes before the file, whose creation takes its time.
        reader = armed.ring.reader(request.overrun, back=request.pre_trigger_fields)
        meta = capture_meta(
            capture_id,
            (setup.name, setup.config, stream),
            request,
            armed,
            self.clock,
            site=self.site,
            trigger_n=reader.back_fields,
            armed_utc=None if waiting is None else waiting.armed_utc,
        )
        writer = CaptureWriter.create(part, meta)
        if setup.measuring is not None:
            writer.begin_run(1, "live", iso_utc(self.clock.utc_now()), __version__, setup.made_with)
        backlog: Backlog[Slot] = Backlog(capacity=round(self.queue_s * stream.rate_hz))
        return CaptureSession(
            capture_id,
            self._recorder(_length(request, reader, waiting), backlog, stream),
            reader,
            writer,
            backlog,
            self.clock,
            measured=setup.measuring is not None,
            ends_when_interrupted=meta.extra["on_interruption"] == "end",
            shortage=self.disk.shortage,
            on_sealed=self.on_sealed,
        )

    def _recorder(self, fields: int | None, backlog: Backlog[Slot], stream: StreamInfo) -> Recorder:
        return Recorder(
            fields,
            backlog,
            self.clock,
            round(1e9 / stream.rate_hz),
            lossless=stream.waits_for_reader,
            live=stream.live,
            interruption=lambda: self.intake.interruption,
        )


def ring_bytes_per_field(setup: DeviceSetup, armed: Armed) -> float:
    """What a field of this ring takes on disk."""
    rig = setup.config.rig
    rows = rig.lines if armed.lines == "doubled" else rig.lines // 2
    return bytes_per_field(armed.bits, rows, rig.columns)


def _length(request: CaptureRequest, reader: RingReader, waiting: WaitingCapture | None) -> int | None:
    """Of a capture in fields; what is asked of an armed one counts from its trigger on."""
    if request.fields is None or waiting is None:
        return request.fields
    return reader.back_fields + request.fields

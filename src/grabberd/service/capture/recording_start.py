"""What a capture is put together from when it begins: reader, file, queue, recorder."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from grabberd import __version__
from grabberd.acquisition import RingReader, Slot, StreamInfo
from grabberd.service.capture.backlog import Backlog
from grabberd.service.capture.capture_group import Moment
from grabberd.service.capture.capture_metadata import capture_meta
from grabberd.service.capture.capture_request import Planned
from grabberd.service.capture.disk_guard import DiskGuard, bytes_per_field
from grabberd.service.capture.recorder import Recorder
from grabberd.service.capture.recording import Recording
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.device.configured_ring import ConfiguredRing
from grabberd.service.device.field_pipeline import FieldPipeline
from grabberd.service.setup import DeviceSetup
from grabberd.storage import CaptureWriter


class Taken(NamedTuple):
    """The fields of a capture that has no file yet: however long that takes to be made, none is missed.

    Attributes:
        reader: its place in the ring; `recorder`: takes them from there, `backlog`: to here.
    """

    reader: RingReader
    recorder: Recorder
    backlog: Backlog[Slot]

    def give_up(self) -> None:
        """Takes no more."""
        self.recorder.stop("it could not begin")
        self.reader.close()


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

    intake: FieldPipeline
    clock: Clock
    disk: DiskGuard
    site: Mapping[str, str]
    queue_s: float
    on_sealed: Callable[[Recording], None]

    def take(self, planned: Planned, stream: StreamInfo) -> Taken:
        """Fields are taken from this moment on, or from the ring for a pre-trigger."""
        request = planned.request
        reader = self.intake.armed.ring.reader(request.overrun, back=request.pre_trigger_fields)
        backlog: Backlog[Slot] = Backlog(capacity=round(self.queue_s * stream.rate_hz))
        recorder = self._recorder(_length(planned, reader), backlog, stream)
        recorder.start(reader, planned.id)
        return Taken(reader, recorder, backlog)

    def attach(
        self, planned: Planned, setup: DeviceSetup, stream: StreamInfo, taken: Taken, start: Moment
    ) -> Recording:
        """A capture that can be started.

        Args:
            planned: what is asked for.
            setup: of the device.
            stream: what its driver granted.
            taken: its fields so far.
            start: the moment from which on they are taken.

        Raises:
            StorageError: the file cannot be created.
        """
        device, back_fields = (setup.name, setup.config, stream), taken.reader.back_fields
        meta = capture_meta(planned, device, self.intake.armed, start, site=self.site, trigger_n=back_fields)
        writer = CaptureWriter.create(planned.part, meta)
        if setup.measuring is not None:
            writer.begin_run(1, "live", iso_utc(self.clock.utc_now()), __version__, setup.made_with)
        return Recording(
            planned.id,
            taken.recorder,
            taken.reader,
            writer,
            taken.backlog,
            self.clock,
            measured=setup.measuring is not None,
            group=planned.group,
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


def ring_bytes_per_field(setup: DeviceSetup, armed: ConfiguredRing) -> float:
    """What a field of this ring takes on disk."""
    rig = setup.config.rig
    rows = rig.lines if armed.lines == "doubled" else rig.lines // 2
    return bytes_per_field(armed.bits, rows, rig.columns)


def _length(planned: Planned, reader: RingReader) -> int | None:
    """Of a capture in fields; what is asked of an armed one counts from its trigger on."""
    fields = planned.request.fields
    if fields is None or planned.armed_utc is None:
        return fields
    return reader.back_fields + fields

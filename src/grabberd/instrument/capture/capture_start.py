"""Capture start: the steps for one device, and their order for one device or several.

All captures of a group start at the same moment, or none does; a single capture is a group of one.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace

from grabberd import __version__, runtime
from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.catalogue.capture_documents import document_without_fields
from grabberd.core.ledger import Slot
from grabberd.errors import GrabberdError, GroupRefused, InputError, NotReady
from grabberd.instrument.acquisition import Backlog, Signal
from grabberd.instrument.capture.capture_request import ArmedCapture, NewCapture
from grabberd.instrument.capture.device_captures import CurrentCaptures, DeviceCaptures, locked
from grabberd.instrument.capture.recorder import Begin, Recorder, fields_before
from grabberd.instrument.capture.recording import LIVE_RUN, Recording
from grabberd.instrument.channels.feed import ChannelRecording
from grabberd.runtime import Moment, boot_id, iso_utc


class CaptureStart:
    """The steps from a request to a running capture, performed in order by the functions below.

    All steps are performed under the device's lock.

    Args:
        device: The captures of the device.
        new: The capture to be started or armed.
    """

    def __init__(self, device: DeviceCaptures, new: NewCapture) -> None:
        self.device = device
        self.new = new
        self._back_fields = 0
        self._fields: int | None = None
        self._recording: Recording | None = None
        self._channels: ChannelRecording | None = None
        self._has_file = False

    @property
    def recording(self) -> Recording:
        """The capture; only after `record`."""
        assert self._recording is not None, "record() comes first"
        return self._recording

    @property
    def duration_s(self) -> float | None:
        """Length of the capture; None if it has none."""
        fields = self.new.request.fields
        return None if fields is None else fields / self.device.pipeline.rate_hz

    def check_free(self) -> None:
        """Checks that a capture may be started or armed.

        Raises:
            CaptureRunning: The device has a capture already.
            NotReady: The device does not stream.
            InputError: The ring has fewer slots than the pre-trigger requires.
            CalibrationMismatch: The calibration is for pictures of another size than the stream's.
        """
        self.device.check_no_capture()
        self.check_streams()
        asked, slots = self.new.request.pre_trigger_fields, self.device.pipeline.ring.slots
        if asked > slots:
            raise InputError(
                f"pre_trigger_fields is {asked}, but the ring has {slots} slots",
                f"ask for fewer, or raise devices.{self.device.name}.ring.slots",
            )

    def check_streams(self) -> None:
        """Checks that the device streams pictures that fit its calibration, if it has one.

        Raises:
            NotReady, CalibrationMismatch: See `check_free`.
        """
        if not self.device.accepts:
            status = self.device.board.now
            cause = f" ({status.cause})" if status.cause else ""
            raise NotReady(
                f"device {self.device.name} is {status.state}{cause}",
                status.hint or "wait until its state is ready: GET /api/v1/state",
            )
        self.device.check_measurable()

    def configure_ring(self) -> None:
        """Gives the ring the capture's bits and lines, and chooses and holds its threshold."""
        pipeline = self.device.pipeline
        configured = pipeline.configure_ring(self.new.request.bits, self.new.request.lines)
        # Without a signal no field comes for choosing a threshold, and the wait would end by its time-out.
        if self.device.board.now.signal is not Signal.ABSENT:
            pipeline.thresholds.settle(configured)
        pipeline.thresholds.hold()

    def arm(self, armed_utc: str) -> ArmedCapture:
        """Keeps the ring as it is until the trigger."""
        pipeline = self.device.pipeline
        document = document_without_fields(
            id=self.new.id,
            device=self.device.name,
            state="armed",
            created_utc=armed_utc,
            group=self.new.group,
            bits=pipeline.ring.bits,
            lines=None if pipeline.is_progressive else pipeline.ring.lines,
            rate_hz=pipeline.rate_hz,
            labels=self.new.request.labels,
            note=self.new.request.note,
        )
        armed = self.device.armed = ArmedCapture(document, self.new.request)
        return armed

    def record(self, start: Moment) -> None:
        """Starts to take fields, from a moment on or with the pre-trigger's fields from the ring.

        They are measured at once. There is no file yet, so no field is missed, and none is published late,
        even if creating it takes long.
        """
        pipeline, request = self.device.pipeline, self.new.request
        stream = replace(self.device.stream, rate_hz=self.device.pipeline.rate_hz)
        reader = pipeline.ring.reader(request.overrun, back=request.pre_trigger_fields)
        period_ns = round(1e9 / stream.rate_hz)
        keeps_pace = stream.live and not stream.waits_for_reader
        asked_ns = start.ns if keeps_pace else None
        begin = Begin.of(reader, asked_ns, request.pre_trigger_fields, period_ns)
        self._back_fields = fields_before(reader, pipeline.ring.newest, begin, start.ns)
        backlog: Backlog[Slot] = Backlog(capacity=round(self.device.queue_s * stream.rate_hz))
        self._fields = request.fields
        if self._fields is not None and self.new.armed_utc is not None:
            self._fields += self._back_fields  # the length of an armed capture counts from its trigger
        recorder = Recorder(reader, backlog, self.device.clock, stream, pipeline, self._fields, begin)
        recorder.start(self.new.id)
        self._channels = self.device.loggers.follow(self.device.name, same_clock=keeps_pace)
        self._recording = self.device.starting = Recording(
            self.new,
            recorder,
            self.device.clock,
            measured=self.device.setup.measuring is not None,
            disk=self.device.disk,
            channels=self._channels,
            on_sealed=self.device.sealed,
        )

    def make_file(self, start: Moment) -> None:
        """Creates the file of the capture; may take long on a slow disk.

        Args:
            start: Moment at which recording started; the same for all captures of a group.

        Raises:
            StorageError: The file cannot be created.
        """
        setup = self.device.setup
        meta = self._meta(start)
        channels = self._channels.channels if self._channels else ()
        writer = CaptureWriter.create(self.new.part, meta, channels=channels)
        with writer.discarded_if_it_fails():
            if self._channels is not None:
                writer.keep_account(self._channels.account)
            if setup.measuring is not None:
                made_utc = iso_utc(self.device.clock.utc_now())
                writer.begin_run(LIVE_RUN, "live", made_utc, __version__, setup.made_with)
        self.recording.write_to(writer)
        self._has_file = True

    def discard(self) -> None:
        """Undoes what `record` and `make_file` have started."""
        self.recording.recorder.abandon()
        self.device.starting = None
        if self._channels is not None:
            self._channels.close()
        if self._has_file:
            self.recording.discard()

    def begin(self) -> None:
        """Starts writing; from now on the capture belongs to the device."""
        self.device.recording, self.device.armed = self.recording, None
        self.device.starting = None
        self.recording.start()

    def _meta(self, start: Moment) -> CaptureMeta:
        device, request = self.device, self.new.request
        started = {"start_utc": start.utc, "start_ns": start.ns}
        config, stream, ring = device.setup.config, device.stream, device.pipeline.ring
        return CaptureMeta(
            id=self.new.id,
            created_utc=start.utc,
            start_ns=start.ns,
            device={
                "name": device.name,
                "driver": config.driver,
                "options": config.options,
                "stream": asdict(stream),
            },
            config=config.model_dump(mode="json"),
            site=device.site,
            labels=request.labels,
            note=request.note,
            bits=ring.bits,
            lines=ring.lines,
            rate_hz=device.pipeline.rate_hz,
            version=__version__,
            boot_id=boot_id(),
            extra={
                # From the first commit on: after a crash, the ordered length shows what is missing.
                "order": {
                    "fields": self._fields,
                    "pre_trigger_fields": request.pre_trigger_fields,
                    "overrun": request.overrun,
                },
                "on_interruption": request.on_interruption or config.capture.on_interruption,
                "trigger": {"utc": start.utc, "n": self._back_fields, "armed_utc": self.new.armed_utc},
                "group": self.new.group and {**self.new.group.model_dump(), **started},
            },
        )


def start(starts: Sequence[CaptureStart], current: CurrentCaptures) -> None:
    """Starts captures; fields are taken from this moment on, or from the ring for a pre-trigger.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch: See `CaptureStart.check_free`.
        StorageError: A file cannot be created, or the disk has no room for all of them.
        GroupRefused: Some of several cannot start, so none does.
    """
    with _configured(starts):
        _begin(starts, current)


def arm(starts: Sequence[CaptureStart]) -> list[ArmedCapture]:
    """Arms captures: their rings are configured, and stay so until they are triggered or disarmed.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch, GroupRefused: As `start`.
    """
    with _configured(starts):
        armed_utc = iso_utc(starts[0].device.clock.utc_now())
        return [one.arm(armed_utc) for one in starts]


def trigger(starts: Sequence[CaptureStart], current: CurrentCaptures) -> None:
    """Starts armed captures, with the requested fields from before the trigger as far as the ring has them.

    Raises:
        Conflict: One is not armed.
        NotReady, CalibrationMismatch, StorageError, GroupRefused: As `start`; they stay armed.
    """
    with locked(one.device for one in starts):
        # Checked again under the locks: another request may have triggered or stopped one meanwhile.
        _each(starts, lambda one: one.device.check_armed(one.new.id))
        _each(starts, CaptureStart.check_streams)
        _begin(starts, current)


@contextmanager
def _configured(starts: Sequence[CaptureStart]) -> Iterator[None]:
    """Holds the locks of all devices, with their rings configured and their thresholds held."""
    with locked(one.device for one in starts):
        # Before any ring is touched: a running capture's must stay as it is.
        _each(starts, CaptureStart.check_free)
        try:
            _each(starts, CaptureStart.configure_ring)
            yield
        except GrabberdError:
            # All of them, including those of devices whose rings were configured without an error.
            for one in starts:
                one.device.pipeline.thresholds.release()
            raise


def _begin(starts: Sequence[CaptureStart], current: CurrentCaptures) -> None:
    _check_room(starts, current)
    moment = Moment.now(starts[0].device.clock)
    # All record before the first file is created, which may take longer than the ring lasts (0.64 s).
    for one in starts:
        one.record(moment)
    try:
        _each(starts, lambda one: one.make_file(moment))
    except GrabberdError:
        for one in starts:
            one.discard()
        raise
    # No capture belongs to its device until all files exist: until here everything can be undone.
    for one in starts:
        one.begin()


def _check_room(starts: Sequence[CaptureStart], current: CurrentCaptures) -> None:
    """Checks that captures fit on the disk, in addition to the running ones.

    Raises:
        StorageError: The disk has no room for all of them.
    """
    bytes_per_s = current.bytes_per_s + sum(one.device.bytes_per_s for one in starts)
    lengths_s = [one.duration_s for one in starts]
    longest_s = None if None in lengths_s else max(length or 0.0 for length in lengths_s)
    starts[0].device.disk.check_fits(starts[0].new.part.parent, bytes_per_s, longest_s)


def _each(starts: Sequence[CaptureStart], step: Callable[[CaptureStart], None]) -> None:
    """Performs a step for all at the same time, so that a slow one delays no other.

    Raises:
        GrabberdError: A single capture fails; GroupRefused: some of several fail.
    """

    def attempt(one: CaptureStart) -> GrabberdError | None:
        try:
            step(one)
        except GrabberdError as error:
            return error
        return None

    if len(starts) == 1:
        step(starts[0])
        return
    with runtime.pool(len(starts), "capture-start") as pool:
        errors = list(pool.map(attempt, starts))
    refusals = {one.device.name: error for one, error in zip(starts, errors, strict=True) if error}
    if refusals:
        raise GroupRefused(refusals)

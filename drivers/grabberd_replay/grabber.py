"""The replay driver, and the recording that needs no decoding: a capture file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Any

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RecordedField
from grabberd.core.field import FieldOrder, unpack
from grabberd.core.ledger import Outcome
from grabberd.errors import (
    CaptureFileError,
    DeviceAbsent,
    DeviceLost,
    DeviceRefused,
    GrabberdError,
    PictureError,
    StreamEnded,
)
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo
from grabberd.runtime import Clock, SystemClock
from grabberd_replay.folder import FolderSource
from grabberd_replay.footage import FootageRecording, Options
from grabberd_replay.recording import MANIFEST, Batch, Format, ManifestRecording, Recording
from grabberd_replay.video import KINDS, VideoSource, container_of

_RECORDINGS = f"a capture file, a folder of pictures, or a video ({KINDS})"


class Pace(StrEnum):
    """Pace at which a recording is played."""

    FREE = "free"
    REAL = "real"


class ReplayGrabber:
    """Plays a capture file, a video file or a folder of pictures.

    An option that has no effect on what is played is refused when it is opened.

    Args:
        path: path of the file or folder.
        pictures: kind of the pictures: "frames" (woven), "fields", "doubled" (fields whose missing lines have
            been interpolated), "progressive", or "auto", by their size.
        field_order: order of the fields of a frame: "top_first" (PAL) or "bottom_first"; by default as a
            video is marked, else the top field first.
        first_parity: parity of the first field, "top" or "bottom", if pictures are fields or doubled; by
            default top.
        rate_hz: fields per second, or progressive pictures, for a folder without times or a video with a
            wrong rate; by default by the pictures' own times, or that of the standard: 50 or 59.94.
        bits: significant bits of pictures that are stored with 16 bits a sample: 8, 10, 12, 14 or 16, of
            which the upper 8 are used; by default as the first picture's values show.
        pace: "free": as fast as fields are read; "real": when they are due.
        clock: clock for the real pace; the computer's by default.

    Raises:
        ValueError: an option has a value that is not allowed.
    """

    called_ns = 0  # nothing here hangs as a kernel's driver may

    def __init__(
        self,
        path: str | Path,
        pictures: str | None = None,
        field_order: str | None = None,
        first_parity: str | None = None,
        rate_hz: float | None = None,
        bits: int | None = None,
        pace: str = "free",
        clock: Clock | None = None,
    ) -> None:
        if not isinstance(path, str | Path):
            raise ValueError(f"path is the name of a file or folder, not {path!r}")
        self._path = Path(path)
        self._options = Options(pictures, field_order, first_parity, rate_hz, bits)
        self._options.check()
        self._pace = Pace(pace)
        self._clock: Clock = clock or SystemClock()
        self._recording: Recording | None = None
        self._batches: Iterator[Batch] = iter(())
        self._next: Batch | None = None
        self._failure: GrabberdError | None = None
        self._shift_ns: int | None = None
        self.found_empty = False

    def open(self) -> StreamInfo:
        """Opens the recording from its beginning.

        Raises:
            DeviceAbsent: there is no such file or folder.
            DeviceRefused: it is no recording.
            PictureError: its first picture cannot be read.
        """
        self.close()
        self._recording = self._open_recording()
        self._batches = self._recording.batches()
        self._next, self._failure, self._shift_ns = None, None, None
        return self._info(self._recording)

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        """The next picture's fields; empty if they are not due within `timeout_s`.

        Raises:
            DeviceLost: it is not open.
            StreamEnded: the recording has no more fields.
            PictureError: the next picture cannot be read; every further call raises it again.
        """
        batch = self._peek()
        if not self._wait_until_due(batch, timeout_s):
            yield ()
            return
        self._next = None
        yield batch

    def signal(self) -> Signal:
        """Always unknown: a recording has no signal."""
        return Signal.UNKNOWN

    def restart(self) -> StreamInfo:
        """Continues the recording where it is: there are no buffers to flush.

        Raises:
            DeviceLost: it is not open.
        """
        if self._recording is None:
            raise _not_open(self._path)
        return self._info(self._recording)

    def reset(self) -> None:
        """Refuses: a recording has nothing to reset.

        Raises:
            DeviceRefused: always.
        """
        raise DeviceRefused(f"the recording {self._path} is no device", "open it again")

    def close(self) -> None:
        """Closes the recording."""
        if self._recording is not None:
            self._recording.close()
        self._recording, self._batches, self._failure = None, iter(()), None

    def _open_recording(self) -> Recording:
        if not self._path.exists():
            raise DeviceAbsent(f"there is no recording {self._path}", f"name {_RECORDINGS}")
        if self._path.is_dir():
            return self._open_folder()
        container = container_of(self._path)
        if container is None:
            self._options.refuse(self._path, "a capture file", *Options._fields)
            return self._open_capture()
        return FootageRecording(VideoSource(self._path, container), self._options)

    def _open_folder(self) -> Recording:
        if not (self._path / MANIFEST).exists():
            return FootageRecording(FolderSource(self._path), self._options)
        others = (name for name in Options._fields if name != "rate_hz")
        self._options.refuse(self._path, f"pictures of which {MANIFEST} tells what they are", *others)
        return ManifestRecording(self._path, self._options.rate_hz)

    def _open_capture(self) -> Recording:
        try:
            return CaptureRecording(self._path)
        except CaptureFileError as error:
            hint = error.hint if ".grab" in self._path.name else f"name {_RECORDINGS}"
            raise DeviceRefused(f"{error.message}, and it is no video", hint) from error

    def _info(self, recording: Recording) -> StreamInfo:
        form = recording.format
        return StreamInfo(
            driver="replay",
            card=str(self._path),
            standard=_standard(form),
            columns=form.columns,
            field_rows=form.field_rows,
            rate_hz=form.rate_hz,
            field_order=form.field_order,
            pixel_format="GREY",
            buffers=2,  # a woven frame's two fields are all that is ever held
            live=False,
            counts_losses=form.counts_losses,
            tells_signal=False,
            time_sigma_ns=0,
            waits_for_reader=self._pace is Pace.FREE,
            details={**form.details, "times": "as recorded", "pace": str(self._pace)},
            remarks=form.remarks,
        )

    def _peek(self) -> Batch:
        if self._failure is not None:
            raise self._failure
        if self._recording is None:
            raise _not_open(self._path)
        if self._next is None:
            self._next = self._read()
        return self._next

    def _read(self) -> Batch:
        try:
            return next(self._batches)
        except StopIteration:
            hint = "reopen it to play it again"
            self._failure = StreamEnded(f"the recording {self._path} has ended", hint)
        except GrabberdError as error:
            self._failure = error
        raise self._failure

    def _wait_until_due(self, batch: Batch, timeout_s: float) -> bool:
        """In real time a picture comes when its last field is over, as from a grabber."""
        if self._pace is Pace.FREE:
            return True
        now_ns, last_ns = self._clock.now_ns(), batch[-1].time_ns
        # The recording's clock and this computer's are related by the first picture that is due.
        if self._shift_ns is None:
            self._shift_ns = now_ns - last_ns
        wait_s = (last_ns + self._shift_ns - now_ns) / 1e9
        self.found_empty = wait_s > 0
        self._clock.sleep(min(wait_s, timeout_s))
        return wait_s <= timeout_s


def _standard(form: Format) -> str:
    """Video standard of a recording's fields, as far as they have one."""
    if form.field_order is FieldOrder.PROGRESSIVE:
        return ""
    return {50.0: "PAL", 59.94: "NTSC"}.get(round(form.rate_hz, 2), "")


def _not_open(path: Path) -> DeviceLost:
    return DeviceLost(f"the recording {path} is not open", "open it first")


class CaptureRecording(Recording):
    """The fields of a capture, one per batch; damaged ones are delivered as damaged.

    Raises:
        CaptureFileError: the file is no capture, is damaged, or has no fields.
    """

    def __init__(self, path: Path) -> None:
        self._reader = CaptureReader(path)
        first = next(self._reader.fields(), None)
        if first is None:
            self._reader.close()
            raise CaptureFileError(f"{path} has no fields", "choose a capture with fields")
        meta, packed = self._reader.meta, first.numbered.packed
        stream: dict[str, Any] = dict(meta.device.get("stream") or {})
        self.format = Format(
            columns=packed.columns,
            field_rows=packed.rows,
            rate_hz=meta.rate_hz,
            field_order=FieldOrder(stream.get("field_order", FieldOrder.ALTERNATE)),
            counts_losses=bool(stream.get("counts_losses", False)),
            details={"capture": meta.id, "bits": str(packed.bits), "lines": meta.lines},
        )

    def batches(self) -> Iterator[Batch]:
        """One field at a time, unpacked."""
        try:
            for recorded in self._reader.fields():
                yield (_grabbed(recorded),)
        except CaptureFileError as error:
            raise PictureError(error.message, error.hint) from error

    def close(self) -> None:
        """Closes the file."""
        self._reader.close()


def _grabbed(recorded: RecordedField) -> GrabbedField:
    numbered = recorded.numbered
    damage = None if recorded.outcome is Outcome.RECEIVED else recorded.reason or str(recorded.outcome)
    return GrabbedField(unpack(numbered.packed), numbered.time_ns, numbered.sequence, damage)

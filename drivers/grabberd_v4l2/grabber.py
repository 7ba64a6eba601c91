"""The V4L2 grabber, implementing the driver contract, with its signal, standard and remarks on its stream."""

import contextlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from grabberd.core.ledger import OF_FRAME_BEFORE
from grabberd.errors import Cause, DeviceError, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition.device import SYSTEM, GrabbedField, Roots, Signal, StreamInfo, Verdict
from grabberd_v4l2 import abi, formats
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.devices import find_node, node_at, video_nodes
from grabberd_v4l2.discovery import remarks_on, reset_of
from grabberd_v4l2.fields import FieldTimes, Granted, LaidField, Layout
from grabberd_v4l2.formats import FORMATS, JpegLuma, Scan
from grabberd_v4l2.marks import Marks, stale
from grabberd_v4l2.negotiation import capture_node, negotiate, picture_bytes
from grabberd_v4l2.node import Kernel, LinuxKernel, Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.profiles import Profile, Profiles, SignalSource
from grabberd_v4l2.stream import Filled, Stream, opening, restarting

FLAGGED = "the driver flags an error"
_NO_SIGNAL = abi.IN_ST_NO_POWER | abi.IN_ST_NO_SIGNAL | abi.IN_ST_NO_H_LOCK
# Time for a decoder to lock.
_RECHECK_NS = 250_000_000


class Watch:
    """Queries signal and standard, if the card is known to report them.

    A wrong standard must be seen twice, since decoders guess while they lock. A camera without a standard
    cannot have a wrong one.

    Args:
        node: The streaming node.
        source: Query that reports a missing camera.
        scan: Scan of the granted standard.

    Attributes:
        trouble: Reason why the stream has become unusable, or None; `remedy`: what to do about it.
        tells: True if the card reported a signal status when last queried.
    """

    def __init__(self, node: Node, source: SignalSource, scan: Scan) -> None:
        self._node = node
        self._source = source
        self._scan = scan
        self._suspect_ns: int | None = None
        self.trouble: str | None = None
        self.remedy = ""
        self.tells = False

    def look(self) -> Signal:
        """Signal status; unknown if the card does not report one."""
        signal = self._signal()
        trouble = (
            None if self._scan.is_progressive else self._changed_by_others() or self._wrong_camera(signal)
        )
        self.tells = signal is not Signal.UNKNOWN
        if trouble is None:
            self._suspect_ns = None
        elif self._suspect_ns is None:
            self._suspect_ns = self._node.now_ns()
        elif self._node.now_ns() - self._suspect_ns >= _RECHECK_NS:
            self.trouble, self.remedy = trouble
        return signal

    def look_again(self) -> None:
        """Queries again only while a wrong standard waits to be confirmed, so it may be called often."""
        if self._suspect_ns is not None and self._node.now_ns() - self._suspect_ns >= _RECHECK_NS:
            self.look()

    def settle(self) -> str | None:
        """Waits a moment for the decoder to lock; returns the problem if it still sees a wrong standard."""
        self.look()
        while self._suspect_ns is not None and self.trouble is None:
            self._node.pause(_RECHECK_NS / 5e9)
            self.look()
        return self.trouble

    def _signal(self) -> Signal:
        # Polled, since hardly any analog card reports a change of its source (SOURCE_CHANGE).
        try:
            if self._source is SignalSource.ENUMINPUT:
                return _present(not self._node.input().status & _NO_SIGNAL)
            if self._source is SignalSource.QUERYSTD:
                return _present(self._node.seen_standard() != 0)
        except OSError:
            pass
        return Signal.UNKNOWN

    def _changed_by_others(self) -> tuple[str, str] | None:
        try:
            standard = self._node.standard()
        except OSError:
            return None
        if formats.scan(standard) == self._scan:
            return None
        said = f"another program has set the card to {formats.name(standard)}"
        return said, f"grabberd restarts it at {self._scan}; end that program"

    def _wrong_camera(self, signal: Signal) -> tuple[str, str] | None:
        """A problem with the camera's standard, and its remedy; without a signal, many cards guess 60 Hz."""
        if signal is not Signal.PRESENT:
            return None
        try:
            seen = formats.scan(self._node.seen_standard())
        except OSError:
            return None
        if seen is None or seen == self._scan:
            return None
        own, other = formats.family(self._scan), formats.family(seen)
        return (
            f"the camera's signal is of {seen} ({other}), but the card is set to {self._scan} ({own})",
            f"connect a {own} camera, and grabberd resumes; or set the option 'standard: {other}', "
            f"and the rig's lines to {seen.lines}",
        )


def _present(there: bool) -> Signal:
    return Signal.PRESENT if there else Signal.ABSENT


@dataclass(frozen=True, slots=True)
class _Running:
    """A streaming node with everything needed to read its buffers."""

    stream: Stream
    layout: Layout
    times: FieldTimes
    watch: Watch
    profile: Profile
    jpeg: JpegLuma | None
    marks: Marks | None
    whole_bytes: int
    info: StreamInfo


class V4l2Grabber:
    """An analog grabber or a digital camera under a video node; `V4l2Options` lists its options."""

    def __init__(self, *, kernel: Kernel | None = None, roots: Roots = SYSTEM, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            kernel: System calls; by default those of this computer.
            roots: Locations of /sys and /dev.
            options: See `V4l2Options`.

        Raises:
            ValueError: An option is unknown or not allowed; the message has a line for each.
        """
        self.options = V4l2Options.read(options)
        self._kernel = kernel or LinuxKernel()
        self._roots = roots
        self._node: Node | None = None
        self._abandoned: tuple[Node, Stream] | None = None
        self._running: _Running | None = None
        self._layout: Layout | None = None
        self._called_ns = 0

    @property
    def called_ns(self) -> int:
        """Total time spent in calls to the device, except waiting for fields."""
        return self._called_ns + (0 if self._node is None else self._node.called_ns)

    @property
    def found_empty(self) -> bool:
        """True if no buffer was filled when the last `dequeue` began."""
        return self._running is not None and self._running.stream.found_empty

    def open(self) -> StreamInfo:
        """Finds the device, sets it up and starts it.

        Raises:
            DeviceAbsent: The device is not connected.
            DeviceRefused: The device is already open, unsuitable, in use, or grants no usable stream.
            StreamFailed: The device does not respond properly; a reset may help.
        """
        if self._node is not None:
            raise DeviceRefused(f"{self._node.path} is open already", "close it first")
        self._let_go_of_abandoned()
        path = find_node(self.options.identity, self._roots)
        try:
            with opening(path):
                self._node = Node(self._kernel, path)
                self._running = self._started(self._node)
        except BaseException:
            self.close()
            raise
        self._layout = self._running.layout
        return self._running.info

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        """The fields of the next buffer, the older first; empty if none arrives in time.

        Raises:
            DeviceLost: The device is not open, or has disappeared.
            StreamFailed: The stream has ended, or its camera has another standard.
            DeviceRefused: A buffer does not state the parity of its field.
        """
        running = self._streaming()
        running.watch.look_again()
        if running.watch.trouble:
            raise StreamFailed(running.watch.trouble, running.watch.remedy)
        with running.stream.dequeue(timeout_s) as filled:
            if running.stream.source_changed():
                running.watch.look()
            yield [] if filled is None else _fields(running, filled)

    def signal(self) -> Signal:
        """Signal status reported by the card; unknown if it reports none or is closed."""
        return Signal.UNKNOWN if self._running is None else self._running.watch.look()

    def restart(self) -> StreamInfo:
        """Stops the stream, negotiates it again and restarts it, on the same descriptor.

        Raises:
            DeviceLost: The device is not open, or has disappeared.
            StreamFailed: The stream does not start.
            DeviceRefused: The granted stream differs from the previous one.
        """
        if self._node is None:
            raise _not_open()
        self._stop()
        with restarting(self._node.path):
            running = self._started(self._node)
        if running.layout != self._layout:
            running.stream.stop()
            raise DeviceRefused(
                f"{self._node.path} grants a different stream than before", "close it and open it again"
            )
        self._running = running
        return running.info

    def reset(self) -> None:
        """Resets the closed device's USB port.

        Raises:
            DeviceAbsent: The device is not connected.
            DeviceRefused: The device is open or not on USB, or libusb or permissions are missing.
        """
        # A reset unbinds and rebinds the kernel driver; a device with an open node or mapped buffers does not
        # come back.
        if self._node is not None:
            raise DeviceRefused(f"{self._node.path} is open", "close it first")
        reset_of(self.options.identity, self._roots)

    def close(self) -> None:
        """Stops the stream and releases everything; may be called twice, and after a failed `open`."""
        self._stop()
        node, self._node = self._node, None
        if node is not None:
            self._called_ns += node.called_ns
            with contextlib.suppress(OSError):
                node.close()

    def _stop(self) -> None:
        running, self._running = self._running, None
        if running is not None:
            running.stream.stop()

    def _started(self, node: Node) -> _Running:
        capability = capture_node(node)
        profiles = Profiles.load(self.options.profiles)
        nodes = video_nodes(self._roots)
        place = node_at(node.path, nodes)
        profile = profiles.of(capability.driver, place.usb_id if place else "")
        # Everything is set before buffers exist: with buffers, drivers refuse a new standard or format, and
        # usbtv, which does not, must not change its standard while streaming.
        granted = negotiate(node, capability, self.options, profile)
        watch = _settled(node, profile, granted)
        remarks = (*profiles.remarks, *(remarks_on(place, nodes) if place else ()))
        layout = Layout.of(granted, profile, self.options.older)
        times = FieldTimes(layout, profile, self.options.exposure_ns)
        jpeg = JpegLuma(granted.lines, granted.columns) if FORMATS[granted.fourcc].is_compressed else None
        whole_bytes = picture_bytes(granted)
        marks = Marks.of(granted)
        stream = self._started_stream(node, profile, whole_bytes, marks)
        layout = replace(layout, granted=replace(granted, buffers=stream.buffers))
        info = stream_info(layout, profile, times, watch.tells, node.path, remarks)
        return _Running(stream, layout, times, watch, profile, jpeg, marks, whole_bytes, info)

    def _started_stream(self, node: Node, profile: Profile, whole_bytes: int, marks: Marks | None) -> Stream:
        stream = Stream(node, self.options.buffers, whole_bytes, marks)
        try:
            stream.start()
        except BaseException:
            if profile.starts_again:
                stream.stop()
            else:
                self._abandoned, self._node = (node, stream), None
                with contextlib.suppress(DeviceError):
                    reset_of(self.options.identity, self._roots)
            raise
        return stream

    def _let_go_of_abandoned(self) -> None:
        """Frees the buffers of a failed start, if the driver that may use them has been unbound by now."""
        if self._abandoned is None:
            return
        node, stream = self._abandoned
        with contextlib.suppress(OSError):
            node.capability()
            raise DeviceRefused(
                f"{node.path} has failed to start, and its driver must not be started again",
                "unplug it and plug it in again; where grabberd may reset it, it does that by itself",
            )
        self._abandoned = None
        stream.stop()
        node.close()

    def _streaming(self) -> _Running:
        if self._node is None:
            raise _not_open()
        if self._running is None:
            raise StreamFailed(
                f"{self._node.path} does not stream", "restart it, or close it and open it again"
            )
        return self._running


def _settled(node: Node, profile: Profile, granted: Granted) -> Watch:
    watch = Watch(node, profile.signal_source, granted.scan)
    if watch.settle():
        raise DeviceRefused(f"{node.path}: {watch.trouble}", watch.remedy, Cause.WRONG_STANDARD)
    return watch


def _not_open() -> DeviceLost:
    return DeviceLost("the grabber is not open", "open it first")


def _fields(running: _Running, filled: Filled) -> list[GrabbedField]:
    if running.times.handed_back(filled.stamp):
        return []
    damage, picture = _damage(filled, running.whole_bytes), filled.picture
    if running.jpeg is not None:
        luma, broken = running.jpeg.decode(filled.picture[: filled.bytes_used])
        if luma is None:
            return []  # the stream starts with its first intact picture
        damage, picture = damage or broken, luma.ravel()
    try:
        laid = running.layout.fields(picture, filled.field)
    except DeviceRefused:
        if damage is None:
            raise
        return []  # a damaged field without parity counts as lost, which the time gap shows
    times = running.times.of(filled.stamp, laid)
    return [
        GrabbedField(one.field, time.time_ns, time.sequence, found)
        for one, time, found in zip(laid, times, _damages(running, filled, laid, damage), strict=True)
    ]


def _damages(
    running: _Running, filled: Filled, laid: Sequence[LaidField], damage: str | None
) -> Iterator[str | None]:
    """The damage of each field of a buffer, given that of the whole."""
    gaps = None if running.marks is None else running.marks.gaps(filled.picture)
    profile = running.profile
    # Where the gaps are, the damage is; without any, it may be in both fields.
    is_placed = gaps is not None and gaps.any() and (damage != FLAGGED or profile.flags_gaps_alone)
    for one in laid:
        found = None if gaps is None else stale(one.field, gaps[one.lines])
        if damage and (found or not is_placed):
            yield damage
        elif found or not running.times.follows_gap or one.age_steps not in profile.old_after_gap:
            yield found
        else:
            yield OF_FRAME_BEFORE


def _damage(filled: Filled, whole_bytes: int) -> str | None:
    if filled.stamp.flags & abi.BUF_FLAG_ERROR:
        return FLAGGED
    if filled.bytes_used < whole_bytes:
        return f"short: {filled.bytes_used} of {whole_bytes} bytes"
    return None


_MANY_BUFFERS = 8
"""At 25 frames a second, these last for delays in this process of a third of a second."""
_ENOUGH_S = 0.1
"""Time for which the buffers should last; delays of a tenth of a second are common."""
_ANALOG_SIZES = ((720, 576), (720, 480))


def stream_info(
    layout: Layout,
    profile: Profile,
    times: FieldTimes,
    tells_signal: bool,
    path: Path,
    remarks: tuple[str, ...],
) -> StreamInfo:
    """Description of the stream; general `remarks` come before its own."""
    granted = layout.granted
    return StreamInfo(
        driver="v4l2",
        card=granted.node.card,
        standard=granted.standard,
        columns=granted.columns,
        field_rows=layout.field_rows,
        rate_hz=layout.rate_hz,
        field_order=layout.order,
        pixel_format=granted.fourcc,
        buffers=granted.buffers * layout.fields_per_buffer,
        live=True,
        counts_losses=profile.trusts_sequence,
        tells_signal=tells_signal,
        time_sigma_ns=times.sigma_ns,
        details={
            "node": str(path),
            "kernel driver": granted.node.driver,
            "bus": granted.node.bus_info,
            "field order of the driver": Arrangement(granted.field).name,
            "buffers of the driver": str(granted.buffers),
        },
        remarks=(*remarks, *layout.remarks, *_doubts(profile), *_of_pictures(layout), *_few(layout)),
    )


def _doubts(profile: Profile) -> Iterator[str]:
    if profile.verdict is Verdict.DOUBTFUL:
        yield f"{profile.driver}: {'; '.join((*profile.remarks, profile.advice))}"


def _of_pictures(layout: Layout) -> Iterator[str]:
    granted = layout.granted
    if not granted.scan.is_progressive:
        return
    if (granted.columns, granted.lines) in _ANALOG_SIZES:
        yield (
            f"whole pictures of {granted.columns}×{granted.lines} may come from an analog camera behind a "
            "stick that throws one field of every frame away and invents its lines: use another grabber"
        )
    if FORMATS[granted.fourcc].is_compressed:
        yield (
            "the camera compresses its pictures (JPEG): places of targets are less exact, decoding costs "
            "processor time; a smaller size or rate may come uncompressed"
        )


def _few(layout: Layout) -> Iterator[str]:
    buffers, scan = layout.granted.buffers, layout.granted.scan
    if buffers < _MANY_BUFFERS:
        yield f"the driver has only {buffers} buffers: fields will be lost while the computer is busy"
    elif scan.is_progressive and buffers / scan.rate_hz < _ENOUGH_S:
        yield (
            f"{buffers} buffers last for {buffers / scan.rate_hz * 1e3:.0f} ms: set the option 'buffers' to "
            "a larger number, 32 at most"
        )

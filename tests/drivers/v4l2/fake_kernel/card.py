"""A driver of the kernel with its card and the camera before it."""

import errno
from collections import defaultdict, deque
from dataclasses import dataclass, field

from drivers.v4l2.fake_kernel.pictures import (
    ROWS,
    SINGLE,
    arranged,
    bytes_per_line,
    encode,
    size,
)
from drivers.v4l2.fake_kernel.queue import Queue, refusal
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement

PERIOD_NS = 20_000_000
NTSC = 0x1000
CAPTURES = abi.CAP_VIDEO_CAPTURE | abi.CAP_STREAMING
SOCKETS = (("Television", abi.INPUT_TYPE_TUNER), ("Composite", 2), ("S-Video", 2))
SIGNALS = ("enuminput", "querystd", "none")


@dataclass
class Card:
    """What it is, what it can, what is wrong with it just now; all of it may be changed at any time.

    Attributes:
        driver, card, bus_info, caps: what QUERYCAP says.
        sockets: name and type of the inputs; standards: bits by name, of every input but HDMI.
        formats, orders: what it can deliver; what else is asked for becomes the first of these.
        older: parity of the older field of an INTERLACED frame; None: as V4L2 has it for the standard.
        numbering: whether `sequence` counts "frames" or "fields" in ALTERNATE; first_sequence: its start.
        padding: bytes after every line.
        columns: most pixels a line.
        most_buffers: what REQBUFS grants at most; fewest_buffers: at least.
        tells: where it tells of the signal.
        camera: bits of the camera's standard, 0 without a camera.
        tampers: changes what S_FMT has granted: called with the card's PixFormat.
        stamp: from when a buffer was full to its timestamp; stamp_flags: of the buffer.

    Faults, units (buffers) counted from STREAMON:
        lost: units that never come; uncounted: those of them that `sequence` does not tell of.
        unwritten: bytes by unit, as slices, that the driver leaves as they were.
        flagged: units with the error flag; short: bytes used by unit; unlabelled: units of field ANY.
        answers: errno of the next calls by name, 0 for one that goes well.
        eio_takes: an EIO of DQBUF costs the buffer.
        idle_wakes: so many DQBUF say EAGAIN although poll said otherwise.
        stalled: nothing comes, nothing is said.
        held_ns: from when to when buffers are held up: they are full, and stamped, at the end all at once.
        recounts: `sequence` of the unit from which on it counts anew.
        turned: unit from which on the camera's fields have the other parity; None: never.
        plugged: False after an unplug.
    """

    driver: str = "bttv"
    card: str = "BT878 video (fake)"
    bus_info: str = "PCI:0000:04:00.0"
    caps: int = CAPTURES
    sockets: tuple = SOCKETS
    standards: dict = field(default_factory=lambda: {"PAL": abi.STD_PAL, "NTSC": NTSC, "PAL-M": 0x100})
    formats: tuple = ("GREY", "YUYV", "UYVY", "NV12")
    orders: tuple = (Arrangement.INTERLACED, Arrangement.ALTERNATE, Arrangement.SEQ_TB)
    older: int | None = None
    numbering: str = "frames"
    first_sequence: int = 0
    padding: int = 0
    columns: int = 924
    most_buffers: int = 32
    fewest_buffers: int = 1
    tells: str = "enuminput"
    camera: int = abi.STD_PAL
    tampers: object = None
    stamp: object = staticmethod(lambda due_ns: due_ns)
    stamp_flags: int = abi.BUF_FLAG_TIMESTAMP_MONOTONIC

    lost: set = field(default_factory=set)
    uncounted: set = field(default_factory=set)
    unwritten: dict = field(default_factory=dict)
    flagged: set = field(default_factory=set)
    short: dict = field(default_factory=dict)
    unlabelled: set = field(default_factory=set)
    answers: dict = field(default_factory=lambda: defaultdict(deque))
    eio_takes: bool = True
    idle_wakes: int = 0
    stalled: bool = False
    held_ns: tuple = (0, 0)
    recounts: dict = field(default_factory=dict)
    turned: int | None = None
    plugged: bool = True

    def __post_init__(self):
        self.queue = Queue()
        self.input = 0
        self.standard = NTSC
        self.subscribed, self.events = set(), deque()
        self.unit = self.first_unit = 0
        self.started_at_60_hz = False
        self.set_format(720, 480, self.formats[0], Arrangement.INTERLACED)

    @property
    def is_60_hz(self):
        return bool(self.standard & abi.STD_525_60)

    def time_of(self, field):
        """When the camera's field of that number has begun."""
        return field * 1001 * 10**9 // 60_000 if self.started_at_60_hz else field * PERIOD_NS

    def number_at(self, time_ns):
        """The number of the field at that time."""
        return time_ns * 60_000 // (1001 * 10**9) if self.started_at_60_hz else time_ns // PERIOD_NS

    # ---- what it is set to

    def set_input(self, index):
        self._settled()
        if index >= len(self.sockets):
            raise refusal(errno.EINVAL)
        self.input, self.standard = index, NTSC

    def set_standard(self, standard):
        self._settled()
        known = [bits for bits in self.standards.values() if bits & standard]
        if not known:
            raise refusal(errno.EINVAL)
        self.standard = known[0] & standard
        self.set_format(self.pix.width, 2 * self.rows(), self.formats[0], Arrangement.INTERLACED)

    def set_format(self, columns, lines, fourcc, order):
        self._settled()
        self.pix = self.granted(columns, lines, fourcc, order)

    def granted(self, columns, lines, fourcc, order):
        """What it makes of a wish: as many drivers do, something that it can."""
        order = self._granted_order(order, lines)
        rows = self.rows() * (1 if order in SINGLE else 2)
        fourcc = fourcc if fourcc in self.formats else self.formats[0]
        pix = abi.PixFormat(width=min(columns, self.columns), height=min(lines, rows), field=order)
        pix.pixelformat = abi.fourcc(fourcc)
        pix.bytesperline = bytes_per_line(fourcc, pix.width, self.padding)
        pix.sizeimage = size(fourcc, pix.height, pix.bytesperline)
        if self.tampers is not None:
            self.tampers(pix)
        return pix

    def rows(self):
        at_60_hz = self.started_at_60_hz if self.queue.streaming else self.is_60_hz
        return 240 if at_60_hz else ROWS

    def _granted_order(self, order, lines):
        if order == Arrangement.ANY:  # as several drivers do
            return Arrangement.BOTTOM if lines <= self.rows() else Arrangement.INTERLACED
        return order if order in self.orders else self.orders[0]

    def _settled(self):
        if self.queue.busy:
            raise refusal(errno.EBUSY)

    # ---- what only a digital camera can

    def tell_size(self, _asked):
        raise refusal(errno.ENOTTY)

    def tell_interval(self, _asked):
        raise refusal(errno.ENOTTY)

    def tell_parm(self, _asked):
        raise refusal(errno.ENOTTY)

    def set_parm(self, _asked):
        raise refusal(errno.ENOTTY)

    # ---- what it says of the camera

    @property
    def status(self):
        lost = self.tells == "enuminput" and not self.camera
        return abi.IN_ST_NO_SIGNAL if lost else 0

    def seen_standard(self):
        if self.tells == "querystd":
            return self.camera
        if self.tells == "enuminput":  # a guess by the number of lines
            return abi.STD_625_50 if self.camera & abi.STD_625_50 else abi.STD_525_60
        raise refusal(errno.ENOTTY)

    def set_camera(self, standard):
        """Another camera, or none; said where somebody asked to be told."""
        self.camera = standard
        self.tell(abi.EVENT_SOURCE_CHANGE)

    def tell(self, event):
        if event in self.subscribed:
            self.events.append(event)

    # ---- what it streams

    def start(self, now_ns):
        self.queue.start()
        self.started_at_60_hz = self.is_60_hz
        self.unit = next(n for n in _from(self.number_at(now_ns) // 2) if self._begin_ns(n) >= now_ns)
        if self.order == Arrangement.ALTERNATE:  # with the older field of the standard
            self.unit += (self.unit + self.is_60_hz) % 2
        self.first_unit = self.unit

    @property
    def order(self):
        return Arrangement(self.pix.field)

    def fields_of(self, unit):
        """Numbers of the camera's fields in a buffer, the older first."""
        order = self.order
        if order == Arrangement.ALTERNATE:
            return (unit,)
        if order in (Arrangement.TOP, Arrangement.BOTTOM):
            return (2 * unit + (order == Arrangement.BOTTOM),)
        own = int(self.is_60_hz) if self.older is None else self.older
        older = {Arrangement.INTERLACED: own, Arrangement.NONE: own}.get(
            order, int(order in (Arrangement.INTERLACED_BT, Arrangement.SEQ_BT))
        )
        return (2 * unit + older, 2 * unit + older + 1)

    def _begin_ns(self, unit):
        return self.time_of(self.fields_of(unit)[0])

    def _end_ns(self, unit):
        return self.time_of(self.fields_of(unit)[-1] + 1)

    def due_ns(self):
        """When the next buffer is full; None while nothing comes."""
        if not self.queue.streaming or self.queue.failed or self.stalled or not self.plugged:
            return None
        due_ns = self._end_ns(self.unit)
        held_from_ns, held_until_ns = self.held_ns
        return held_until_ns if held_from_ns <= due_ns < held_until_ns else due_ns

    def deliver(self):
        """The buffer that is due; lost if there is none to write to."""
        due_ns, count = self.due_ns(), self.unit - self.first_unit
        memory = None if count in self.lost else self.queue.fill()
        if memory is not None:
            self._fill(memory, count, due_ns)
        self.unit += 1

    def skip_to(self, now_ns):
        """After a stall: what came meanwhile is gone."""
        while self._end_ns(self.unit) < now_ns:
            self.unit += 1

    def _fill(self, memory, count, due_ns):
        numbers = self.fields_of(self.unit)
        filled = memory.filled
        left = [(part, memory.bytes[part].copy()) for part in self.unwritten.get(count, ())]
        used = self._draw(numbers, count, memory.bytes)
        for part, was in left:
            memory.bytes[part] = was
        filled.bytesused = self.short.get(count, used)
        filled.flags = self.stamp_flags | (abi.BUF_FLAG_ERROR if count in self.flagged else 0)
        filled.field = Arrangement.ANY if count in self.unlabelled else self._label(numbers, count)
        filled.timestamp.tv_sec, rest_ns = divmod(self.stamp(due_ns), 1_000_000_000)
        filled.timestamp.tv_usec = rest_ns // 1_000
        filled.sequence = self._sequence(count)

    def _draw(self, numbers, _count, memory):
        """Writes the picture of these fields; returns its size in bytes."""
        fourcc = abi.fourcc_name(self.pix.pixelformat)
        stride = bytes_per_line(fourcc, self.pix.width, self.padding)
        encode(arranged(numbers, self.order, self.pix.width, self.rows()), fourcc, stride, memory)
        return self.pix.sizeimage

    def _label(self, numbers, count):
        if self.order == Arrangement.ALTERNATE:
            turned = self.turned is not None and count >= self.turned
            return Arrangement.BOTTOM if (numbers[0] + turned) % 2 else Arrangement.TOP
        return self.order

    def _sequence(self, count):
        begin = max((unit for unit in self.recounts if unit <= count), default=0)
        counted = count - begin - sum(begin <= n < count for n in self.uncounted)
        shared = self.order == Arrangement.ALTERNATE and self.numbering == "frames"
        first = self.recounts.get(begin, self.first_sequence)
        return (first + (counted // 2 if shared else counted)) % 2**32


def _from(number):
    while True:
        yield number
        number += 1

"""A digital camera: progressive pictures, no standard, sizes and rates of its own."""

import errno
from dataclasses import dataclass, field
from fractions import Fraction

from drivers.v4l2.fake_kernel.card import Card
from drivers.v4l2.fake_kernel.pictures import (
    blocks_picture,
    bytes_per_line,
    encode,
    jpeg,
    size,
    whole_picture,
)
from drivers.v4l2.fake_kernel.queue import refusal
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement

UVC_MODES = {
    "YUYV": {(640, 480): (30, 15), (1280, 720): (10, 5), (320, 240): (120, 60, 30)},
    "MJPG": {(640, 480): (120, 60, 30), (1280, 720): (60, 30), (1920, 1080): (30,)},
}


@dataclass
class Camera(Card):
    """What a card is, and besides:

    Attributes:
        modes: rates by size by format, the default first.
        span: rates and sizes are told as a range, from the least to the largest of a format.
        tells_modes: sizes and rates can be enumerated; tells_rate: G_PARM and S_PARM are there.
        keeps_rate: S_PARM is answered by this rate whatever was asked for; None: by the nearest.
        soe: stamps are of the start of the exposure, as UVC has them.
        scene: what it sees: a function of number, columns and lines; None: pictures that tell their number.

    Faults: spoilt: what becomes of a unit's JPEG, a function by unit.
    """

    driver: str = "uvcvideo"
    card: str = "HD camera (fake)"
    bus_info: str = "usb-0000:00:14.0-2"
    sockets: tuple = (("Camera 1", 2),)
    standards: dict = field(default_factory=dict)
    formats: tuple = ()
    orders: tuple = (Arrangement.NONE,)
    tells: str = "none"
    modes: dict = field(default_factory=lambda: UVC_MODES)
    span: bool = False
    tells_modes: bool = True
    tells_rate: bool = True
    keeps_rate: object = None
    soe: bool = True
    scene: object = None
    spoilt: dict = field(default_factory=dict)

    def __post_init__(self):
        self.formats = self.formats or tuple(self.modes)
        self.rate_hz = Fraction(30)
        super().__post_init__()
        self.standard = 0
        if self.soe:
            self.stamp_flags |= abi.BUF_FLAG_TSTAMP_SRC_SOE
            self.stamp = lambda due_ns: due_ns - self.period_ns

    # ---- sizes and rates

    @property
    def period_ns(self):
        return round(10**9 / self.rate_hz)

    def granted(self, columns, lines, fourcc, _order):
        fourcc = fourcc if fourcc in self.formats else self.formats[0]
        sizes = self.modes.get(fourcc, {})
        if sizes and not (self.span and self._is_within(sizes, columns, lines)):
            columns, lines = min(sizes, key=lambda one: abs(one[0] - columns) + abs(one[1] - lines))
        pix = abi.PixFormat(width=columns, height=lines, field=Arrangement.NONE)
        pix.pixelformat = abi.fourcc(fourcc)
        if fourcc == "MJPG":
            pix.sizeimage = columns * lines * 2
        else:
            pix.bytesperline = bytes_per_line(fourcc, columns, self.padding)
            pix.sizeimage = size(fourcc, lines, pix.bytesperline)
        if self.tampers is not None:
            self.tampers(pix)
        return pix

    def set_format(self, columns, lines, fourcc, order):
        super().set_format(columns, lines, fourcc, order)
        rates = self._rates()
        self.rate_hz = Fraction(rates[-1]) if rates else self.rate_hz

    def rows(self):
        return self.pix.height // 2

    def _rates(self):
        sizes = self.modes.get(abi.fourcc_name(self.pix.pixelformat), {})
        size_ = (self.pix.width, self.pix.height)
        if self.span and sizes:
            return next(iter(sizes.values()))
        return sizes.get(size_, ())

    @staticmethod
    def _is_within(sizes, columns, lines):
        widths, heights = zip(*sizes, strict=True)
        return min(widths) <= columns <= max(widths) and min(heights) <= lines <= max(heights)

    def tell_size(self, asked):
        sizes = sorted(self.modes.get(abi.fourcc_name(asked.pixel_format), {}))
        if not self.tells_modes:
            raise refusal(errno.ENOTTY)
        if asked.index >= (1 if self.span else len(sizes)):
            raise refusal(errno.EINVAL)
        if self.span:
            asked.type, span = 3, asked.stepwise
            (span.min_width, span.min_height), (span.max_width, span.max_height) = sizes[0], sizes[-1]
            span.step_width = span.step_height = 2
        else:
            asked.type = abi.FRMSIZE_TYPE_DISCRETE
            asked.discrete.width, asked.discrete.height = sizes[asked.index]

    def tell_interval(self, asked):
        if not self.tells_modes:
            raise refusal(errno.ENOTTY)
        sizes = self.modes.get(abi.fourcc_name(asked.pixel_format), {})
        if self.span:
            rates = next(iter(sizes.values()), ())
            self._tell_range(asked, rates)
            return
        rates = sizes.get((asked.width, asked.height), ())
        if asked.index >= len(rates):
            raise refusal(errno.EINVAL)
        asked.type = abi.FRMIVAL_TYPE_DISCRETE
        _fill(asked.discrete, 1 / Fraction(rates[asked.index]))

    @staticmethod
    def _tell_range(asked, rates):
        if asked.index:
            raise refusal(errno.EINVAL)
        asked.type = 3
        _fill(asked.stepwise.min, 1 / Fraction(max(rates)))
        _fill(asked.stepwise.max, 1 / Fraction(min(rates)))
        _fill(asked.stepwise.step, Fraction(1, 10_000_000))

    def tell_parm(self, asked):
        if not self.tells_rate:
            raise refusal(errno.ENOTTY)
        asked.capability = 0x1000
        _fill(asked.timeperframe, 1 / self.rate_hz)

    def set_parm(self, asked):
        self._settled()
        if not self.tells_rate:
            raise refusal(errno.ENOTTY)
        wanted = Fraction(asked.timeperframe.denominator, asked.timeperframe.numerator)
        rates = [Fraction(rate) for rate in self._rates()]
        if self.keeps_rate is not None:
            self.rate_hz = Fraction(self.keeps_rate)
        elif self.span or not rates:
            self.rate_hz = wanted
        else:
            self.rate_hz = min(rates, key=lambda rate: abs(rate - wanted))

    # ---- what it streams

    def time_of(self, number):
        return int(number * 10**9 / self.rate_hz)

    def number_at(self, time_ns):
        return int(time_ns * self.rate_hz / 10**9)

    def fields_of(self, unit):
        return (unit,)

    def start(self, now_ns):
        self.queue.start()
        self.unit = self.first_unit = self.number_at(now_ns) + 1

    def seen_standard(self):
        raise refusal(errno.ENODATA)

    def _draw(self, numbers, count, memory):
        fourcc = abi.fourcc_name(self.pix.pixelformat)
        columns, lines = self.pix.width, self.pix.height
        if fourcc != "MJPG":
            stride = bytes_per_line(fourcc, columns, self.padding)
            encode((self.scene or whole_picture)(numbers[0], columns, lines), fourcc, stride, memory)
            return self.pix.sizeimage
        data = jpeg((self.scene or blocks_picture)(numbers[0], columns, lines))
        data = self.spoilt.get(count, lambda whole: whole)(data)
        memory[: data.size] = data
        return data.size


def _fill(told, value):
    told.numerator, told.denominator = value.numerator, value.denominator

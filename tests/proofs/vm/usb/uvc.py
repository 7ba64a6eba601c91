"""A USB camera of the video class (UVC 1.0), for `uvcvideo`: YUYV or Motion JPEG, isochronous or bulk.

Descriptors, probe and commit, and payload headers after the class definition for video devices 1.0 and its
payload documents. Invented: vendor and product. One that gives every picture twice stands for a dongle that
makes progressive pictures of fields (MacroSilicon).
"""

import importlib
import struct
from dataclasses import dataclass
from typing import ClassVar

from proofs.vm.usb import device
from proofs.vm.usb.camera import COLUMNS, ROW_BYTES, WEBCAM, Camera
from proofs.vm.usb.faults import Due, Fault, Script, without
from proofs.vm.usb.stream import Sent

VIDEO = 1
"""Number of the endpoint that sends pictures."""
_VIDEO_CLASS, _CONTROL, _STREAMING = 14, 1, 2
_OF_INTERFACE = 0x24
_ASYNCHRONOUS = 5
_PROBE, _COMMIT = 1, 2
_SET_CUR, _GET_LEN, _GET_INFO = 0x01, 0x85, 0x86
_ASKED = struct.Struct("<HBBIHHHHHII")
_CLOCK_HZ = 48_000_000
_HEAD = struct.Struct("<BBIIH")
_END_OF_FRAME, _HAS_TIME, _HAS_CLOCK, _END_OF_HEAD = 0x02, 0x04, 0x08, 0x80
_YUY2 = b"YUY2" + bytes.fromhex("00001000800000aa00389b71")
_INTERVAL_100NS = round(1e7 / WEBCAM.rate_hz)
_PICTURE_BYTES = WEBCAM.lines * ROW_BYTES
_JPEG_QUALITY = 95


_BULK_PACKET_BYTES, _BULK_BYTES = 512, 1 << 14
"""Of a packet on the bus, and of a payload with its head."""


@dataclass(frozen=True)
class Claims:
    """What a camera says of its pictures; the truth, unless it lies.

    Attributes:
        columns: Of a picture.
        interval_100ns: From picture to picture.
        picture_bytes: The most of a picture.
    """

    columns: int = COLUMNS
    interval_100ns: int = _INTERVAL_100NS
    picture_bytes: int = _PICTURE_BYTES


class UvcCamera(device.UsbDevice):
    """A camera of 720 × 480 at 30 Hz.

    Args:
        is_jpeg: False for YUYV.
        is_bulk: False for isochronous transfers.
        times: How often each picture is sent.
        claims: What it says of them.

    Attributes:
        is_bulk: See above.
        columns_sent: Of the pictures in Motion JPEG.
    """

    numbers: ClassVar = (0x1D6B, 0x0102, 0x0100)
    device_class: ClassVar = (0xEF, 2, 1)

    def __init__(
        self, *, is_jpeg: bool = False, is_bulk: bool = False, times: int = 1, claims: Claims = Claims()
    ) -> None:
        super().__init__()
        self.strings = ("emulated", "camera", "")
        self.camera = Camera(standard=WEBCAM)
        self.script = Script()
        self.slow = 1.0
        self.field = self.skipped = 0
        self.columns_sent = COLUMNS
        self._is_jpeg, self.is_bulk = is_jpeg, is_bulk
        if is_jpeg:
            # Loaded before it is plugged in: the first picture must not be late.
            self._cv2 = importlib.import_module("cv2")
        self._claims = claims
        self._times, self._sent = times, 0
        self._asked = self._answer()

    @property
    def period_s(self) -> float:
        """From picture to picture, repeated ones included."""
        return self.slow / self.camera.standard.rate_hz

    @property
    def configuration(self) -> bytes:
        """An interface for control and one for pictures, with one format of one size."""
        together = struct.pack("<8B", 8, 11, 0, 2, _VIDEO_CLASS, 3, 0, 0)
        camera = struct.pack("<BBBBHBBHHHBH", 17, _OF_INTERFACE, 2, 1, 0x0201, 0, 0, 0, 0, 0, 2, 0)
        output = struct.pack("<BBBBHBBB", 9, _OF_INTERFACE, 3, 2, 0x0101, 0, 1, 0)
        sizes = 13 + len(camera) + len(output), _CLOCK_HZ
        head = struct.pack("<BBBHHIBB", 13, _OF_INTERFACE, 1, 0x100, *sizes, 1, 1)
        control = device.interface(0, 0, [], (_VIDEO_CLASS, _CONTROL, 0), head + camera + output)
        quiet = device.interface(1, 0, [], (_VIDEO_CLASS, _STREAMING, 0), self._formats())
        if self.is_bulk:
            video = device.endpoint(0x81, device.BULK, _BULK_PACKET_BYTES, 0)
            only = device.interface(1, 0, [video], (_VIDEO_CLASS, _STREAMING, 0), self._formats())
            return device.configuration(2, together + control + only)
        video = device.endpoint(0x81, _ASYNCHRONOUS, device.THREE_A_MICROFRAME)
        loud = device.interface(1, 1, [video], (_VIDEO_CLASS, _STREAMING, 0))
        return device.configuration(2, together + control + quiet + loud)

    def _formats(self) -> bytes:
        bits = round(_PICTURE_BYTES * 8 * WEBCAM.rate_hz)
        claims = self._claims
        times = (claims.interval_100ns, 1, claims.interval_100ns)
        size = (claims.columns, WEBCAM.lines, bits, bits, claims.picture_bytes, *times)
        if self._is_jpeg:
            form, of_frame = struct.pack("<11B", 11, _OF_INTERFACE, 6, 1, 1, 1, 1, 0, 0, 0, 0), 7
        else:
            form = struct.pack("<5B16s6B", 27, _OF_INTERFACE, 4, 1, 1, _YUY2, 16, 1, 0, 0, 0, 0)
            of_frame = 5
        frame = struct.pack("<5BHHIIIIBI", 30, _OF_INTERFACE, of_frame, 1, 0, *size)
        total = 14 + len(form) + len(frame)
        return (
            struct.pack("<BBBBH8B", 14, _OF_INTERFACE, 1, 1, total, 0x81, 0, 2, 0, 0, 0, 1, 0) + form + frame
        )

    def _answer(self) -> bytes:
        claims = self._claims
        sizes = (claims.picture_bytes, self._payload_bytes)
        return _ASKED.pack(0, 1, 1, claims.interval_100ns, 0, 0, 0, 0, 0, *sizes)

    @property
    def _payload_bytes(self) -> int:
        return _BULK_BYTES if self.is_bulk else device.MOST_BYTES

    def of_class(self, request: int, value: int, index: int, wanted: int, data: bytes) -> bytes | None:
        """Probe and commit: there is one format of one size, whatever is asked for."""
        if index & 255 != 1 or value >> 8 not in (_PROBE, _COMMIT):
            return None
        if request == _SET_CUR:
            return b""
        if request == _GET_LEN:
            return struct.pack("<H", _ASKED.size)
        return b"\3" if request == _GET_INFO else self._answer()

    def next_field(self) -> Sent:
        """The next picture."""
        number = self.field
        self._sent += 1
        if self._sent % self._times == 0:
            self.field += 1
        packets, silent_s = self._packets(number), 0.0
        for due in self.script.of(number) if self._sent % self._times == 0 else ():
            if due.kind == Fault.SILENCE:
                silent_s = due.arguments[0]
            else:
                packets = _harmed(packets, due)
        return Sent(packets, silent_s)

    def _packets(self, number: int) -> list[bytes]:
        picture = self._picture(number)
        room = self._payload_bytes - _HEAD.size
        at_ticks = round(number * _CLOCK_HZ / WEBCAM.rate_hz) % 2**32
        flags = self._sent % 2 | _HAS_TIME | _HAS_CLOCK | _END_OF_HEAD
        packets = []
        for at in range(0, len(picture), room):
            is_last = at + room >= len(picture)
            head = (flags | _END_OF_FRAME * is_last, at_ticks, at_ticks, number % 2048)
            packets.append(_HEAD.pack(_HEAD.size, *head) + picture[at : at + room])
        return packets

    def _picture(self, number: int) -> bytes:
        rows = self.camera.field(number & 0xFFFF)
        if not self._is_jpeg:
            return rows.tobytes()
        luma = rows[:, : 2 * self.columns_sent : 2]
        _, coded = self._cv2.imencode(".jpg", luma, [self._cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        return coded.tobytes()


def _harmed(packets: list[bytes], due: Due) -> list[bytes]:
    arguments = tuple(map(int, due.arguments))
    if due.kind == Fault.LOST:
        return without(packets, *arguments)
    if due.kind == Fault.FIELD:
        return []
    assert due.kind == Fault.SHORT, due
    at, count = arguments
    return [*packets[:at], packets[at][:-count], *packets[at + 1 :]]

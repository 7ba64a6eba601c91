"""A dongle with STK1160 and SAA7113 (05e1:0408): registers, I²C, and pictures, for `stk1160`.

A field begins with a short packet of 0xc0 (top: rows 0, 2, …; it also ends a frame) or 0x80 (bottom); its
data follow in packets of their own, each behind four bytes. After drivers/media/usb/stk1160 and
drivers/media/i2c/saa7115.c of Linux 6.1. Invented: the descriptors but the endpoint, the four bytes, and what
is sent without a signal: a blue picture, as decoders with a free-running clock give it.
"""

from typing import ClassVar

import numpy as np

from proofs.vm.usb import device
from proofs.vm.usb.camera import NTSC, PAL, Camera
from proofs.vm.usb.faults import Due, Fault, Script, without
from proofs.vm.usb.stream import Sent

VIDEO = 2
"""Number of the endpoint that sends pictures."""
_READ, _WRITE = 0, 1
_SERIAL, _SERIAL_STATE = 0x200, 0x201
_WRITTEN_AT, _WRITTEN, _READ_AT, _READ_VALUE = 0x204, 0x205, 0x208, 0x209
_START_READ, _WRITE_IS_DONE, _READ_IS_DONE = 0x20, 0x04, 0x01
_SOUND = 0x500
_LAST_LINE = 0x116
"""Last line of a field, low byte; only its value tells the standard that was asked for."""
_OF_625 = 0x21
_TOP, _BOTTOM = 0xC0, 0x80
_HEAD = b"\x40\0\0\0"
_CHIP = (0x10, 0xF, 7, 1, 1, 3)
"""What register 0 of the decoder says in turn: f7113."""
_STATUS = 0x1F
_NOT_LOCKED, _IS_60_HZ, _IS_READY = 0x40, 0x20, 0x81
_BLUE = bytes((0xF0, 0x29, 0x6E, 0x29))
"""UYVY."""


class Decoder:
    """The SAA7113 behind the I²C bus.

    Attributes:
        has_signal: False: it is not locked.
        is_60_hz: The signal's standard.
    """

    def __init__(self) -> None:
        self.has_signal = True
        self.is_60_hz = False
        self._registers: dict[int, int] = {}

    def write(self, register: int, value: int) -> None:
        """Writes a register."""
        self._registers[register] = value

    def read(self, register: int) -> int:
        """Reads a register."""
        if register == 0:
            turn = self._registers.get(0, 0)
            return _CHIP[turn] if turn < len(_CHIP) else 0
        if register == _STATUS:
            if not self.has_signal:
                return _NOT_LOCKED
            return _IS_READY | (_IS_60_HZ if self.is_60_hz else 0)
        return self._registers.get(register, 0)


class Stk1160(device.UsbDevice):
    """The grabber; fields with an even number are top fields, and begin a frame."""

    numbers: ClassVar = (0x05E1, 0x0408, 0x0005)

    def __init__(self) -> None:
        super().__init__()
        self.strings = ("Syntek Semiconductor", "USB 2.0 Video Capture Controller", "")
        self.camera = Camera(luma_first=False)
        self.decoder = Decoder()
        self.script = Script()
        self.slow = 1.0
        self.field = self.skipped = 0
        self._registers: dict[int, int] = {}

    @property
    def period_s(self) -> float:
        """From field to field."""
        return self.slow / self.camera.standard.rate_hz

    @property
    def configuration(self) -> bytes:
        """Six alternate settings, of which the last one suffices for pictures."""
        packets = (0, 0x300, 0xB00, 0x1300, 0x1380, device.THREE_A_MICROFRAME)
        body = b"".join(
            device.interface(0, k, [device.endpoint(0x82, device.ISOCHRONOUS, packet)])
            for k, packet in enumerate(packets)
        )
        return device.configuration(1, body)

    def vendor(self, request: int, value: int, index: int, wanted: int, data: bytes) -> bytes | None:
        """Reads or writes a register; some of them are those of the I²C bus."""
        if request == _READ:
            return bytes([self._read(index)])
        if request != _WRITE:
            return None
        self._registers[index] = value
        if index == _SERIAL:
            self._transfer(value)
        elif index == _LAST_LINE:
            self.camera.standard = PAL if value & 255 == _OF_625 else NTSC
        return b""

    def _read(self, register: int) -> int:
        if register == _SERIAL_STATE:
            return _WRITE_IS_DONE | _READ_IS_DONE
        if register == _SOUND:
            return 0  # its transfers are over at once
        return self._registers.get(register, 0) & 255

    def _transfer(self, how: int) -> None:
        of = self._registers.get
        if how & _START_READ:
            self._registers[_READ_VALUE] = self.decoder.read(of(_READ_AT, 0))
        else:
            self.decoder.write(of(_WRITTEN_AT, 0), of(_WRITTEN, 0))

    def next_field(self) -> Sent:
        """The next field."""
        number, self.field = self.field, self.field + 1
        packets, silent_s = self._packets(number), 0.0
        for due in self.script.of(number):
            if due.kind == Fault.SILENCE:
                silent_s = due.arguments[0]
            else:
                packets = _harmed(packets, due)
        return Sent(packets, silent_s)

    def _packets(self, number: int) -> list[bytes]:
        is_top = number % 2 == 0
        rows = self.camera.field(number & 0xFFFF, number % 2)
        if not self.decoder.has_signal:
            rows.reshape(-1, 4)[:] = np.frombuffer(_BLUE, np.uint8)
        data, room = rows.tobytes(), device.MOST_BYTES - len(_HEAD)
        mark = bytes([_TOP if is_top else _BOTTOM]) + bytes(7)
        return [mark, *(_HEAD + data[at : at + room] for at in range(0, len(data), room))]


def _harmed(packets: list[bytes], due: Due) -> list[bytes]:
    arguments = tuple(map(int, due.arguments))
    if due.kind == Fault.LOST:
        return without(packets, *arguments)
    if due.kind == Fault.FIELD:
        return []
    if due.kind == Fault.SHORT:
        at, count = arguments
        return [*packets[:at], packets[at][:-count], *packets[at + 1 :]]
    assert due.kind == Fault.SAME_PARITY, due
    return [bytes([packets[0][0] ^ 0x40]) + packets[0][1:], *packets[1:]]

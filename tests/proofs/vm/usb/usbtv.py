"""A Fushicai USBTV007 ("EasyCAP", 1b71:3002): registers, and pictures in chunks, for `usbtv`.

A field is sent in chunks of 960 bytes behind a word: 0x88, the frame's number (8 bits), odd (1 bit) and the
chunk's number; three of them, filled up to 1024 bytes each, are a packet. After drivers/media/usb/usbtv of
Linux 6.1. What the driver does not look at is invented: the endpoints but the first, and what is sent without
a signal (nothing is known of that; it is not emulated).
"""

from typing import ClassVar

import numpy as np

from proofs.vm.usb import device
from proofs.vm.usb.camera import NTSC, PAL, ROW_BYTES, Camera
from proofs.vm.usb.faults import Due, Fault, Script, without
from proofs.vm.usb.stream import Sent

VIDEO = 1
"""Number of the endpoint that sends pictures."""
_CHUNK, _CHUNK_SENT, _A_PACKET = 960, 1024, 3
_WRITE, _BLOCK = 12, 11
_IS_PAL = 0xC117
"""Register that is 1 for 625 lines and 0 for 525."""


class Usbtv(device.UsbDevice):
    """The grabber; fields with an odd number are top fields, and end a frame."""

    numbers: ClassVar = (0x1B71, 0x3002, 0x0100)

    def __init__(self) -> None:
        super().__init__()
        self.strings = ("fushicai", "usbtv007", "300000000002")
        self.camera = Camera()
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
        """Two alternate settings with four endpoints, as the driver wants them; the first sends pictures."""
        others = [
            device.endpoint(0x82, device.BULK, 512, 0),
            device.endpoint(0x83, device.BULK, 512, 0),
            device.endpoint(0x84, device.INTERRUPT, 8, 8),
        ]
        body = b"".join(
            device.interface(0, k, [device.endpoint(0x81, device.ISOCHRONOUS, packet), *others])
            for k, packet in enumerate((0, device.THREE_A_MICROFRAME))
        )
        return device.configuration(1, body)

    def vendor(self, request: int, value: int, index: int, wanted: int, data: bytes) -> bytes | None:
        """Reads or writes registers."""
        if request == _WRITE:
            self._registers[index] = value
            if index == _IS_PAL:
                self.camera.standard = PAL if value else NTSC
            return b""
        if request != _BLOCK:
            return None
        self._registers.update(enumerate(data, index))
        return bytes(self._registers.get(index + k, 0) & 255 for k in range(wanted))

    def next_field(self) -> Sent:
        """The next field."""
        number, self.field = self.field, self.field + 1
        chunks, silent_s = self._chunks(number), 0.0
        for due in self.script.of(number):
            if due.kind == Fault.SILENCE:
                silent_s = due.arguments[0]
            else:
                chunks = _harmed(chunks, due)
        sent = range(0, len(chunks), _A_PACKET)
        return Sent([b"".join(chunks[k : k + _A_PACKET]) for k in sent], silent_s)

    def _chunks(self, number: int) -> list[bytes]:
        odd = number & 1
        rows = self.camera.field(number & 0xFFFF, 1 - odd)
        count = len(rows) * ROW_BYTES // _CHUNK
        chunks = np.zeros((count, _CHUNK_SENT), np.uint8)
        heads = 0x88 << 24 | (number >> 1 & 255) << 16 | odd << 15 | np.arange(count)
        chunks[:, :4] = heads.astype(">u4").view(np.uint8).reshape(-1, 4)
        chunks[:, 4 : 4 + _CHUNK] = rows.reshape(count, _CHUNK)
        whole = chunks.tobytes()
        return [whole[at : at + _CHUNK_SENT] for at in range(0, len(whole), _CHUNK_SENT)]


def _harmed(chunks: list[bytes], due: Due) -> list[bytes]:
    if due.kind == Fault.LOST:
        return without(chunks, *map(int, due.arguments))
    if due.kind == Fault.FIELD:
        return []
    if due.kind == Fault.GARBLED:
        at = int(due.arguments[0])
        return [*chunks[:at], b"\0" + chunks[at][1:], *chunks[at + 1 :]]
    if due.kind == Fault.REPEATED_ID:
        return [one[:1] + bytes([one[1] - 1 & 255]) + one[2:] for one in chunks]
    assert due.kind == Fault.SAME_PARITY, due
    return [one[:2] + bytes([one[2] ^ 0x80]) + one[3:] for one in chunks]

"""A high-speed USB device: its descriptors, and the requests that all devices answer (USB 2.0, chapter 9)."""

import struct
from collections.abc import Sequence
from typing import ClassVar

_STANDARD, _CLASS, _VENDOR = 0x00, 0x20, 0x40
_KIND, _TO_HOST = 0x60, 0x80
_GET_STATUS, _SET_ADDRESS, _GET_DESCRIPTOR, _GET_CONFIGURATION = 0, 5, 6, 8
_SET_CONFIGURATION, _GET_INTERFACE, _SET_INTERFACE = 9, 10, 11
_CLEAR_FEATURE, _SET_FEATURE = 1, 3
_OF_DEVICE, _OF_CONFIGURATION, _OF_STRING = 1, 2, 3
_ENGLISH = b"\x04\x03\x09\x04"
ISOCHRONOUS, BULK, INTERRUPT = 1, 2, 3
THREE_A_MICROFRAME = 0x1400
"""Packets of 1024 bytes, three of them in 125 µs: the most that USB 2.0 has."""
MOST_BYTES = 3072
"""Those of a microframe."""


def endpoint(address: int, kind: int, packet_bytes: int, interval: int = 1) -> bytes:
    """Descriptor of an endpoint."""
    return struct.pack("<BBBBHB", 7, 5, address, kind, packet_bytes, interval)


def interface(
    number: int,
    alternate: int,
    endpoints: Sequence[bytes],
    kind: tuple[int, int, int] = (255, 0, 0),
    extra: bytes = b"",
) -> bytes:
    """Descriptor of an alternate setting of an interface, with those of its class and of its endpoints."""
    head = struct.pack("<9B", 9, 4, number, alternate, len(endpoints), *kind, 0)
    return head + extra + b"".join(endpoints)


def configuration(interfaces: int, body: bytes) -> bytes:
    """Descriptor of the only configuration."""
    return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), interfaces, 1, 0, 0x80, 250) + body


class UsbDevice:
    """What all devices do; a kind of device adds its own requests.

    Attributes:
        numbers: Vendor, product and version.
        strings: Manufacturer, product and serial number; "": none.
        alternates: Alternate setting of each interface that was set.
        has_bandwidth: False refuses every alternate setting that takes bandwidth.
    """

    numbers: ClassVar[tuple[int, int, int]]
    strings: tuple[str, str, str] = ("", "", "")
    device_class: ClassVar[tuple[int, int, int]] = (0, 0, 0)

    def __init__(self) -> None:
        self.alternates: dict[int, int] = {}
        self.has_bandwidth = True

    @property
    def configuration(self) -> bytes:
        """Descriptors of its configuration."""
        raise NotImplementedError

    def control(self, setup: bytes, data: bytes) -> bytes | None:
        """The answer to a control request; None stalls."""
        kind, request, value, index, length = struct.unpack("<BBHHH", setup)
        if kind & _KIND == _STANDARD:
            return self._standard(kind, request, value, index)
        if kind & _KIND == _VENDOR:
            return self.vendor(request, value, index, length if kind & _TO_HOST else 0, data)
        return self.of_class(request, value, index, length if kind & _TO_HOST else 0, data)

    def vendor(self, request: int, value: int, index: int, wanted: int, data: bytes) -> bytes | None:
        """A request of the maker's own; `wanted`: bytes that the host asks for."""
        return None

    def of_class(self, request: int, value: int, index: int, wanted: int, data: bytes) -> bytes | None:
        """A request of the device's class."""
        return None

    def _standard(self, kind: int, request: int, value: int, index: int) -> bytes | None:
        if request == _GET_DESCRIPTOR:
            return self._descriptor(value >> 8, value & 255)
        if request == _SET_INTERFACE:
            if value and not self.has_bandwidth:
                return None
            self.alternates[index] = value
        answers = {
            _GET_STATUS: b"\0\0",
            _GET_CONFIGURATION: b"\1",
            _GET_INTERFACE: bytes([self.alternates.get(index, 0)]),
        }
        silent = (_CLEAR_FEATURE, _SET_FEATURE, _SET_ADDRESS, _SET_CONFIGURATION, _SET_INTERFACE)
        return answers.get(request, b"" if request in silent else None)

    def _descriptor(self, kind: int, number: int) -> bytes | None:
        if kind == _OF_DEVICE:
            named = (k + 1 if text else 0 for k, text in enumerate(self.strings))
            return struct.pack("<BBH4B3H4B", 18, 1, 0x200, *self.device_class, 64, *self.numbers, *named, 1)
        if kind == _OF_CONFIGURATION:
            return self.configuration
        if kind != _OF_STRING or number > len(self.strings):
            return None
        if not number:
            return _ENGLISH
        text = self.strings[number - 1].encode("utf-16-le")
        return bytes([2 + len(text), 3]) + text

"""Queries that work on any video node, even while it streams for another program."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import reduce
from operator import or_
from pathlib import Path

from grabberd_v4l2 import abi
from grabberd_v4l2.abi import ONE_FIELD, Arrangement
from grabberd_v4l2.formats import FORMATS, RAW
from grabberd_v4l2.kernel import Kernel
from grabberd_v4l2.modes import in_words, offered
from grabberd_v4l2.node import Node

_COLUMNS, _FRAME_LINES, _FIELD_LINES = 720, 576, 288
FAMILIES = {
    "PAL": abi.STD_PAL,
    "PAL-M": 0x0100,
    "PAL-N": 0x0600,
    "PAL-60": 0x0800,
    "NTSC": 0xF000,
    "SECAM": 0xFF0000,
}
"""Standards that have a name of their own, V4L2_STD_*."""


@dataclass(frozen=True, slots=True)
class Answers:
    """Properties that a node reports.

    Attributes:
        kernel_driver: name of the kernel driver, e.g. "bttv"; `card`: the device's own name.
        captures: True if the node delivers pictures; if False, all further attributes are empty.
        inputs: names of its inputs.
        standards: families of standards that its inputs support, such as "PAL".
        at_50_hz: True if one of them has 50 fields per second.
        standard_now: the selected standard, "" if unknown.
        formats: supported pixel formats that grabberd reads; `other_formats`: all others.
        field_orders: field orders that it grants.
        pictures: sizes and rates of a camera without standards, in words; "" for all others.
    """

    kernel_driver: str
    card: str
    captures: bool
    inputs: tuple[str, ...] = ()
    standards: tuple[str, ...] = ()
    at_50_hz: bool = False
    standard_now: str = ""
    formats: tuple[str, ...] = ()
    other_formats: tuple[str, ...] = ()
    field_orders: tuple[Arrangement, ...] = ()
    pictures: str = ""

    @property
    def is_camera(self) -> bool:
        """True for a digital camera: whole pictures, and no video standard."""
        return not self.standards and Arrangement.NONE in self.field_orders


def ask(kernel: Kernel, path: Path) -> Answers:
    """Asks a node.

    Raises:
        OSError: the node cannot be opened, or disappears meanwhile.
    """
    with closing(Node(kernel, path)) as node:
        own = node.capability()
        if not own.flags & abi.CAP_VIDEO_CAPTURE:
            return Answers(own.driver, own.card, captures=False)
        return _answers(node, own.driver, own.card)


def _answers(node: Node, kernel_driver: str, card: str) -> Answers:
    inputs = node.inputs()
    standards = reduce(or_, (one.std for one in inputs), 0)
    formats = node.pixel_formats()
    # What counts is the selected input: a card may have inputs with standards beside others.
    has_standards = bool(node.standards())
    readable = tuple(name for name in (RAW if has_standards else FORMATS) if name in formats)
    return Answers(
        kernel_driver=kernel_driver,
        card=card,
        captures=True,
        inputs=tuple(one.name.decode("utf-8", "replace") for one in inputs),
        standards=_families(standards),
        at_50_hz=bool(standards & abi.STD_625_50),
        standard_now="/".join(_families(_standard_now(node))),
        formats=readable,
        other_formats=tuple(name for name in formats if name not in readable),
        field_orders=tuple(_field_orders(node, formats)),
        pictures="" if has_standards or not readable else in_words(list(offered(node, readable))),
    )


def _families(standards: int) -> tuple[str, ...]:
    return tuple(name for name, bits in FAMILIES.items() if bits & standards)


def _standard_now(node: Node) -> int:
    """Bits of the selected standard; 0 if the selected input has no standards."""
    try:
        return node.standard()
    except OSError:
        return 0


def _field_orders(node: Node, formats: tuple[str, ...]) -> Iterator[Arrangement]:
    fourcc = next((name for name in (*FORMATS, *formats) if name in formats), None)
    if fourcc is None:
        return
    for wanted in Arrangement:
        lines = _FIELD_LINES if wanted in ONE_FIELD else _FRAME_LINES
        if wanted is not Arrangement.ANY and _grants(node, lines, fourcc, wanted):
            yield wanted


def _grants(node: Node, lines: int, fourcc: str, wanted: Arrangement) -> bool:
    """True if TRY_FMT returns the arrangement; drivers refuse one by an error or by returning another."""
    try:
        return bool(node.tried_format(_COLUMNS, lines, fourcc, wanted).field == wanted)
    except OSError:
        return False

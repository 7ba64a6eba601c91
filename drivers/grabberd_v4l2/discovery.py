"""Discovery of frame grabbers, with verdicts and the options that identify them; bandwidth and reset of USB.

Only queries are used that work even while a node is streaming for another program.

All facts about USB come from /sys; only the reset needs libusb. Without that library everything else works.
"""

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.core.field import LARGEST_SIDE_PX
from grabberd.errors import DeviceAbsent, DeviceError, DeviceRefused
from grabberd.instrument.acquisition.device import SYSTEM, FoundDevice, Roots, Verdict
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import ONE_FIELD, Arrangement
from grabberd_v4l2.devices import Identity, UsbPlace, VideoNode, find_node, node_at, usb_places, video_nodes
from grabberd_v4l2.formats import FORMATS, LEAST_HZ, MOST_HZ, RAW, in_words, offered, wishes
from grabberd_v4l2.node import Kernel, LinuxKernel, Node
from grabberd_v4l2.profiles import Profile, Profiles

HIGH_SPEED_MBIT_S = 480.0
"""Speed of USB 2.0."""

RULE = "72-grabberd.rules"
"""The udev rule in the driver's folder `udev`."""

GONE = (errno.ENODEV, errno.ENOENT)
"""Error numbers of a reset after which the device re-enumerates; the next open finds it."""


def libusb() -> Any | None:
    """The system's libusb for pyusb, or None if it is not installed or does not start."""
    from usb.backend import libusb1  # type: ignore[import-untyped] # noqa: PLC0415 - loads a library that may be missing

    return libusb1.get_backend()


def reset_of(
    identity: Identity, roots: Roots = SYSTEM, find_backend: Callable[[], Any | None] = libusb
) -> None:
    """Resets a grabber like unplugging it; it returns, possibly as another node, in about half a second.

    No program may have its node open.

    Raises:
        DeviceAbsent: The grabber is not connected.
        DeviceRefused: The grabber is not on USB, or libusb or permissions are missing.
    """
    place = _place_of(identity, roots)
    device = _device_at(place, find_backend())
    try:
        device.reset()
    except OSError as error:
        if error.errno not in GONE:
            raise _unreadable(place, error) from error


def remarks_on(node: VideoNode, nodes: Iterable[VideoNode]) -> Iterator[str]:
    """Warnings about the USB port of a grabber; `nodes` are all video nodes of the computer."""
    if node.usb is None:
        return
    if node.usb.speed_mbit_s < HIGH_SPEED_MBIT_S:
        yield (
            f"It runs at {node.usb.speed_mbit_s:g} Mbit/s (USB 1.1), but PAL takes 166: plug it directly "
            f"into a USB 2.0 port, with another cable."
        )
    others = [other for other in nodes if _share_a_bus(node, other)]
    if others:
        yield (
            f"It shares USB bus {node.usb.bus} with {' and '.join(str(other.path) for other in others)}: PAL "
            f"takes 20.7 MB/s, which a USB 2.0 bus carries only once. Plug one into a port of another bus."
        )


def _share_a_bus(one: VideoNode, other: VideoNode) -> bool:
    if one.usb is None or other.usb is None or other.index > 0 or one.usb.port == other.usb.port:
        return False
    return one.usb.bus == other.usb.bus and one.usb.speed_mbit_s <= HIGH_SPEED_MBIT_S


def _place_of(identity: Identity, roots: Roots) -> UsbPlace:
    if identity.device is None:
        return _only([place for place in usb_places(roots) if identity.matches(place)], identity)
    node = node_at(find_node(identity, roots), video_nodes(roots))
    if node is None or node.usb is None:
        raise DeviceRefused(
            f"{identity} cannot be reset by software: it is not on USB",
            "reboot the computer; if the card still hangs, switch the computer off for ten seconds",
        )
    return node.usb


def _only(places: list[UsbPlace], identity: Identity) -> UsbPlace:
    if not places:
        raise DeviceAbsent(f"no USB device is {identity}", "plug it in")
    if len(places) > 1:
        raise DeviceRefused(
            f"{len(places)} USB devices are {identity}: {', '.join(map(str, places))}",
            f'add port: "{places[0].port}" (or another of these ports) to the device\'s options',
        )
    return places[0]


def _device_at(place: UsbPlace, backend: Any | None) -> Any:
    """The pyusb object for a device."""
    import usb.core  # type: ignore[import-untyped] # noqa: PLC0415 - only a reset needs it

    if backend is None:
        raise DeviceRefused(
            f"{place} cannot be reset: the library libusb-1.0 is missing, or does not start",
            "install it (Debian: apt install libusb-1.0-0), and allow the service AF_NETLINK; everything but "
            "the reset works without it",
        )
    vendor, product = (int(word, 16) for word in place.vendor_product.split(":"))
    device = usb.core.find(
        backend=backend, bus=place.bus, address=place.address, idVendor=vendor, idProduct=product
    )
    if device is None:
        raise DeviceAbsent(f"{place} has just disappeared", "plug it in")
    return device


def _unreadable(place: UsbPlace, error: OSError) -> DeviceError:
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceRefused(
            f"{place} cannot be reset: no permission for /dev/bus/usb/{place.bus:03}/{place.address:03}",
            f"install the udev rule {RULE} into /etc/udev/rules.d, run 'udevadm control --reload', plug the "
            f"grabber in again, and run grabberd in the group video",
        )
    return DeviceRefused(
        f"{place} could not be reset: {error.strerror or error}",
        "unplug it and plug it in again; a service without permission to open USB devices fails like this, "
        "too: it needs DeviceAllow=char-usb_device rw",
    )


_COLUMNS, _FRAME_LINES, _FIELD_LINES = 720, 576, 288
FAMILIES = {
    "PAL": abi.STD_PAL,
    "PAL-M": 0x0100,
    "PAL-N": 0x0600,
    "PAL-60": 0x0800,
    "NTSC": 0xF000,
    "SECAM": 0xFF0000,
}
"""Families of standards with their bits, V4L2_STD_*."""


@dataclass(frozen=True, slots=True)
class Answers:
    """Properties reported by a node.

    Attributes:
        kernel_driver: Name of the kernel driver, e.g. "bttv"; `card`: the device's own name.
        captures: True if the node delivers pictures; if False, all further attributes are empty.
        inputs: Names of its inputs.
        standards: Families of standards that its inputs support, such as "PAL".
        at_50_hz: True if one of them has 50 fields per second.
        standard_now: The selected standard, "" if unknown.
        formats: Supported pixel formats that grabberd reads; `other_formats`: all others.
        field_orders: Field orders that it grants.
        pictures: Sizes and rates of a camera without standards, in words; "" for all others.
        can_be_taken: False if grabberd can read none of these pictures, whatever their format.
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
    can_be_taken: bool = True

    @property
    def is_camera(self) -> bool:
        """True for a digital camera, which has progressive pictures and no video standard."""
        return not self.standards and Arrangement.NONE in self.field_orders


def ask(kernel: Kernel, path: Path) -> Answers:
    """Queries a node.

    Raises:
        OSError: The node cannot be opened, or disappears meanwhile.
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
    # Only the selected input counts: a card may have inputs with and without standards.
    has_standards = bool(node.standards())
    readable = tuple(name for name in (RAW if has_standards else FORMATS) if name in formats)
    modes = [] if has_standards else list(offered(node, readable))
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
        pictures=in_words(modes) if modes else "",
        can_be_taken=not modes or bool(wishes(modes, dict.fromkeys(readable, 0), None, None)),
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
    """True if TRY_FMT returns the arrangement; drivers refuse by an error or by returning another."""
    try:
        return bool(node.tried_format(_COLUMNS, lines, fourcc, wanted).field == wanted)
    except OSError:
        return False


DRIVER = "v4l2"
Ask = Callable[[Path], Answers]


class _Seen(NamedTuple):
    """A node and its answers; `refusal` is the reason if there are none."""

    node: VideoNode
    answers: Answers
    refusal: str = ""


def discover(
    roots: Roots = SYSTEM, asked: Ask | None = None, profiles: Profiles | None = None
) -> tuple[FoundDevice, ...]:
    """All nodes that deliver pictures, by number; one that cannot be queried is listed with the reason."""
    answer = asked or (lambda path: ask(LinuxKernel(), path))
    known = profiles or Profiles.load()
    nodes = video_nodes(roots)
    seen = (_seen(node, answer) for node in nodes)
    return tuple(_found(one, nodes, known) for one in seen if one.answers.captures)


def _seen(node: VideoNode, asked: Ask) -> _Seen:
    """Queries a node; if that fails, assumes that only a device's first node delivers pictures."""
    try:
        return _Seen(node, asked(node.path))
    except OSError as error:
        return _Seen(node, Answers(node.kernel_driver, node.card, node.index == 0), _refusal(node, error))


def _found(seen: _Seen, nodes: Sequence[VideoNode], profiles: Profiles) -> FoundDevice:
    profile = profiles.of(seen.answers.kernel_driver, seen.node.usb_id)
    faults = tuple(_faults(seen))
    best, *others = _ways(seen.node, nodes)
    return FoundDevice(
        driver=DRIVER,
        card=seen.answers.card or seen.node.card,
        options=best,
        verdict=_verdict(profile, seen.node, faults),
        remarks=(*_remarks(seen, nodes, profile), *faults, *map(_sentence, profiles.remarks)),
        facts=dict(_facts(seen.node, seen.answers)),
        other_options=tuple(others),
    )


def _faults(seen: _Seen) -> Iterator[str]:
    """Reasons why a grabber is unusable, from its own answers."""
    if seen.refusal:
        return
    answers = seen.answers
    if not answers.standards and not answers.is_camera:
        yield "It has no video standard, and grants no progressive pictures (field order 'none') either."
    if not answers.formats:
        known = ", ".join(answers.other_formats) or "none"
        yield f"It has no format that grabberd reads ({', '.join(FORMATS)}), only {known}."
    if not answers.can_be_taken:
        yield (
            f"None of its pictures can be taken ({answers.pictures}): grabberd needs an even number of "
            f"lines, at most {LARGEST_SIDE_PX} pixels each way and {LEAST_HZ} to {MOST_HZ} pictures a second."
        )


def _verdict(profile: Profile, node: VideoNode, faults: tuple[str, ...]) -> Verdict:
    too_slow = node.usb is not None and node.usb.speed_mbit_s < HIGH_SPEED_MBIT_S
    return Verdict.UNUSABLE if faults or too_slow else profile.verdict


def _remarks(seen: _Seen, nodes: Sequence[VideoNode], profile: Profile) -> Iterator[str]:
    if seen.refusal:
        yield seen.refusal
    yield from (_sentence(remark) for remark in (*profile.remarks, profile.advice) if remark)
    yield from _of_standards(seen.answers)
    yield from remarks_on(seen.node, nodes)
    if seen.node.by_path is None:
        yield (
            "udev has no link for it under /dev/v4l/by-path: its node may have another number after a "
            "reboot or after replugging."
        )


def _of_standards(answers: Answers) -> Iterator[str]:
    """Remarks on the kind of pictures, and on how it is chosen."""
    if answers.is_camera:
        yield "It delivers progressive pictures: choose by the options 'size', 'rate_hz' and 'format'."
    elif answers.standards and not answers.at_50_hz:
        known = ", ".join(answers.standards)
        yield f"It has no standard of 50 fields a second, only {known}: set the option 'standard'."
    elif FAMILIES.get(answers.standard_now, 0) & abi.STD_525_60:
        yield (
            f"It is set to {answers.standard_now} now, the default of some drivers; grabberd selects PAL "
            "when it opens it, or what the option 'standard' says."
        )


def _refusal(node: VideoNode, error: OSError) -> str:
    if error.errno in (errno.EACCES, errno.EPERM):
        return (
            f"It could not be queried: no permission to open {node.path}. Add yourself to the group video "
            f"('sudo usermod -aG video $USER', then log in again)."
        )
    return f"It could not be queried: {os.strerror(error.errno or 0)}."


def _ways(node: VideoNode, nodes: Sequence[VideoNode]) -> Iterator[dict[str, str]]:
    """Options by which a configuration can identify the device, the most durable first."""
    if node.by_path is not None:
        yield {"device": str(node.by_path)}
    if node.usb is not None and node.index == 0:
        usb = {"usb": node.usb.vendor_product}
        if _equal_ones(node, nodes) == 1:
            yield usb
        elif node.usb.serial:
            yield usb | {"serial": node.usb.serial}
        yield usb | {"port": node.usb.port}
    # Cheap dongles share one by-id name, so it comes after the port, which distinguishes them.
    if node.by_id is not None:
        yield {"device": str(node.by_id)}
    yield {"device": str(node.path)}


def _equal_ones(node: VideoNode, nodes: Sequence[VideoNode]) -> int:
    assert node.usb is not None
    places = [other.usb for other in nodes if other.usb and other.index == 0]
    return sum(place.vendor_product == node.usb.vendor_product for place in places)


def _facts(node: VideoNode, answers: Answers) -> Iterator[tuple[str, str]]:
    """Names and values of the known facts."""
    usb = node.usb
    facts = {
        "node": str(node.path),
        "kernel driver": answers.kernel_driver,
        "by-path": str(node.by_path or ""),
        "by-id": str(node.by_id or ""),
        "USB": f"{usb.vendor_product} {usb.name}".strip() if usb else "",
        "serial": (usb.serial or "") if usb else "",
        "port": usb.port if usb else "",
        "speed": f"{usb.speed_mbit_s:g} Mbit/s" if usb else "",
        "inputs": ", ".join(answers.inputs),
        "standards": ", ".join(answers.standards),
        "formats": _formats(answers),
        "pictures a second": answers.pictures,
        "field orders": ", ".join(_order(order) for order in answers.field_orders),
    }
    return ((name, word) for name, word in facts.items() if word)


def _formats(answers: Answers) -> str:
    others = len(answers.other_formats)
    words = [*answers.formats, *([f"{others} that grabberd does not read"] if others else [])]
    return ", ".join(words)


def _order(order: Arrangement) -> str:
    return "none (not interlaced)" if order is Arrangement.NONE else order.name.lower()


def _sentence(text: str) -> str:
    """A profile's remark with a capital and a full stop."""
    return text[0].upper() + text[1:].rstrip(".") + "."

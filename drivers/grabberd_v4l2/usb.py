"""USB: bandwidth warnings, and the reset that revives a hung grabber.

All facts come from /sys; only the reset needs libusb. Without that library everything else works.
"""

import errno
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from grabberd.errors import DeviceAbsent, DeviceError, DeviceRefused
from grabberd.instrument.acquisition.discovery import SYSTEM, Roots
from grabberd_v4l2.devices import Identity, UsbPlace, VideoNode, find_node, node_at, usb_places, video_nodes

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
            raise _refusal(place, error) from error


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


def _refusal(place: UsbPlace, error: OSError) -> DeviceError:
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

"""Video nodes and USB devices of this computer, and the identity by which a configuration names a grabber.

All facts come from /sys and the links in /dev; no device is opened.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from grabberd.errors import Cause, DeviceAbsent, DeviceRefused
from grabberd.instrument.acquisition.device import SYSTEM, Roots, attribute, by_number


@dataclass(frozen=True, slots=True)
class UsbPlace:
    """A USB device and its location.

    Attributes:
        vendor_product: E.g. "05e1:0408", in lower case.
        serial: Serial number of the device; most cheap ones have none.
        port: Bus and ports of hubs, e.g. "1-2.3"; constant as long as the cable is not moved.
        bus: Number of the bus; `address`: address on it, which changes with every reset.
        speed_mbit_s: Negotiated speed: 1.5, 12, 480, 5000 …
        name: Manufacturer and product strings of the device, or "".
    """

    vendor_product: str
    serial: str | None
    port: str
    bus: int
    address: int
    speed_mbit_s: float
    name: str

    def __str__(self) -> str:
        serial = f", serial {self.serial}" if self.serial else ""
        return f"USB {self.vendor_product} at port {self.port}{serial}"


@dataclass(frozen=True, slots=True)
class VideoNode:
    """A video node of the kernel.

    Attributes:
        path: Path, e.g. /dev/video0; the number may change after a reboot or after replugging.
        index: Index among the nodes of one device; 0 delivers the pictures.
        card: Name given by the kernel driver.
        kernel_driver: Name of the driver, e.g. "stk1160", or "" if unknown.
        by_path: Link that identifies it by its location; `by_id`: by its identity.
        usb: The USB device, or None for other buses.
    """

    path: Path
    index: int
    card: str
    kernel_driver: str
    by_path: Path | None
    by_id: Path | None
    usb: UsbPlace | None

    @property
    def usb_id(self) -> str:
        """The device's "VENDOR:PRODUCT", or "" if it is not on USB."""
        return self.usb.vendor_product if self.usb else ""

    def __str__(self) -> str:
        place = str(self.usb) if self.usb else self.card
        return f"{self.path} ({', '.join(word for word in (self.kernel_driver, place) if word)})"


def video_nodes(roots: Roots = SYSTEM) -> tuple[VideoNode, ...]:
    """All video nodes, by number."""
    by_path, by_id = (_links(roots.dev / "v4l" / kind) for kind in ("by-path", "by-id"))
    entries = by_number(roots.sys / "class" / "video4linux", "video*")
    return tuple(_video_node(entry, roots, by_path, by_id) for entry in entries)


def usb_places(roots: Roots = SYSTEM) -> tuple[UsbPlace, ...]:
    """All USB devices, by port."""
    entries = (roots.sys / "bus" / "usb" / "devices").glob("*")
    found = (_usb_place(_real(entry)) for entry in sorted(entries))
    return tuple(place for place in found if place is not None)


def node_at(path: Path, nodes: Iterable[VideoNode]) -> VideoNode | None:
    """The node with this path; None if there is none."""
    return next((node for node in nodes if path in (node.path, _real(node.path))), None)


def _video_node(entry: Path, roots: Roots, by_path: dict[Path, Path], by_id: dict[Path, Path]) -> VideoNode:
    path = roots.dev / entry.name
    device = _real(entry / "device")
    driver = device / "driver"
    return VideoNode(
        path=path,
        index=int(attribute(entry / "index") or 0),
        card=attribute(entry / "name"),
        kernel_driver=_real(driver).name if driver.exists() else "",
        by_path=by_path.get(_real(path)),
        by_id=by_id.get(_real(path)),
        usb=next((place for place in map(_usb_place, (device, *device.parents)) if place), None),
    )


def _links(folder: Path) -> dict[Path, Path]:
    """Link to each node in a folder of links; the first by name if there are several."""
    return {_real(link): link for link in sorted(folder.glob("*"), reverse=True)}


def _real(path: Path) -> Path:
    """Target of a link; the link itself if it vanishes while it is read."""
    try:
        return path.resolve()
    except OSError:
        return path


def _usb_place(device: Path) -> UsbPlace | None:
    """The USB device of a folder; None if the folder is not one or vanishes while it is read."""
    if not (device / "idVendor").is_file():
        return None
    words = {name: attribute(device / name) for name in _ATTRIBUTES}
    if not all(words[name] for name in _NEEDED):
        return None
    return UsbPlace(
        vendor_product=f"{words['idVendor']}:{words['idProduct']}".lower(),
        serial=words["serial"] or None,
        port=device.name,
        bus=int(words["busnum"]),
        address=int(words["devnum"]),
        speed_mbit_s=float(words["speed"]),
        name=" ".join(words[name] for name in ("manufacturer", "product") if words[name]),
    )


_NEEDED = ("idVendor", "idProduct", "busnum", "devnum", "speed")
_ATTRIBUTES = (*_NEEDED, "serial", "manufacturer", "product")


VENDOR_PRODUCT = re.compile(r"[0-9a-f]{4}:[0-9a-f]{4}")
PORT = re.compile(r"\d+-\d+(\.\d+)*")


@dataclass(frozen=True, slots=True)
class Identity:
    """A grabber by its path or by its USB identity; never both.

    Attributes:
        device: A node or a link to one, preferably in /dev/v4l/by-path.
        usb: "VENDOR:PRODUCT", four hexadecimal digits each; `serial` and `port` distinguish equal devices.
    """

    device: Path | None = None
    usb: str | None = None
    serial: str | None = None
    port: str | None = None

    @classmethod
    def from_options(
        cls,
        device: str | Path | None = None,
        usb: str | None = None,
        serial: str | None = None,
        port: str | None = None,
    ) -> "Identity":
        """The identity in a configuration.

        Raises:
            ValueError: No identity, two, or a malformed one is given.
        """
        _check_texts({"usb": usb, "serial": serial, "port": port})
        if (device is None) == (usb is None):
            raise ValueError(
                "name the grabber either by device: /dev/v4l/by-path/… or by usb: VENDOR:PRODUCT; "
                "'grabberd devices' prints what to write"
            )
        if device is not None:
            _check_path(device, serial, port)
            return cls(device=Path(device))
        assert usb is not None
        return cls(usb=_checked_usb(usb), serial=serial, port=_checked_port(port))

    def matches(self, place: UsbPlace) -> bool:
        """True if a USB device matches the identity."""
        wanted = ((self.usb, place.vendor_product), (self.serial, place.serial), (self.port, place.port))
        return self.usb is not None and all(want is None or want == got for want, got in wanted)

    def __str__(self) -> str:
        if self.device is not None:
            return str(self.device)
        port = f" at port {self.port}" if self.port else ""
        serial = f" with serial {self.serial}" if self.serial else ""
        return f"USB {self.usb}{port}{serial}"


def find_node(identity: Identity, roots: Roots = SYSTEM) -> Path:
    """The grabber's present node; to be looked up at every open, since its number may have changed.

    Raises:
        DeviceAbsent: The grabber is not connected; the hint lists the connected ones.
        DeviceRefused: Several devices match; the message lists them.
    """
    if identity.device is not None:
        return _find_path(identity.device, roots)
    found = [node for node in main_nodes(roots) if node.usb is not None and identity.matches(node.usb)]
    if len(found) > 1:
        raise DeviceRefused(
            f"{len(found)} grabbers are {identity}: {', '.join(map(str, found))}",
            f'add port: "{_port(found[0])}" (or another of these ports) to the device\'s options',
            Cause.SEVERAL_DEVICES,
        )
    if not found:
        raise _absent_usb(identity, roots)
    return found[0].path


def main_nodes(roots: Roots = SYSTEM) -> tuple[VideoNode, ...]:
    """The nodes with index 0: one for each device."""
    return tuple(node for node in video_nodes(roots) if node.index == 0)


def _find_path(device: Path, roots: Roots) -> Path:
    path = roots.dev / device.relative_to("/dev") if device.is_relative_to("/dev") else device
    if path.exists():
        return path.resolve()
    raise DeviceAbsent(f"there is no {device}", f"plug the grabber in; {_instead(roots)}")


def _absent_usb(identity: Identity, roots: Roots) -> DeviceAbsent:
    """The error for a device that is missing, or plugged in without a node."""
    if bare := [place for place in usb_places(roots) if identity.matches(place)]:
        return DeviceAbsent(
            f"{bare[0]} is plugged in, but no kernel driver has made a video node for it",
            "wait a second if it was just plugged in; otherwise look in 'dmesg' for the module that it needs "
            "(stk1160, usbtv, em28xx, uvcvideo)",
        )
    return DeviceAbsent(f"no grabber is {identity}", f"plug it in; {_instead(roots)}")


def _instead(roots: Roots) -> str:
    nodes = main_nodes(roots)
    if not nodes:
        return "this computer has no video nodes at present"
    return f"present are: {', '.join(map(str, nodes))}; 'grabberd devices' prints how to identify them"


def _port(node: VideoNode) -> str:
    return node.usb.port if node.usb else ""


def _check_texts(options: dict[str, object]) -> None:
    for name, value in options.items():
        if value is not None and not isinstance(value, str):
            raise ValueError(f"{name}: put {value!r} in quotation marks, it has to be a string")


def _check_path(device: str | Path, serial: str | None, port: str | None) -> None:
    if serial is not None or port is not None:
        raise ValueError(
            "serial and port belong to usb: VENDOR:PRODUCT; a path identifies one grabber by itself"
        )
    if not Path(device).is_absolute():
        raise ValueError(f"device: {device} is not an absolute path such as /dev/video0")


def _checked_usb(usb: str) -> str:
    if not VENDOR_PRODUCT.fullmatch(usb.lower()):
        raise ValueError(f"usb: {usb!r} is not VENDOR:PRODUCT in hexadecimal digits, such as '05e1:0408'")
    return usb.lower()


def _checked_port(port: str | None) -> str | None:
    if port is not None and not PORT.fullmatch(port):
        raise ValueError(f"port: {port!r} is not a USB port such as '1-2.3'; 'grabberd devices' prints it")
    return port

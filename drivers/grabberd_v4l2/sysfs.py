"""Facts about video nodes and USB devices from /sys and the links in /dev, without opening a device."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple


class Roots(NamedTuple):
    """Root folders of the kernel's and udev's trees."""

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")


SYSTEM = Roots()
"""Root folders of this computer."""


@dataclass(frozen=True, slots=True)
class UsbPlace:
    """A USB device and its location.

    Attributes:
        vendor_product: e.g. "05e1:0408", in lower case.
        serial: the device's serial number; most cheap ones have none.
        port: bus and the hubs' ports, e.g. "1-2.3": unchanged as long as the cable is not moved.
        bus: number of the bus; `address`: address on it, which changes with every reset.
        speed_mbit_s: negotiated speed: 1.5, 12, 480, 5000 …
        name: the device's own manufacturer and product strings, or "".
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
        path: path, e.g. /dev/video0; its number may change after a reboot or after replugging.
        index: index among the nodes of one device; 0 has the pictures.
        card: name given by the kernel driver.
        kernel_driver: name of the driver, e.g. "stk1160", or "" if unknown.
        by_path: link that identifies it by its location; `by_id`: by its identity.
        usb: the USB device, or None for other buses.
    """

    path: Path
    index: int
    card: str
    kernel_driver: str
    by_path: Path | None
    by_id: Path | None
    usb: UsbPlace | None

    def __str__(self) -> str:
        place = str(self.usb) if self.usb else self.card
        return f"{self.path} ({', '.join(word for word in (self.kernel_driver, place) if word)})"


def video_nodes(roots: Roots = SYSTEM) -> tuple[VideoNode, ...]:
    """All video nodes, by number."""
    folder = roots.sys / "class" / "video4linux"
    if not folder.is_dir():
        return ()
    by_path, by_id = (_links(roots.dev / "v4l" / kind) for kind in ("by-path", "by-id"))
    # By length first: video10 comes after video9.
    entries = sorted(folder.glob("video*"), key=lambda entry: (len(entry.name), entry.name))
    return tuple(_video_node(entry, roots, by_path, by_id) for entry in entries)


def usb_places(roots: Roots = SYSTEM) -> tuple[UsbPlace, ...]:
    """All USB devices, by port."""
    folder = roots.sys / "bus" / "usb" / "devices"
    if not folder.is_dir():
        return ()
    found = (_usb_place(_real(entry)) for entry in sorted(folder.iterdir()))
    return tuple(place for place in found if place is not None)


def _video_node(entry: Path, roots: Roots, by_path: dict[Path, Path], by_id: dict[Path, Path]) -> VideoNode:
    path = roots.dev / entry.name
    device = _real(entry / "device")
    driver = device / "driver"
    return VideoNode(
        path=path,
        index=int(_text(entry / "index") or 0),
        card=_text(entry / "name"),
        kernel_driver=_real(driver).name if driver.exists() else "",
        by_path=by_path.get(_real(path)),
        by_id=by_id.get(_real(path)),
        usb=next((place for place in map(_usb_place, (device, *device.parents)) if place), None),
    )


def _links(folder: Path) -> dict[Path, Path]:
    """Link to each node in a folder of links; the first by name of several."""
    links = sorted(folder.iterdir(), reverse=True) if folder.is_dir() else []
    return {_real(link): link for link in links}


def _real(path: Path) -> Path:
    """Target of a link; the link itself if it vanishes while it is read."""
    try:
        return path.resolve()
    except OSError:
        return path


def _usb_place(device: Path) -> UsbPlace | None:
    """The USB device of this folder; None if it is none or vanishes while it is read."""
    if not (device / "idVendor").is_file():
        return None
    words = {name: _text(device / name) for name in _ATTRIBUTES}
    if not all(words[name] for name in _NEEDED):
        return None
    return UsbPlace(
        vendor_product=f"{words['idVendor']}:{words['idProduct']}".lower(),
        serial=words["serial"] or None,
        port=device.name,
        bus=int(words["busnum"]),
        address=int(words["devnum"]),
        speed_mbit_s=float(words["speed"]),
        name=" ".join(_own_names(words)),
    )


_NEEDED = ("idVendor", "idProduct", "busnum", "devnum", "speed")
_ATTRIBUTES = (*_NEEDED, "serial", "manufacturer", "product")


def _own_names(words: dict[str, str]) -> Iterator[str]:
    return (words[name] for name in ("manufacturer", "product") if words[name])


def _text(file: Path) -> str:
    """Value of an attribute; "" if it does not exist or its device has just gone."""
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""

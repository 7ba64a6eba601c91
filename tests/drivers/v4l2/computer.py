"""A computer's /sys and /dev with video nodes and USB devices, built as the kernel and udev would."""

from pathlib import Path

from grabberd.instrument.acquisition.device import Roots

PCI = "devices/pci0000:00"


class Computer:
    """Two trees in a folder; what is plugged in appears in them, what is pulled out disappears."""

    def __init__(self, folder: Path) -> None:
        self.roots = Roots(folder / "sys", folder / "dev")
        self.sys, self.dev = self.roots
        for path in (self.sys / "class" / "video4linux", self.sys / "bus" / "usb" / "devices", self.dev):
            path.mkdir(parents=True)
        self._addresses = 1

    def plug_usb(self, vendor_product, port, serial="", speed="480", name="USB 2.0 Grabber") -> Path:
        """A USB device without a driver; the folder of it."""
        self._addresses += 1
        vendor, product = vendor_product.split(":")
        bus = port.split("-")[0]
        words = {"idVendor": vendor, "idProduct": product, "busnum": bus, "devnum": self._addresses}
        words |= {"speed": speed, "product": name, "serial": serial}
        device = self.sys / PCI / "0000:00:14.0" / f"usb{bus}" / port
        _write(device, {key: word for key, word in words.items() if word != ""})
        _link(self.sys / "bus" / "usb" / "devices" / port, device)
        return device

    def plug_dongle(self, number, driver="stk1160", vendor_product="05e1:0408", port="1-2", **usb) -> Path:
        """A USB grabber; its node."""
        interface = self.plug_usb(vendor_product, port, **usb) / f"{port}:1.0"
        path_id = f"pci-0000:00:14.0-usb-0:{port.partition('-')[2]}:1.0"
        return self.add_node(number, interface, driver, card=driver, path_id=path_id)

    def plug_card(self, number, driver="bttv", slot="0000:04:00.0") -> Path:
        """A PCI card; its node."""
        return self.add_node(number, self.sys / PCI / slot, driver, card="BT878 video", path_id=f"pci-{slot}")

    def add_node(self, number, device: Path, driver, card="", path_id=None, index=0) -> Path:
        """A video node of a device, with its link by path."""
        entry = device / "video4linux" / f"video{number}"
        _write(entry, {"index": index, "name": card})
        _link(entry / "device", device)
        (self.sys / "drivers" / driver).mkdir(parents=True, exist_ok=True)
        _link(device / "driver", self.sys / "drivers" / driver)
        _link(self.sys / "class" / "video4linux" / entry.name, entry)
        node = self.dev / entry.name
        node.touch()
        if path_id:
            self.link("by-path", f"{path_id}-video-index{index}", node)
        return node

    def link(self, kind, name, node: Path) -> Path:
        """A link of udev's to a node."""
        link = self.dev / "v4l" / kind / name
        _link(link, node)
        return link

    def pull(self, number) -> None:
        """The node and its links go, as at an unplug; the folders in /sys/devices are nobody's any more."""
        node = self.dev / f"video{number}"
        self.pull_links(node)
        node.unlink()
        (self.sys / "class" / "video4linux" / node.name).unlink()

    def pull_links(self, node: Path) -> None:
        """What udev made for a node goes."""
        for link in self.dev.glob("v4l/*/*"):
            if link.resolve() == node:
                link.unlink()


def _write(folder: Path, words) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, word in words.items():
        (folder / name).write_text(f"{word}\n")


def _link(link: Path, target: Path) -> None:
    link.parent.mkdir(parents=True, exist_ok=True)
    link.unlink(missing_ok=True)
    link.symlink_to(target)

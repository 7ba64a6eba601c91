"""USB as the driver sees it: what is there, resets, and an EasyCAP made of the kernel's dummy controller."""

import os
import time
from pathlib import Path
from typing import Any

from grabberd.errors import GrabberdError
from grabberd_v4l2.devices import Identity, usb_places, video_nodes
from grabberd_v4l2.discovery import discover, libusb, reset_of
from proofs.vm.guest.shell import run, wait_for

GADGET = Path("/sys/kernel/config/usb_gadget/easycap")
EASYCAP = "05e1:0408"
PATIENCE_S = 30.0


def places() -> list[dict[str, Any]]:
    """Every USB device, by the driver's look into /sys."""
    return [
        {
            "usb": place.vendor_product,
            "port": place.port,
            "mbit_s": place.speed_mbit_s,
            "address": place.address,
        }
        for place in usb_places()
    ]


def seen_by_libusb() -> list[str]:
    """Vendor and product of every device that pyusb finds."""
    import usb.core  # noqa: PLC0415

    found = usb.core.find(find_all=True, backend=libusb())
    return [f"{device.idVendor:04x}:{device.idProduct:04x}" for device in found]


def reset(vendor_product: str) -> dict[str, Any]:
    """Resets a device as the driver does; seconds until it is there again, or why it was not done."""
    before = _port(vendor_product)
    started = time.monotonic()
    try:
        reset_of(Identity.from_options(None, vendor_product, None, None))
    except GrabberdError as error:
        return {"refused": error.message, "hint": error.hint}
    wait_for(lambda: _port(vendor_product) == before, PATIENCE_S)
    return {"seconds": time.monotonic() - started, "port": before}


def wait_until(vendor_product: str, there: bool) -> float:
    """Seconds until a device has come, or gone."""
    return wait_for(lambda: (_port(vendor_product) is not None) == there, PATIENCE_S)


def kernel_resets() -> int:
    """How often the kernel says that it has reset a device."""
    return run("dmesg").count("reset ")


def plug_in_easycap(serial: str = "") -> dict[str, Any]:
    """Makes the device and plugs it in; what the kernel's driver for it and our discovery make of it."""
    for module in ("dummy_hcd", "libcomposite", "usb_f_ss_lb", "stk1160"):
        run(f"modprobe {module}")
    if not GADGET.exists():
        _make(serial)
    (GADGET / "UDC").write_text(os.listdir("/sys/class/udc")[0])
    seconds = wait_until(EASYCAP, there=True)
    run("udevadm settle")
    time.sleep(1.0)
    return {
        "seconds": seconds,
        "nodes": [
            {
                "path": str(node.path),
                "driver": node.kernel_driver,
                "usb": node.usb and node.usb.vendor_product,
            }
            for node in video_nodes()
        ],
        "found": [
            {
                "card": found.card,
                "verdict": str(found.verdict),
                "options": dict(found.options),
                "remarks": found.remarks,
            }
            for found in discover()
        ],
        "kernel": [line for line in run("dmesg").splitlines() if "stk1160" in line][-8:],
    }


def unplug_easycap() -> float:
    """Pulls its plug."""
    (GADGET / "UDC").write_text("\n")
    return wait_until(EASYCAP, there=False)


def _make(serial: str) -> None:
    run("mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config")
    for folder in ("strings/0x409", "configs/c.1/strings/0x409", "functions/SourceSink.0"):
        (GADGET / folder).mkdir(parents=True)
    words = {
        "idVendor": "0x05e1",
        "idProduct": "0x0408",
        "strings/0x409/product": "USB 2.0 Video Capture Controller",
        "strings/0x409/serialnumber": serial,
    }
    for name, word in words.items():
        (GADGET / name).write_text(word)
    (GADGET / "configs/c.1/SourceSink.0").symlink_to(GADGET / "functions/SourceSink.0")


def _port(vendor_product: str) -> str | None:
    return next((place.port for place in usb_places() if place.vendor_product == vendor_product), None)

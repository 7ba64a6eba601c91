"""Serial ports and industrial I/O devices of this computer that may be loggers."""

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from grabberd.instrument.acquisition.device import SYSTEM, FoundDevice, Roots, Verdict, attribute, by_number
from grabberd_loggers.iio.tree import IioDevice, iio_devices

_PORT = re.compile(r"^tty(USB|ACM|AMA|S|XRUSB|O|mxc)\d+$")
_BUILT_IN = re.compile(r"^ttyS\d+$")


def discover() -> Sequence[FoundDevice]:
    """List serial ports and industrial I/O devices."""
    return [*serial_ports(), *sensors()]


def serial_ports(roots: Roots = SYSTEM) -> Iterator[FoundDevice]:
    """Serial ports, without those of a mainboard that has none: the kernel offers names for 32."""
    names = {
        link.resolve(): link for link in sorted((roots.dev / "serial" / "by-id").glob("*"), reverse=True)
    }
    for port in by_number(roots.dev, "tty*"):
        if not _PORT.match(port.name) or not _exists(port, roots):
            continue
        link = names.get(port.resolve())
        usable = os.access(port, os.R_OK | os.W_OK)
        remarks = [] if usable else ["This user may not open it: add the user to its group, usually dialout."]
        if link is None:
            remarks.append("It has no link in /dev/serial/by-id: its name may change.")
        yield FoundDevice(
            driver="serial",
            card=link.name if link else f"serial port {port.name}",
            options={"port": str(link or port)},
            verdict=Verdict.USABLE if usable else Verdict.DOUBTFUL,
            remarks=tuple(remarks),
            facts={"port": str(port)},
            other_options=({"port": str(port)},),
        )


def sensors(roots: Roots = SYSTEM) -> Iterator[FoundDevice]:
    """Industrial I/O devices that measure pressure or a voltage."""
    for device in iio_devices(roots):
        channels = [one.name for one in device.channels() if one.name.startswith(("pressure", "voltage"))]
        if channels:
            yield _sensor(device, channels)


def _sensor(device: IioDevice, channels: list[str]) -> FoundDevice:
    ways = [name for name in (device.label, device.name, device.number) if name]
    read = "scans with the kernel's own times" if device.streams else "polled"
    return FoundDevice(
        driver="iio",
        card=device.label or device.name or device.number,
        options={"device": ways[0], "channels": channels},
        verdict=Verdict.USABLE,
        facts={"device": device.number, "chip": device.name, "channels": ", ".join(channels), "read": read},
        other_options=tuple({"device": way} for way in ways),
    )


def _exists(port: Path, roots: Roots) -> bool:
    """True unless it is a name for a port that the mainboard does not have."""
    kind = roots.sys / "class" / "tty" / port.name / "type"
    return not _BUILT_IN.match(port.name) or attribute(kind) not in ("", "0")

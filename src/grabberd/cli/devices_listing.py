"""Output of `grabberd devices`: each grabber with its verdict, and a configuration to paste."""

from collections.abc import Container, Iterator, Sequence
from dataclasses import asdict
from itertools import count

import typer
import yaml
from rich.table import Table
from rich.text import Text

from grabberd.cli.devices_text import one_line, print_device, print_plain
from grabberd.cli.loggers_listing import loggers_document, print_loggers
from grabberd.cli.options import print_json
from grabberd.cli.terminal import console
from grabberd.config import Config
from grabberd.instrument.acquisition import GRABBERS, discover
from grabberd.instrument.acquisition.discovery import FoundDevice, Verdict

NOTHING_FOUND = (
    "No frame grabber was found. If one is plugged in ('lsusb', 'lspci'), the kernel has no driver for it: "
    "'sudo dmesg' shows how it recognised the device, 'sudo modprobe stk1160' (usbtv, em28xx, bttv …) "
    "loads a driver. Cloud kernels have none of them: install the full kernel (Debian: linux-image-amd64)."
)


def list_devices(settings: Config, json: bool) -> None:
    """Print the installed drivers, the configured devices, and the grabbers and loggers found."""
    drivers, found = GRABBERS.available(), discover()
    if not json:
        print_loggers(settings)
        print_listing(drivers, settings, found)  # ends with what is to be pasted
        return
    configured = {
        name: {"driver": device.driver, "options": device.options}
        for name, device in settings.devices.items()
    }
    named = [asdict(one) | {"configured_as": configured_as(settings, one)} for one in found]
    print_json({"drivers": drivers, "devices": configured, "found": named} | loggers_document(settings))


def configured_as(settings: Config, found: FoundDevice) -> list[str]:
    """Names of the configured devices that match a found grabber."""
    return [
        name for name, device in settings.devices.items() if found.is_meant_by(device.driver, device.options)
    ]


def print_listing(drivers: Sequence[str], settings: Config, found: Sequence[FoundDevice]) -> None:
    """Print the grabbers found, the configured devices, and a configuration for the grabbers without one."""
    for device in found:
        print_device(device, configured_as(settings, device))
    if not found:
        print_plain(NOTHING_FOUND)
    _print_configured(settings, found)
    print_plain(f"Installed drivers: {', '.join(drivers)}.")
    new = [one for one in found if one.verdict is not Verdict.UNUSABLE and not configured_as(settings, one)]
    if new:
        what = "it, add this" if len(new) == 1 else "them, add all or part of this"
        print_plain(f"\nTo use {what} to the configuration:")
        typer.echo("\n" + yaml_of(new, settings.devices), nl=False)


def yaml_of(found: Sequence[FoundDevice], taken: Container[str] = ()) -> str:
    """Configuration of these devices under names that are not taken yet."""
    lines = ["devices:"]
    for name, device in zip(_free_names(taken), found, strict=False):
        # width: yaml would fold a long value, and a folded one is easily spoilt when it is pasted.
        document = {name: {"driver": device.driver, "options": dict(device.options)}}
        text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=1000)
        lines += [f"  # {one_line(device.card)}", *(f"  {line}" for line in text.splitlines())]
    return "\n".join(lines) + "\n"


def _free_names(taken: Container[str]) -> Iterator[str]:
    names = ("grabber" if number == 1 else f"grabber-{number}" for number in count(1))
    return (name for name in names if name not in taken)


def _print_configured(settings: Config, found: Sequence[FoundDevice]) -> None:
    table = Table(
        "device", "driver", "grabber", "calibration", title="Configured devices", title_justify="left"
    )
    for name, device in settings.devices.items():
        calibration = device.calibration.name if device.calibration else "none"
        there = [one.card for one in found if one.is_meant_by(device.driver, device.options)]
        known = any(one.driver == device.driver for one in found)
        words = ", ".join(map(one_line, there)) or ("not found" if known else "–")
        table.add_row(name, device.driver, Text(words), calibration)
    console.print(table)

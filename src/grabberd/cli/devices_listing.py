"""Output of `grabberd devices`: each grabber with its verdict, a configuration to paste, and the loggers.

Names that devices give themselves can neither format nor colour anything.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import count
from typing import Any

import typer
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from grabberd.bounded_documents import yaml_text
from grabberd.cli.options import print_json
from grabberd.cli.terminal import console
from grabberd.config import Config, DeviceConfig, LoggerConfig
from grabberd.instrument.acquisition import GRABBERS, LOGGERS, discover
from grabberd.instrument.acquisition.device import LOGGER_SEARCH, FoundDevice, Verdict

Configured = Mapping[str, DeviceConfig | LoggerConfig]

STYLES = {
    Verdict.RECOMMENDED: "bold green",
    Verdict.USABLE: "green",
    Verdict.DOUBTFUL: "yellow",
    Verdict.UNUSABLE: "bold red",
}


def print_device(device: FoundDevice, names: Sequence[str]) -> None:
    """Print a device with its verdict, facts and remarks, and the names that it is configured by."""
    title = Text(one_line(device.card), style="bold")
    title.append(f"  {device.verdict}", style=STYLES[device.verdict])
    if names:
        title.append(f"  configured as {', '.join(names)}", style="not bold")
    console.print(title)
    console.print(Padding(_facts(device), (0, 0, 0, 2)))
    for remark in device.remarks:
        console.print(_bullet(remark))
    console.print()


def print_plain(text: str) -> None:
    """Print text in which brackets stay brackets: it may come from a device."""
    console.print(text, highlight=False, markup=False)


def one_line(text: str) -> str:
    """Reduce a name reported by a device, which may contain anything, to one printable line."""
    return " ".join("".join(char if char.isprintable() else " " for char in text).split())


def _facts(device: FoundDevice) -> Table:
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column(overflow="fold")
    for name, words in device.facts.items():
        grid.add_row(name, Text(one_line(words)))
    return grid


def _bullet(remark: str) -> Padding:
    grid = Table.grid(padding=(0, 1))
    grid.add_row("•", Text(one_line(remark)))
    return Padding(grid, (0, 0, 0, 2))


def loggers_document(settings: Config) -> dict[str, Any]:
    """Drivers, configured and found loggers, for scripts."""
    configured, found = _documents(settings.loggers, discover(LOGGER_SEARCH))
    return {"logger_drivers": LOGGERS.available(), "loggers": configured, "found_loggers": found}


def print_loggers(settings: Config) -> None:
    """Print the serial ports and sensors found, and the configured loggers."""
    found = discover(LOGGER_SEARCH)
    if found or settings.loggers:
        print_plain("Data loggers, or what may be one:\n")
    for device in found:
        print_device(device, configured_as(settings.loggers, device))
    if settings.loggers:
        channels = [", ".join(one.channels) for one in settings.loggers.values()]
        _print_configured(("logger", "driver", "found", "channels"), settings.loggers, found, channels)
    print_plain(f"Drivers of loggers: {', '.join(LOGGERS.available())}.")
    new = next((one for one in found if not configured_as(settings.loggers, one)), None)
    if new is not None:
        way = next(iter(new.options.values()))
        print_plain(f"To listen to one: grabberd logger {new.driver}:{one_line(str(way))}")
    print_plain("")


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
    configured, named = _documents(settings.devices, found)
    print_json({"drivers": drivers, "devices": configured, "found": named} | loggers_document(settings))


def _documents(
    known: Configured, found: Sequence[FoundDevice]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The configured devices or loggers, and the found ones with the names that each is configured by."""
    configured = {name: {"driver": one.driver, "options": one.options} for name, one in known.items()}
    return configured, [asdict(one) | {"configured_as": configured_as(known, one)} for one in found]


def configured_as(known: Configured, found: FoundDevice) -> list[str]:
    """Names of the configured devices or loggers that match a found one."""
    return [name for name, one in known.items() if found.is_meant_by(one.driver, one.options)]


def print_listing(drivers: Sequence[str], settings: Config, found: Sequence[FoundDevice]) -> None:
    """Print the grabbers found, the configured devices, and a configuration for the grabbers without one."""
    known = settings.devices
    for device in found:
        print_device(device, configured_as(known, device))
    if not found:
        print_plain(NOTHING_FOUND)
    used = [one.calibration.name if one.calibration else "none" for one in known.values()]
    _print_configured(("device", "driver", "grabber", "calibration"), known, found, used)
    print_plain(f"Installed drivers: {', '.join(drivers)}.")
    new = [one for one in found if one.verdict is not Verdict.UNUSABLE and not configured_as(known, one)]
    if new:
        what = "it, add this" if len(new) == 1 else "them, add all or part of this"
        print_plain(f"\nTo use {what} to the configuration:")
        typer.echo("\n" + yaml_of(new, known), nl=False)


def yaml_of(found: Sequence[FoundDevice], taken: Container[str] = ()) -> str:
    """Configuration of these devices under names that are not taken yet."""
    lines = ["devices:"]
    for name, device in zip(_free_names(taken), found, strict=False):
        # width: yaml would fold a long value, and a folded one is easily spoilt when it is pasted.
        document = {name: {"driver": device.driver, "options": dict(device.options)}}
        text = yaml_text(document, width=1000)
        lines += [f"  # {one_line(device.card)}", *(f"  {line}" for line in text.splitlines())]
    return "\n".join(lines) + "\n"


def _free_names(taken: Container[str]) -> Iterator[str]:
    names = ("grabber" if number == 1 else f"grabber-{number}" for number in count(1))
    return (name for name in names if name not in taken)


def _print_configured(
    headings: Sequence[str], known: Configured, found: Sequence[FoundDevice], last: Sequence[str]
) -> None:
    """Print the configured devices or loggers, where each was found, and the last column."""
    table = Table(*headings, title=f"Configured {headings[0]}s", title_justify="left")
    for (name, one), words in zip(known.items(), last, strict=True):
        there = [device.card for device in found if device.is_meant_by(one.driver, one.options)]
        has_search = any(device.driver == one.driver for device in found)
        where = ", ".join(map(one_line, there)) or ("not found" if has_search else "–")
        table.add_row(name, one.driver, Text(where), words)
    console.print(table)

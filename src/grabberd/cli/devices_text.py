"""Text of found devices: names that they give themselves can neither format nor colour anything."""

from collections.abc import Sequence

from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from grabberd.cli.terminal import console
from grabberd.instrument.acquisition.discovery import FoundDevice, Verdict

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

"""`grabberd status`: what the daemon is doing."""

import typer
from rich.table import Table

from grabberd.cli.options import DEFAULT_URL, JsonOption, UrlOption, console, print_json


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("status")(status)


def status(url: UrlOption = DEFAULT_URL, json: JsonOption = False) -> None:
    """Show the daemon's devices: state, fields, losses, ring, points.

    Example: grabberd status --url http://127.0.0.1:8050
    """
    from grabberd.cli.remote import ask  # noqa: PLC0415

    state = ask(url, "/api/v1/state")
    if json:
        print_json(state)
        return
    table = Table("device", "state", "received", "lost", "points", "bits", "threshold", "capture")
    for name, device in state["devices"].items():
        live = device["live"] or {"points": "–"}
        lost = sum(count for outcome, count in device["fields"].items() if outcome != "received")
        words = device["state"] + (f": {device['cause']}" if device["cause"] else "")
        ring = device["ring"]
        cells = (device["fields"]["received"], lost, live["points"], ring["bits"], ring["threshold"])
        table.add_row(name, words, *(str(cell) for cell in cells), device["capture_id"] or "–")
    console.print(table)

"""`grabberd devices`: which drivers there are, and what the configured grabbers say of themselves."""

import typer
from rich.table import Table

from grabberd.cli.options import ConfigOption, JsonOption, console, load, print_json


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("devices")(devices)


def devices(config: ConfigOption = None, json: JsonOption = False) -> None:
    """List the installed drivers and the configured devices.

    Example: grabberd devices --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.acquisition import registry  # noqa: PLC0415

    settings = load(config)
    drivers = registry.available()
    if json:
        configured = {name: device.driver for name, device in settings.devices.items()}
        print_json({"drivers": drivers, "devices": configured})
        return
    table = Table("device", "driver", "calibration", title="Configured devices")
    for name, device in settings.devices.items():
        table.add_row(name, device.driver, device.calibration.name if device.calibration else "none")
    typer.echo(f"installed drivers: {', '.join(drivers)}")
    console.print(table)

"""`grabberd devices`: lists grabbers, their suitability, and the configuration for them."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grabberd.cli.options import ConfigOption, JsonOption, load, print_json
from grabberd.config import Config

if TYPE_CHECKING:
    from grabberd.acquisition.discovery import FoundDevice


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("devices")(devices)


def devices(
    name: Annotated[
        str | None,
        typer.Argument(
            help="With --check-field-order: a configured device, or replay:PATH.", show_default=False
        ),
    ] = None,
    config: ConfigOption = None,
    check_field_order: Annotated[
        bool,
        typer.Option(
            "--check-field-order", help="Check the field order by watching a moving object for four seconds."
        ),
    ] = False,
    json: JsonOption = False,
) -> None:
    """List the grabbers of this computer and the configured devices, or check a device's field order.

    Example: grabberd devices

    Example: grabberd devices --check-field-order grabber --config /etc/grabberd/grabberd.yaml
    """
    settings = load(config)
    if check_field_order:
        from grabberd.cli.field_order import check  # noqa: PLC0415

        raise typer.Exit(check(settings, config, name, json))
    if name is not None:
        raise typer.BadParameter("a name is only used with --check-field-order", param_hint="NAME")
    _list(settings, json)


def _list(settings: Config, json: bool) -> None:
    from grabberd.acquisition import available, discover  # noqa: PLC0415
    from grabberd.cli.devices_listing import print_listing  # noqa: PLC0415

    drivers, found = available(), discover()
    if json:
        print_json(_document(drivers, settings, found))
    else:
        print_listing(drivers, settings, found)


def _document(drivers: tuple[str, ...], settings: Config, found: "tuple[FoundDevice, ...]") -> dict[str, Any]:
    """Installed drivers, configured devices, and the grabbers found with their configured names."""
    from grabberd.cli.devices_listing import configured_as  # noqa: PLC0415

    configured = {
        name: {"driver": device.driver, "options": device.options}
        for name, device in settings.devices.items()
    }
    return {
        "drivers": drivers,
        "devices": configured,
        "found": [asdict(one) | {"configured_as": configured_as(settings, one)} for one in found],
    }

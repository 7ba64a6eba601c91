"""`grabberd devices`: lists grabbers, their suitability, the configuration for them, and loggers."""

from typing import Annotated

import typer

from grabberd.cli.options import ConfigOption, JsonOption, load


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
    """List grabbers and loggers, found and configured, or check a device's field order.

    Exit code of the check 0: the field order is right; 3: it is not, or cannot be told.

    Example: grabberd devices

    Example: grabberd devices --check-field-order grabber --config /etc/grabberd/grabberd.yaml
    """
    settings = load(config)
    if check_field_order:
        from grabberd.cli.field_order import check  # noqa: PLC0415

        raise typer.Exit(check(settings, config, name, json))
    if name is not None:
        raise typer.BadParameter("a name is only used with --check-field-order", param_hint="NAME")
    from grabberd.cli.devices_listing import list_devices  # noqa: PLC0415 - finding them loads numpy

    list_devices(settings, json)

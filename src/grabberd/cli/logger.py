"""`grabberd logger`: shows what a data logger says, before anything relies on it."""

from typing import Annotated

import typer

from grabberd.cli.options import ConfigOption, JsonOption, load


def logger(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A configured logger, or serial:PORT, csv:PATH, iio:DEVICE, fake:; default: the only one.",
            show_default=False,
        ),
    ] = None,
    config: ConfigOption = None,
    seconds: Annotated[float, typer.Option(min=0.5, max=3600, help="Time to listen.")] = 5.0,
    json: JsonOption = False,
) -> None:
    """Listen to a data logger and show its columns, rate, the σ of its times, and any problems.

    Example: grabberd logger vacuum --config /etc/grabberd/grabberd.yaml

    Example: grabberd logger serial:/dev/ttyUSB0 --seconds 20
    """
    settings = load(config)
    from grabberd.cli.logger_listening import chosen, listen, print_heard  # noqa: PLC0415 - loads numpy

    setup = chosen(settings, config, name)
    print_heard(listen(setup, seconds), json)

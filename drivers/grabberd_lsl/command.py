"""`grabberd outlet`: hands points and events of a running daemon on to other programs as they happen."""

import threading
from contextlib import suppress
from typing import Annotated

import typer

from grabberd.cli.options import DEFAULT_URL, TokenFileOption, UrlOption, end_as_ctrl_c_does

commands = typer.Typer(
    help="Pass points and events of a running daemon on to other programs, live.", no_args_is_help=True
)


@commands.callback()
def _commands() -> None:
    # Without it, typer would make a group of one command that command itself.
    pass


@commands.command()
def lsl(
    device: Annotated[
        str | None, typer.Option(help="Name of the device; not needed if there is only one.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
) -> None:
    """Stream points and events of a device over the Lab Streaming Layer until Ctrl-C.

    Example: grabberd outlet lsl

    Example: grabberd outlet lsl --device north --token-file token
    """
    from grabberd.client.daemon import Daemon  # noqa: PLC0415
    from grabberd_lsl import outlets  # noqa: PLC0415
    from grabberd_lsl.feeding import feed, only_device, outlets_of  # noqa: PLC0415
    from grabberd_lsl.outlets import LslClock  # noqa: PLC0415

    end_as_ctrl_c_does()
    clock = LslClock(outlets.lsl().local_clock)
    daemon = Daemon(url, token_file)
    name = only_device(daemon, device)
    typer.echo(f"streams: grabberd-{name}-points, grabberd-{name}-events", err=True)
    found = outlets_of(daemon, name, clock)
    with suppress(KeyboardInterrupt):
        feed(daemon, found, lambda words: typer.echo(words, err=True), threading.Event())

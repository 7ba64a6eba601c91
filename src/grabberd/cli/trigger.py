"""`grabberd trigger`: triggers an armed capture."""

from typing import Annotated

import typer

from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, print_json


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("trigger")(trigger)


def trigger(
    capture: Annotated[
        str | None, typer.Argument(help="Id of the armed capture; not needed if there is only one.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="Only captures of this device.")] = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Trigger the armed capture: it records from now on, including its pre-trigger fields.

    Example: grabberd trigger

    Example: grabberd trigger --device north --url http://barn.local:8050 --token-file token
    """
    from grabberd.cli.remote import remote_capture as remote  # noqa: PLC0415

    document = remote.trigger(url, capture or remote.armed_capture(url, device, token_file), token_file)
    if json:
        print_json(document)
    else:
        typer.echo(f"{document['id']}: {document['state']}, triggered {document['trigger_utc']}")

"""`grabberd trigger`: triggers an armed capture."""

from typing import Annotated

import typer

from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, print_result


def trigger(
    capture: Annotated[
        str | None, typer.Argument(help="Id of the armed capture; not needed if there is only one.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="Only captures of this device.")] = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Trigger the armed capture, which then records, including its pre-trigger fields.

    Example: grabberd trigger

    Example: grabberd trigger --device north --url http://barn.local:8050 --token-file token
    """
    from grabberd.cli import daemon_captures as captures  # noqa: PLC0415
    from grabberd.client.daemon import Daemon  # noqa: PLC0415

    daemon = Daemon(url, token_file)
    document = captures.trigger(daemon, capture or captures.armed_capture(daemon, device))
    words = f"{document['id']}: {document['state']}, triggered {document['trigger_utc']}"
    print_result(document, words, as_json=json)

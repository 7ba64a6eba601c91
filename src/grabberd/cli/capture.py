"""`grabberd capture`: records a capture to a file, directly or through the daemon that holds the device.

`grabberd trigger` triggers a capture that is armed in a daemon.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from grabberd.cli import options
from grabberd.errors import said

OutOption = Annotated[Path, options.out_file("the capture, NAME.grab")]
DeviceOption = Annotated[
    str | None, typer.Option(help="A configured device, or replay:PATH to play back a recording instead.")
]
FieldsOption = Annotated[int | None, typer.Option(min=1, help="Length in fields, or progressive pictures.")]
DurationOption = Annotated[float | None, typer.Option("--duration-s", min=0.001, help="Length in seconds.")]
BitsOption = Annotated[int | None, typer.Option(min=1, max=8, help="Bits per pixel: 1 to 6, or 8.")]
LinesOption = Annotated[str | None, typer.Option(help="doubled or field (intact).")]
InterruptionOption = Annotated[
    str | None, typer.Option(help="If the device stops delivering: continue, or end the capture.")
]
NoteOption = Annotated[str, typer.Option(help="Note stored with the capture.")]
LabelOption = Annotated[list[str] | None, typer.Option(help="KEY=VALUE, e.g. cow=112; may be repeated.")]
ArmedOption = Annotated[
    bool,
    typer.Option(
        "--armed", help="Let the daemon wait for 'grabberd trigger'; the length counts from the trigger."
    ),
]
PreTriggerOption = Annotated[
    int, typer.Option(min=0, help="Include this many fields from the ring before the start or trigger.")
]
GroupOption = Annotated[
    str | None,
    typer.Option(
        "--together",
        help="Start these devices at the same moment, A,B or all; writes NAME-DEVICE.grab for each.",
        metavar="DEVICES",
    ),
]
ThroughOption = Annotated[
    str | None,
    typer.Option(
        "--url",
        help="Record through the daemon at this address; for --armed and --together, by default, that "
        "of the configuration.",
        envvar="GRABBERD_URL",
        show_default=False,
    ),
]


def capture(  # noqa: PLR0913, PLR0917 - a command has as many parameters as it has options
    out: OutOption,
    config: options.ConfigOption = None,
    device: DeviceOption = None,
    option: options.DriverOption = None,
    fields: FieldsOption = None,
    duration: DurationOption = None,
    bits: BitsOption = None,
    lines: LinesOption = None,
    on_interruption: InterruptionOption = None,
    note: NoteOption = "",
    label: LabelOption = None,
    armed: ArmedOption = False,
    pre_trigger: PreTriggerOption = 0,
    group_devices: GroupOption = None,
    url: ThroughOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """Record and measure fields into one file; Ctrl-C ends the capture.

    Example: grabberd capture --config configs/fake.yaml --fields 64 --out liner.grab

    Example: grabberd capture --url http://127.0.0.1:8050 --duration-s 60 --label cow=112 --out 112.grab

    Example: grabberd capture --device replay:frames/ --option pictures=progressive --option rate_hz=60
    --out frame.grab

    Example: grabberd capture --armed --pre-trigger 25 --fields 500 --out slip.grab

    Example: grabberd capture --together left,right --duration-s 60 --out 112.grab
    """
    picture = {"bits": bits, "lines": lines, "pre_trigger_fields": pre_trigger}
    kept = {"on_interruption": on_interruption, "note": note, "labels": options.labels_of(label or [])}
    request = validated({**_length(fields, duration, armed=armed), **picture, **kept})
    options.check_folder(out)
    if group_devices and device is not None:
        raise typer.BadParameter("give either --device or --together, not both")
    if not group_devices:
        options.check_absent(out)
    if option and (group_devices or url or armed):
        raise typer.BadParameter("--option is for a device that no daemon holds")
    if group_devices or url or armed:
        daemon = (options.daemon_url(url, config), token_file)
        document = _capture_through(daemon, group_devices, device, request, out)
    else:
        from grabberd.cli.direct_capture import capture_directly  # noqa: PLC0415

        document = capture_directly(
            options.load(config), config, device, request, out, options.driver_options(option)
        )
    if json:
        options.print_json(document)
    else:
        _summarise(document, out)


def _length(fields: int | None, duration_s: float | None, *, armed: bool) -> dict[str, Any]:
    """Length of the capture for the API; that of an armed one counts from its trigger."""
    if not armed:
        return {"fields": fields, "duration_s": duration_s}
    if fields is not None and duration_s is not None:
        raise typer.BadParameter("give --fields or --duration-s, not both")
    return {"armed": True, "post_trigger_fields": fields, "duration_s": duration_s}


def validated(request: dict[str, Any]) -> dict[str, Any]:
    """Validate the options as the API would, with errors in terms of the command line."""
    from pydantic import ValidationError  # noqa: PLC0415

    from grabberd.documents.requests import NewCapture  # noqa: PLC0415

    try:
        return NewCapture.model_validate(request).model_dump(exclude_none=True)
    except ValidationError as error:
        faults = (
            f"{'.'.join(map(str, one['loc'])) or 'capture'}: {said(one['msg'])}" for one in error.errors()
        )
        raise typer.BadParameter("; ".join(faults)) from None


def _capture_through(
    daemon: tuple[str, Path | None],
    devices: str | None,
    device: str | None,
    request: dict[str, Any],
    out: Path,
) -> dict[str, Any]:
    """Let the daemon at an address record a capture, or a group of them."""
    from grabberd.cli.daemon_captures import capture_group_through, capture_through  # noqa: PLC0415
    from grabberd.client.daemon import Daemon  # noqa: PLC0415

    if not devices:
        return capture_through(Daemon(*daemon), device, request, out)
    names = None if devices == "all" else [name.strip() for name in devices.split(",") if name.strip()]
    return capture_group_through(Daemon(*daemon), names, request, out)


def _summarise(document: dict[str, Any], out: Path) -> None:
    """Print a line for each file: of a single capture, or of every capture of a group."""
    for one in document.get("captures", [document]):
        file = options.group_file(out, one["device"]) if "captures" in document else out
        words = one["ledger"]["in_words"]
        if one["ended_because"] != "length reached":
            words += f"; {one['ended_because']}"
        typer.echo(f"{file}: {one['fields']} fields, {words}")
        if (coverage := one.get("coverage")) is not None:
            typer.echo(f"{options.VERDICTS[coverage['verdict']]}: {coverage['in_words']}")
        if (channels := one.get("channels")) is not None:
            typer.echo(f"{', '.join(channels['names'])}: {channels['in_words']}")
        options.warn(f"{file}: {warning}" for warning in _warnings(one))


def _warnings(document: dict[str, Any]) -> list[str]:
    """Return what is wrong with the points of a capture; a daemon of an earlier version says nothing."""
    from grabberd.documents.devices import FieldOrderDocument  # noqa: PLC0415

    found = document.get("field_order")
    warning = FieldOrderDocument.model_validate(found).warning if found else None
    return [warning] if warning else []


def trigger(
    capture: Annotated[
        str | None, typer.Argument(help="Id of the armed capture; not needed if there is only one.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="Only captures of this device.")] = None,
    url: options.UrlOption = options.DEFAULT_URL,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
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
    options.print_result(document, words, as_json=json)

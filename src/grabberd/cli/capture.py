"""`grabberd capture`: records a capture to a file, directly or through the daemon that holds the device."""

import contextlib
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from grabberd.cli.options import (
    DEFAULT_URL,
    ConfigOption,
    JsonOption,
    TokenFileOption,
    load,
    print_json,
    progress_console,
    warn,
    with_device,
)
from grabberd.config import Config, default_config_file
from grabberd.errors import DeviceAbsent, StorageError

if TYPE_CHECKING:
    from grabberd.service.capture.capture_request import CaptureRequest
    from grabberd.service.capture.recording import Recording
    from grabberd.service.instrument import Instrument

POLL_S = 0.05
FIELD_S = 0.02
OPEN_TIMEOUT_S = 10.0


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("capture")(capture)


def capture(  # noqa: PLR0913, PLR0917 - a command has as many parameters as it has options
    out: Annotated[Path, typer.Option("--out", "-o", help="Capture file to write, NAME.grab.")],
    config: ConfigOption = None,
    device: Annotated[
        str | None, typer.Option(help="A configured device, or replay:PATH to play back a recording instead.")
    ] = None,
    fields: Annotated[int | None, typer.Option(min=1, help="Length in fields of 20 ms.")] = None,
    duration: Annotated[
        float | None, typer.Option("--duration-s", min=0.02, help="Length in seconds.")
    ] = None,
    bits: Annotated[int | None, typer.Option(min=1, max=8, help="Bits per pixel: 1 to 6, or 8.")] = None,
    lines: Annotated[str | None, typer.Option(help="doubled or field (intact).")] = None,
    on_interruption: Annotated[
        str | None, typer.Option(help="If the device stops delivering: continue, or end the capture.")
    ] = None,
    note: Annotated[str, typer.Option(help="Note stored with the capture.")] = "",
    label: Annotated[list[str] | None, typer.Option(help="KEY=VALUE, e.g. cow=112; may be repeated.")] = None,
    armed: Annotated[
        bool,
        typer.Option(
            "--armed", help="Let the daemon wait for 'grabberd trigger'; the length counts from the trigger."
        ),
    ] = False,
    pre_trigger: Annotated[
        int,
        typer.Option(min=0, help="Include this many fields from the ring before the start or trigger."),
    ] = 0,
    group_devices: Annotated[
        str | None,
        typer.Option(
            "--together",
            help="Start these devices at the same moment, A,B or all; writes NAME-DEVICE.grab for each.",
            metavar="DEVICES",
        ),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option("--url", help="Record through the daemon at this address.", envvar="GRABBERD_URL"),
    ] = None,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Record and measure fields into one file; Ctrl-C ends the capture.

    Example: grabberd capture --config configs/fake.yaml --fields 64 --out liner.grab

    Example: grabberd capture --url http://127.0.0.1:8050 --duration-s 60 --label cow=112 --out 112.grab

    Example: grabberd capture --armed --pre-trigger 25 --fields 500 --out slip.grab

    Example: grabberd capture --together left,right --duration-s 60 --out 112.grab
    """
    order = _order(
        {
            **_lengths(fields, duration, armed=armed),
            "pre_trigger_fields": pre_trigger,
            "bits": bits,
            "lines": lines,
            "on_interruption": on_interruption,
            "note": note,
        },
        label or [],
    )
    if not out.parent.is_dir():
        raise StorageError(f"there is no folder {out.parent}", "create it, or name another file")
    if group_devices:
        if device is not None:
            raise typer.BadParameter("give either --device or --together, not both")
        _capture_group(url or DEFAULT_URL, group_devices, order, out, token_file, json=json)
        return
    if out.exists():
        raise StorageError(f"{out} exists already", "name another file; nothing is overwritten")
    if url or armed:
        from grabberd.cli.remote.remote_capture import capture_through  # noqa: PLC0415

        document = capture_through(url or DEFAULT_URL, device, order, out, token_file)
    else:
        document = _capture_here(load(config), config, device, order, out)
    if json:
        print_json(document)
    else:
        _summarise(out, document)


def _summarise(out: Path, document: dict[str, Any]) -> None:
    words = document["ledger"]["in_words"]
    if document["ended_because"] != "length reached":
        words += f"; {document['ended_because']}"
    typer.echo(f"{out}: {document['fields']} fields, {words}")


def _capture_group(
    url: str, devices: str, order: dict[str, Any], out: Path, token_file: Path | None, *, json: bool
) -> None:
    from grabberd.cli.remote.remote_group import capture_group_through, file_of  # noqa: PLC0415

    names = "all" if devices == "all" else [name.strip() for name in devices.split(",") if name.strip()]
    group = capture_group_through(url, {**order, "devices": names}, out, token_file)
    if json:
        print_json(group)
        return
    for document in group["captures"]:
        _summarise(file_of(out, document["device"]), document)


def _lengths(fields: int | None, duration_s: float | None, *, armed: bool) -> dict[str, Any]:
    """Length of the capture for the API; that of an armed one counts from its trigger."""
    if not armed:
        return {"fields": fields, "duration_s": duration_s}
    if fields is not None and duration_s is not None:
        raise typer.BadParameter("give --fields or --duration-s, not both")
    if duration_s is not None:
        fields = max(1, round(duration_s / FIELD_S))
    return {"armed": True, "post_trigger_fields": fields}


def _order(values: dict[str, Any], labels: list[str]) -> dict[str, Any]:
    """Validate the options as the API would, with errors in terms of the command line."""
    from pydantic import ValidationError  # noqa: PLC0415

    from grabberd.documents.requests import NewCapture  # noqa: PLC0415

    pairs = [label.partition("=") for label in labels]
    if wrong := [label for label, (_, equals, _) in zip(labels, pairs, strict=True) if not equals]:
        raise typer.BadParameter(f"{wrong[0]!r} is not KEY=VALUE", param_hint="--label")
    try:
        order = {**values, "labels": {key: value for key, _, value in pairs}}
        return NewCapture.model_validate(order).model_dump(exclude_none=True)
    except ValidationError as error:
        faults = "; ".join(
            f"{'.'.join(str(part) for part in fault['loc']) or 'capture'}: {fault['msg']}"
            for fault in error.errors()
        )
        raise typer.BadParameter(faults) from None


def _capture_here(
    config: Config, file: Path | None, device: str | None, order: dict[str, Any], out: Path
) -> dict[str, Any]:
    from grabberd.acquisition.clock import SystemClock  # noqa: PLC0415
    from grabberd.service.capture.capture_documents import describe  # noqa: PLC0415
    from grabberd.service.instrument import Instrument  # noqa: PLC0415
    from grabberd.service.setup import set_up  # noqa: PLC0415
    from grabberd.storage.capture.recording_folder import interrupted_captures, recording_folder  # noqa: PLC0415

    warn(
        f"{part} was left by an interrupted capture; 'grabberd storage seal {part}' recovers it"
        for part in interrupted_captures(out.parent)
    )
    # As in `grabberd serve`: at Python's default of 5 ms the capture thread would lose fields.
    sys.setswitchinterval(0.001)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end the capture as Ctrl-C does
    chosen = with_device(config, file, device)
    setup = next(iter(set_up(chosen, file or default_config_file()).values()))
    instrument = Instrument(setup, SystemClock(), site=dict(config.site), queue_s=config.storage.queue_s)
    instrument.start()
    try:
        _wait_until_it_accepts(instrument)
        warn(instrument.board.now.warnings)
        rate_hz = instrument.rate_hz
        with recording_folder(out.parent) as folder:
            recording = instrument.start_capture(
                out.stem, _request(order, rate_hz), folder / f"{out.name}.part"
            )
            _follow(recording, order, rate_hz)
            _keep(recording, out)
    finally:
        instrument.stop()
    # A pin belongs to the state of a daemon, and there is none here.
    return describe(out).model_dump(mode="json", exclude={"pinned"})


def _request(order: dict[str, Any], rate_hz: float) -> "CaptureRequest":
    from grabberd.service.capture.capture_request import CaptureRequest  # noqa: PLC0415

    values = dict(order)
    values.pop("armed", None)  # without a daemon a capture always starts at once
    duration_s = values.pop("duration_s", None)
    if duration_s is not None:
        values["fields"] = max(1, round(duration_s * rate_hz))
    return CaptureRequest(**values)


def _wait_until_it_accepts(instrument: "Instrument") -> None:
    from grabberd.documents.states import DeviceState  # noqa: PLC0415

    board = instrument.board
    with board.changed:
        hopeless = (DeviceState.FAILED, DeviceState.ENDED)
        board.changed.wait_for(lambda: instrument.accepts or board.state in hopeless, OPEN_TIMEOUT_S)
    if not instrument.accepts:
        raise DeviceAbsent(
            f"device {instrument.name} is {board.now.state}: {board.now.cause}",
            board.now.hint
            or "check the grabber and the configuration; 'grabberd devices' lists all grabbers",
        )


def _follow(recording: "Recording", order: dict[str, Any], rate_hz: float) -> None:
    """Show progress until the file is sealed; Ctrl-C ends the recording."""
    wanted = order.get("fields") or round(order.get("duration_s", 0) * rate_hz) or None
    columns = (
        TextColumn("recording"),
        BarColumn(),
        TextColumn("{task.completed} fields"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("", total=wanted)
        # Ctrl-C only asks the recording to stop; the loop goes on until its file is sealed, so that a second
        # Ctrl-C cannot leave a file without its ledger.
        while not recording.sealed.is_set():
            with contextlib.suppress(KeyboardInterrupt):
                progress.update(task, completed=recording.recorder.ledger.total)
                recording.sealed.wait(POLL_S)
                continue
            recording.stop("stopped by the operator")


def _keep(recording: "Recording", out: Path) -> None:
    """Rename the file, complete or not, then raise the failure that made it incomplete."""
    # First the file, then the error: what was recorded is kept even if the recording failed.
    recording.path.rename(out)
    if recording.failure is not None:
        raise recording.failure

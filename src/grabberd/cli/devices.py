"""`grabberd devices`: lists grabbers, their suitability, the configuration for them, and loggers.

`--check-field-order` checks which field of a frame is the older one. `grabberd logger` shows what a data
logger says, before anything relies on it.
"""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grabberd.cli import EX_BAD_VERDICT
from grabberd.cli.options import ConfigOption, JsonOption, load, print_result, with_device
from grabberd.cli.terminal import progress_console
from grabberd.errors import DeviceRefused, StreamEnded, StreamFailed

if TYPE_CHECKING:
    from grabberd.config import Config, DeviceConfig
    from grabberd.core.chain.field_order import FieldOrderFinding
    from grabberd.core.field import Field
    from grabberd.core.reconstruction.field_order import Order
    from grabberd.instrument.acquisition import Grabber, StreamInfo


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
        raise typer.Exit(check(settings, config, name, json))
    if name is not None:
        raise typer.BadParameter("a name is only used with --check-field-order", param_hint="NAME")
    from grabberd.cli.devices_listing import list_devices  # noqa: PLC0415 - finding them loads numpy

    list_devices(settings, json)


WATCHED_S = 4.0
"""200 fields: several times the least that the check needs, with time to move, pause and move again."""
SILENCE_S = 1.0
PATIENCE = 3
"""Consecutive silences after which the check gives up."""
EDGE_ROWS = 16
"""Rows at top and bottom left out: half lines, teletext and stamped numbers do not move."""


def check(config: "Config", file: Path | None, name: str | None, json: bool) -> int:
    """Watch a device and print its field order; returns the exit code, 0 if it is right.

    Raises:
        DeviceError: the device cannot be opened, is in use, or delivers nothing.
        ConfigError: the device is not clear from the name.
    """
    from grabberd.core.reconstruction.field_order import Order  # noqa: PLC0415 - loads NumPy

    ((name, device),) = with_device(config, file, name).devices.items()
    info, finding = _watch(name, device)
    advice = _advice(finding.order, device, info)
    document = {"device": name, **_document(finding), "advice": advice}
    words = f"{name}: {_WORDS[finding.order]}\n  {finding.evidence}\n  {advice}"
    print_result(document, words, as_json=json)
    return 0 if finding.order is Order.RIGHT else EX_BAD_VERDICT


def _document(finding: "FieldOrderFinding") -> dict[str, Any]:
    ratios = {"top_to_bottom": finding.top_to_bottom, "bottom_to_top": finding.bottom_to_top}
    return asdict(finding) | {name: ratio and ratio._asdict() for name, ratio in ratios.items()}


def _watch(name: str, device: "DeviceConfig") -> "tuple[StreamInfo, FieldOrderFinding]":
    from grabberd.core.chain.field_order import check as judged  # noqa: PLC0415
    from grabberd.core.field import FieldOrder  # noqa: PLC0415
    from grabberd.instrument.acquisition import GRABBERS  # noqa: PLC0415

    with closing(GRABBERS.create(device.driver, device.options)) as grabber:
        info = _opened(grabber)
        if info.field_order is FieldOrder.PROGRESSIVE:
            raise DeviceRefused(
                f"{name} gives progressive pictures, without fields: there is no order to check",
                "nothing to do: every line of a picture is of the same moment",
            )
        if info.field_order is FieldOrder.ONE_PARITY:
            raise DeviceRefused(
                f"{name} delivers only one field of every frame: there is no order to check",
                "choose another field order or another grabber; 'grabberd devices' lists what it supports",
            )
        progress_console.print(
            f"{name}: watching for {WATCHED_S:g} s; move an object, pause, and move it again"
        )
        return info, judged(_fields(name, grabber))


def _opened(grabber: "Grabber") -> "StreamInfo":
    try:
        return grabber.open()
    except DeviceRefused as error:
        hint = f"{error.hint}; a running daemon holds its devices: stop it for the check"
        raise DeviceRefused(error.message, hint) from error


def _fields(name: str, grabber: "Grabber") -> "Iterator[Field]":
    """Yield the undamaged fields of a few seconds, each valid until the next is taken."""
    first_ns, silences = None, 0
    while silences < PATIENCE:
        try:
            with grabber.dequeue(SILENCE_S) as grabbed:
                silences = 0 if grabbed else silences + 1
                for one in grabbed:
                    first_ns = first_ns if first_ns is not None else one.time_ns
                    if one.time_ns - first_ns > WATCHED_S * 1e9:
                        return
                    if one.damage is None:
                        yield _inside(one.field)
        except StreamEnded:
            return
    raise StreamFailed(
        f"no field came from {name} for {PATIENCE * SILENCE_S:g} s", "check the camera and its cable"
    )


def _inside(field: "Field") -> "Field":
    inside = field.luma[EDGE_ROWS:-EDGE_ROWS]
    return replace(field, luma=inside, y0=field.y0 + EDGE_ROWS * field.y_step)


_WORDS = {
    "right": "the field order is right",
    "reversed": "the field order is reversed",
    "same_instant": "both fields of a frame show the same instant: this grabber discards one field",
    "no_movement": "nothing moved",
    "unclear": "no clear result",
}


def _advice(order: "Order", device: "DeviceConfig", info: "StreamInfo") -> str:
    from grabberd.core.field import FieldOrder  # noqa: PLC0415

    if order == "reversed":
        older = "top" if info.field_order is FieldOrder.BOTTOM_FIRST else "bottom"
        recording = device.driver == "replay"
        option = f"field_order: {older}_first" if recording else f"older_field: {older}"
        return f"set '{option}' in the options of this device"
    if order == "same_instant":
        return "it delivers half of the fields: use another grabber; 'grabberd devices' rates them"
    if order == "right":
        return "nothing to do"
    return "try again: move a hand or an object with targets in front of the camera, pause, and move it again"


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

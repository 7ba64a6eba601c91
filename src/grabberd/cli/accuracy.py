"""`grabberd accuracy`: measured points against the truth, the paper's Table 1 and what belongs to it."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.progress import Progress

from grabberd.cli.options import JsonOption, console, print_json, progress_console
from grabberd.errors import NotReady

if TYPE_CHECKING:
    from grabberd.processes.accuracy import Investigation, InvestigationSettings, Truth
    from grabberd.processes.measure import MeasureSetup
    from grabberd.reconstruction import Points
    from grabberd.storage import CaptureReader

MeasuredPoints = Iterable[tuple[int, int, "Points"]]


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("accuracy")(accuracy)


def accuracy(  # noqa: PLR0913, PLR0917 - options of a command
    capture: Annotated[Path, typer.Argument(help="A capture file, NAME.grab; it is not changed.")],
    truth: Annotated[Path, typer.Option(help="CSV: target, x_mm, y_mm, z_mm, and n where the object moves.")],
    calibration: Annotated[
        Path | None, typer.Option(help="Measure the fields anew with this calibration (JSON).")
    ] = None,
    object_model: Annotated[
        Path | None, typer.Option("--object", help="Object model (YAML); default: the capture's own.")
    ] = None,
    run: Annotated[
        int | None, typer.Option(min=1, help="Whose points, if not measured anew; the latest.")
    ] = None,
    bits: Annotated[
        str | None, typer.Option(help="Quantise an 8-bit capture anew, e.g. 1,2,3,4,5,6,7,8; measures anew.")
    ] = None,
    lines: Annotated[
        Literal["doubled", "field"] | None,
        typer.Option(help="Of the fields quantised anew; default: doubled at 1 bit, else field."),
    ] = None,
    method: Annotated[str | None, typer.Option(help="Location method, where measured anew.")] = None,
    fit: Annotated[
        Literal["none", "rigid"], typer.Option(help="Turn and shift onto the truth first; never scaled.")
    ] = "none",
    limit: Annotated[float, typer.Option("--limit-mm", min=0.0, help="Allowed error of a length.")] = 0.2,
    line_jitter: Annotated[
        float | None, typer.Option("--line-jitter-px", min=0, max=2, help="Default: the capture's own.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Compare points with the truth: RMSE, precision and lengths, field by field and smoothed over time.

    Example: grabberd accuracy object.grab --calibration rig.calibration.json --truth truth.csv
    """
    from grabberd.cli.accuracy_tables import document, show  # noqa: PLC0415
    from grabberd.processes.accuracy import InvestigationSettings  # noqa: PLC0415
    from grabberd.storage import CaptureReader  # noqa: PLC0415
    from grabberd.storage.input_files import read_truth  # noqa: PLC0415

    known, wanted = read_truth(truth), _bits(bits)
    settings = InvestigationSettings(fit=fit == "rigid", limit_mm=limit)
    with CaptureReader(capture) as reader:
        settings = replace(settings, bits=reader.meta.bits)
        if calibration is None and not wanted:
            results = [_of_points(reader.timed_points(run), known, settings)]
        else:
            setup = _setup(reader, calibration, object_model, line_jitter, method)
            results = list(_anew(reader, setup, wanted, lines, known, settings))
    if json:
        print_json(document(results))
    else:
        show(results, console)


def _of_points(points: MeasuredPoints, truth: "Truth", settings: "InvestigationSettings") -> "Investigation":
    from grabberd.processes.accuracy import investigate  # noqa: PLC0415

    return investigate(points, truth, settings)


def _anew(
    reader: "CaptureReader",
    setup: "MeasureSetup",
    wanted: list[int],
    lines: str | None,
    truth: "Truth",
    settings: "InvestigationSettings",
) -> Iterator["Investigation"]:
    """The fields measured as they are, or with each of the bits that are wanted."""
    from grabberd.processes.accuracy import requantised  # noqa: PLC0415
    from grabberd.processes.measure import measure_fields  # noqa: PLC0415

    with Progress(console=progress_console, transient=True) as progress:
        for bits in wanted or [settings.bits]:
            words = f"measuring, {bits} {'bit' if bits == 1 else 'bits'}"
            fields = progress.track(reader.received(), total=reader.field_count, description=words)
            if wanted:
                fields = requantised(fields, bits, doubled=(lines or _usual(bits)) == "doubled")
            points = ((one.n, one.time_ns, one.points) for one in measure_fields(fields, setup))
            yield _of_points(points, truth, replace(settings, bits=bits))


def _usual(bits: int) -> str:
    return "doubled" if bits == 1 else "field"


def _setup(
    reader: "CaptureReader",
    calibration: Path | None,
    object_model: Path | None,
    line_jitter: float | None,
    method: str | None,
) -> "MeasureSetup":
    """What to measure with: what is named on the command line, else what the capture was taken with."""
    from grabberd.service.setup import measure_setup, read_documents, settings_of_capture  # noqa: PLC0415

    stored = reader.runs[-1].made_with if reader.runs else {}
    named = read_documents(calibration, object_model or _configured(reader, stored))
    documents = {key: named[key] or stored.get(key) for key in named}
    for key, option in (("calibration", "--calibration"), ("object", "--object")):
        if not documents[key]:
            raise NotReady(f"capture {reader.meta.id} was taken without {key}", f"name one with {option}")
    chosen = {"line_jitter_px": line_jitter, "method": method}
    settings = settings_of_capture(reader.meta.config) | {
        key: value for key, value in chosen.items() if value is not None
    }
    return measure_setup(documents, settings)


def _configured(reader: "CaptureReader", stored: dict[str, Any]) -> Path | None:
    """The object model's file in the capture's configuration, where no run has its document."""
    name = reader.meta.config.get("object")
    return Path(name) if name and not stored.get("object") else None


def _bits(text: str | None) -> list[int]:
    try:
        bits = [int(part) for part in (text or "").split(",") if part.strip()]
    except ValueError:
        bits = [0]
    if any(not 1 <= each <= 8 for each in bits):
        raise typer.BadParameter(f"{text!r} is no list of 1 to 8", param_hint="--bits")
    return bits

"""`grabberd accuracy`: compares measured points with the truth, as in the paper's Table 1."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.progress import Progress

from grabberd.cli.options import JsonOption, LineJitterOption, follow_link, given, print_json, warn
from grabberd.cli.terminal import console, progress_console
from grabberd.errors import NotReady

if TYPE_CHECKING:
    from grabberd.archive import CaptureReader
    from grabberd.core.chain.accuracy import Investigation, InvestigationSettings
    from grabberd.core.chain.measure import MeasureSetup
    from grabberd.core.reconstruction.accuracy.ground_truth import Truth


def accuracy(  # noqa: PLR0913, PLR0917 - options of a command
    capture: Annotated[
        Path, typer.Argument(help="Capture file, NAME.grab; it is not modified.", callback=follow_link)
    ],
    truth: Annotated[
        Path, typer.Option(help="CSV file: target, x_mm, y_mm, z_mm, and n if the object moves.")
    ],
    calibration: Annotated[
        Path | None, typer.Option(help="Re-measure the fields with this calibration (JSON).")
    ] = None,
    object_model: Annotated[
        Path | None, typer.Option("--object", help="Object model (YAML); default: the capture's.")
    ] = None,
    run: Annotated[
        int | None, typer.Option(min=1, help="Run to compare, unless re-measured; default: the latest.")
    ] = None,
    bits: Annotated[
        str | None,
        typer.Option(help="Requantise an 8-bit capture to these bits and re-measure it, e.g. 1,2,3,4."),
    ] = None,
    lines: Annotated[
        Literal["doubled", "field"] | None,
        typer.Option(help="Lines of the requantised fields; default: doubled at 1 bit, else field."),
    ] = None,
    method: Annotated[str | None, typer.Option(help="Location method for re-measuring.")] = None,
    fit: Annotated[
        Literal["none", "rigid"], typer.Option(help="Rotate and shift onto the truth first; never scale.")
    ] = "none",
    limit: Annotated[
        float, typer.Option("--limit-mm", min=0.0, help="Maximum permissible error of a length.")
    ] = 0.2,
    line_jitter: LineJitterOption = None,
    json: JsonOption = False,
) -> None:
    """Compare points with the truth: RMSE, precision and lengths, per field and smoothed over time.

    Example: grabberd accuracy object.grab --calibration rig.calibration.json --truth truth.csv
    """
    from grabberd.archive import CaptureReader  # noqa: PLC0415
    from grabberd.archive.capture.digests import Damage, left_out_in_words  # noqa: PLC0415
    from grabberd.archive.input_files import read_truth  # noqa: PLC0415
    from grabberd.cli.accuracy_tables import document, show  # noqa: PLC0415
    from grabberd.core.chain.accuracy import InvestigationSettings, investigate  # noqa: PLC0415

    known, wanted = read_truth(truth), _bits(bits)
    settings = InvestigationSettings(fit=fit == "rigid", limit_mm=limit)
    left_out: list[Damage] = []
    with CaptureReader(capture, left_out) as reader:
        reader.check_unchanged(runs=())
        settings = replace(settings, bits=reader.meta.bits, interlaced=reader.meta.is_interlaced)
        if calibration is None and not wanted:
            results = [investigate(reader.timed_points(run), known, settings)]
        else:
            setup = _setup(reader, calibration, object_model, line_jitter, method)
            results = list(_remeasured(reader, setup, wanted, lines, known, settings))
    warn(left_out_in_words(left_out))
    if json:
        print_json(document(results))
    else:
        show(results, console)


def _remeasured(
    reader: "CaptureReader",
    setup: "MeasureSetup",
    wanted: list[int],
    lines: str | None,
    truth: "Truth",
    settings: "InvestigationSettings",
) -> Iterator["Investigation"]:
    """Re-measure the fields as recorded, or once for each requested number of bits."""
    from grabberd.core.chain.accuracy import investigate, requantised  # noqa: PLC0415
    from grabberd.core.chain.measure import measure_fields  # noqa: PLC0415

    with Progress(console=progress_console, transient=True) as progress:
        for bits in wanted or [settings.bits]:
            label = f"measuring, {bits} {'bit' if bits == 1 else 'bits'}"
            fields = progress.track(reader.received(), total=reader.field_count, description=label)
            if wanted:
                fields = requantised(fields, bits, doubled=lines == "doubled" if lines else bits == 1)
            points = ((one.n, one.time_ns, one.points) for one in measure_fields(fields, setup))
            yield investigate(points, truth, replace(settings, bits=bits))


def _setup(
    reader: "CaptureReader",
    calibration: Path | None,
    object_model: Path | None,
    line_jitter: float | None,
    method: str | None,
) -> "MeasureSetup":
    """Calibration, object model and settings from the command line, else from the capture."""
    from grabberd.archive.measure_setups import measure_setup, settings_of_capture  # noqa: PLC0415
    from grabberd.files.documents import read_documents  # noqa: PLC0415

    stored = reader.runs[-1].made_with if reader.runs else {}
    named = read_documents(calibration, object_model or _configured(reader, stored))
    documents = {key: named[key] or stored.get(key) for key in named}
    for key, option in (("calibration", "--calibration"), ("object", "--object")):
        if not documents[key]:
            raise NotReady(f"capture {reader.meta.id} has no {key}", f"give one with {option}")
    chosen = given(line_jitter_px=line_jitter, method=method)
    return measure_setup(documents, settings_of_capture(reader.meta.config) | chosen)


def _configured(reader: "CaptureReader", stored: dict[str, Any]) -> Path | None:
    """The object model file named in the capture's configuration, if no run holds the document itself."""
    name = reader.meta.config.get("object")
    return Path(name) if name and not stored.get("object") else None


def _bits(text: str | None) -> list[int]:
    try:
        bits = [int(part) for part in (text or "").split(",") if part.strip()]
    except ValueError:
        bits = [0]
    if any(not 1 <= each <= 8 for each in bits):
        raise typer.BadParameter(f"{text!r} is not a list of numbers from 1 to 8", param_hint="--bits")
    return bits

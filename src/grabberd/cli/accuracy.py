"""`grabberd accuracy`: compares measured points with the truth, as in the paper's Table 1.

It prints tables for people, or a JSON document for scripts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from grabberd.cli.options import JsonOption, LineJitterOption, follow_link, given, print_json, warn
from grabberd.cli.terminal import console, progress_console
from grabberd.errors import NotReady

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from grabberd.archive.capture.reader import CaptureReader
    from grabberd.core.chain.accuracy import Compared, Investigation, InvestigationSettings
    from grabberd.core.chain.measure import MeasureSetup
    from grabberd.core.reconstruction.accuracy import Axes, PointingPrecision, RigidMotion, Truth


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
    from grabberd.archive.capture.digests import Damage, left_out_in_words  # noqa: PLC0415
    from grabberd.archive.capture.reader import CaptureReader  # noqa: PLC0415
    from grabberd.archive.input_files import read_truth  # noqa: PLC0415
    from grabberd.core.chain.accuracy import InvestigationSettings, investigate  # noqa: PLC0415

    known, wanted = read_truth(truth), _wanted_bits(bits)
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
    from grabberd.files.reading import read_documents  # noqa: PLC0415

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


def _wanted_bits(text: str | None) -> list[int]:
    try:
        bits = [int(part) for part in (text or "").split(",") if part.strip()]
    except ValueError:
        bits = [0]
    if any(not 1 <= each <= 8 for each in bits):
        raise typer.BadParameter(f"{text!r} is not a list of numbers from 1 to 8", param_hint="--bits")
    return bits


MUCH_CHI2 = 4.0
"""Above this the errors are more than twice the σ that the points carry."""


def show(results: "Sequence[Investigation]", console: Console) -> None:
    """Print Table 1, lengths and pointing of every investigation."""
    from grabberd.core.reconstruction.accuracy import PAPER_PRECISION, PAPER_RMSE  # noqa: PLC0415

    table = Table("mm", "X", "Y", "Z", "XYZ", title="Accuracy, as in the paper's Table 1")
    _row(table, "paper, RMSE", PAPER_RMSE)
    _row(table, "paper, precision (σ)", PAPER_PRECISION)
    for result in results:
        table.add_section()
        for name, compared in (("single fields", result.single), ("smoothed", result.smoothed)):
            head = f"{_bits_in_words(result.bits)}, {name}"
            _row(table, f"{head}, RMSE", compared.accuracy.rmse)
            if compared.accuracy.precision and compared is result.single:
                _row(table, f"{head}, precision (σ)", compared.accuracy.precision)
            _row(table, f"{head}, predicted σ", compared.sigma)
    console.print(table)
    for result in results:
        for line in _words(result):
            console.print(line, highlight=False, soft_wrap=True)


def _row(table: Table, name: str, axes: "Axes") -> None:
    table.add_row(name, *(f"{value:.4f}" for value in axes))


def _bits_in_words(bits: int) -> str:
    return f"{bits} bit" if bits == 1 else f"{bits} bits"


def _words(result: "Investigation") -> list[str]:
    table, motion = result.single.accuracy, result.smoothing
    head = _bits_in_words(result.bits)
    left_out = int(motion.left_out.sum())
    words = [
        f"{head}: {table.matched} points in {table.fields} fields; {table.missing} missing, "
        f"{table.wrong} wrong, {table.unknown} of targets missing from the truth",
        f"{head}: χ² {result.single.chi2:.2f} for single fields, {result.smoothed.chi2:.2f} smoothed (1: the "
        f"predicted σ is right); {_movement(motion.acceleration_mm_s2)}; {left_out} points left out",
    ]
    words += [f"{head}: remark: {remark}" for remark in _remarks(result.single)]
    if table.fitted:
        words.append(f"{head}: fitted: {_fit_words(table.fitted)}")
    for name, compared in (("single fields", result.single), ("smoothed", result.smoothed)):
        words.append(f"{head}, {name}: {_length_words(compared)}")
    if result.pointing:
        words.append(f"{head}: {_pointing_words(result.pointing)}")
    return words


def _remarks(compared: "Compared") -> list[str]:
    """Remarks on the calibration."""
    if compared.chi2 <= MUCH_CHI2:
        return []
    return [
        f"the errors are {compared.chi2**0.5:.1f} times the predicted σ: camera or mirrors may have moved "
        "since the calibration, or truth and object are not aligned; run grabberd check"
    ]


def _pointing_words(pointing: "PointingPrecision") -> str:
    from grabberd.core.reconstruction.accuracy import PAPER_PX  # noqa: PLC0415

    (x, y), (paper_x, paper_y) = pointing.both_px, PAPER_PX
    return (
        f"pointing {x:.3f} px in x, {y:.3f} px in y, from {pointing.fields} measurements of "
        f"{pointing.targets} targets (paper: {paper_x:.3f}, {paper_y:.3f})"
    )


def _movement(acceleration_mm_s2: "NDArray[np.float64]") -> str:
    greatest = float(acceleration_mm_s2.max(initial=0.0))
    return "the object is at rest" if greatest == 0 else f"accelerations about {greatest:.0f} mm/s²"


def _fit_words(motion: "RigidMotion") -> str:
    shift = ", ".join(f"{value:+.4f}" for value in motion.shift_mm)
    return f"rotated by {motion.angle_deg:.4f} degrees, shifted by {shift} mm; not scaled"


def _length_words(compared: "Compared") -> str:
    lengths = compared.lengths
    if lengths is None:
        return f"length-measuring error not determined: {compared.no_lengths}"
    verdict = "within" if lengths.passed else "NOT within"
    return (
        f"length-measuring error {lengths.greatest_mm:+.4f} mm, {verdict} {lengths.limit_mm:g} mm "
        f"(VDI/VDE 2634-1: {len(lengths.lines)} lines, {lengths.measured} lengths)"
    )


def document(results: "Sequence[Investigation]") -> dict[str, Any]:
    """JSON document of all results; the first investigation is repeated at the top level."""
    from grabberd.core.reconstruction.accuracy import PAPER_PRECISION, PAPER_PX, PAPER_RMSE  # noqa: PLC0415

    investigations = [_investigation(result) for result in results]
    paper = {"rmse": PAPER_RMSE._asdict(), "precision": PAPER_PRECISION._asdict(), "pointing_px": PAPER_PX}
    return {**investigations[0]["single"], "paper": paper, "investigations": investigations}


def _investigation(result: "Investigation") -> dict[str, Any]:
    found = result.smoothing
    shares = {name: getattr(found.shares, name).tolist() for name in ("white", "opposite", "common")}
    return {
        "bits": result.bits,
        "single": _compared(result.single),
        "smoothed": _compared(result.smoothed),
        "smoothing": {
            "acceleration_mm_s2": sorted(set(found.acceleration_mm_s2.tolist())),
            "error_shares": shares,
            "left_out": int(found.left_out.sum()),
        },
        "pointing": result.pointing and result.pointing._asdict(),
    }


def _compared(compared: "Compared") -> dict[str, Any]:
    table = compared.accuracy
    return {
        **{name: getattr(table, name) for name in ("fields", "matched", "missing", "wrong", "unknown")},
        "rmse": table.rmse._asdict(),
        "precision": table.precision and table.precision._asdict(),
        "sigma": compared.sigma._asdict(),
        "calibration_sigma": compared.calibration_sigma._asdict(),
        "chi2": compared.chi2,
        "chi2_axes": list(compared.chi2_axes),
        "remarks": _remarks(compared),
        "fitted": table.fitted and _fit(table.fitted),
        "lengths": compared.lengths and asdict(compared.lengths) | {"passed": compared.lengths.passed},
        "no_lengths": compared.no_lengths,
    }


def _fit(motion: "RigidMotion") -> dict[str, Any]:
    return {
        "rotation": motion.rotation.tolist(),
        "shift_mm": motion.shift_mm.tolist(),
        "angle_deg": motion.angle_deg,
    }

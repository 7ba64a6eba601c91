"""`grabberd calibrate`: computes a calibration and its report from a capture of the calibration frame."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.markup import escape
from rich.table import Table

from grabberd.cli import EX_BAD_VERDICT
from grabberd.cli.options import (
    ConfigOption,
    JsonOption,
    check_absent,
    check_folder,
    follow_links,
    out_file,
    print_json,
)
from grabberd.cli.terminal import console, progress_bar, progress_console
from grabberd.errors import AmbiguousView, InputError, StorageError, said

if TYPE_CHECKING:
    from grabberd.config import RigConfig
    from grabberd.core.reconstruction import ObjectModel
    from grabberd.documents.calibration_reports import CalibrationAcceptance, CalibrationReport
    from grabberd.documents.requests import CalibrationOptions
    from grabberd.library.calibrations import Calibration


_ID = re.compile(r"\bid:\s*(\d+)")
VERDICTS = {
    "passed": "[green]passed[/green]",
    "passed_with_remarks": "[yellow]passed with remarks[/yellow]",
    "failed": "[red]failed[/red]",
}


def calibrate(  # noqa: PLR0913, PLR0917 - the options of a command
    captures: Annotated[
        list[Path],
        typer.Argument(
            help="Capture of the calibration frame, NAME.grab; several: one for each of its poses.",
            callback=follow_links,
        ),
    ],
    calibration_frame: Annotated[Path, typer.Option(help="Targets of the calibration frame (YAML).")],
    out: Annotated[Path, out_file("the calibration (JSON)")],
    report: Annotated[
        Path | None, typer.Option(help="Report to write as well: NAME.html or NAME.json.")
    ] = None,
    config: ConfigOption = None,
    device: Annotated[
        str | None, typer.Option(help="Device whose nominal rig is used; only with --config.")
    ] = None,
    weights: Annotated[
        Literal["honest", "equal"],
        typer.Option(help="Weight image points by their own σ, or equally as in the paper."),
    ] = "honest",
    targets: Annotated[
        Literal["weighted", "held"],
        typer.Option(help="Treat the frame's targets as observations with σ, or hold them fixed."),
    ] = "weighted",
    lens: Annotated[
        Literal["apart", "shared"],
        typer.Option(help="Separate lens parameters for each view, or one shared lens."),
    ] = "apart",
    tied: Annotated[bool, typer.Option(help="Tie b9 = b8, as printed in the paper.")] = False,
    free: Annotated[
        str | None, typer.Option(help="Parameters to adjust, e.g. f_mm,x0_px,…,left.b1; default: all.")
    ] = None,
    alpha: Annotated[float, typer.Option(min=1e-6, max=0.5, help="Significance level of the tests.")] = 0.05,
    local_field: Annotated[
        bool, typer.Option(help="Try a smooth residual field in addition to b1…b9.")
    ] = True,
    handedness: Annotated[
        Literal["auto", "+1", "-1"],
        typer.Option(
            help="Handedness of both views, by the mirrors before them; auto: as the rig states, or as seen."
        ),
    ] = "auto",
    turn: Annotated[
        Literal["0", "90", "180", "270"] | None,
        typer.Option(
            help="Turn of the frame in the picture, counter-clockwise, as you see it there: 0 if its X "
            "points down and its Y to the right. Only a frame that looks the same in several ways needs it."
        ),
    ] = None,
    identifications: Annotated[
        list[Path] | None,
        typer.Option(
            help="Targets marked by hand, CSV: view, target, x_px, y_px; one may do. Once for each capture, "
            "in the same order."
        ),
    ] = None,
    drop: Annotated[
        str | None, typer.Option(help="Ids of targets to leave out, e.g. 41,109: wrong in the file, or bent.")
    ] = None,
    check_length: Annotated[
        str | None,
        typer.Option(help="Certified distance of two targets: ID,ID,MM[,SIGMA_MM]; default: the file's."),
    ] = None,
    previous: Annotated[
        Path | None, typer.Option(help="Earlier calibration of this rig (JSON) to compare with.")
    ] = None,
    note: Annotated[str, typer.Option(help="Note stored with the calibration.")] = "",
    json: JsonOption = False,
) -> None:
    """Calibrate both virtual cameras from a capture of the calibration frame.

    The rig's nominal geometry is taken from the capture's configuration, or from --config. Several captures,
    with the calibration frame turned and moved in between and the rig untouched, calibrate better than a
    longer one; the first defines the coordinates.

    Exit code 0: its acceptance passed, with remarks or without; 3: it failed, for the reasons printed. The
    calibration is written in either case.

    Example: grabberd calibrate frame.grab --calibration-frame configs/calibration-frames/paper-108.yaml
    --out rig.calibration.json --report report.html
    """
    from grabberd.library.calibrations import nominal_rig_of  # noqa: PLC0415

    _check_new(out, report)
    options = _options(
        weights=weights,
        frame=targets,
        shared=lens == "shared",
        tied=tied,
        free=[name.strip() for name in free.split(",")] if free else None,
        alpha=alpha,
        local_field=local_field,
        handedness=None if handedness == "auto" else int(handedness),
        turn_deg=None if turn is None else int(turn),
        dropped=_ids(drop),
        check_length=_length(check_length),
    )
    rig = nominal_rig_of(config, device) if config else None
    made = _calibrated(captures, calibration_frame, options, note, rig, identifications, previous)
    made.save(out)
    if report:
        made.save_report(report)
    assert made.report is not None, "it was made and not loaded"
    if json:
        print_json(made.report.model_dump(mode="json", by_alias=True))
    else:
        _show(out, report, calibration_frame, made.report)
    if made.verdict == "failed":
        raise typer.Exit(EX_BAD_VERDICT)


def _ids(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        return [int(one) for one in text.split(",")]
    except ValueError:
        raise InputError(f"--drop {text}: not a list of ids", "write --drop 41,109") from None


def _length(text: str | None) -> dict[str, Any] | None:
    if text is None:
        return None
    parts = text.split(",")
    try:
        first, second, length, *sigma = parts
        known: dict[str, Any] = {"between": (int(first), int(second)), "length_mm": float(length)}
        return known | ({"sigma_mm": float(sigma[0])} if sigma else {})
    except ValueError:
        raise InputError(
            f"--check-length {text}: not two ids and a length", "write --check-length 1,108,119.40,0.02"
        ) from None


def _options(**given: Any) -> "CalibrationOptions":
    from pydantic import ValidationError  # noqa: PLC0415

    from grabberd.documents.requests import CalibrationOptions  # noqa: PLC0415

    try:
        return CalibrationOptions.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(f"{where}: {said(first['msg'])}", "see grabberd calibrate --help") from error


def _check_new(*paths: Path | None) -> None:
    for path in filter(None, paths):
        check_absent(path)
        check_folder(path)
        if path is paths[1] and path.suffix not in {".html", ".json"}:
            raise StorageError(f"{path} is neither .html nor .json", "call the report NAME.html or NAME.json")


def _calibrated(
    captures: list[Path],
    calibration_frame: Path,
    options: "CalibrationOptions",
    note: str,
    rig: "RigConfig | None",
    identifications: list[Path] | None,
    previous: Path | None,
) -> "Calibration":
    from grabberd.archive.input_files import read_identifications  # noqa: PLC0415
    from grabberd.files.reading import read_documents, read_yaml  # noqa: PLC0415
    from grabberd.library.calibrations import Calibration  # noqa: PLC0415
    from grabberd.library.jobs.calibration import calibrate_files  # noqa: PLC0415

    by_hand = [read_identifications(one) for one in identifications or ()]
    frame = read_yaml(calibration_frame)
    try:
        with progress_bar("calibrating") as progress:
            made = calibrate_files(
                progress,
                paths=captures,
                calibration_frame=frame,
                options=options,
                note=note,
                previous=read_documents(previous, None)["calibration"] if previous else None,
                rig=rig,
                by_hand=by_hand,
            )
    except AmbiguousView as error:
        _draw(frame, error)
        raise AmbiguousView(error.message, _hint(error, captures[0])) from error
    return Calibration(made.calibration.to_document(), made.report)


def _draw(frame: dict[str, Any], error: AmbiguousView) -> None:
    """Draw the frame as an unmirrored picture shows it, so that a person can say how it really stands."""
    from grabberd.archive.calibrations.calibration_catalog import calibration_frame_model  # noqa: PLC0415

    lines = frame_drawing(calibration_frame_model(frame), error.added_mm)
    if lines:
        progress_console.print("the calibration frame, as an unmirrored picture shows it at --turn 0:\n")
        progress_console.print("\n".join(lines), highlight=False, markup=False)
        for place in error.added_mm:
            x, y, z = (f"{one:.1f}" for one in place)
            progress_console.print(
                f"\n+: a further target at ({x}, {y}, {z}) mm, added to the file too, settles this for good"
            )


def _hint(error: AmbiguousView, capture: Path) -> str:
    from grabberd.core.calibration.identification.decision import turns_hint  # noqa: PLC0415

    if not error.turns:
        return error.hint
    look = f"grabberd export {capture} --format png --out pictures"
    return f"{turns_hint(error.turns, '--turn {}')}. To see it: {look}"


def _show(out: Path, path: Path | None, calibration_frame: Path, report: "CalibrationReport") -> None:
    result, found = report.result, report.identification
    table = Table(title=f"{out}: calibration {report.id}")
    table.add_column("")
    views = [view.name for view in report.views]
    for name in views:
        table.add_column(name, justify="right")
    table.add_row("targets identified", *(f"{found.found[name]} of {found.of}" for name in views))
    table.add_row("handedness", *(f"{found.handedness[name]:+d}" for name in views))
    table.add_row("residuals x, px rms", *(f"{result.rms_px[name].x:.3f}" for name in views))
    table.add_row("residuals y, px rms", *(f"{result.rms_px[name].y:.3f}" for name in views))
    console.print(table)
    if found.turn_deg is not None:
        turn_deg = round(found.turn_deg) + 0
        console.print(f"calibration frame turned by {turn_deg} degrees in the picture; views as configured")
    for number, pose in enumerate(result.poses, start=2):
        console.print(
            f"pose {number}: turned by {pose.turn_deg:.1f} degrees, {pose.image_points} image points, "
            f"residuals {pose.tau:.2f} of their sigma"
        )
    if report.validation:
        words = ", ".join(f"{axis.upper()} {rmse:.3f}" for axis, rmse in report.validation.rmse_mm)
        console.print(f"held-out targets, RMSE in mm: {words}")
    console.print(f"sigma 0 {result.sigma0:.2f}, {result.freedom} degrees of freedom")
    if report.dropped:
        console.print(f"not significant, held at 0: {', '.join(report.dropped)}")
    _show_rig(report.acceptance)
    _show_verdict(report.acceptance, calibration_frame)
    if path:
        console.print(f"report: {path}")


def _show_rig(acceptance: "CalibrationAcceptance") -> None:
    table = Table(title="the rig")
    table.add_column("")
    for name in ("nominal", "previous", "found", "± σ", "from nominal", "from previous"):
        table.add_column(name, justify="right")
    for one in acceptance.rig:
        name = " ".join(filter(None, (one.view, one.quantity.replace("_", " "), one.unit)))
        digits = "+.0f" if one.quantity == "handedness" else ".2f"
        values = (_number(value, digits) for value in (one.nominal, one.previous, one.found))
        sigmas = (f"{z:+.1f} σ" if z is not None else "" for z in (one.nominal_z, one.previous_z))
        table.add_row(name, *values, f"{one.sigma:.2f}" if one.sigma else "", *sigmas)
    console.print(table)


def _number(value: float | None, digits: str) -> str:
    return "" if value is None else format(value, digits)


def _show_verdict(acceptance: "CalibrationAcceptance", calibration_frame: Path) -> None:
    if length := acceptance.check_length:
        console.print(
            f"check length {length.first} to {length.second}: {length.measured_mm:.3f} mm, certified "
            f"{length.certified_mm:.3f}"
        )
    console.print(f"acceptance: {VERDICTS[acceptance.verdict]}")
    for one in acceptance.reasons:
        colour = "red" if one.level == "failed" else "yellow"
        console.print(f"[{colour}]{one.level}:[/{colour}] {escape(one.message)} – {escape(one.hint)}")
        if one.code == "elsewhere":
            for line in _lines_of(calibration_frame, str(one.values["ids"]).split(",")):
                console.print(f"  {escape(line)}")


def _lines_of(calibration_frame: Path, ids: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the file in which these targets stand, with their numbers."""
    text = calibration_frame.read_text("utf-8")
    for number, line in enumerate(text.splitlines(), start=1):
        if (found := _ID.search(line)) and found[1] in ids:
            yield f"{calibration_frame}:{number}: {line.strip()}"


_ROWS_A_PITCH, _COLUMNS_A_PITCH = 2, 4
_WIDEST = 100


def frame_drawing(frame: "ObjectModel", added_mm: Sequence[Sequence[float]] = ()) -> list[str]:
    """Lines of a drawing as an unmirrored picture shows the frame, turned by 0 degrees.

    Args:
        frame: The calibration frame; X points down the drawing, Y to the right.
        added_mm: Places (x, y, z) marked with a plus.

    Returns:
        The lines; none of a frame that is too wide for a terminal.
    """
    import numpy as np  # noqa: PLC0415

    from grabberd.core.calibration.calibration_frame import pitch_mm  # noqa: PLC0415

    low_mm = frame.xyz_mm[:, :2].min(axis=0)
    steps = np.array([_ROWS_A_PITCH, _COLUMNS_A_PITCH]) / pitch_mm(frame)
    places = np.rint((frame.xyz_mm[:, :2] - low_mm) * steps).astype(int)
    down, across = (places.max(axis=0) + 1).tolist()
    if across > _WIDEST:
        return []
    marks = dict.fromkeys(map(tuple, places.tolist()), "·")
    added = np.rint((np.reshape(added_mm, (-1, 3))[:, :2] - low_mm) * steps).astype(int)
    marks |= dict.fromkeys(map(tuple, added.tolist()), "+")
    diagonals = places @ [[1, 1], [1, -1]]
    for corner in {*diagonals.argmin(axis=0).tolist(), *diagonals.argmax(axis=0).tolist()}:
        marks[tuple(places[corner].tolist())] = str(frame.target[corner])
    width = across + len(str(frame.target.max()))
    lines = []
    for row in range(down):
        text = [" "] * width
        for column in range(across):
            for offset, character in enumerate(marks.get((row, column), "")):
                text[column + offset] = character
        lines.append("".join(text).rstrip())
    return lines

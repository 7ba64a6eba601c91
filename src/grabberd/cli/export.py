"""`grabberd export`: writes a capture in other formats."""

from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from grabberd.cli.options import follow_link, out_folder, warn


def export(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.", callback=follow_link)],
    out: Annotated[Path, out_folder("the results")],
    format: Annotated[
        Literal["csv", "csv-semicolon", "ply", "parquet", "hdf5", "mat", "c3d", "png"],
        typer.Option(
            help="csv, csv-semicolon (for spreadsheets with decimal commas), parquet, hdf5, mat (MATLAB), "
            "c3d (motion analysis): points and channels; ply: point cloud; png: fields as pictures."
        ),
    ] = "csv",
    run: Annotated[int | None, typer.Option(min=1, help="Run to export; default: the latest.")] = None,
    field: Annotated[
        int | None, typer.Option(min=0, help="Only this field (ply); default: all fields.")
    ] = None,
) -> None:
    """Export the points or pictures of a capture to a folder.

    Example: grabberd export liner.grab --format csv --out liner-points

    Example: grabberd export liner.grab --format mat --out liner-matlab

    Example: grabberd export liner.grab --format ply --field 25 --out open-liner
    """
    # The command line starts without numpy.
    from grabberd.archive.capture.digests import Damage, left_out_in_words  # noqa: PLC0415
    from grabberd.archive.export.field_pictures import export_png  # noqa: PLC0415
    from grabberd.archive.export.formats import POINT_EXPORTS  # noqa: PLC0415
    from grabberd.archive.export.points_export import export_ply  # noqa: PLC0415

    if field is not None and format != "ply":
        raise typer.BadParameter("--field requires --format ply", param_hint="--field")
    left_out: list[Damage] = []
    _warn_of_changes(capture)
    if format == "png":
        words = f"{out}: {export_png(capture, out, left_out)} pictures and fields.csv"
    else:
        write = partial(export_ply, field=field) if format == "ply" else POINT_EXPORTS[format]
        points = write(capture, out, run, left_out if field is None else None)
        suffix = {"hdf5": "h5", "csv-semicolon": "csv"}.get(format, format)
        words = f"{out}/points.{suffix}: {points} points"
    typer.echo(words)
    warn(left_out_in_words(left_out))
    if left_out:
        warn([f"{out}/left_out.csv lists them all"])


def _warn_of_changes(capture: Path) -> None:
    """Say what the disk has changed beside fields and points; it does not keep them from being exported."""
    from grabberd.archive.capture.reader import CaptureReader  # noqa: PLC0415
    from grabberd.errors import CaptureFileError  # noqa: PLC0415

    with CaptureReader(capture) as reader:
        try:
            reader.check_unchanged()
        except CaptureFileError as error:
            warn([f"{error.message}; {error.hint}"])

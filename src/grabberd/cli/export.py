"""`grabberd export`: writes a capture in other formats."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    """Output formats."""

    CSV = "csv"
    PLY = "ply"
    PARQUET = "parquet"
    PNG = "png"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("export")(export)


def export(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="New or empty folder for the results.")],
    format: Annotated[
        Format,
        typer.Option(help="csv, parquet: points; ply: point cloud; png: fields as pictures."),
    ] = Format.CSV,
    run: Annotated[int | None, typer.Option(min=1, help="Run to export; default: the latest.")] = None,
    field: Annotated[
        int | None, typer.Option(min=0, help="Only this field (ply); default: all fields.")
    ] = None,
) -> None:
    """Export the points or pictures of a capture to a folder.

    Example: grabberd export liner.grab --format csv --out liner-points

    Example: grabberd export liner.grab --format ply --field 25 --out open-liner
    """
    from grabberd import storage  # noqa: PLC0415 - the command line starts without numpy

    if field is not None and format is not Format.PLY:
        raise typer.BadParameter("--field requires --format ply", param_hint="--field")
    match format:
        case Format.CSV:
            typer.echo(f"{out}/points.csv: {storage.export_csv(capture, out, run)} points")
        case Format.PARQUET:
            typer.echo(f"{out}/points.parquet: {storage.export_parquet(capture, out, run)} points")
        case Format.PLY:
            typer.echo(f"{out}/points.ply: {storage.export_ply(capture, out, run, field)} points")
        case Format.PNG:
            typer.echo(f"{out}: {storage.export_png(capture, out)} pictures and fields.csv")

"""`grabberd export`: a capture in other formats."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    """What can be written."""

    CSV = "csv"
    PLY = "ply"
    PARQUET = "parquet"
    PNG = "png"


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("export")(export)


def export(
    capture: Annotated[Path, typer.Argument(help="A capture file, NAME.grab.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="A new or empty folder.")],
    format: Annotated[
        Format,
        typer.Option(help="csv, parquet: the points; ply: as a cloud; png: the fields as pictures."),
    ] = Format.CSV,
    run: Annotated[int | None, typer.Option(min=1, help="Which run's points; default: the latest.")] = None,
    field: Annotated[int | None, typer.Option(min=0, help="Of ply: only this field's; default: all.")] = None,
) -> None:
    """Write a capture's points or pictures into a folder.

    Example: grabberd export liner.grab --format csv --out liner-points

    Example: grabberd export liner.grab --format ply --field 25 --out open-liner
    """
    from grabberd import storage  # noqa: PLC0415 - the command line starts without numpy

    if field is not None and format is not Format.PLY:
        raise typer.BadParameter("one field is for ply alone", param_hint="--field")
    match format:
        case Format.CSV:
            typer.echo(f"{out}/points.csv: {storage.export_csv(capture, out, run)} points")
        case Format.PARQUET:
            typer.echo(f"{out}/points.parquet: {storage.export_parquet(capture, out, run)} points")
        case Format.PLY:
            typer.echo(f"{out}/points.ply: {storage.export_ply(capture, out, run, field)} points")
        case Format.PNG:
            typer.echo(f"{out}: {storage.export_png(capture, out)} pictures and fields.csv")

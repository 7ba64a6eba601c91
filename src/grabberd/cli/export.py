"""`grabberd export`: a capture in other formats."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    """What can be written."""

    CSV = "csv"
    PNG = "png"


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("export")(export)


def export(
    capture: Annotated[Path, typer.Argument(help="A capture file, NAME.grab.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="A new or empty folder.")],
    format: Annotated[
        Format, typer.Option(help="csv: the points; png: the fields as pictures.")
    ] = Format.CSV,
    run: Annotated[int | None, typer.Option(min=1, help="Which run's points; default: the latest.")] = None,
) -> None:
    """Write a capture's points or pictures into a folder.

    Example: grabberd export liner.grab --format csv --out liner-points
    """
    from grabberd.storage.export import export_csv, export_png  # noqa: PLC0415

    if format is Format.CSV:
        typer.echo(f"{out}/points.csv: {export_csv(capture, out, run)} points")
    else:
        typer.echo(f"{out}: {export_png(capture, out)} pictures and fields.csv")

"""`grabberd export`: writes a capture in other formats."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from grabberd.cli.options import follow_link


def export(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.", callback=follow_link)],
    out: Annotated[Path, typer.Option("--out", "-o", help="New or empty folder for the results.")],
    format: Annotated[
        Literal["csv", "ply", "parquet", "png"],
        typer.Option(help="csv, parquet: points; ply: point cloud; png: fields as pictures."),
    ] = "csv",
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

    if field is not None and format != "ply":
        raise typer.BadParameter("--field requires --format ply", param_hint="--field")
    if format == "png":
        typer.echo(f"{out}: {storage.export_png(capture, out)} pictures and fields.csv")
        return
    writers: dict[str, Callable[[Path, Path, int | None], int]] = {
        "csv": storage.export_csv,
        "parquet": storage.export_parquet,
        "ply": partial(storage.export_ply, field=field),
    }
    typer.echo(f"{out}/points.{format}: {writers[format](capture, out, run)} points")

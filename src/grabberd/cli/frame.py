"""`grabberd frame`: writes the file of a calibration frame or of an object with a grid of targets."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from grabberd.cli.options import JsonOption, check_absent, check_folder, out_file, print_result, warn

if TYPE_CHECKING:
    from grabberd.core.reconstruction import ObjectModel

PUBLIC = 0o644
CERTIFIED_SIGMA_MM, OBJECT_SIGMA_MM = 0.01, 0.3
OBJECT_KEYS = ("# homologous: false   # if targets mark other points of the surface in every field",)


def frame(  # noqa: PLR0913, PLR0917 - options of a command
    rows: Annotated[int, typer.Option(min=1, help="Number of rows, along X.")],
    columns: Annotated[int, typer.Option(min=1, help="Number of columns, along Y.")],
    pitch_mm: Annotated[float, typer.Option(help="Distance between the centres of neighbouring targets.")],
    out: Annotated[Path, out_file("the targets (YAML)")],
    row_pitch_mm: Annotated[
        float | None, typer.Option(help="Distance between rows; default: that of the columns.")
    ] = None,
    diameter_mm: Annotated[float, typer.Option(help="Diameter of the targets.")] = 1.5,
    depth_mm: Annotated[
        float,
        typer.Option(
            help="Height from the lowest to the highest target, along Z; 0: a plane, which cannot calibrate."
        ),
    ] = 0.0,
    depth_steps: Annotated[int, typer.Option(min=2, help="Number of equally spaced depths.")] = 5,
    depth_along: Annotated[
        Literal["targets", "rows", "columns"],
        typer.Option(help="Vary the depth by target, by row, or by column."),
    ] = "targets",
    sigma_mm: Annotated[
        float | None,
        typer.Option(help="Standard deviation of the positions; default: 0.01, for an object 0.3.", min=0),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the frame or object; default: that of the file.")
    ] = None,
    is_object: Annotated[
        bool, typer.Option("--object", help="Write an object file instead of a calibration frame's.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Write a calibration frame's file from its dimensions, with position, row and column of every target.

    Example: grabberd frame --rows 12 --columns 9 --pitch-mm 6.5 --depth-mm 16 --out stand-frame.yaml

    Example: grabberd frame --rows 10 --columns 6 --pitch-mm 6.5 --object --out plate-object.yaml
    """
    from grabberd.core.chain.calibration.designed_grid import (  # noqa: PLC0415
        Along,
        GridDesign,
        calibration_frame_remarks,
        designed_grid,
    )
    from grabberd.files.disk import storage_errors, write_synced  # noqa: PLC0415

    check_folder(out)
    check_absent(out)
    design = GridDesign(
        name=name or out.stem,
        rows=rows,
        columns=columns,
        pitch_mm=pitch_mm,
        row_pitch_mm=row_pitch_mm,
        diameter_mm=diameter_mm,
        depth_mm=depth_mm,
        depth_steps=depth_steps,
        along=Along(depth_along),
        sigma_mm=(OBJECT_SIGMA_MM if is_object else CERTIFIED_SIGMA_MM) if sigma_mm is None else sigma_mm,
    )
    model = designed_grid(design)
    remarks = () if is_object else tuple(calibration_frame_remarks(model))
    text = "\n".join(_lines(model, remarks, is_object=is_object)) + "\n"
    with storage_errors(out):
        write_synced(out, text.encode(), PUBLIC)
    warn(remarks)
    if remarks and depth_mm == 0:
        warn(["give it depth by --depth-mm 16, or enter the measured z_mm of every target in the file"])
    print_result(_document(out, model, remarks), f"{out}: {_in_words(model, is_object)}", as_json=json)


def _kind(is_object: bool) -> str:
    return "object" if is_object else "calibration frame"


def _in_words(model: "ObjectModel", is_object: bool) -> str:
    x_mm, y_mm, z_mm = _extent_mm(model)
    return (
        f"{_kind(is_object)} {model.name}, {len(model)} targets of {model.target_diameter_mm:g} mm in "
        f"{model.row.max() + 1} rows and {model.column.max() + 1} columns, {x_mm:.1f} x {y_mm:.1f} mm, "
        f"depth {z_mm:.1f} mm"
    )


def _extent_mm(model: "ObjectModel") -> tuple[float, float, float]:
    x_mm, y_mm, z_mm = (model.xyz_mm.max(axis=0) - model.xyz_mm.min(axis=0)).round(4).tolist()
    return x_mm, y_mm, z_mm


def _document(out: Path, model: "ObjectModel", remarks: Sequence[str]) -> dict[str, object]:
    x_mm, y_mm, z_mm = _extent_mm(model)
    return {
        "file": str(out),
        "name": model.name,
        "targets": len(model),
        "rows": int(model.row.max()) + 1,
        "columns": int(model.column.max()) + 1,
        "target_diameter_mm": model.target_diameter_mm,
        "extent_mm": [x_mm, y_mm],
        "depth_mm": z_mm,
        "remarks": list(remarks),
    }


def _lines(model: "ObjectModel", remarks: Sequence[str], *, is_object: bool) -> Iterator[str]:
    """Lines of the file, with comments on what to complete."""
    from grabberd.bounded_documents import yaml_text  # noqa: PLC0415

    words = _in_words(model, is_object)
    yield f"# {words[0].upper()}{words[1:]}."
    yield "# Places as designed; every key is explained in docs/reference/object-files.md."
    yield from (f"# Note: {one}." for one in remarks)
    yield yaml_text({"name": model.name}).rstrip("\n")
    yield f"target_diameter_mm: {model.target_diameter_mm:g}   # gives their size in the picture"
    yield f"sigma_mm: {model.sigma_mm:g}   # standard deviation of each x_mm, y_mm and z_mm below"
    yield from (OBJECT_KEYS if is_object else _certified_keys(model))
    yield "# x_mm runs from row to row, y_mm from column to column, z_mm toward the cameras."
    yield "targets:"
    columns = (model.target, *model.xyz_mm.T, model.row, model.column)
    for number, x_mm, y_mm, z_mm, row, column in zip(*(one.tolist() for one in columns), strict=True):
        place = f"x_mm: {x_mm:.4f}, y_mm: {y_mm:.4f}, z_mm: {z_mm:.4f}"
        yield f"  - {{id: {number}, {place}, row: {row}, column: {column}}}"


def _certified_keys(model: "ObjectModel") -> Iterator[str]:
    """Commented keys of what only a laboratory knows, with the first and the last target as an example."""
    first, last = model.target[[0, -1]].tolist()
    length_mm = float(((model.xyz_mm[-1] - model.xyz_mm[0]) ** 2).sum() ** 0.5)
    yield "# Once it has been measured, enter the places and their sigma_mm, and:"
    yield "# certificate: number, laboratory, date"
    yield "# temperature_C: 20.0   # at which it was measured"
    yield (
        f"# check_length: {{between: [{first}, {last}], length_mm: {length_mm:.3f}, sigma_mm: 0.02}}   "
        "# measured by other means"
    )

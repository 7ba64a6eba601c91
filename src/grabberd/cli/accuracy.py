"""`grabberd accuracy`: measured points against the truth, the paper's Table 1."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from grabberd.cli.options import JsonOption, console, print_json

if TYPE_CHECKING:
    from grabberd.processes.accuracy import Accuracy


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("accuracy")(accuracy)


def accuracy(
    capture: Annotated[Path, typer.Argument(help="A capture file with points, NAME.grab.")],
    truth: Annotated[Path, typer.Option(help="CSV: target, x_mm, y_mm, z_mm, and n where the object moves.")],
    run: Annotated[int | None, typer.Option(min=1, help="Which run's points; default: the latest.")] = None,
    json: JsonOption = False,
) -> None:
    """Compare a capture's points with the truth: RMSE and precision in X, Y, Z and XYZ; nothing is fitted.

    Example: grabberd accuracy liner.grab --truth truth.csv
    """
    from grabberd.processes.accuracy import Coordinates  # noqa: PLC0415
    from grabberd.processes.accuracy import accuracy as compare  # noqa: PLC0415
    from grabberd.storage import CaptureReader  # noqa: PLC0415
    from grabberd.storage.truth import read_truth  # noqa: PLC0415

    known = read_truth(truth)
    with CaptureReader(capture) as reader:
        result = compare(Coordinates.of(reader.points(run)), known)
    if json:
        print_json(_document(result))
    else:
        _show(result)


def _document(result: "Accuracy") -> dict[str, object]:
    axes = {"rmse": result.rmse._asdict(), "precision": result.precision and result.precision._asdict()}
    return {**asdict(result), **axes}


def _show(result: "Accuracy") -> None:
    table = Table("mm", "X", "Y", "Z", "XYZ", title="Accuracy")
    table.add_row("RMSE", *(f"{value:.4f}" for value in result.rmse))
    if result.precision:
        table.add_row("Precision (σ)", *(f"{value:.4f}" for value in result.precision))
    console.print(table)
    words = (
        f"{result.matched} points in {result.fields} fields; {result.missing} missing, {result.wrong} wrong, "
        f"{result.unknown} of targets that the truth does not have"
    )
    typer.echo(words)

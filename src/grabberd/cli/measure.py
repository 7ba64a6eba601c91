"""`grabberd measure`: measures the fields of a recorded capture."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from grabberd.cli.options import JsonOption, print_json, progress_console


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("measure")(measure)


def measure(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.")],
    calibration: Annotated[Path, typer.Option(help="Calibration (JSON).")],
    object_model: Annotated[Path, typer.Option("--object", help="Object model (YAML).")],
    method: Annotated[str | None, typer.Option(help="Location method; default: the capture's.")] = None,
    line_jitter: Annotated[
        float | None,
        typer.Option("--line-jitter-px", min=0, max=2, help="Line jitter assumed; default: the capture's."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Measure a capture with a calibration; the points are added to the file as a new run.

    Example: grabberd measure liner.grab --calibration rig.calibration.json --object liner.yaml
    """
    from grabberd.service.jobs.measurement import measure_file  # noqa: PLC0415
    from grabberd.service.setup import read_documents, settings_of_capture  # noqa: PLC0415
    from grabberd.storage import CaptureReader  # noqa: PLC0415

    chosen = {"method": method, "line_jitter_px": line_jitter}
    with CaptureReader(capture) as reader:
        settings = settings_of_capture(reader.meta.config)
    settings |= {key: value for key, value in chosen.items() if value is not None}
    made_with = {**read_documents(calibration, object_model), "settings": settings}
    with Progress(console=progress_console, transient=True) as progress:
        task = progress.add_task("measuring", total=1.0)
        result = measure_file(
            lambda share: progress.update(task, completed=share), path=capture, made_with=made_with
        )
    if json:
        print_json(result.model_dump())
    else:
        words = f"run {result.run}, {result.points} points in {result.fields} fields"
        typer.echo(f"{capture}: {words}")

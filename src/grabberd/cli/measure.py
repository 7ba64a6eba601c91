"""`grabberd measure`: measures the fields of a recorded capture."""

from pathlib import Path
from typing import Annotated

import typer

from grabberd.cli.coverage_table import print_coverage
from grabberd.cli.options import (
    IncludeDamagedOption,
    JsonOption,
    LineJitterOption,
    given,
    print_result,
    progress_bar,
)


def measure(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.")],
    calibration: Annotated[Path, typer.Option(help="Calibration (JSON).")],
    object_model: Annotated[Path, typer.Option("--object", help="Object model (YAML).")],
    method: Annotated[str | None, typer.Option(help="Location method; default: the capture's.")] = None,
    line_jitter: LineJitterOption = None,
    include_damaged: IncludeDamagedOption = False,
    json: JsonOption = False,
) -> None:
    """Measure a capture with a calibration; the points are added to the file as a new run.

    Example: grabberd measure liner.grab --calibration rig.calibration.json --object liner.yaml
    """
    from grabberd.service.jobs.measurement import measure_file  # noqa: PLC0415
    from grabberd.service.setup import read_documents, settings_of_capture  # noqa: PLC0415
    from grabberd.storage import CaptureReader  # noqa: PLC0415

    with CaptureReader(capture) as reader:
        settings = settings_of_capture(reader.meta.config)
    settings |= given(method=method, line_jitter_px=line_jitter, include_damaged=include_damaged or None)
    made_with = {**read_documents(calibration, object_model), "settings": settings}
    with progress_bar("measuring") as progress:
        result = measure_file(progress, path=capture, made_with=made_with)
    words = f"run {result.run}, {result.points} points in {result.fields} fields"
    print_result(result.model_dump(mode="json"), f"{capture}: {words}", as_json=json)
    if not json and result.coverage is not None:
        print_coverage(result.coverage)

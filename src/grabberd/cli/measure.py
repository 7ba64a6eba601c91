"""`grabberd measure`: measures the fields of a recorded capture, and tells how well that went."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from grabberd.cli import options
from grabberd.cli.terminal import console, progress_bar

if TYPE_CHECKING:
    from grabberd.documents.captures import CoverageDocument, TargetCoverage


ProposeOption = Annotated[
    Path | None,
    typer.Option(
        help="Write an object file to this path, with misplaced targets moved to where they were measured."
    ),
]


def measure(
    capture: Annotated[Path, typer.Argument(help="Capture file, NAME.grab.", callback=options.follow_link)],
    calibration: Annotated[Path, typer.Option(help="Calibration (JSON).")],
    object_model: Annotated[Path, typer.Option("--object", help="Object model (YAML).")],
    method: Annotated[str | None, typer.Option(help="Location method; default: the capture's.")] = None,
    line_jitter: options.LineJitterOption = None,
    include_damaged: options.IncludeDamagedOption = False,
    propose_object: ProposeOption = None,
    json: options.JsonOption = False,
) -> None:
    """Measure a capture with a calibration; the points are added to the file as a new run.

    Example: grabberd measure liner.grab --calibration rig.calibration.json --object liner-object.yaml

    Example: grabberd measure liner.grab --calibration rig.calibration.json --object liner-object.yaml
    --propose-object liner-object-seen.yaml
    """
    from grabberd.archive.capture.reader import CaptureReader  # noqa: PLC0415
    from grabberd.archive.measure_setups import settings_of_capture  # noqa: PLC0415
    from grabberd.files.reading import read_documents  # noqa: PLC0415
    from grabberd.library.jobs.measurement import measure_file  # noqa: PLC0415

    with CaptureReader(capture) as reader:
        settings = settings_of_capture(reader.meta.config)
    settings |= options.given(
        method=method, line_jitter_px=line_jitter, include_damaged=include_damaged or None
    )
    made_with = {**read_documents(calibration, object_model), "settings": settings}
    if propose_object is not None:
        options.check_folder(propose_object)
        options.check_absent(propose_object)
    with progress_bar("measuring") as progress:
        result = measure_file(progress, path=capture, made_with=made_with)
    document = result.model_dump(mode="json")
    if propose_object is not None:
        document["proposal"] = _proposed(capture, made_with, propose_object)
    options.warn(f"{capture}: {one}" for one in result.warnings)
    words = f"run {result.run}, {result.points} points in {result.fields} fields"
    lines = [f"{capture}: {words}"]
    if propose_object is not None:
        lines.append(f"{propose_object}: {document['proposal']['in_words']}")
    options.print_result(document, "\n".join(lines), as_json=json)
    if not json and result.coverage is not None:
        print_coverage(result.coverage)


def _proposed(capture: Path, made_with: dict[str, Any], out: Path) -> dict[str, Any]:
    """Write the proposed object file, and return what it changes."""
    from grabberd.library.jobs.measurement import propose_object  # noqa: PLC0415

    with progress_bar("comparing with the object model") as progress:
        found = propose_object(progress, path=capture, made_with=made_with, out=out)
    moved = [one._asdict() for one in found.moved]
    return {
        "file": str(out) if moved else None,
        "in_words": found.in_words,
        "fields": found.fields,
        "moved": moved,
    }


SHOWN = 10
"""Number of targets listed, the worst first; --json has all."""


def print_coverage(coverage: "CoverageDocument") -> None:
    """Print the verdict with its findings, then the targets that were missed most."""
    for finding in coverage.findings:
        typer.echo(f"{options.VERDICTS[finding.verdict]}: {finding.in_words}")
    missed = [one for one in coverage.targets if one.found < one.expected]
    if missed:
        console.print(_table(sorted(missed, key=_share)[:SHOWN]))
    if len(missed) > SHOWN:
        typer.echo(f"and {len(missed) - SHOWN} more targets that were missed at times; --json lists all")


def _table(targets: "list[TargetCoverage]") -> Table:
    table = Table("target", "found", "of", "share", "mostly because")
    for one in targets:
        table.add_row(
            str(one.target), str(one.found), str(one.expected), f"{int(100 * _share(one))} %", one.in_words
        )
    return table


def _share(target: "TargetCoverage") -> float:
    return target.found / target.expected

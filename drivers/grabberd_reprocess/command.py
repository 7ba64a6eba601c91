"""`grabberd reprocess`: re-measures an archive of captures into a data set of points."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TimeRemainingColumn

from grabberd.cli import EX_INTERRUPTED
from grabberd.cli.options import (
    IncludeDamagedOption,
    JsonOption,
    end_as_ctrl_c_does,
    given,
    out_folder,
    print_json,
    warn,
)
from grabberd.cli.terminal import progress_console

if TYPE_CHECKING:
    from grabberd_reprocess.reprocess_archive import ReprocessProgress, ReprocessSummary

RATE_OVER_S = 600
"""Seconds over which the rate, and so the remaining time, is estimated."""


def reprocess(  # noqa: PLR0913, PLR0917 - options of a command
    captures: Annotated[
        list[str],
        typer.Argument(help="Folders, patterns ('*/2026-03-*.grab') or files; they are not modified."),
    ],
    calibration: Annotated[Path, typer.Option(help="Calibration (JSON) to measure with.")],
    out: Annotated[Path, out_folder("the data set; an existing one is extended")],
    object_model: Annotated[
        Path | None, typer.Option("--object", help="Object model (YAML); default: each capture's.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=512, help="Number of local processes; default: one per processor."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Dask cluster to use instead, tcp://HOST:PORT.")
    ] = None,
    barn: Annotated[str | None, typer.Option(help="Barn of captures whose site does not name one.")] = None,
    method: Annotated[str | None, typer.Option(help="Location method; default: each capture's.")] = None,
    line_jitter: Annotated[
        float | None,
        typer.Option("--line-jitter-px", min=0, max=2, help="Line jitter assumed; default: each capture's."),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace points made with another calibration.")
    ] = False,
    include_damaged: IncludeDamagedOption = False,
    json: JsonOption = False,
) -> None:
    """Re-measure many captures into Parquet files by barn and day, skipping those already done.

    Example: grabberd reprocess captures/ --calibration rig.calibration.json --out points

    Example: grabberd reprocess 'archive/**/2026-03-*.grab' --calibration rig.calibration.json --out points
    --scheduler tcp://10.0.0.5:8786
    """
    from grabberd_reprocess.reprocess_archive import ReprocessRequest, reprocess_archive  # noqa: PLC0415
    from grabberd_reprocess.workers import cluster_workers, local_workers  # noqa: PLC0415

    if scheduler and workers:
        raise typer.BadParameter(
            "not possible with --scheduler: the cluster has its own workers", param_hint="--workers"
        )
    settings = given(method=method, line_jitter_px=line_jitter, include_damaged=include_damaged or None)
    request = ReprocessRequest(captures, out, calibration, object_model, settings, barn, replace)
    end_as_ctrl_c_does()
    make = partial(cluster_workers, scheduler) if scheduler else lambda _: local_workers(workers)
    with _bar() as bar:
        task = bar.add_task("inspecting captures", total=None, rate="", left="")
        summary = reprocess_archive(request, make, lambda progress: _show(bar, task, progress))
    _report(summary, out, json)
    if summary.interrupted:
        raise typer.Exit(EX_INTERRUPTED)
    if summary.refused:
        raise typer.Exit(1)


def _bar() -> Progress:
    texts = ("{task.fields[rate]}", "{task.fields[left]}")
    columns = ("{task.description}", BarColumn(), *texts, TimeRemainingColumn())
    return Progress(*columns, console=progress_console, transient=True, speed_estimate_period=RATE_OVER_S)


def _show(bar: Progress, task: Any, progress: "ReprocessProgress") -> None:
    bar.update(
        task,
        description="measuring",
        total=progress.all_fields,
        completed=progress.fields,
        rate=f"{progress.fields_per_s:.0f} fields/s",
        left=f"{progress.left} captures left",
    )


def _report(summary: "ReprocessSummary", out: Path, as_json: bool) -> None:
    if as_json:
        print_json(_document(summary, out))
        return
    words = f"{summary.measured} measured, {summary.unchanged} already done, {len(summary.refused)} failed"
    made = f"{summary.fields} fields, {summary.points} points, {summary.fields_per_s:.0f} fields/s"
    typer.echo(f"{out}: {words}; {made}")
    warn(f"skipped: {one.capture} {one.reason}" for one in summary.left_out)
    warn(f"{one.capture}: {one.reason}" for one in summary.warned)
    for capture, problem, hint in summary.refused:
        typer.echo(f"failed: {capture}: {problem}\n  hint: {hint}", err=True)
    if summary.interrupted:
        typer.echo("interrupted; repeat the command to continue", err=True)


def _document(summary: "ReprocessSummary", out: Path) -> dict[str, Any]:
    lists = {
        name: [{**one._asdict(), "capture": str(one.capture)} for one in getattr(summary, name)]
        for name in ("refused", "left_out", "warned")
    }
    return {"out": str(out), **asdict(summary), "fields_per_s": round(summary.fields_per_s, 1), **lists}

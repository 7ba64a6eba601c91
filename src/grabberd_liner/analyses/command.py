"""`grabberd analyse`: computes shape, strain, tension and pressure from a capture's points."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from grabberd.cli.options import (
    ConfigOption,
    JsonOption,
    follow_link,
    labels_of,
    out_folder,
    print_json,
    warn,
)
from grabberd.cli.terminal import console, progress_bar
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    from grabberd_liner.analyses.job import AnalysisOutput
    from grabberd_liner.profiles.profiles import FoundProfiles

_SHOWN = ("period_s", "offset_s")
"""Columns of the summary that are no quantities of the field."""


def analyse(  # noqa: PLR0913, PLR0917 - options of a command
    capture: Annotated[
        Path,
        typer.Argument(help="Capture file with points, NAME.grab; it is not modified.", callback=follow_link),
    ],
    out: Annotated[Path, out_folder("the results")],
    inputs: Annotated[
        Path | None,
        typer.Option(
            help="Reference state, material, vacuum, plane, … (YAML); without it, only the shape is analysed."
        ),
    ] = None,
    bursts: Annotated[
        list[Path] | None,
        typer.Option(help="Another capture of the same liner, combined by phase; may be repeated."),
    ] = None,
    vacuum_log: Annotated[
        Path | None, typer.Option(help="CSV file of a vacuum logger: time_s, pulsation_vacuum_kpa, …")
    ] = None,
    compare_with: Annotated[
        Path | None,
        typer.Option(
            help="CSV file of another method's pressures: along_mm, round_deg, pressure_kpa, sigma_kpa. What "
            "they are of, the inputs say: agreement."
        ),
    ] = None,
    profiles: Annotated[
        bool,
        typer.Option(
            "--profiles", help="Complete the inputs from the profiles that the labels liner, cow, … name."
        ),
    ] = False,
    label: Annotated[
        list[str] | None,
        typer.Option(help="KEY=VALUE, in place of the capture's own label, e.g. liner=A; may be repeated."),
    ] = None,
    run: Annotated[int | None, typer.Option(min=1, help="Run to analyse; default: the latest.")] = None,
    formats: Annotated[
        str, typer.Option(help="Comma-separated list of csv, parquet, hdf5, vtu, ply, mat.")
    ] = "csv",
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Compute surface, sections, curvature, strain, tension and pressure of a capture, by field and by phase.

    What an analysis needs besides the points comes from the inputs file; vacuum that was recorded with the
    capture is taken from there. What is missing is listed, and where each value comes from. With --profiles,
    what the file does not say comes from the profiles of the configuration's state directory. Writes tables
    and a report: report.html to read, report.json for programs.

    Example: grabberd analyse liner.grab --inputs configs/analysis/liner.yaml --out liner-analysis

    Example: grabberd analyse liner.grab --inputs liner-inputs.yaml --vacuum-log log.csv --formats csv,vtu
    --out out

    Example: grabberd analyse liner.grab --inputs film-inputs.yaml --compare-with film.csv --out out

    Example: grabberd analyse liner.grab --profiles --label liner=A --out out

    Example: grabberd analyse b1.grab --bursts b2.grab --bursts b3.grab --inputs liner-inputs.yaml --out out
    """
    from grabberd.archive.input_files import read_table_text  # noqa: PLC0415
    from grabberd.files.disk import results_folder  # noqa: PLC0415
    from grabberd.files.reading import read_yaml  # noqa: PLC0415
    from grabberd_liner.analyses.export import check_formats, write_analysis  # noqa: PLC0415
    from grabberd_liner.analyses.job import AnalysisOptions, analyse_file, with_log  # noqa: PLC0415

    wanted = [name.strip() for name in formats.split(",") if name.strip()]
    check_formats(wanted)
    given = read_yaml(inputs) if inputs else {}
    log = read_table_text(vacuum_log) if vacuum_log else None
    found = _found(capture, config, label or [], profiles)
    files = {"vacuum.log": vacuum_log, "agreement.table": compare_with}
    sources = {**dict.fromkeys(given, str(inputs)), **{key: str(one) for key, one in files.items() if one}}
    if compare_with:
        given = {
            **given,
            "agreement": {**(given.get("agreement") or {}), "table": read_table_text(compare_with)},
        }
    with results_folder(out):
        with progress_bar("analysing") as progress:
            made = analyse_file(
                progress,
                path=capture,
                inputs=with_log(given, log),
                bursts=bursts or [],
                profiles=found,
                sources=sources,
                options=AnalysisOptions(run=run),
            )
        with progress_bar("writing"):
            # First the report: a table that a format has no room for must not cost it.
            report = _report(out, made)
            written = write_analysis(out, made.tables, made.analysis.grid, made.about, wanted) + report
    if json:
        print_json(_document(made, written))
    else:
        _show(made)
        typer.echo(f"{out}: {', '.join(path.name for path in written)}")


def _report(out: Path, made: "AnalysisOutput") -> list[Path]:
    from grabberd_liner.analyses.job import write_document, write_page  # noqa: PLC0415
    from grabberd_liner.analyses.store import DOCUMENT  # noqa: PLC0415

    document = write_document(out, made)
    try:
        return [out / DOCUMENT, write_page(out, document)]
    except ExtraMissing as error:
        warn([f"{error.message}; {error.hint}"])
        return [out / DOCUMENT]


def _found(capture: Path, config: Path | None, words: list[str], wanted: bool) -> "FoundProfiles | None":
    """The profiles that the labels of the capture name; None where they are not wanted."""
    from grabberd_liner.profiles.access import labels_of_file, local_profiles  # noqa: PLC0415

    if wanted:
        profiles = local_profiles(config)
        return profiles.of_labels({**labels_of_file(capture, config), **labels_of(words)})
    if words:
        raise typer.BadParameter("--label requires --profiles", param_hint="--label")
    return None


def _document(made: "AnalysisOutput", written: list[Path]) -> dict[str, Any]:
    """Summary for scripts; everything else is in the files."""
    from grabberd.core.geometry.document_reader import finite  # noqa: PLC0415

    return {
        **made.about,
        "summary": {name: finite(value) for name, value in _summary(made).items()},
        **({"agreement": agreed} if (agreed := _agreement(made)) else {}),
        "quantities": [
            {**one, **{key: finite(one[key]) for key in ("value", "sigma_value", "sigma_common")}}
            for one in _quantities(made)
        ],
        "taken": dict(made.taken),
        "lacks": list(made.analysis.inputs.lacks),
        "problems": list(made.analysis.problems),
        "files": [str(path) for path in written],
    }


def _summary(made: "AnalysisOutput") -> dict[str, float]:
    """The only row of the table `summary`."""
    return {name: values.tolist()[0] for name, values in made.tables["summary"].rows.items()}


def _agreement(made: "AnalysisOutput") -> dict[str, Any]:
    """The only row of the table `agreement`; empty without another method."""
    from grabberd.core.chain.columns import json_values  # noqa: PLC0415

    table = made.tables["agreement"]
    return {name: json_values(values)[0] for name, values in table.rows.items() if len(table)}


def _quantities(made: "AnalysisOutput") -> list[dict[str, Any]]:
    """Rows of the table `quantities`, without definition and source."""
    table = made.tables["quantities"]
    names = ("name", "value", "sigma_value", "sigma_common", "unit", "verdict", "reason")
    columns = [table.column(name).tolist() for name in names]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def _show(made: "AnalysisOutput") -> None:
    from grabberd.reports.notation import measured  # noqa: PLC0415
    from grabberd_liner.chain.analysis.quantities import left_out  # noqa: PLC0415

    row = _summary(made)
    whole = " (a ramp needs no more)" if made.analysis.empty else ""
    fields = f"{row['analysed']} of {row['fields']} fields analysed{whole}, {row['missing']} missing"
    shown = Table(title=fields)
    for heading, side in (("", "left"), ("value", "right"), ("σ", "right")):
        shown.add_column(heading, justify=side)  # type: ignore[arg-type]
    for name in _SHOWN:
        if math.isfinite(row[name]):
            shown.add_row(name, *measured(row[name], row[f"sigma_{name}"]))
    for one in _quantities(made):
        if math.isfinite(one["value"]):
            verdict = f", ISO 5707: {one['verdict']}" if one["verdict"] else ""
            shown.add_row(f"{one['name']}{verdict}", *measured(one["value"], one["sigma_value"]))
    if (agreed := _agreement(made)) and not agreed["reason"]:
        shown.add_row("bias to the other method", *measured(agreed["bias_kpa"], agreed["sigma_bias_kpa"]))
        limits = f"{agreed['lower_kpa']:.1f} … {agreed['upper_kpa']:.1f}"
        shown.add_row("limits of agreement with it, kPa", limits, "")
    for cells in _ranges(made):
        shown.add_row(*cells)
    console.print(shown)
    warn(_taken(made))
    warn(f"missing: {words}" for words in made.analysis.inputs.lacks)
    table = made.tables["quantities"]
    titles = zip(table.column("title").tolist(), table.column("reason").tolist(), strict=True)
    warn(f"left out: {words}" for words in left_out(titles))
    warn(made.analysis.problems)


def _taken(made: "AnalysisOutput") -> list[str]:
    """Inputs that nobody gave, by where they come from."""
    names: dict[str, list[str]] = {}
    for name, source in made.taken.items():
        names.setdefault(source, []).append(name)
    return [f"{', '.join(some)}: {source}" for source, some in names.items()]


def _ranges(made: "AnalysisOutput") -> list[tuple[str, str, str]]:
    """Smallest and largest values of some columns over all fields."""
    import numpy as np  # noqa: PLC0415

    from grabberd.reports.notation import measured  # noqa: PLC0415

    fields, rows = made.tables["fields"], []
    for name in ("area_mm2", "mean_contact_kpa", "greatest_contact_kpa"):
        values, sigma = fields.column(name), fields.column(f"sigma_{name}")
        if np.isfinite(values).any():
            median = float(np.nanmedian(sigma))
            ends = " … ".join(measured(float(end(values)), median).value for end in (np.nanmin, np.nanmax))
            rows.append((f"{name}, range over the fields", ends, measured(0.0, median).sigma))
    return rows

"""`grabberd study`: compares the quantities of many analysed captures, and finds their trend."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from grabberd.cli.options import ConfigOption, JsonOption, TokenFileOption, out_folder, print_json, warn
from grabberd.cli.terminal import console, progress_bar
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    from grabberd_liner.chain.study.study import LeftOut, Studied
    from grabberd_liner.studies.captures import Selection

DOCUMENT, PAGE = "study.json", "report.html"
_MOST_REASONS = 8
"""Reasons that are printed on the terminal; all are in the report."""


def study(  # noqa: PLR0913, PLR0917 - options of a command
    out: Annotated[Path, out_folder("the results")],
    select: Annotated[
        list[str] | None,
        typer.Argument(
            help="Folders of results, or folders of these; or conditions on the archive, which all have to "
            "be met: liner=A,B cow=112 since=2026-11-01 until=2026-12-01 verdict=complete device=barn. "
            "Default: the whole archive.",
            show_default=False,
        ),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(help="What defines the groups: a label (liner, cow, teat, …), device or date."),
    ] = None,
    within: Annotated[
        str | None,
        typer.Option(help="Compare groups within this: with cow, the liners are compared within each cow."),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            help="One independent replicate, whose captures are averaged: a label, or id for every capture. "
            "Default: every capture; with --within, what is in it of one group."
        ),
    ] = None,
    over: Annotated[
        str | None, typer.Option(help="Trend over this: date, milkings, or another label with numbers.")
    ] = None,
    quantities: Annotated[
        str | None, typer.Option(help="Comma-separated names of quantities; default: all.")
    ] = None,
    formats: Annotated[str, typer.Option(help="Comma-separated list of csv, parquet.")] = "csv",
    config: ConfigOption = None,
    url: Annotated[
        str | None,
        typer.Option(
            help="Address of a daemon, for its archive; default: the configuration's state directory.",
            envvar="GRABBERD_URL",
            show_default=False,
        ),
    ] = None,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Compare many analysed captures: quantities with σ, tested differences between groups, trends.

    What captures of one liner share, such as its modulus or the gauges, counts once however many there are.
    Captures and quantities that cannot take part are listed with the reason. Writes tables and a report:
    report.html to read, study.json for programs.

    Example: grabberd study results --by liner --out liners

    Example: grabberd study liner=A,B since=2026-11-01 --by liner --within cow --out liners

    Example: grabberd study liner=A --over milkings --url http://barn.local:8050 --token-file token --out wear
    """
    from grabberd.files.disk import results_folder  # noqa: PLC0415
    from grabberd_liner.analyses.export import TABLE_FORMATS, check_formats  # noqa: PLC0415
    from grabberd_liner.chain.study.study import StudyQuestion  # noqa: PLC0415
    from grabberd_liner.studies.captures import Selection  # noqa: PLC0415

    wanted = _names(formats)
    check_formats(wanted, TABLE_FORMATS, "a study")
    selection = Selection.of(select or [])
    question = StudyQuestion(by, within, unit, over, tuple(_names(quantities or "")))
    with results_folder(out):
        with progress_bar("reading analyses") as progress:
            captures, left_out = _captures(selection, progress, config, url, token_file)
        document, written = _written(out, question, captures, left_out, select or [], wanted)
    if json:
        print_json({**document, "files": [str(path) for path in written]})
    else:
        _show(document)
        typer.echo(f"{out}: {', '.join(path.name for path in written)}")


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _captures(
    selection: "Selection", progress: Any, config: Path | None, url: str | None, token_file: Path | None
) -> "tuple[list[Studied], list[LeftOut]]":
    """The captures of the selection: those in folders, or else those of the archive."""
    from grabberd_liner.studies.access import study_archive  # noqa: PLC0415
    from grabberd_liner.studies.captures import captures_of_archive, captures_of_folders  # noqa: PLC0415

    if not selection.folders:
        return captures_of_archive(study_archive(config, url, token_file), selection, progress)
    captures, left_out = captures_of_folders(selection.folders, progress)
    return [one for one in captures if selection.matches(one)], left_out


def _written(
    out: Path,
    question: Any,
    captures: "list[Studied]",
    left_out: "list[LeftOut]",
    select: list[str],
    formats: list[str],
) -> tuple[dict[str, Any], list[Path]]:
    """Make the study and write its files; return its document with them."""
    from grabberd import __version__  # noqa: PLC0415
    from grabberd.runtime import SystemClock, iso_utc  # noqa: PLC0415
    from grabberd_liner.analyses.export import write_tables  # noqa: PLC0415
    from grabberd_liner.chain.study.study import make_study  # noqa: PLC0415
    from grabberd_liner.chain.study.study_document import study_document, tables  # noqa: PLC0415

    with progress_bar("comparing") as progress:
        made = make_study(question, captures, left_out, progress)
    about = {"created_utc": iso_utc(SystemClock().utc_now()), "version": __version__, "select": select}
    all_tables = tables(made)
    document = study_document(made, all_tables, about)
    with progress_bar("writing"):
        report = _report(out, document)
        return document, write_tables(out, all_tables, about, formats) + report


def _report(out: Path, document: Mapping[str, Any]) -> list[Path]:
    """Write the document and, if it can be drawn, the page."""
    from grabberd.files.checked_file import write_text  # noqa: PLC0415
    from grabberd.reports import document_json  # noqa: PLC0415
    from grabberd_liner.studies.report import study_html  # noqa: PLC0415

    written = [write_text(out / DOCUMENT, document_json(document))]
    try:
        return [*written, write_text(out / PAGE, study_html(document))]
    except ExtraMissing as error:
        warn([f"{error.message}; {error.hint}"])
        return written


def _show(document: Mapping[str, Any]) -> None:
    from grabberd_liner.studies.report import answer, remarks, trend_answer  # noqa: PLC0415

    over = document["question"]["over"]
    groups = (
        f", {document['question']['by']}: {', '.join(document['groups'])}"
        if document["question"]["by"]
        else ""
    )
    table = Table(title=f"{document['captures']} captures{groups}", title_justify="left")
    for heading in ("quantity", "verdict", "result", *([f"trend over {over}"] if over else [])):
        table.add_column(heading)
    for one in document["quantities"]:
        trend = [trend_answer(one, document["over_unit"])] if over else []
        table.add_row(one["title"], one["verdict"], answer(one), *trend)
    console.print(table)
    warn(remarks(document))
    left_out = document["left_out"]
    warn(_left_out(one) for one in left_out[:_MOST_REASONS])
    if (more := len(left_out) - _MOST_REASONS) > 0:
        warn([f"{more} more reasons why something was left out are in the report"])


def _left_out(one: Mapping[str, Any]) -> str:
    if not one["quantity"]:
        return f"left out: {one['capture']}: {one['reason']}"
    return f"{one['quantity']}: {one['count']} captures have none: {one['reason']}"

"""`grabberd test`: a guided test of a liner, from captures, or recorded on the spot."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from grabberd.cli import EX_BAD_VERDICT
from grabberd.cli.options import (
    ConfigOption,
    JsonOption,
    TokenFileOption,
    check_absent,
    follow_link,
    given,
    labels_of,
    load,
    out_folder,
    print_json,
    warn,
)
from grabberd.cli.terminal import console, progress_bar
from grabberd.errors import Conflict, InputError

if TYPE_CHECKING:
    from grabberd_liner.analyses.job import AnalysisOutput
    from grabberd_liner.chain.guided_tests.recipes import Recipe
    from grabberd_liner.guided_tests.documents import LinerTestDocument, TestCheck
    from grabberd_liner.profiles.access import ProfileAccess
    from grabberd_liner.profiles.profiles import FoundProfiles


def liner_test(  # noqa: PLR0913, PLR0917 - options of a command
    kind: Annotated[
        str,
        typer.Argument(
            help="reference, ramp, milking, artificial-teat, overpressure or wear.", metavar="KIND"
        ),
    ],
    captures: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Capture files with points; without one, the command records it.", metavar="[CAPTURE]..."
        ),
    ] = None,
    out: Annotated[Path | None, out_folder("the results")] = None,
    liner: Annotated[
        str | None, typer.Option(help="Name of the liner, in place of the captures' label.")
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(help="KEY=VALUE, in place of the captures' own label, e.g. cow=112; may be repeated."),
    ] = None,
    inputs: Annotated[
        Path | None, typer.Option(help="Inputs of the analyses (YAML), which override profiles and recipe.")
    ] = None,
    vacuum_log: Annotated[
        Path | None, typer.Option(help="CSV file of a vacuum logger, as for 'grabberd analyse'.")
    ] = None,
    accept: Annotated[
        bool,
        typer.Option("--accept", help="Store the values found by the test as the profile's next version."),
    ] = False,
    device: Annotated[str | None, typer.Option(help="Device that records.")] = None,
    duration: Annotated[
        float | None, typer.Option("--duration-s", min=0.5, help="Length in seconds; default: the recipe's.")
    ] = None,
    config: ConfigOption = None,
    url: Annotated[
        str | None,
        typer.Option("--url", help="Record through the daemon at this address, with its profiles."),
    ] = None,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Test a liner by a recipe: check by check, with advice where one fails, and a one-page report.

    reference, ramp and milking evaluate one capture: a file, or one recorded on the spot after the steps
    shown. artificial-teat, overpressure and wear evaluate several files. The liner's properties come from its
    profile. Writes test.json, test.html and, for each capture, a folder with its analysis, which
    `grabberd study` reads.

    Exit code 0: no check failed; 3: one did.

    Example: grabberd test ramp ramp.grab --out ramp-test --accept

    Example: grabberd test milking --config configs/fake.yaml --liner example-reference --out milking-test

    Example: grabberd test artificial-teat reference.grab up-*.grab down-*.grab --out teat-test
    """
    from grabberd.files.disk import results_folder  # noqa: PLC0415
    from grabberd_liner.chain.guided_tests.recipes import RECIPES  # noqa: PLC0415
    from grabberd_liner.profiles.access import profile_access  # noqa: PLC0415

    if (recipe := RECIPES.get(kind)) is None:
        raise typer.BadParameter(f"{kind!r} is none of {', '.join(RECIPES)}", param_hint="KIND")
    if out is None:
        raise typer.BadParameter("name a folder for the results", param_hint="--out")
    files = [path for one in captures or [] if (path := follow_link(one))]
    words = labels_of(label or []) | given(liner=liner)
    stated, sources = _stated(inputs, vacuum_log)
    profiles = profile_access(config, url, token_file)
    with results_folder(out):
        if not files:
            request = _request(recipe, words, duration)
            files = [_recorded(recipe, request, out / _new_name(kind), (config, device, url, token_file))]
        document, written = _tested(recipe, files, _finder(profiles, config, words), (stated, sources), out)
    if json:
        print_json(document.model_dump(mode="json", by_alias=True))
    else:
        show(document)
        typer.echo(f"{out}: {', '.join(path.name for path in written)}")
    if accept:
        _accept(profiles, document)
    if document.verdict == "failed":
        raise typer.Exit(EX_BAD_VERDICT)


def _stated(inputs: Path | None, vacuum_log: Path | None) -> tuple[dict[str, Any], dict[str, str]]:
    """The inputs that are given, and where each comes from."""
    from grabberd.archive.input_files import read_table_text  # noqa: PLC0415
    from grabberd.files.reading import read_yaml  # noqa: PLC0415
    from grabberd_liner.analyses.job import with_log  # noqa: PLC0415

    stated = read_yaml(inputs) if inputs else {}
    sources = dict.fromkeys(stated, str(inputs)) | given(**{"vacuum.log": vacuum_log and str(vacuum_log)})
    return with_log(stated, read_table_text(vacuum_log) if vacuum_log else None), sources


def _request(recipe: "Recipe", words: dict[str, str], duration: float | None) -> dict[str, Any]:
    """The capture of a recipe, as the API takes it."""
    from grabberd.cli.capture import validated  # noqa: PLC0415
    from grabberd_liner.chain.guided_tests.recipes import LABEL  # noqa: PLC0415

    if recipe.several:
        raise InputError(
            f"the test {recipe.kind} evaluates several captures, and none is given",
            f"record them: grabberd capture --label {LABEL}={recipe.kind} …, and name their files",
        )
    labels = {**words, LABEL: recipe.kind}
    return validated({"duration_s": duration or recipe.duration_s, "bits": recipe.bits, "labels": labels})


def _new_name(kind: str) -> str:
    """Name of a capture's file, which becomes its id: captures of one name would be one to a study."""
    from grabberd.runtime import SystemClock  # noqa: PLC0415

    return f"{kind}-{SystemClock().utc_now():%Y%m%dT%H%M%SZ}.grab"


def _recorded(
    recipe: "Recipe",
    request: dict[str, Any],
    out: Path,
    through: tuple[Path | None, str | None, str | None, Path | None],
) -> Path:
    """Shows the steps, and records the capture once the operator is ready."""
    import sys  # noqa: PLC0415

    config, device, url, token_file = through
    check_absent(out)
    typer.echo(f"{recipe.title}:", err=True)
    for number, step in enumerate(recipe.steps, start=1):
        typer.echo(f"  {number}. {step.text}", err=True)
    if sys.stdin.isatty():
        typer.prompt("Press Enter to start the capture", default="", show_default=False, err=True)
    if url:
        from grabberd.cli.daemon_captures import capture_through  # noqa: PLC0415
        from grabberd.client.daemon import Daemon  # noqa: PLC0415

        capture_through(Daemon(url, token_file), device, request, out)
    else:
        from grabberd.cli.direct_capture import capture_directly  # noqa: PLC0415

        capture_directly(load(config), config, device, request, out)
    return out


def _finder(
    profiles: "ProfileAccess", config: Path | None, words: dict[str, str]
) -> "Callable[[Path], FoundProfiles]":
    """Function that finds the labels of a capture, and the profiles that they name."""
    from grabberd_liner.profiles.access import labels_of_file  # noqa: PLC0415
    from grabberd_liner.profiles.documents import ProfileDocument  # noqa: PLC0415
    from grabberd_liner.profiles.profiles import KINDS, FoundProfiles, plain_name  # noqa: PLC0415

    in_use = {(row["kind"], row["name"]) for row in profiles.rows(None, retired=False)}

    def found(path: Path) -> FoundProfiles:
        labels = {**labels_of_file(path, config), **words}
        named = [(kind, plain_name(labels[kind])) for kind in KINDS if kind in labels]
        known = [profiles.get(*one, None) for one in named if one in in_use]
        return FoundProfiles(labels, [ProfileDocument.model_validate(one) for one in known])

    return found


def _tested(
    recipe: "Recipe",
    files: list[Path],
    found: "Callable[[Path], FoundProfiles]",
    inputs: tuple[dict[str, Any], dict[str, str]],
    out: Path,
) -> "tuple[LinerTestDocument, list[Path]]":
    from grabberd_liner.guided_tests.run import run_liner_test, write_liner_test  # noqa: PLC0415

    with progress_bar("analysing") as progress:
        output = run_liner_test(progress, recipe.kind, files, found, *inputs)  # type: ignore[arg-type]
    written, no_page = write_liner_test(out, output.document)
    if no_page:
        warn([no_page])
    known = [made for made in output.analyses.values() if made]
    folders = [_analysis(out / f"analysis-{number}", made) for number, made in enumerate(known, start=1)]
    return output.document, written + folders


def _analysis(folder: Path, made: "AnalysisOutput") -> Path:
    """Writes the document of an analysis, which `grabberd study` reads; returns its folder."""
    from grabberd_liner.analyses.job import write_document  # noqa: PLC0415

    folder.mkdir()
    write_document(folder, made)
    return folder


def _accept(profiles: "ProfileAccess", document: "LinerTestDocument") -> None:
    """Stores the offer as the profile's next version."""
    offer = document.offer
    if offer is None:
        warn(["the test has nothing to offer to the profile, so nothing was stored"])
        return
    name = str(offer.profile["name"])
    newest = profiles.get("liner", name, None)["version"]
    if newest != offer.after:
        raise Conflict(
            f"the liner's profile {name} has version {newest} by now; the test was made with {offer.after}",
            "test again with the newest version",
        )
    stored, _ = profiles.put(dict(offer.profile))
    typer.echo(f"liner {name}: version {stored['version']}", err=True)


def show(document: "LinerTestDocument") -> None:
    """Print the checks, the quantities and the offer; the tables fit 80 columns."""
    from grabberd_liner.guided_tests.report import with_sigma  # noqa: PLC0415

    checks = [
        (one.title, one.verdict, with_sigma(one.value, one.sigma, one.unit), one.limit)
        for one in document.checks
    ]
    _print_table(f"{document.kind}: {document.verdict}", ("check", "verdict", "value ± σ", "limit"), checks)
    for one in document.checks:
        if one.reason:
            _print_line(f"{one.title}: {_said(one)}")
    found = [
        (one.title, with_sigma(one.value, one.sigma, one.unit), one.verdict)
        for one in document.quantities
        if one.value is not None
    ]
    _print_table("quantities", ("quantity", "value ± σ", "verdict"), found)
    if document.offer is not None:
        _print_line(f"offered to the profile (--accept stores it): {'; '.join(document.offer.changes)}")


def _print_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = Table(title=title)
    for heading in headings:
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(*row)
    if rows:
        console.print(table)


def _print_line(text: str) -> None:
    console.print(text, markup=False, highlight=False)


def _said(one: "TestCheck") -> str:
    return f"{one.verdict}: {one.reason}" + (f" – {one.remedy}" if one.remedy else "")


test = liner_test  # under the command's name

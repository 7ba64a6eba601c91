"""`grabberd profile`: keeps what is known of liners, pulsators, cups and cows, version by version."""

from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.table import Table

from grabberd.cli import options
from grabberd.cli.terminal import console
from grabberd.errors import GrabberdError, InputError

if TYPE_CHECKING:
    from grabberd_liner.profiles.access import ProfileAccess

commands = typer.Typer(
    help="Manage profiles of liners, pulsators, cups and cows, which captures select by label.",
    no_args_is_help=True,
)
_LONGEST_NOTE = 60
Kind = Literal["liner", "pulsator", "cup", "cow"]
KindArgument = Annotated[Kind, typer.Argument(help="Kind of the profile.")]
NameArgument = Annotated[str, typer.Argument(help="Name of the profile: the value of the captures' label.")]
VersionOption = Annotated[int | None, typer.Option(min=1, help="Version; default: the newest.")]
UrlOption = Annotated[
    str | None,
    typer.Option(
        help="Address of a daemon, for its profiles; default: those in the configuration's state directory.",
        envvar="GRABBERD_URL",
        show_default=False,
    ),
]


@commands.command("list")
def list_profiles(
    kind: Annotated[Kind | None, typer.Argument(help="Only profiles of this kind.")] = None,
    retired: Annotated[bool, typer.Option("--retired", help="Include retired ones.")] = False,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """List the newest version of each profile.

    Example: grabberd profile list

    Example: grabberd profile list liner --retired --url http://barn.local:8050 --token-file token
    """
    rows = _access(config, url, token_file).rows(kind, retired)
    if json:
        options.print_json(rows)
        return
    table = Table()
    for heading in ("kind", "name", "version", "stored", *(["retired"] if retired else [])):
        table.add_column(heading, no_wrap=True)
    table.add_column("note")
    for row in rows:
        days = [row["created_utc"], *([row["retired_utc"]] if retired else [])]
        note = row["problem"] or shorten(row["note"], _LONGEST_NOTE, placeholder=" …")
        table.add_row(
            row["kind"], row["name"], str(row["version"]), *((day or "")[:10] for day in days), note
        )
    console.print(table)


@commands.command()
def show(
    kind: KindArgument,
    name: NameArgument,
    version: VersionOption = None,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """Show a profile and the time when this version was stored.

    Example: grabberd profile show liner A

    Example: grabberd profile show liner A --version 1 --json
    """
    document = _access(config, url, token_file).get(kind, name, version)
    retired = f", retired {_minute(document['retired_utc'])}" if document["retired_utc"] else ""
    newest = "" if document["version"] == document["newest"] else f" of {document['newest']}"
    stored = f"stored {_minute(document['created_utc'])}{retired}"
    head = f"{kind} {name}, version {document['version']}{newest}, {stored}"
    options.print_result(document, f"# {head}\n{document['yaml']}".rstrip(), as_json=json)


@commands.command()
def add(
    file: Annotated[Path, typer.Argument(help="The profile, a YAML file.")],
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """Store a new profile or a new version of an existing one; unchanged content creates no version.

    Example: grabberd profile add liner-A.yaml

    Example: grabberd profile add cow-112.yaml --url http://barn.local:8050 --token-file token
    """
    document, is_new = _access(config, url, token_file).put(_read(file))
    options.print_result({**document, "is_new": is_new}, _stored(document, is_new), as_json=json)


@commands.command()
def export(
    kind: KindArgument,
    name: NameArgument,
    version: VersionOption = None,
    out: Annotated[Path | None, options.out_file("the profile (YAML); default: standard output")] = None,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
) -> None:
    """Write a profile as YAML, to edit and add again, or to copy.

    Example: grabberd profile export liner A --out liner-A.yaml

    Example: grabberd profile export liner A --version 1
    """
    from grabberd.files.checked_file import write_text  # noqa: PLC0415

    if out is not None:
        options.check_absent(out)
        options.check_folder(out)
    text = _access(config, url, token_file).get(kind, name, version)["yaml"]
    if out is None:
        typer.echo(text, nl=False)
        return
    write_text(out, text)
    typer.echo(f"{out}: {kind} {name}")


@commands.command("import")
def import_profiles(
    folder: Annotated[Path | None, typer.Argument(help="Folder of YAML files, one profile each.")] = None,
    examples: Annotated[
        bool, typer.Option("--examples", help="Import the examples that come with the program.")
    ] = False,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """Store all profiles of a folder, or none if one of them is invalid.

    Example: grabberd profile import profiles

    Example: grabberd profile import --examples
    """
    from grabberd.config import shipped_configs  # noqa: PLC0415

    if (folder is None) != examples:
        raise typer.BadParameter("name a folder, or give --examples", param_hint="FOLDER")
    documents = _checked(folder or shipped_configs() / "profiles")
    access = _access(config, url, token_file)
    stored = [access.put(document) for document in documents]
    listing = [{**document, "is_new": is_new} for document, is_new in stored]
    options.print_result(listing, "\n".join(_stored(*one) for one in stored), as_json=json)


@commands.command()
def retire(
    kind: KindArgument,
    name: NameArgument,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """Retire a profile: labels no longer select it, but all its versions stay readable.

    To bring it back, add it again.

    Example: grabberd profile retire liner A
    """
    document = _access(config, url, token_file).retire(kind, name)
    words = f"{kind} {name} is retired; its {document['newest']} versions stay readable"
    options.print_result(document, words, as_json=json)


@commands.command()
def history(
    kind: KindArgument,
    name: NameArgument,
    config: options.ConfigOption = None,
    url: UrlOption = None,
    token_file: options.TokenFileOption = None,
    json: options.JsonOption = False,
) -> None:
    """List the versions of a profile, newest first, with what each changed.

    Example: grabberd profile history liner A
    """
    from grabberd_liner.profiles.changes import changes_in_words  # noqa: PLC0415

    access = _access(config, url, token_file)
    rows = access.versions(kind, name)
    sound = {row["version"]: access.get(kind, name, row["version"]) for row in rows if not row["problem"]}
    for row in rows:
        before, after = (sound.get(number) for number in (row["version"] - 1, row["version"]))
        row["changes"] = changes_in_words(before["profile"], after["profile"]) if before and after else []
    if json:
        options.print_json(rows)
        return
    table = Table("version", "stored", "changed")
    for row in rows:
        changes = row["problem"] or "\n".join(row["changes"]) or "–"
        table.add_row(str(row["version"]), _minute(row["created_utc"]), changes)
    console.print(table)


def _access(config: Path | None, url: str | None, token_file: Path | None) -> "ProfileAccess":
    from grabberd_liner.profiles.access import profile_access  # noqa: PLC0415

    return profile_access(config, url, token_file)


def _read(file: Path) -> dict[str, Any]:
    """The document in a file.

    Raises:
        InputError: It cannot be read, or is no YAML.
    """
    from grabberd.bounded_documents import read_text  # noqa: PLC0415
    from grabberd_liner.profiles.profiles import read_profile  # noqa: PLC0415

    try:
        return read_profile(read_text(file))
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}", "check the file's name") from error
    except ValueError as error:
        raise InputError(f"{file} cannot be read: {error}", "give a YAML file in UTF-8") from error
    except InputError as error:
        raise InputError(f"{file}: {error.message}", error.hint) from error


def _checked(folder: Path) -> list[dict[str, Any]]:
    """The documents in a folder, all of which can be used.

    Raises:
        InputError: There are none, or some cannot be used; the message lists the problems of all files.
    """
    from grabberd_liner.chain.analysis.profile_inputs import quantity_problems  # noqa: PLC0415
    from grabberd_liner.profiles.profiles import checked_profile  # noqa: PLC0415

    files = sorted([*folder.glob("*.yaml"), *folder.glob("*.yml")])
    if not files:
        raise InputError(f"there is no YAML file in {folder}", "name a folder of profiles")
    documents, problems = [], []
    for file in files:
        try:
            document = _read(file)
            checked_profile(document, quantity_problems)
            documents.append(document)
        except GrabberdError as error:
            problems.append(f"{file.name}: {error.message}")
    if problems:
        raise InputError(
            f"{len(problems)} of {len(files)} profiles cannot be used, so none was stored:\n"
            + "\n".join(problems),
            "correct these files; docs/howto/profiles.md describes every key",
        )
    return documents


def _stored(document: dict[str, Any], is_new: bool) -> str:
    what = f"{document['kind']} {document['name']}: version {document['version']}"
    return what if is_new else f"{what}, unchanged"


def _minute(moment_utc: str) -> str:
    """Shorten a time to minutes, so that a table fits a terminal."""
    return f"{moment_utc[:16]}Z"

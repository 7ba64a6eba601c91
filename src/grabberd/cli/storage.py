"""`grabberd storage`: manages the captures on disk."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from grabberd.cli.options import ConfigOption, JsonOption, load, print_json, print_result
from grabberd.cli.terminal import console, progress_bar
from grabberd.errors import count_of

CapturesArgument = Annotated[
    list[Path] | None,
    typer.Argument(help="Capture files, NAME.grab; default: all in the configuration's folder."),
]
DAMAGED_EXIT = 65
"""EX_DATAERR of sysexits.h."""

commands = typer.Typer(help="Manage the captures on disk. Run it as the daemon's user.", no_args_is_help=True)


@commands.command()
def index(config: ConfigOption = None, json: JsonOption = False) -> None:
    """Rebuild the index from the capture files, as the daemon does at every start; stop it first.

    Unfinished captures are sealed; files that cannot be read are moved to the folder damaged.

    Example: grabberd storage index --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.archive.catalogue.archive import Archive  # noqa: PLC0415
    from grabberd.files.disk import DirectoryLock  # noqa: PLC0415

    directory = load(config).state_directory
    lock, archive = DirectoryLock(directory), Archive(directory / "captures", list)
    lock.acquire()  # a daemon that waits for its folder of captures holds this one alone
    archive.open()
    entries = archive.index.list()
    archive.close()
    lock.release()
    if json:
        print_json([entry._asdict() for entry in entries])
        return
    damaged = [entry for entry in entries if entry.state == "damaged"]
    typer.echo(f"{archive.index.path}: {count_of(len(entries), 'capture')}, {len(damaged)} damaged")
    for entry in damaged:
        typer.echo(f"damaged: {archive.directory / entry.file}")


@commands.command()
def verify(captures: CapturesArgument = None, config: ConfigOption = None, json: JsonOption = False) -> None:
    """Read captures completely and check their digests; exit with 65 if one is damaged.

    The daemon does the same once a month, at idle priority; it may be running.

    Example: grabberd storage verify liner.grab

    Example: grabberd storage verify --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.archive.capture.verification import verify_files  # noqa: PLC0415

    captures = captures or _files(load(config).state_directory)
    damaged, documents = 0, []
    for path, found in verify_files(captures):
        damaged += bool(found.damages)
        documents.append({"file": str(path), **found._asdict()})
        if json:
            continue
        words = f": {count_of(found.fields, 'sound field')} and the points of {found.points}"
        words += f", {count_of(found.readings, 'reading')} of channels" if found.readings else ""
        proven = "" if found.has_digests else "; of an earlier version, without digests"
        readable = found.has_digests or found.fields > 0 or not found.damages
        verdict = "damaged" if found.damages else "sound"
        typer.echo(f"{path}: {verdict}{words + proven if readable else ''}")
        for damage in found.damages:
            typer.echo(f"    {damage}")
    if json:
        print_json(documents)
    elif len(captures) != 1:
        typer.echo(f"{count_of(len(captures), 'capture')}, {damaged} damaged")
    if damaged:
        raise typer.Exit(DAMAGED_EXIT)


@commands.command()
def convert(captures: CapturesArgument = None, config: ConfigOption = None, json: JsonOption = False) -> None:
    """Convert captures from earlier versions to the present, smaller format; exit with 65 if one fails.

    Pictures, times and runs stay as they are, points to far below their σ. A capture is replaced when its new
    file has been compared with it whole, and kept if anything fails. The daemon may be running.

    Example: grabberd storage convert liner.grab

    Example: grabberd storage convert --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.archive.capture.conversion import convert as convert_file  # noqa: PLC0415
    from grabberd.errors import GrabberdError  # noqa: PLC0415

    captures = captures or _files(load(config).state_directory)
    documents: list[dict[str, object]] = []
    for path in captures:
        try:
            with progress_bar(path.name) as progress:
                converted = convert_file(path, datetime.now(UTC), progress)
        except GrabberdError as error:
            documents.append({"file": str(path), "kept": error.message, "hint": error.hint})
            words = f"kept as it is: {error.message}; hint: {error.hint}"
        else:
            documents.append({"file": str(path), **converted._asdict()})
            words = _sizes(*converted)
        if not json:
            typer.echo(f"{path}: {words}")
    if json:
        print_json(documents)
    if any("kept" in document for document in documents):
        raise typer.Exit(DAMAGED_EXIT)


def _files(state_directory: Path) -> list[Path]:
    from grabberd.archive.capture.schema import SUFFIX  # noqa: PLC0415

    return sorted((state_directory / "captures").glob(f"*{SUFFIX}"))


def _sizes(before: int, after: int) -> str:
    if before == after:
        return "has today's format already"
    return f"converted, {before / 1e3:,.0f} kB before, {after / 1e3:,.0f} kB now"


@commands.command()
def retention(config: ConfigOption = None, json: JsonOption = False) -> None:
    """Show which captures storage.retention would delete now; nothing is deleted.

    Captures used by a running job are listed too, although they are kept until it ends.

    Example: grabberd storage retention --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.archive.catalogue.disk_guard import GB, Policy, candidates, free_bytes, removals  # noqa: PLC0415
    from grabberd.archive.state.index_entries import entry_of  # noqa: PLC0415
    from grabberd.archive.state.state_database import AnnotationStore  # noqa: PLC0415
    from grabberd.files.disk import storage_errors  # noqa: PLC0415

    settings = load(config)
    state, folder = settings.state_directory / "state.sqlite", settings.state_directory / "captures"
    said = AnnotationStore(state).all() if state.exists() else {}
    pinned = {capture for capture, one in said.items() if one.pinned}
    policy = Policy.from_config(settings.storage.retention)
    kept = list(candidates(folder, map(entry_of, _files(settings.state_directory)), pinned))
    with storage_errors(folder):
        # Before its first start a daemon has no folder yet; it will be on the disk of the nearest one.
        free = free_bytes(next(one for one in (folder, *folder.absolute().parents) if one.exists()))
    found = removals(kept, policy, datetime.now(UTC), free)
    if json:
        print_json([removal._asdict() for removal in found])
        return
    table = Table("capture", "GB", "because")
    for removal in found:
        table.add_row(removal.id, f"{removal.size_bytes / GB:.3f}", removal.because)
    if found:
        console.print(table)
    words = "" if policy.removes else "storage.retention is not configured; "
    typer.echo(f"{words}{len(found)} of {len(kept)} captures would be deleted, {len(pinned)} are pinned")


@commands.command()
def accept(config: ConfigOption = None, json: JsonOption = False) -> None:
    """Accept recovered or lost settings, and the folder of captures as it is; the daemon may be running.

    Check settings and tokens first. A missing folder of captures is created, empty.

    Example: grabberd storage accept --config /etc/grabberd/grabberd.yaml
    """
    from grabberd.archive.state.state_keeper import STATE, accept_state  # noqa: PLC0415

    directory = load(config).state_directory
    accepted = accept_state(directory / STATE, directory / "captures")
    print_result({"accepted": accepted}, "\n".join(accepted) or "there is nothing to accept", as_json=json)


@commands.command()
def seal(
    part: Annotated[Path, typer.Argument(help="File left by an interrupted capture, NAME.grab.part.")],
    json: JsonOption = False,
) -> None:
    """Seal an interrupted capture; its content is kept and it is marked incomplete.

    The daemon seals its own captures at its next start; this is for captures made by grabberd capture.

    Example: grabberd storage seal .grabberd-k3x9/liner.grab.part
    """
    from grabberd.archive.capture.crash_recovery import seal as seal_part  # noqa: PLC0415
    from grabberd.archive.catalogue.capture_documents import describe  # noqa: PLC0415

    path = seal_part(part)
    capture = describe(path)
    # A pin belongs to the daemon's state, not to the file.
    document = {"file": str(path), **capture.model_dump(mode="json", exclude={"pinned"})}
    print_result(
        document, f"{path}: {count_of(capture.fields, 'field')}, {capture.ledger.in_words}", as_json=json
    )

"""`grabberd backup` and `grabberd restore`: saves and restores all state that is not in capture files."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from grabberd import __version__
from grabberd.cli.options import ConfigOption, JsonOption, load, out_file, print_result
from grabberd.errors import count_of


def backup(
    out: Annotated[Path, out_file("the backup, such as barn-2026-03-01.zip")],
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Save settings, tokens, pins, notes, profiles and calibrations to one file; the daemon may be running.

    Captures are not included: they are files of their own. Keep the backup as safe as a password.

    Example: grabberd backup --config /etc/grabberd/grabberd.yaml --out barn-2026-03-01.zip
    """
    from grabberd.archive.state.backup import back_up  # noqa: PLC0415
    from grabberd.runtime import iso_utc  # noqa: PLC0415

    info = back_up(load(config).state_directory, out, iso_utc(datetime.now(UTC)), __version__)
    words = f"{out}: state and {count_of(info.calibrations, 'calibration')}"
    print_result({"file": str(out), **info._asdict()}, words, as_json=json)


def restore(
    file: Annotated[Path, typer.Argument(help="File written by grabberd backup.")],
    config: ConfigOption = None,
    json: JsonOption = False,
) -> None:
    """Restore a backup; stop the daemon first, and run this as the daemon's user.

    Replaced files are kept in a folder replaced-TIME. Captures are not touched.

    Example: grabberd restore --config /etc/grabberd/grabberd.yaml barn-2026-03-01.zip
    """
    from grabberd.archive.state.backup import restore as put_back  # noqa: PLC0415

    now = f"{datetime.now(UTC):%Y%m%dT%H%M%S%fZ}"
    info, replaced = put_back(load(config).state_directory, file, now)
    words = f"restored state and {count_of(info.calibrations, 'calibration')} of {info.created_utc}"
    if replaced:
        words += f"\nthe previous state is kept in {replaced}"
    document = {**info._asdict(), "replaced": str(replaced) if replaced else None}
    print_result(document, words, as_json=json)

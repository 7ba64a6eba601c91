"""Captures by the folders that `grabberd analyse --out` has made."""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from grabberd.bounded_documents import LARGEST_TABLE, read_bounded
from grabberd.errors import InputError
from grabberd_liner.analyses.store import DOCUMENT
from grabberd_liner.chain.study.studied import LeftOut, Studied
from grabberd_liner.studies.analysed_capture import of_report


def captures_of_folders(
    folders: Sequence[Path], progress: Callable[[float], None] = lambda _: None
) -> tuple[list[Studied], list[LeftOut]]:
    """The captures whose analyses are in folders, at any depth; of a capture's analyses the newest counts.

    Raises:
        InputError: A folder has none at all.
    """
    found = list(dict.fromkeys(path for folder in folders for path in _reports(folder)))
    taken: dict[str, Studied] = {}
    left_out: list[LeftOut] = []
    for number, path in enumerate(found):
        one = _read(path)
        if isinstance(one, LeftOut):
            left_out.append(one)
        elif one.id in taken:
            older, taken[one.id] = sorted((taken[one.id], one), key=lambda either: either.analysed_utc)
            left_out.append(LeftOut(one.id, "", _counted_once(older, taken[one.id])))
        else:
            taken[one.id] = one
        progress((number + 1) / len(found))
    return list(taken.values()), left_out


def _reports(folder: Path) -> Iterator[Path]:
    """Reports in a folder, or in those below it; hidden folders and links are left alone."""
    found = False
    for where, below, files in os.walk(folder.resolve()):
        if DOCUMENT in files:
            found = True
            below.clear()
            yield Path(where) / DOCUMENT
        below[:] = sorted(name for name in below if not name.startswith("."))
    if not found:
        raise InputError(
            f"no analysis is in {folder}: neither it nor a folder below has a {DOCUMENT}",
            f"make some: grabberd analyse CAPTURE.grab --profiles --out {folder}/NAME",
        )


def _read(path: Path) -> Studied | LeftOut:
    try:
        document: Any = json.loads(read_bounded(path, LARGEST_TABLE))
    except (OSError, ValueError, RecursionError) as error:
        return LeftOut(str(path.parent), "", f"its {DOCUMENT} cannot be read: {error}")
    return of_report(document, str(path.parent))


def _counted_once(older: Studied, newer: Studied) -> str:
    if older.analysed_utc == newer.analysed_utc:
        return f"the same analysis is in {older.analysis} and in {newer.analysis}: it counts once"
    return f"a newer analysis of it is in {newer.analysis}: that in {older.analysis} does not count"

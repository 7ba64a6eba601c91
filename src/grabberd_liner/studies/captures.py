"""Captures that a study takes, each with its newest analysis: those of an archive, by the records of their
analyses, or those in the folders that `grabberd analyse --out` has made, by their reports.
"""

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from pydantic import ValidationError

from grabberd.archive.catalogue.capture_documents import describe
from grabberd.archive.state.capture_index import CaptureIndex, Unusable
from grabberd.archive.state.index_entries import CAPTURES, DAMAGED_ENTRY
from grabberd.archive.state.state_database import AnnotationStore
from grabberd.archive.state.state_keeper import STATE
from grabberd.bounded_documents import LARGEST_TABLE, read_bounded
from grabberd.documents.document import JsonObject
from grabberd.errors import CaptureFileError, InputError, NotFound, StorageError
from grabberd.files.reading import read_json
from grabberd_liner.analyses.documents import RENAMED, AnalysisRow, QuantityDocument, TableDocument, outdated
from grabberd_liner.analyses.store import DOCUMENT, AnalysisStore
from grabberd_liner.chain.study.study import VERDICT, Found, LeftOut, Meaning, Studied, unanalysed

SINCE, UNTIL = "since", "until"
_VERDICTS = ("complete", "incomplete")


class Condition(NamedTuple):
    """Values of which a capture must have one under a name."""

    key: str
    values: tuple[str, ...]

    def holds(self, capture: Studied) -> bool:
        """True if a capture meets it."""
        if self.key == SINCE:
            return _moment(capture.captured_utc) >= _moment(self.values[0])
        if self.key == UNTIL:
            return _moment(capture.captured_utc) < _moment(self.values[0])
        return capture.value_of(self.key) in self.values


class Selection(NamedTuple):
    """Folders of results, and conditions that all have to be met."""

    folders: tuple[Path, ...]
    conditions: tuple[Condition, ...]

    @classmethod
    def of(cls, words: Sequence[str]) -> Self:
        """A selection in the words of the command line; what exists as a path is one.

        Raises:
            InputError: A word is neither; it tells which, and what to do about it.
        """
        folders, conditions = [], []
        for word in words:
            if Path(word).exists() or "=" not in word:
                folders.append(_folder(Path(word)))
            else:
                conditions.append(_condition(word))
        return cls(tuple(folders), tuple(conditions))

    def matches(self, capture: Studied, *, but_verdict: bool = False) -> bool:
        """True if a capture meets all conditions.

        Args:
            capture: The capture.
            but_verdict: True to leave the verdict aside, which takes opening the file to know.
        """
        asked = (one for one in self.conditions if not (but_verdict and one.key == VERDICT))
        return all(one.holds(capture) for one in asked)

    def single(self, key: str) -> str | None:
        """The value that a condition asks for, if there is one and it has no alternatives."""
        found = [one.values for one in self.conditions if one.key == key]
        return found[0][0] if len(found) == 1 and len(found[0]) == 1 else None


def _folder(path: Path) -> Path:
    if path.is_dir():
        return path
    if path.name == DOCUMENT and path.is_file():
        return path.parent
    if path.name.endswith(CAPTURES):
        raise InputError(
            f"{path} is a capture, and a study takes analyses",
            f"analyse it first: grabberd analyse {path} --profiles --out {path.stem}-analysis",
        )
    what = "is no folder" if path.exists() else "does not exist, and is no condition"
    raise InputError(
        f"{path} {what}",
        f"give folders that grabberd analyse --out has made (with {DOCUMENT} in them), folders of such "
        "folders, or conditions on the archive such as liner=A,B",
    )


def _condition(word: str) -> Condition:
    key, _, values = (part.strip() for part in word.partition("="))
    condition = Condition(key, tuple(one.strip() for one in values.split(",") if one.strip()))
    if not key or not condition.values:
        raise InputError(f"{word!r} is no condition", "give NAME=VALUE, or NAME=VALUE,OTHER")
    if key in (SINCE, UNTIL):
        if len(condition.values) > 1:
            raise InputError(f"{word!r} has several times", f"give one: {key}=2026-11-01")
        _moment(condition.values[0], word)
    if key == VERDICT and (unknown := set(condition.values) - set(_VERDICTS)):
        raise InputError(f"there is no verdict {', '.join(unknown)}", f"choose from {', '.join(_VERDICTS)}")
    return condition


def _moment(text: str, word: str = "") -> datetime:
    """A day or a time in UTC; one without a zone is in UTC already."""
    try:
        moment = datetime.fromisoformat(text)
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        hint = "write days as 2026-11-01, times as 2026-11-01T06:30"
        raise InputError(f"{word or text!r} is no day or time", hint) from None


_AGAIN = "analyse it again"
OUTDATED = f"its pressures were found in the earlier, wrong way: {_AGAIN}"
WITHOUT = f"its analysis is of a version that had no quantities: {_AGAIN}"
_SCHEMA = "grabberd/analysis-report/1"
_LINER = "liner"
_LONGEST = 200


def of_record(capture: Studied, row: AnalysisRow) -> Studied | LeftOut:
    """A capture of an archive with its newest analysis.

    Args:
        capture: What is known of it without its analysis.
        row: The analysis as it is listed.
    """
    if row.problem is not None:
        return LeftOut(capture.id, "", f"its analysis {row.analysis} is damaged: {row.problem}")
    if row.outdated == "pressure":
        return LeftOut(capture.id, "", OUTDATED)
    if not row.quantities:
        return LeftOut(capture.id, "", WITHOUT)
    return capture._replace(
        liner=liner_of([one.model_dump() for one in row.profiles], capture.labels, row.inputs),
        analysis=str(row.analysis),
        analysed_utc=row.created_utc or "",
        found={one.name: _found(one) for one in row.quantities},
    )


def of_report(document: Any, where: str) -> Studied | LeftOut:
    """A capture by the report of its analysis.

    Args:
        document: Content of `report.json`.
        where: The folder that it is in.
    """
    if not isinstance(document, Mapping) or document.get("schema") != _SCHEMA:
        return LeftOut(where, "", f"its {DOCUMENT} is no report of an analysis")
    try:
        return _of_report(document, where)
    except (ValidationError, ValueError, KeyError, TypeError, AttributeError) as error:
        said = " ".join(str(error).split())[:_LONGEST]
        return LeftOut(where, "", f"its {DOCUMENT} is damaged: {type(error).__name__}: {said}")


def _of_report(document: Mapping[str, Any], where: str) -> Studied | LeftOut:
    about, capture_id = document["about"], str(document["id"])
    labels = {str(key): str(value) for key, value in (about.get("labels") or {}).items()}
    has_pressure = any(
        one["name"] == "mean_contact_kpa" and any(v is not None for v in one["values"])
        for one in document["tables"]["fields"]["columns"]
    )
    if outdated(document.get("pressure_method"), has_pressure, ()):
        return LeftOut(capture_id, "", f"{OUTDATED} ({where})")
    if "quantities" not in document["tables"]:
        return LeftOut(capture_id, "", f"{WITHOUT} ({where})")
    rows = _rows(TableDocument.model_validate(document["tables"]["quantities"]))
    ledger = about.get("ledger")
    return Studied(
        capture_id,
        str(about["captured_utc"]),
        str(about.get("device") or ""),
        "" if ledger is None else "incomplete" if ledger["lacking"] else "complete",
        labels,
        liner_of(about.get("profiles") or [], labels, document["inputs"]["given"]),
        where,
        str(document["created_utc"]),
        {str(row["name"]): _of_row(row) for row in rows},
        _meanings(rows),
    )


def meanings_of(document: Any) -> dict[str, Meaning]:
    """Titles and definitions of quantities from the report of an analysis; none if it has no such table."""
    try:
        return _meanings(_rows(TableDocument.model_validate(document["tables"]["quantities"])))
    except (ValidationError, ValueError, KeyError, TypeError):
        return {}


def _meanings(rows: Iterable[Mapping[str, Any]]) -> dict[str, Meaning]:
    return {str(row["name"]): Meaning(str(row["title"]), str(row["definition"])) for row in rows}


def liner_of(profiles: Iterable[Mapping[str, Any]], labels: Mapping[str, str], inputs: JsonObject) -> str:
    """The liner of an analysis: the version of its profile, else its label, else what its material is."""
    for one in profiles:
        if one["kind"] == _LINER:
            return f"{one['name']}, version {one['version']}"
    if labels.get(_LINER):
        return labels[_LINER]
    if material := inputs.get("material"):
        text = json.dumps(material, sort_keys=True, ensure_ascii=False)
        return f"material {hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return ""


def _rows(table: TableDocument) -> list[dict[str, float | str | None]]:
    names = [column.name for column in table.columns]
    values = zip(*(column.values for column in table.columns), strict=True)
    return [_renamed(dict(zip(names, row, strict=True))) for row in values]


def _renamed(row: dict[str, float | str | None]) -> dict[str, float | str | None]:
    """A row of the quantities with the name and meaning that it has now."""
    name = RENAMED.get(str(row["name"]))
    if name is None:
        return row
    # The daemon starts without what computes loads.
    from grabberd_liner.analysis.load.liner_compression import QUANTITIES  # noqa: PLC0415

    now = QUANTITIES[name]
    return {**row, "name": name, "title": now.title, "definition": now.definition}


def _of_row(row: Mapping[str, float | str | None]) -> Found:
    common = row.get("sigma_common")
    return Found(
        str(row["unit"]),
        _number(row["value"]),
        _number(row["sigma_value"]),
        None if common is None else _number(common),
        str(row["reason"]),
    )


def _found(one: QuantityDocument) -> Found:
    return Found(one.unit, _number(one.value), _number(one.sigma), one.sigma_common, one.reason)


def _number(value: float | str | None) -> float:
    return math.nan if value is None else float(value)


_MOST_REPORTS = 5
NOT_ANALYSED = "it has not been analysed"


class Listed(NamedTuple):
    """A capture as an archive lists it, without its analyses.

    Attributes:
        capture: What is known of it.
        problem: Why it cannot be studied; empty if it can.
        is_damaged: True if its labels cannot be known: it is listed whatever the conditions.
    """

    capture: Studied
    problem: str = ""
    is_damaged: bool = False


class StudyArchive(Protocol):
    """An archive as a study reads it."""

    def captures(self, selection: Selection) -> Iterator[Listed]:
        """Captures; it may leave out what the selection does not take anyhow."""
        ...

    def verdict(self, capture: Studied) -> str:
        """Verdict on a capture."""
        ...

    def newest_analysis(self, capture_id: str) -> AnalysisRow | None:
        """A capture's newest analysis; None if it has none."""
        ...

    def report(self, capture_id: str, analysis: str) -> Any:
        """The report of an analysis as a document."""
        ...


def captures_of_archive(
    archive: StudyArchive, selection: Selection, progress: Callable[[float], None] = lambda _: None
) -> tuple[list[Studied], list[LeftOut]]:
    """The captures of an archive that meet the conditions, each with its newest analysis.

    Raises:
        InputError: None does.
        GrabberdError: The archive cannot be read.
    """
    listed = [
        one
        for one in archive.captures(selection)
        if one.is_damaged or selection.matches(one.capture, but_verdict=True)
    ]
    taken: list[Studied] = []
    left_out: list[LeftOut] = []
    for number, one in enumerate(listed):
        found = _with_analysis(archive, selection, one)
        if isinstance(found, Studied):
            taken.append(found)
        elif found is not None:
            left_out.append(found)
        progress((number + 1) / len(listed))
    if not taken and not left_out:
        words = " ".join(f"{one.key}={','.join(one.values)}" for one in selection.conditions)
        raise InputError(
            f"no capture of the archive has {words}" if words else "the archive has no captures",
            "grabberd status lists the archive; labels are compared letter for letter",
        )
    return _with_meanings(archive, taken), left_out


def _with_meanings(archive: StudyArchive, captures: Sequence[Studied]) -> list[Studied]:
    """The captures with titles and definitions of their quantities, which the records of analyses lack.

    They are taken from one report for all, and from others for what that one does not have.
    """
    meanings: dict[str, Meaning] = {}
    asked = 0
    for capture in captures:
        if asked < _MOST_REPORTS and not capture.found.keys() <= meanings.keys():
            asked += 1
            with suppress(NotFound, StorageError):  # then their names have to do
                meanings = meanings_of(archive.report(capture.id, capture.analysis)) | meanings
    return [one._replace(meanings=meanings) for one in captures]


def _with_analysis(archive: StudyArchive, selection: Selection, listed: Listed) -> Studied | LeftOut | None:
    """A capture with its analysis, or why it has none; None if it does not meet the conditions."""
    capture = listed.capture
    if listed.problem:
        return LeftOut(capture.id, "", listed.problem)
    try:
        judged = capture._replace(verdict=archive.verdict(capture))
        if not selection.matches(judged):
            return None
        row = archive.newest_analysis(capture.id)
    except (CaptureFileError, NotFound, StorageError) as error:
        return LeftOut(capture.id, "", error.message)
    except ValidationError as error:
        return LeftOut(capture.id, "", f"its analyses cannot be read: {error.errors()[0]['msg']}")
    return of_record(judged, row) if row else LeftOut(capture.id, "", NOT_ANALYSED)


class LocalArchive:
    """The archive in a state directory, which a daemon may be using; nothing in it is changed."""

    def __init__(self, directory: Path) -> None:
        self._files = directory / "captures"
        self._index = CaptureIndex(self._files, heal=self._refuse)
        self._state = directory / STATE
        self._analyses = AnalysisStore(directory / "analyses")
        self._paths: dict[str, Path] = {}

    def captures(self, selection: Selection) -> Iterator[Listed]:
        """All captures that have ended.

        Raises:
            StorageError: There is no index, or it cannot be read.
        """
        annotated = AnnotationStore(self._state).all() if self._state.exists() else {}
        for entry in self._index.list():
            self._paths[entry.id] = self._files / entry.file
            known = annotated[entry.id].labels if entry.id in annotated else None
            labels = dict(read_json(entry.labels) if known is None else known)
            is_damaged = entry.state == DAMAGED_ENTRY
            problem = f"it is damaged: {entry.reason}" if is_damaged else ""
            capture = unanalysed(entry.id, entry.created_utc, entry.device, labels=labels)
            yield Listed(capture, problem, is_damaged)

    def verdict(self, capture: Studied) -> str:
        """The verdict in the capture's file.

        Raises:
            CaptureFileError: It cannot be read.
        """
        return str(describe(self._paths[capture.id]).verdict)

    def newest_analysis(self, capture_id: str) -> AnalysisRow | None:
        """A capture's newest analysis; None if it has none."""
        newest = max(self._analyses.numbers(capture_id), default=None)
        return None if newest is None else self._analyses.row(capture_id, newest)

    def report(self, capture_id: str, analysis: str) -> Any:
        """The report of an analysis as a document.

        Raises:
            NotFound: There is none.
            StorageError: It cannot be read.
        """
        path = self._analyses.file(capture_id, int(analysis), DOCUMENT)
        try:
            return json.loads(read_bounded(path, LARGEST_TABLE))
        except (OSError, ValueError, RecursionError) as error:
            raise StorageError(f"{path} cannot be read: {error}", "analyse the capture again") from error

    def _refuse(self, reason: Unusable) -> None:
        raise StorageError(
            f"the archive's index {self._index.path} cannot be read: {reason}",
            "start the daemon, or run grabberd storage index, which makes it anew; or name another "
            "configuration, a daemon by --url, or folders of results",
        )


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

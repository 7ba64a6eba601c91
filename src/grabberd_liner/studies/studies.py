"""Captures of an archive, with their newest analyses."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from pydantic import ValidationError

from grabberd.archive.catalogue.capture_documents import describe
from grabberd.archive.state.annotation_store import AnnotationStore
from grabberd.archive.state.capture_index import CaptureIndex, Unusable
from grabberd.archive.state.index_entries import DAMAGED_ENTRY
from grabberd.archive.state.state_backups import STATE
from grabberd.bounded_documents import LARGEST_TABLE, read_bounded
from grabberd.errors import CaptureFileError, InputError, NotFound, StorageError
from grabberd.files.json_value import read_json
from grabberd_liner.analyses.device_documents import analysis_list
from grabberd_liner.analyses.documents import AnalysisRow
from grabberd_liner.analyses.store import DOCUMENT, AnalysisStore
from grabberd_liner.chain.study.studied import LeftOut, Meaning, Studied, unanalysed
from grabberd_liner.studies.analysed_capture import meanings_of, of_record
from grabberd_liner.studies.selection import Selection

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

    def analyses(self, capture_id: str) -> list[AnalysisRow]:
        """A capture's analyses, newest first."""
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
        rows = archive.analyses(capture.id)
    except (CaptureFileError, NotFound, StorageError) as error:
        return LeftOut(capture.id, "", error.message)
    except ValidationError as error:
        return LeftOut(capture.id, "", f"its analyses cannot be read: {error.errors()[0]['msg']}")
    return of_record(judged, rows[0]) if rows else LeftOut(capture.id, "", NOT_ANALYSED)


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

    def analyses(self, capture_id: str) -> list[AnalysisRow]:
        """A capture's analyses, newest first."""
        return analysis_list(self._analyses, capture_id).analyses

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

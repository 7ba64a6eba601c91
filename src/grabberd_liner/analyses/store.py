"""Analyses on disk: a folder each, CAPTURE/N, which never changes; its maps, and the documents built from
its record.

    CAPTURE/N/record.json   what it was made from, and a summary of its results
    CAPTURE/N/report.json   the report as a document; report.html: as a page, if it could be drawn
    CAPTURE/N/maps.jsonl    a line for each field and phase with its targets' columns; maps.json: offsets
    CAPTURE/N/NAME.csv      every table

A folder is written under another name and renamed, so it exists whole or not at all.

Results on disk: a folder each, written under another name and renamed, so whole or not there at all.
"""

import json
import shutil
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from grabberd import runtime
from grabberd.errors import ExtraMissing, NotFound, said
from grabberd.files.checked_file import Check, checked_file, write_text
from grabberd.files.disk import clear_scratch, scratch_folder, storage_errors, sync_directory
from grabberd_liner.analyses.documents import AnalysisRow, PulsationDocument, outdated

if TYPE_CHECKING:
    from grabberd_liner.chain.analysis.analysis_document import TargetMap


class ResultFolders:
    """A folder of results; any thread and process may read, one at a time may add."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def open(self) -> None:
        """Creates the folder, and removes what a crash left unfinished.

        Raises:
            StorageError: It cannot be written.
        """
        clear_scratch(self.directory)

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A folder to write a result into, removed afterwards unless it was published.

        What a killed program left of another one is removed first.

        Raises:
            StorageError: It cannot be made.
        """
        clear_scratch(self.directory)
        with scratch_folder(self.directory) as scratch:
            yield scratch


RECORD, DOCUMENT, PAGE = "record.json", "report.json", "report.html"


class AnalysisStore(ResultFolders):
    """The analyses in a folder."""

    def publish(self, capture_id: str, made: Path) -> int:
        """Gives a finished folder the next number of its capture, and returns the number.

        Raises:
            StorageError: The folder cannot be renamed.
        """
        home = self.directory / capture_id
        with storage_errors(home):
            home.mkdir(exist_ok=True)
            number = max(self.numbers(capture_id), default=0) + 1
            runtime.rename(made, home / str(number))
            for folder in (home, self.directory):
                sync_directory(folder)
        return number

    def captures(self) -> list[str]:
        """Ids of the captures that have been analysed, newest first."""
        return sorted((path.name for path in self.directory.glob("[!.]*") if path.is_dir()), reverse=True)

    def among(self, captures: Collection[str] | None) -> set[str]:
        """Ids of those that have an analysis, of some captures or of all."""
        if captures is None:
            return set(self.captures())
        return {one for one in captures if self.numbers(one)}

    def numbers(self, capture_id: str) -> list[int]:
        """Numbers of a capture's analyses, in order."""
        home = self.directory / capture_id
        return sorted(int(path.name) for path in home.glob("*") if path.name.isdigit())

    def records(self, capture_id: str) -> Iterator[dict[str, Any]]:
        """Records of a capture's analyses, newest first, one at a time: one may hold a whole vacuum log. Of a
        damaged one its number and problem.
        """
        return (self._record(capture_id, number) for number in reversed(self.numbers(capture_id)))

    def row(self, capture_id: str, number: int) -> AnalysisRow:
        """An analysis as it is listed; of a damaged one only its number and problem."""
        record = self._record(capture_id, number)
        try:
            row = AnalysisRow.model_validate(record)
        except ValidationError as error:
            problem = f"{RECORD} cannot be read: {said(error.errors()[0]['msg'])}"
            return AnalysisRow.model_validate({"analysis": number, "problem": problem})
        names = [one["name"] for one in record.get("quantities", ())]
        found = outdated(row.pressure_method, _asked_for_pressure(row), names)
        return row.model_copy(update={f"outdated_{found}": True} if found else {})

    def record(self, capture_id: str, number: int) -> dict[str, Any]:
        """Record of an analysis as it was stored.

        Raises:
            ValueError: It is damaged.
            OSError: It cannot be read.
        """
        return dict(json.loads((self.directory / capture_id / str(number) / RECORD).read_bytes()))

    def made_by(self, capture_id: str, job: str) -> int | None:
        """Number of the analysis that a job has stored; None if it has stored none."""
        found = (one for one in self.records(capture_id) if one.get("job") == job)
        return next((int(one["analysis"]) for one in found), None)

    def file(self, capture_id: str, number: int, name: str) -> Path:
        """A file of an analysis.

        Raises:
            NotFound: The analysis or the file does not exist.
        """
        folder = self.directory / capture_id / str(number)
        if not folder.is_dir():
            raise NotFound(
                f"capture {capture_id} has no analysis {number}",
                f"GET /api/v1/captures/{capture_id}/analyses lists those it has",
            )
        if not (folder / name).is_file():
            raise NotFound(f"analysis {number} of capture {capture_id} has no {name}", "analyse it again")
        return folder / name

    def remove(self, capture_id: str) -> None:
        """Deletes all analyses of a capture, for good.

        Raises:
            StorageError: They cannot be deleted.
        """
        home = self.directory / capture_id
        with storage_errors(home), suppress(FileNotFoundError):
            shutil.rmtree(home)

    def _record(self, capture_id: str, number: int) -> dict[str, Any]:
        try:
            return {**self.record(capture_id, number), "analysis": number}
        except (OSError, ValueError, TypeError) as error:
            return {"analysis": number, "problem": f"{RECORD} cannot be read: {error}"}


MAPS, OFFSETS = "maps.jsonl", "maps.json"


def write_maps(folder: Path, maps: Iterable["TargetMap"], units: Mapping[str, str]) -> None:
    """Writes a line for each map, and a second file with the value, offset and length of each.

    Raises:
        StorageError: The files cannot be written, or do not read back as they were written.
    """
    offsets: dict[str, list[tuple[float, int, int]]] = {"field": [], "phase": []}
    sums: list[int] = []
    with checked_file(folder / MAPS, _lines_check(sums)) as file:
        for one in maps:
            line = json.dumps(_document(one, units), ensure_ascii=False, allow_nan=False).encode() + b"\n"
            offsets[one.kind].append((one.value, file.tell(), len(line)))
            sums.append(zlib.crc32(line))
            file.write(line)
    write_text(folder / OFFSETS, json.dumps(offsets))


def _lines_check(sums: Sequence[int]) -> Check:
    """Lines of JSON with these checksums, which are asked for once all have been written."""

    def check(path: Path) -> str | None:
        count = 0
        with path.open("rb") as file:
            for count, line in enumerate(file, 1):
                if count > len(sums) or zlib.crc32(line) != sums[count - 1]:
                    return f"line {count} is another one"
                json.loads(line)
        return None if count == len(sums) else f"it has {count} lines, expected {len(sums)}"

    return check


def read_map(folder: Path, kind: str, value: float) -> bytes:
    """One map as JSON: of that field, or of the nearest phase.

    Raises:
        NotFound: There is none.
        StorageError: The files cannot be read.
    """
    with storage_errors(folder / OFFSETS):
        offsets = json.loads((folder / OFFSETS).read_bytes())[kind]
    apart = [_apart(kind, known, value) for known, _, _ in offsets]
    if not offsets or (kind == "field" and min(apart) > 0):
        raise NotFound(
            f"the analysis has no {kind} {value:g}", _hint(kind, [known for known, _, _ in offsets])
        )
    _, first, length = offsets[apart.index(min(apart))]
    with storage_errors(folder / MAPS), (folder / MAPS).open("rb") as file:
        file.seek(first)
        return file.read(length)


def _document(one: "TargetMap", units: Mapping[str, str]) -> dict[str, Any]:
    known = {name: unit for name, unit in units.items() if name in one.columns}
    which = (
        {"field": int(one.value), "phase": None}
        if one.kind == "field"
        else {"field": None, "phase": one.value}
    )
    return {**which, "units": known, "columns": one.columns}


def _apart(kind: str, known: float, value: float) -> float:
    """The difference of two fields or phases; phases wrap around at 1."""
    return abs(known - value) if kind == "field" else abs((known - value + 0.5) % 1 - 0.5)


def _hint(kind: str, known: list[float]) -> str:
    return f"choose from {min(known):g} to {max(known):g}" if known else f"it has no {kind} at all"


_FOR_PRESSURE = frozenset({"reference", "material", "vacuum", "sought_kpa"})
"""Inputs without which no analysis ever had a pressure."""


def report_page(analyses: AnalysisStore, capture_id: str, number: int) -> bytes:
    """The report of an analysis as HTML; one with outdated pressures or overpressure says so at its top.

    Raises:
        NotFound: there is no such analysis, or its report could not be drawn.
        ExtraMissing: what draws the report was not installed when the analysis was made.
    """
    row = analyses.row(capture_id, number)
    if row.missing_extra:
        raise ExtraMissing("the report of an analysis", row.missing_extra)
    if row.page_problem:
        raise NotFound(
            f"the report of analysis {number} could not be drawn: {row.page_problem}",
            "its numbers are available: leave /report off the address",
        )
    page = analyses.file(capture_id, number, PAGE).read_bytes()
    if not row.outdated:
        return page
    # What draws the notice is needed for these pages alone, and the daemon starts without it.
    from grabberd_liner.analyses.report import marked_outdated  # noqa: PLC0415

    return marked_outdated(page.decode(), row.outdated).encode()


def _asked_for_pressure(row: AnalysisRow) -> bool:
    """True if an analysis had all that pressures take; whether every field got one does not matter."""
    lacked = any("pressure" in words for words in row.lacks)
    return row.inputs.keys() >= _FOR_PRESSURE and not lacked


def pulsation_document(analyses: AnalysisStore, device: str) -> PulsationDocument:
    """The rate found in the newest analysed capture of a device; all None where there is none."""
    for capture_id in analyses.captures():
        for record in analyses.records(capture_id):
            rate = (record.get("summary") or {}).get("rate_per_min")
            if record.get("device") == device and rate:
                return PulsationDocument(rate_per_min=rate, capture=capture_id, analysis=record["analysis"])
    return PulsationDocument(rate_per_min=None, capture=None, analysis=None)

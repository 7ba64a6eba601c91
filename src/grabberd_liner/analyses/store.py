"""Analyses on disk: a folder each, CAPTURE/N, which never changes.

    CAPTURE/N/record.json   what it was made from, and a summary of its results
    CAPTURE/N/report.json   the report as a document; report.html: as a page, if it could be drawn
    CAPTURE/N/maps.jsonl    a line for each field and phase with its targets' columns; maps.json: offsets
    CAPTURE/N/NAME.csv      every table

A folder is written under another name and renamed, so it exists whole or not at all.
"""

import json
import shutil
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

from grabberd.archive.state.result_folders import ResultFolders
from grabberd.errors import NotFound
from grabberd.files.disk import storage_errors, sync_directory

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
            made.rename(home / str(number))
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

    def records(self, capture_id: str) -> list[dict[str, Any]]:
        """Records of a capture's analyses, newest first; of a damaged one its number and problem."""
        return [self._record(capture_id, number) for number in reversed(self.numbers(capture_id))]

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

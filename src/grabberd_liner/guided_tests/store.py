"""Guided tests on disk: a folder each, named by the job that made it, which never changes.

    ID/test.json   the test as a document; test.html: as a page, if it could be drawn

A folder is written under another name and renamed, so it exists whole or not at all.
"""

import re
from pathlib import Path

from grabberd import runtime
from grabberd.errors import NotFound, StorageError
from grabberd.files.disk import storage_errors, sync_directory
from grabberd.files.reading import read_json
from grabberd_liner.analyses.store import ResultFolders
from grabberd_liner.guided_tests.documents import LinerTestDocument

DOCUMENT, PAGE = "test.json", "test.html"
_ID = re.compile(r"[0-9A-Za-z_-]{1,80}")
_LIST = "GET /api/v1/tests lists all tests"


class LinerTestStore(ResultFolders):
    """The tests in a folder."""

    def publish(self, test_id: str, made: Path) -> None:
        """Gives a finished folder its name, the id of the job that made it.

        Raises:
            StorageError: The folder cannot be renamed, or there is a test of that id.
        """
        home = self.directory / test_id
        with storage_errors(home):
            runtime.rename(made, home)
            sync_directory(self.directory)

    def ids(self) -> list[str]:
        """Ids of the tests, the newest first."""
        found = (path for path in self.directory.glob("[!.]*") if (path / DOCUMENT).is_file())
        return sorted((path.name for path in found), key=_age, reverse=True)

    def made_by(self, job: str) -> str | None:
        """Id of the test that a job has stored; None if it has stored none."""
        return job if (self.directory / job / DOCUMENT).is_file() else None

    def document(self, test_id: str) -> LinerTestDocument:
        """A test.

        Raises:
            NotFound: There is none of that id.
            StorageError: It is damaged.
        """
        path = self.file(test_id, DOCUMENT)
        try:
            # As values: the offered profile is JSON that passes as it is.
            return LinerTestDocument.model_validate(read_json(path.read_text(encoding="utf-8")))
        except (OSError, ValueError) as error:
            raise StorageError(f"{path} cannot be read: {error}", "make the test again") from error

    def file(self, test_id: str, name: str) -> Path:
        """A file of a test.

        Raises:
            NotFound: The test or the file does not exist.
        """
        if not _ID.fullmatch(test_id) or not (self.directory / test_id / DOCUMENT).is_file():
            raise NotFound(f"no test {test_id!r}", _LIST)
        if not (path := self.directory / test_id / name).is_file():
            raise NotFound(f"test {test_id} has no {name}", "make the test again")
        return path


def _age(test_id: str) -> tuple[int, str]:
    # Jobs are numbered upwards, and numbers grow longer.
    return len(test_id), test_id

"""An archive as `grabberd study` reads it: in a state directory, or through a daemon."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pydantic import BaseModel

from grabberd.cli.options import load
from grabberd.client.daemon import CAPTURES, Daemon
from grabberd.documents.document import JsonObject
from grabberd.errors import GrabberdError, NotReady
from grabberd_liner.analyses.documents import AnalysisRow, QuantityDocument
from grabberd_liner.chain.study.study import DEVICE, Studied, unanalysed
from grabberd_liner.profiles.documents import ProfileUse
from grabberd_liner.studies.captures import SINCE, UNTIL, Listed, LocalArchive, Selection, StudyArchive

_PAGE = 200
_LISTED_WITHIN_S = 60.0
"""Time for a page of captures: the daemon may have to open every file of it for the first time."""


class DaemonArchive:
    """The archive of a running daemon, which may be on another computer."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon

    def captures(self, selection: Selection) -> Iterator[Listed]:
        """The captures of the device and time that the selection asks for, page by page."""
        query = [(key, value) for key in (DEVICE, SINCE, UNTIL) if (value := selection.single(key))]
        found = self._daemon.rows(CAPTURES, "captures", *query, page=_PAGE, timeout_s=_LISTED_WITHIN_S)
        return map(_listed, found)

    def verdict(self, capture: Studied) -> str:
        """The verdict, which the list had."""
        return capture.verdict

    def newest_analysis(self, capture_id: str) -> AnalysisRow | None:
        """A capture's newest analysis; None if it has none."""
        address = f"{CAPTURES}/{quote(capture_id, safe='')}/analyses?limit=1"
        rows = self._daemon.ask(address, timeout_s=_LISTED_WITHIN_S)["analyses"]
        return _row(rows[0]) if rows else None

    def report(self, capture_id: str, analysis: str) -> Any:
        """The report of an analysis as a document; None if the daemon has none."""
        address = f"{CAPTURES}/{quote(capture_id, safe='')}/analyses/{quote(analysis, safe='')}"
        try:
            return self._daemon.ask(address, timeout_s=_LISTED_WITHIN_S)
        except NotReady:
            raise
        except GrabberdError:  # refused: names have to do in place of titles
            return None


def study_archive(config: Path | None, url: str | None, token_file: Path | None) -> StudyArchive:
    """The archive of the daemon at an address, or that of the configuration's state directory."""
    if url is not None:
        return DaemonArchive(Daemon(url, token_file))
    return LocalArchive(load(config).state_directory)


def _listed(sent: JsonObject) -> Listed:
    capture = unanalysed(
        sent["id"], sent["created_utc"], sent["device"], sent["verdict"] or "", labels=sent["labels"]
    )
    if sent["state"] == "sealed":
        return Listed(capture)
    damaged = sent["state"] == "damaged"
    problem = f"it is damaged: {sent['ended_because']}" if damaged else f"it is still {sent['state']}"
    return Listed(capture, problem, damaged)


def _row(sent: JsonObject) -> AnalysisRow:
    """A row of the list; what a later daemon adds to it is left out."""
    parts: dict[str, type[BaseModel]] = {"quantities": QuantityDocument, "profiles": ProfileUse}
    known = _known(AnalysisRow, sent)
    for name, model in parts.items():
        known[name] = [_known(model, one) for one in known.get(name, [])]
    return AnalysisRow.model_validate(known)


def _known(model: type[BaseModel], sent: JsonObject) -> JsonObject:
    return {name: sent[name] for name in model.model_fields if name in sent}

"""A study of some captures of the archive, made by a process of its own: what studies them takes the core."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grabberd import __version__
from grabberd.clock import SystemClock, iso_utc
from grabberd.documents.document import JsonObject
from grabberd.work.process import Processes

NOT_THERE = "there is no such capture"


def study_in_process(
    processes: Processes, directory: Path, captures: Sequence[str], by: str | None, within: str | None
) -> JsonObject:
    """The document of a study.

    Args:
        processes: Where that process is kept.
        directory: The state directory.
        captures: Ids of captures.
        by: What makes the groups; None: all are one.
        within: What has several groups, so that they are compared within it.

    Raises:
        InputError: None of them is there.
        StorageError: The archive cannot be read, or the process does not answer.
    """
    question = {"directory": str(directory), "captures": list(captures), "by": by, "within": within}
    return processes.ask(f"{__name__}:answer", question, "makes studies")


def study_of(directory: Path, captures: Sequence[str], by: str | None, within: str | None) -> JsonObject:
    """The document of a study, made here; see `study_in_process`."""
    from grabberd_liner.chain.study.study import (  # noqa: PLC0415 - the core
        ID,
        LeftOut,
        StudyQuestion,
        make_study,
    )
    from grabberd_liner.chain.study.study_document import study_document  # noqa: PLC0415
    from grabberd_liner.chain.study.tables import tables  # noqa: PLC0415
    from grabberd_liner.studies.captures import LocalArchive, captures_of_archive  # noqa: PLC0415
    from grabberd_liner.studies.selection import Condition, Selection  # noqa: PLC0415

    selection = Selection((), (Condition(ID, tuple(captures)),))
    taken, left_out = captures_of_archive(LocalArchive(directory), selection)
    there = {one.id for one in taken} | {one.capture for one in left_out}
    left_out += [LeftOut(one, "", NOT_THERE) for one in captures if one not in there]
    study = make_study(StudyQuestion(by, within), taken, left_out)
    about = {
        "created_utc": iso_utc(SystemClock().utc_now()),
        "version": __version__,
        "select": list(captures),
    }
    return study_document(study, tables(study), about)


def answer(asked: Any) -> JsonObject:
    """The document of a study, in the process that makes it."""
    return study_of(Path(asked["directory"]), asked["captures"], asked["by"], asked["within"])

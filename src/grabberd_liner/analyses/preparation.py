"""Inputs that an analysis of a capture would be made with, and lacks, before it is asked for."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.documents.document import JsonObject
from grabberd.errors import InputError
from grabberd.work.process import Processes
from grabberd_liner.analyses.documents import AnalysisPreparation
from grabberd_liner.analyses.job import AnalysisJob, with_log

if TYPE_CHECKING:
    from grabberd_liner.chain.analysis.profile_inputs import ResolvedInputs

_TEXT_OF_LOG = "…"
"""In place of a vacuum log, which its sender has."""


def prepare_in_process(processes: Processes, path: Path, job: AnalysisJob) -> AnalysisPreparation:
    """Inputs that a job would analyse a capture with; a process of its own tells, since it takes the core.

    Args:
        processes: Where that process is kept.
        path: The capture.
        job: The analysis as it would be queued.

    Raises:
        GrabberdError: The capture cannot be read, or was not measured with an object model.
    """
    question = {"path": str(path), "job": job.model_dump(mode="json")}
    return AnalysisPreparation.model_validate(
        processes.ask(f"{__name__}:answer", question, "prepares analyses")
    )


def prepared(path: Path, job: AnalysisJob) -> AnalysisPreparation:
    """Inputs that a job would analyse a capture with, their lacks, and everything that is wrong with them.

    Raises:
        GrabberdError: The capture cannot be read, or was not measured with an object model.
    """
    from grabberd_liner.analyses.job import resolved_inputs  # noqa: PLC0415
    from grabberd_liner.analyses.source import read_origin, recorded_channels  # noqa: PLC0415
    from grabberd_liner.analysis.grid import Grid  # noqa: PLC0415
    from grabberd_liner.chain.analysis.profile_inputs import Subject  # noqa: PLC0415

    about, model = read_origin(path, job.run_number)
    grid, recorded = Grid.of(model), recorded_channels(path)
    subject = Subject(about["device"], about["object"], grid, recorded)
    try:
        given = with_log(job.inputs, job.vacuum_log)
        resolved = resolved_inputs(given, job.profiles, subject)
    except InputError as error:
        return AnalysisPreparation(
            run=about["run"], inputs=job.inputs, problems=[error.message], hint=error.hint
        )
    return _checked(about["run"], job, resolved, grid, recorded)


def _checked(
    run: int, job: AnalysisJob, resolved: "ResolvedInputs", grid: Any, recorded: Mapping[str, Sequence[str]]
) -> AnalysisPreparation:
    from grabberd_liner.analyses.job import use_of  # noqa: PLC0415
    from grabberd_liner.chain.analysis.inputs import read_inputs  # noqa: PLC0415
    from grabberd_liner.chain.analysis.profile_inputs import check_inputs  # noqa: PLC0415

    problems, lacks, hint = check_inputs(resolved.inputs, grid, recorded), list(resolved.lacks), ""
    assumed: dict[str, str] = {}
    if not problems:
        try:
            read = read_inputs(resolved.inputs, grid)
            lacks, assumed = [*read.lacks, *lacks], read.assumed
        except InputError as error:
            problems, hint = [error.message], error.hint
    liner = next((one for one in resolved.used if one.kind == "liner"), None)
    return AnalysisPreparation(
        run=run,
        inputs=_without_text(resolved.inputs),
        sources={**job.sources, **resolved.sources, **assumed},
        profiles=[use_of(one) for one in resolved.used],
        obtained={} if liner is None else dict(liner.content.get("obtained") or {}),
        recorded=sorted(recorded),
        lacks=lacks,
        problems=problems,
        hint=hint,
    )


def _without_text(inputs: JsonObject) -> JsonObject:
    vacuum = inputs.get("vacuum")
    if not isinstance(vacuum, dict) or "log" not in vacuum:
        return inputs
    return {**inputs, "vacuum": {**vacuum, "log": _TEXT_OF_LOG}}


def answer(question: Any) -> Any:
    """The inputs, in the process that finds them."""
    job = AnalysisJob.model_validate(question["job"])
    return prepared(Path(question["path"]), job).model_dump(mode="json")

"""Analyses of a capture: ask for one, list them, curves, maps, report, tables."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status
from fastapi.responses import FileResponse

from grabberd.api.etags import IMMUTABLE, NOT_MODIFIED, IfNoneMatch, tagged
from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.problems import Problem
from grabberd.api.routes.analysis_models import AnalysisList, AnalysisOrder, MapDocument
from grabberd.api.routes.calibrations import ANY_DOCUMENT, PAGE_HEADERS
from grabberd.api.routes.captures import CaptureId
from grabberd.api.routes.dependencies import PROBLEMS, ServiceOf, job_document
from grabberd.api.routes.models import JobDocument
from grabberd.errors import ExtraMissing, NotFound
from grabberd.service.jobs.analysis import AnalysisJob
from grabberd.service.service import Service
from grabberd.storage.export.analysis_maps import read_map
from grabberd.storage.state.analysis_store import DOCUMENT, PAGE, RECORD

router = APIRouter(prefix="/captures", tags=["analyses"], responses=PROBLEMS, route_class=OnceRoute)

AnalysisNumber = Annotated[int, Path(ge=1, le=2**53, description="Number of the analysis.")]
TableName = Annotated[str, Path(pattern=r"^[a-z_]{1,40}$", description="Name of the table.")]


@router.post(
    "/{capture_id}/analysis",
    status_code=status.HTTP_202_ACCEPTED,
    response_model=JobDocument,
    dependencies=[TAKES_KEY],
    summary="Analyse a capture",
)
def analyse_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    order: AnalysisOrder | None = None,
) -> object:
    """Surface, sections, curvature, strain, tension, pressure and pulsation from a sealed capture's points: a
    job, whose result has the number of the analysis. Cancelled, it leaves nothing.
    """
    asked = order or AnalysisOrder()
    job = service.jobs.submit(
        AnalysisJob(
            subject=capture_id,
            path=service.archive.sealed_path(capture_id),
            inputs=asked.inputs,
            store=service.analyses.directory,
            bursts=[service.archive.sealed_path(burst) for burst in asked.bursts],
            run_number=asked.run,
            vacuum_log=asked.vacuum_log,
        )
    )
    response.headers["Location"] = str(request.url_for("get_job", job_id=job.id))
    return job_document(job)


@router.get("/{capture_id}/analyses", response_model=AnalysisList, summary="List a capture's analyses")
def list_analyses(capture_id: CaptureId, service: ServiceOf) -> object:
    """What was analysed with which inputs, and what was found in short; the newest first."""
    service.archive.document(capture_id)
    return {"analyses": service.analyses.records(capture_id)}


@router.get(
    "/{capture_id}/analyses/{number}",
    response_class=Response,
    summary="An analysis in numbers",
    responses={200: {"content": {"application/json": {"schema": ANY_DOCUMENT}}}, **NOT_MODIFIED},
)
def get_analysis(
    capture_id: CaptureId, number: AnalysisNumber, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The report's document: inputs, problems, target grid, and the tables summary, fields, sections, phases,
    phase_sections, cycles and gaps column by column, which are the curves over time and phase.
    """
    content = service.analyses.file(capture_id, number, DOCUMENT).read_bytes()
    return tagged(content, "application/json", if_none_match, IMMUTABLE)


@router.get(
    "/{capture_id}/analyses/{number}/maps",
    response_class=Response,
    summary="A map of an analysis",
    responses={200: {"model": MapDocument}, **NOT_MODIFIED},
)
def get_analysis_map(
    capture_id: CaptureId,
    number: AnalysisNumber,
    service: ServiceOf,
    field: Annotated[
        int | None,
        Query(ge=0, le=2**53, description="A field, by its number; the phase does not count then."),
    ] = None,
    phase: Annotated[
        float,
        Query(ge=0, le=1, description="Phase of the mean cycle where no field is asked for."),
    ] = 0.0,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Place, curvature, strain, tension and pressure at every target with σ, of one field or of one phase of
    the mean cycle.
    """
    folder = service.analyses.file(capture_id, number, RECORD).parent
    content = read_map(folder, *(("field", field) if field is not None else ("phase", phase)))
    return tagged(content, "application/json", if_none_match, IMMUTABLE)


@router.get(
    "/{capture_id}/analyses/{number}/report",
    response_class=Response,
    summary="An analysis as a page",
    responses={200: {"content": {"text/html": {}}}, 501: {"model": Problem}},
)
def get_analysis_report(capture_id: CaptureId, number: AnalysisNumber, service: ServiceOf) -> Response:
    """The report: model and pressure, curves, maps, tables, inputs and their source; it needs nothing beside
    it.
    """
    _check_drawn(service, capture_id, number)
    page = service.analyses.file(capture_id, number, PAGE).read_bytes()
    return Response(page, media_type="text/html; charset=utf-8", headers=PAGE_HEADERS)


@router.get(
    "/{capture_id}/analyses/{number}/{table}.csv",
    response_class=FileResponse,
    summary="A table of an analysis",
    responses={200: {"content": {"text/csv": {}}}},
)
def get_analysis_table(
    capture_id: CaptureId, number: AnalysisNumber, table: TableName, service: ServiceOf
) -> Response:
    """One table with all its rows, such as targets, triangles or edges; the reference of an analysis' tables
    has every column.
    """
    path = service.analyses.file(capture_id, number, f"{table}.csv")
    name = f"{capture_id}-analysis-{number}-{table}.csv"
    return FileResponse(path, media_type="text/csv", filename=name, headers={"Cache-Control": IMMUTABLE})


def _check_drawn(service: Service, capture_id: str, number: int) -> None:
    record = next((one for one in service.analyses.records(capture_id) if one["analysis"] == number), {})
    if record.get("missing_extra"):
        raise ExtraMissing("the report of an analysis", record["missing_extra"])
    if record.get("page_problem"):
        raise NotFound(
            f"the report of analysis {number} could not be drawn: {record['page_problem']}",
            "its numbers are there: leave /report off the address",
        )

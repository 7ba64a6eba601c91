"""Analyses of a capture: run, list, and read their curves, maps, report and tables."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status
from fastapi.responses import FileResponse

from grabberd.api.etags import IMMUTABLE, NOT_MODIFIED, IfNoneMatch, tagged
from grabberd.api.idempotency import TAKES_KEY, OnceRoute
from grabberd.api.reading.readings import reads
from grabberd.api.routes.dependencies import (
    PROBLEMS,
    REPORT_HEADERS,
    CaptureId,
    ServiceOf,
    accepted,
)
from grabberd.documents.analyses import AnalysisDocument, AnalysisList, MapDocument
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.documents.requests import AnalysisRequest
from grabberd.service.archive.analysis_documents import analysis_list, analysis_row, report_page
from grabberd.service.jobs.analysis import AnalysisJob
from grabberd.service.profiles.profiles import FoundProfiles
from grabberd.service.service import Service
from grabberd.storage.export.analysis_maps import read_map
from grabberd.storage.state.analysis_store import DOCUMENT, RECORD

router = APIRouter(prefix="/captures", tags=["analyses"], responses=PROBLEMS, route_class=OnceRoute)

AnalysisNumber = Annotated[int, Path(ge=1, le=2**53, description="Number of the analysis.")]
TableName = Annotated[str, Path(pattern=r"^[a-z_]{1,40}$", description="Name of the table.")]


@router.post(
    "/{capture_id}/analysis",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Analyse a capture",
)
def analyse_capture(
    capture_id: CaptureId,
    service: ServiceOf,
    request: Request,
    response: Response,
    wanted: AnalysisRequest | None = None,
) -> JobDocument:
    """Determine surface, sections, curvature, strain, tension, pressure and pulsation from a sealed capture's
    points: a job, whose result has the number of the analysis. A cancelled job leaves nothing behind.
    """
    new = wanted or AnalysisRequest()
    spec = AnalysisJob(
        subject=capture_id,
        inputs=new.inputs,
        bursts=tuple(new.bursts),
        run_number=new.run,
        vacuum_log=new.vacuum_log,
        profiles=_found(service, capture_id) if new.profiles else None,
    )
    for capture in spec.captures:
        service.archive.sealed_path(capture)
    return accepted(service.jobs.submit(spec), request, response)


@router.get("/{capture_id}/analyses", summary="List a capture's analyses")
@reads
def list_analyses(capture_id: CaptureId, service: ServiceOf) -> AnalysisList:
    """The analyses with their inputs and a summary of their results, newest first."""
    service.archive.document(capture_id)
    return analysis_list(service.analyses, capture_id)


@router.get(
    "/{capture_id}/analyses/{number}",
    response_class=Response,
    summary="Get an analysis as JSON",
    responses={200: {"model": AnalysisDocument}, **NOT_MODIFIED},
)
@reads
def get_analysis(
    capture_id: CaptureId, number: AnalysisNumber, service: ServiceOf, if_none_match: IfNoneMatch = None
) -> Response:
    """The report's document: inputs, problems, target grid, and the tables summary, fields, sections, phases,
    phase_sections, cycles and gaps column by column, which contain the curves over time and phase.
    """
    content = service.analyses.file(capture_id, number, DOCUMENT).read_bytes()
    return tagged(content, "application/json", if_none_match, IMMUTABLE)


@router.get(
    "/{capture_id}/analyses/{number}/maps",
    response_class=Response,
    summary="Get a map of an analysis",
    responses={200: {"model": MapDocument}, **NOT_MODIFIED},
)
@reads
def get_analysis_map(
    capture_id: CaptureId,
    number: AnalysisNumber,
    service: ServiceOf,
    field: Annotated[
        int | None,
        Query(ge=0, le=2**53, description="Number of a field; the phase is then ignored."),
    ] = None,
    phase: Annotated[
        float,
        Query(ge=0, le=1, description="Phase of the mean cycle, if no field is given."),
    ] = 0.0,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Position, curvature, strain, tension and pressure with σ at every target, in one field or at one phase
    of the mean cycle.
    """
    folder = service.analyses.file(capture_id, number, RECORD).parent
    content = read_map(folder, *(("field", field) if field is not None else ("phase", phase)))
    return tagged(content, "application/json", if_none_match, IMMUTABLE)


@router.get(
    "/{capture_id}/analyses/{number}/report",
    response_class=Response,
    summary="Get an analysis as a page",
    responses={200: {"content": {"text/html": {}}}, 501: {"model": Problem}},
)
@reads
def get_analysis_report(capture_id: CaptureId, number: AnalysisNumber, service: ServiceOf) -> Response:
    """The report as a self-contained page: model and pressure, curves, maps, tables, inputs, sources."""
    page = report_page(service.analyses, capture_id, number)
    return Response(page, media_type="text/html; charset=utf-8", headers=REPORT_HEADERS)


@router.get(
    "/{capture_id}/analyses/{number}/{table}.csv",
    response_class=FileResponse,
    summary="Get a table of an analysis",
    responses={200: {"content": {"text/csv": {}}}},
)
@reads
def get_analysis_table(
    capture_id: CaptureId, number: AnalysisNumber, table: TableName, service: ServiceOf
) -> Response:
    """One table with all its rows, such as targets, triangles or edges; the reference of the analysis tables
    describes every column. The file's name says so if the analysis has outdated pressures.
    """
    path = service.analyses.file(capture_id, number, f"{table}.csv")
    row = analysis_row(service.analyses, capture_id, number)
    mark = "-outdated-pressure" if row is not None and row.outdated_pressure else ""
    name = f"{capture_id}-analysis-{number}-{table}{mark}.csv"
    return FileResponse(path, media_type="text/csv", filename=name, headers={"Cache-Control": IMMUTABLE})


def _found(service: Service, capture_id: str) -> FoundProfiles:
    """The profiles that the labels of a capture name, also those it was given later."""
    return service.profiles.of_labels(service.archive.document(capture_id).labels)

"""Analyses of a capture: run, list, and read their curves, maps, report and tables.

With routers of their own: analyses of several captures, and the latest pulsation rate before a device.
"""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status
from fastapi.responses import FileResponse

from grabberd.archive.catalogue.capture_list import for_each
from grabberd.documents.captures import BatchDocument, CaptureSelection
from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import IMMUTABLE, NOT_MODIFIED, IfNoneMatch, RenderedRoute, tagged
from grabberd.server.api.routes.dependencies import (
    PROBLEMS,
    REPORT_HEADERS,
    TAKES_KEY,
    CaptureId,
    Cursor,
    DeviceName,
    Limit,
    OnceRoute,
    ServiceOf,
    accepted,
    by_number,
    page_of,
)
from grabberd.server.daemon.service import Service
from grabberd_liner.analyses.documents import (
    AnalysisDocument,
    AnalysisList,
    AnalysisPreparation,
    AnalysisRequest,
    MapDocument,
    PulsationDocument,
)
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.analyses.preparation import prepare_in_process
from grabberd_liner.analyses.store import DOCUMENT, RECORD, pulsation_document, read_map, report_page
from grabberd_liner.part import liner_of

router = APIRouter(prefix="/captures", tags=["analyses"], responses=PROBLEMS, route_class=OnceRoute)
batch_router = APIRouter(prefix="/captures", tags=["captures"], responses=PROBLEMS, route_class=OnceRoute)
pulsation_router = APIRouter(prefix="/devices", tags=["devices"], route_class=RenderedRoute)

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
    points: a job, whose result contains the number of the analysis. A cancelled job leaves nothing behind.
    """
    return accepted(queue_analysis(service, capture_id, wanted or AnalysisRequest()), request, response)


@router.post("/{capture_id}/analysis/inputs", summary="Prepare an analysis")
@reads
def prepare_analysis(
    capture_id: CaptureId, service: ServiceOf, wanted: AnalysisRequest | None = None
) -> AnalysisPreparation:
    """Show the inputs that an analysis requested with this body would use, with their sources, what is
    missing and what that costs, and every reason for which it would be refused. Nothing is computed or
    stored.
    """
    spec = _job(service, capture_id, wanted or AnalysisRequest())
    return prepare_in_process(service.processes, service.archive.sealed_path(capture_id), spec)


@router.get("/{capture_id}/analyses", summary="List a capture's analyses")
@reads
def list_analyses(
    capture_id: CaptureId, service: ServiceOf, limit: Limit = 100, cursor: Cursor = None
) -> AnalysisList:
    """The analyses with their inputs and a summary of their results, newest first, page by page."""
    service.archive.document(capture_id)
    analyses = liner_of(service).analyses
    row = partial(analyses.row, capture_id)
    page, following = page_of(analyses.numbers(capture_id), by_number, row, limit, cursor)
    return AnalysisList(analyses=page, next=following)


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
    content = liner_of(service).analyses.file(capture_id, number, DOCUMENT).read_bytes()
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
        int | None, Query(ge=0, le=2**53, description="Number of a field; the phase is then ignored.")
    ] = None,
    phase: Annotated[
        float, Query(ge=0, le=1, description="Phase of the mean cycle, if no field is given.")
    ] = 0.0,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Position, curvature, strain, tension and pressure with σ at every target, in one field or at one phase
    of the mean cycle.
    """
    folder = liner_of(service).analyses.file(capture_id, number, RECORD).parent
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
    page = report_page(liner_of(service).analyses, capture_id, number)
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
    describes every column. The file name says so if the analysis has outdated pressures or overpressure.
    """
    path = liner_of(service).analyses.file(capture_id, number, f"{table}.csv")
    outdated = liner_of(service).analyses.row(capture_id, number).outdated
    mark = f"-outdated-{outdated}" if outdated else ""
    name = f"{capture_id}-analysis-{number}-{table}{mark}.csv"
    return FileResponse(path, media_type="text/csv", filename=name, headers={"Cache-Control": IMMUTABLE})


@batch_router.post(
    "/analysis",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Analyse several captures",
)
def analyse_captures(selection: CaptureSelection, service: ServiceOf) -> BatchDocument:
    """Queue an analysis of each of up to a hundred captures, with the inputs that the profiles of its labels
    give.
    """
    wanted = AnalysisRequest(profiles=True)
    return for_each(selection.captures, lambda one: queue_analysis(service, one, wanted).id)


@pulsation_router.get("/{name}/pulsation", responses=PROBLEMS, summary="Get the latest pulsation rate")
@reads
def get_pulsation(name: DeviceName, service: ServiceOf) -> PulsationDocument:
    """Pulsations per minute, from the analysis of the device's newest analysed capture."""
    return pulsation_document(liner_of(service).analyses, service.instrument(name).name)


def queue_analysis(service: Service, capture_id: str, new: AnalysisRequest) -> JobDocument:
    """Queues the analysis of a capture.

    Raises:
        NotFound: There is no such capture, or one of its bursts.
        Conflict: One of them is not sealed, or the queue is full.
    """
    spec = _job(service, capture_id, new)
    for capture in spec.captures:
        service.archive.sealed_path(capture)
    return service.jobs.submit(spec)


def _job(service: Service, capture_id: str, wanted: AnalysisRequest) -> AnalysisJob:
    """The job that a request asks for, with the profiles that the capture's labels name today."""
    document = service.archive.document(capture_id)
    inputs, sources = dict(wanted.inputs), {}
    instrument = service.instruments.get(document.device)
    if wanted.configured and instrument is not None:
        usual = {
            key: value for key, value in (instrument.setup.analysis_inputs or {}).items() if key not in inputs
        }
        sources = dict.fromkeys(usual, f"the configuration's {instrument.setup.config.analysis.inputs}")
        inputs |= usual
    return AnalysisJob(
        subject=capture_id,
        inputs=inputs,
        sources=sources,
        bursts=tuple(wanted.bursts),
        run_number=wanted.run,
        vacuum_log=wanted.vacuum_log,
        profiles=liner_of(service).profiles.of_labels(document.labels) if wanted.profiles else None,
    )

"""Guided tests of liners: their recipes, made of captures, read, and their offers accepted."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response, status

from grabberd.documents.jobs import JobDocument
from grabberd.documents.problems import Problem
from grabberd.server.api.readings import reads
from grabberd.server.api.responses import IMMUTABLE, NOT_MODIFIED, IfNoneMatch, tagged
from grabberd.server.api.routes.dependencies import (
    PROBLEMS,
    REPORT_HEADERS,
    TAKES_KEY,
    Cursor,
    Limit,
    OnceRoute,
    ServiceOf,
    accepted,
    page_of,
)
from grabberd_liner.chain.guided_tests.recipes import RECIPES
from grabberd_liner.guided_tests.documents import (
    LinerTestDocument,
    LinerTestKind,
    LinerTestList,
    LinerTestRequest,
    RecipeDocument,
    RecipeList,
)
from grabberd_liner.guided_tests.store import DOCUMENT, PAGE
from grabberd_liner.part import liner_of
from grabberd_liner.profiles.documents import NAME_PATTERN, ProfileDocument

router = APIRouter(prefix="/tests", tags=["tests"], responses=PROBLEMS, route_class=OnceRoute)

TestId = Annotated[str, Path(pattern=r"^[0-9A-Za-z_-]{1,80}$", description="Id of the test.")]


@router.get("", summary="List guided tests")
@reads
def list_tests(
    service: ServiceOf,
    kind: Annotated[LinerTestKind | None, Query(description="Only tests by this recipe.")] = None,
    liner: Annotated[
        str | None, Query(pattern=NAME_PATTERN, description="Only tests of the liner of this name.")
    ] = None,
    limit: Limit = 100,
    cursor: Cursor = None,
) -> LinerTestList:
    """The tests with their verdicts and quantities, newest first, page by page."""
    tests = liner_of(service).liner_tests
    row = partial(tests.row, kind=kind, liner=liner)
    page, following = page_of(tests.store.ids(), _by_number, row, limit, cursor)
    return LinerTestList(tests=page, next=following)


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[TAKES_KEY],
    summary="Make a guided test of captures",
)
def make_test(
    wanted: LinerTestRequest, service: ServiceOf, request: Request, response: Response
) -> JobDocument:
    """Analyse captures made for a guided test, and judge them by its recipe: a job, whose result has the id
    of the test. A capture whose label `test` names a recipe for a single capture is tested automatically as
    soon as it is sealed.
    """
    return accepted(service.jobs.submit(liner_of(service).liner_tests.job(wanted)), request, response)


@router.get("/recipes", summary="List the recipes of guided tests")
def list_recipes() -> RecipeList:
    """The available guided tests: what to do for each, and how its captures are made."""
    return RecipeList(
        recipes=[RecipeDocument.model_validate(one, from_attributes=True) for one in RECIPES.values()]
    )


@router.get(
    "/{test_id}",
    response_class=Response,
    summary="Get a guided test",
    responses={200: {"model": LinerTestDocument}, **NOT_MODIFIED},
)
@reads
def get_test(test_id: TestId, service: ServiceOf, if_none_match: IfNoneMatch = None) -> Response:
    """The checks of a test with their reasons, its quantities, and its offer to the liner's profile."""
    store = liner_of(service).liner_tests.store
    store.document(test_id)  # 507 for a damaged one instead of an invalid document
    content = store.file(test_id, DOCUMENT).read_bytes()
    return tagged(content, "application/json", if_none_match, IMMUTABLE)


@router.get(
    "/{test_id}/report",
    response_class=Response,
    summary="Get a guided test as a page",
    responses={200: {"content": {"text/html": {}}}, 501: {"model": Problem}},
)
@reads
def get_test_report(test_id: TestId, service: ServiceOf) -> Response:
    """The self-contained one-page report: verdict, checks, quantities, figure, sources."""
    page = liner_of(service).liner_tests.store.file(test_id, PAGE).read_bytes()
    return Response(page, media_type="text/html; charset=utf-8", headers=REPORT_HEADERS)


@router.post("/{test_id}/accept", summary="Store what a guided test offers")
def accept_offer(test_id: TestId, service: ServiceOf) -> ProfileDocument:
    """Store the values found by a test as the next version of the liner's profile. 409 if it offers nothing,
    or the profile has been changed since the test; repeated, it answers with the version stored.
    """
    return liner_of(service).liner_tests.accept(test_id)


def _by_number(test_id: str) -> tuple[str, str]:
    """Place in the list: the id is that of a job, whose numbers grow."""
    return test_id.removeprefix("job-").zfill(12), test_id

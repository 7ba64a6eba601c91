"""Studies: captures compared."""

from typing import Annotated

from fastapi import APIRouter, Query

from grabberd.documents.document import Label
from grabberd.documents.requests import CaptureName
from grabberd.server.api.readings import reads
from grabberd.server.api.routes.dependencies import PROBLEMS, ServiceOf
from grabberd_liner.studies.capture_study import study_in_process
from grabberd_liner.studies.documents import StudyDocument

router = APIRouter(prefix="/study", tags=["studies"], responses=PROBLEMS)

MOST = 100
Captures = Annotated[
    list[CaptureName],
    Query(min_length=1, max_length=MOST, description="Ids of captures; repeat the parameter."),
]
By = Annotated[Label | None, Query(description="What makes the groups: a label, device, date, or id.")]
Within = Annotated[Label | None, Query(description="Compare the groups within this, such as cow.")]


@router.get("", summary="Compare captures")
@reads
def study_captures(
    service: ServiceOf, captures: Captures, by: By = None, within: Within = None
) -> StudyDocument:
    """Compare the quantities of captures by their newest analyses: every value with σ, the means of groups,
    and their differences with a test, as `grabberd study` does. Captures and quantities that cannot take
    part are listed with the reason.
    """
    state = service.archive.directory.parent
    return StudyDocument.model_validate(study_in_process(service.processes, state, captures, by, within))

"""The job that follows the seal of a capture: its guided test, its analysis, or none."""

import logging

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.job_problem import JobProblem
from grabberd.instrument.setup import DeviceSetup
from grabberd.server.daemon.check_job import NOTE as CHECK
from grabberd.work.job_spec import JobSpec
from grabberd_liner.analyses.inputs import inputs_of, inputs_of_test
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.chain.guided_tests.recipes import LABEL, RECIPES
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.profiles.profiles import FoundProfiles

log = logging.getLogger(__name__)


def sealed_job(
    document: CaptureDocument, found: FoundProfiles, device: DeviceSetup, *, analysed: bool
) -> JobSpec | JobProblem | None:
    """The job for a capture: its guided test if a label names one, else its analysis if it is to be analysed.

    Args:
        document: The capture.
        found: Profiles that its labels name.
        device: The device that captured it.
        analysed: True if its device has its captures analysed.

    Returns:
        The job; a problem if there is nothing to analyse; None for a capture that is left alone, among them
        those of a recipe that evaluates several: they are analysed with the test.
    """
    named = document.labels.get(LABEL)
    recipe = None if named is None else RECIPES.get(named)
    if named is not None and recipe is None:
        words = "capture %s is taken for no guided test: there is none %r, but %s"
        log.warning(words, document.id, named, ", ".join(RECIPES))
    if document.labels.get("purpose") == CHECK or (recipe is None and not analysed):
        return None
    if recipe is not None and recipe.several:
        return None
    if (problem := _problem_of(document)) is not None:
        return problem
    source = f"the configuration's {device.config.analysis.inputs}"
    if recipe is not None:
        inputs = inputs_of_test(recipe, found, device)
        return LinerTestJob(
            subject=document.id, test=recipe.kind, inputs=inputs, profiles={document.id: found}, source=source
        )
    wanted = inputs_of(found, device)
    if isinstance(wanted, JobProblem):
        return wanted
    return AnalysisJob(
        subject=document.id,
        inputs=wanted,
        source=source,
        pulsating=True,
        profiles=found if found.profiles else None,
    )


def _problem_of(document: CaptureDocument) -> JobProblem | None:
    """Reason why there is nothing to analyse; None if there are points."""
    if not document.runs:
        return JobProblem(
            message=f"capture {document.id} was not measured: there was no calibration or no object model",
            hint="set up both, and measure the capture again",
        )
    if document.coverage is not None and document.coverage.verdict == "not_measured":
        return JobProblem(
            message=f"capture {document.id} has too few points: {document.coverage.in_words}",
            hint="look at its light, calibration and object model",
        )
    return None
